"""Where the trip ends."""

import math

import numpy as np
import pytest
from planned_drives import drive, road

from dvca_sumo.messages import Floats
from dvca_sumo.stack.bugs import build_with
from dvca_sumo.stack.planning import PlanningConfig
from dvca_sumo.stack.reference import StackConfig

BUGGY = build_with("apollo-c803010", StackConfig()).planning
LEVEL = np.column_stack([np.arange(100.0, 400.5), np.full(301, 50.0)])
DIAGONAL = np.column_stack([np.arange(301.0), np.arange(301.0)]) * math.sqrt(0.5)


@pytest.mark.parametrize("points", [LEVEL, DIAGONAL])
@pytest.mark.parametrize("config", [PlanningConfig(), BUGGY], ids=["fixed", "buggy"])
def test_the_ego_stops_at_its_destination_unless_that_is_looked_for_at_the_wrong_place(
    points: Floats, config: PlanningConfig
) -> None:
    driven = drive(road(points, destination=150.0), 25.0, speed=10.0, config=config)
    is_found = config is not BUGGY or points is DIAGONAL
    assert (driven.speeds[-1] < 0.01) == is_found
    assert ("stop destination" in driven.decisions) == is_found


def test_far_past_the_end_of_the_map_the_ego_stops() -> None:
    driven = drive(road(LEVEL, destination=150.0), 60.0, speed=13.0, config=BUGGY)
    assert driven.decisions[-1] == "stop off route"
    assert driven.speeds[-1] == 0.0
