"""Where the ego is on a route that comes by the same place again."""

import math
from typing import cast

import numpy as np
import pytest
from oracle_scenes import FRONT, BareMap, moment_at, road_along

from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.oracles.place import Places
from dvca_sumo.roadmap import RoadMap

ENTRY, ROUND = 100.0, 36.0  # [m] along a straight road to a small roundabout; once round it


@pytest.mark.parametrize("aside", [-0.1, 0.0, 0.1])
def test_once_round_a_small_roundabout_every_pass_of_its_entry_is_told_apart(aside: float) -> None:
    radius = ROUND / (2.0 * math.pi)
    before = np.column_stack((np.arange(0.0, ENTRY), np.zeros(int(ENTRY))))
    angles = np.arange(0.0, ROUND) / radius
    circle = np.column_stack((ENTRY + radius * np.sin(angles), radius - radius * np.cos(angles)))
    after = np.column_stack((np.arange(ENTRY, 150.0), np.zeros(50)))
    line = Polyline(np.concatenate((before, circle, after)))
    places = Places(road_along(line), cast("RoadMap", BareMap()))
    stations = np.arange(20.0, line.length - 20.0, 0.5)
    poses = line.poses(stations, aside)
    found = [
        places.at(moment_at(0.1 * row, x - FRONT * math.cos(h), y - FRONT * math.sin(h), h)).station
        for row, (x, y, h) in enumerate(poses.tolist())
    ]
    assert np.abs(np.array(found) - stations).max() < 1.0
