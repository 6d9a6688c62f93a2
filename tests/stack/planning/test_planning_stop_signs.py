"""Stop signs with others at them: who was there first goes first."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from planned_drives import Actor, Drive, assert_drivable, drive, predicted, road, stop_line

from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.messages import ObjectClass
from dvca_sumo.roadmap.route import Approach, Control
from dvca_sumo.stack.bugs import build_with
from dvca_sumo.stack.planning import PlanningConfig
from dvca_sumo.stack.planning.watching import WatchList
from dvca_sumo.stack.reference import StackConfig

FIXED = PlanningConfig()
BUGGY = build_with("planfuzz-v7", StackConfig()).planning
APPROACH = Approach("south_0", Polyline(np.array([[106.0, -60.0], [106.0, -6.0]])), 3.2, 13.9)


def at_sign(actors: Sequence[Actor], config: PlanningConfig = FIXED, seconds: float = 40.0) -> Drive:
    line = stop_line(100.0, Control.ALL_WAY_STOP, stop_signs=(APPROACH,))
    return drive(road(stop_lines=[line]), seconds, speed=10.0, actors=actors, config=config)


def northbound(track: int, kind: ObjectClass, x: float, front: float, **changes: Any) -> Actor:
    length, width = {ObjectClass.BICYCLE: (1.6, 0.65), ObjectClass.PEDESTRIAN: (0.5, 0.6)}.get(kind, (4.5, 1.8))
    heading = math.pi / 2.0
    return Actor(track, kind, x, front - 0.5 * length, heading=heading, size=(length, width), **changes)


def bicycle(track: int, front: float) -> Actor:
    """Parked 3.2 m to the right of the lane's middle, 1.6 m off the lane."""
    return northbound(track, ObjectClass.BICYCLE, 109.2, front)


def standing_time(driven: Drive) -> float:
    return float(0.1 * (driven.speeds < 0.05).sum())


BICYCLES = (bicycle(1, -6.5), bicycle(2, -8.9))


def test_bicycles_parked_off_the_lane_are_nobody_to_wait_for() -> None:
    driven = at_sign(BICYCLES)
    assert standing_time(driven) < 3.0
    assert driven.fronts[-1] > 150.0
    assert_drivable(driven)


def test_without_the_filter_two_parked_bicycles_are_waited_for_without_end() -> None:
    driven = at_sign(BICYCLES, BUGGY)
    assert driven.speeds[-1] == 0.0
    assert 0.2 < 100.0 - driven.fronts[-1] < 3.0
    assert driven.decisions[-1] == "stop sign ego_0 for 1, 2"


def test_without_the_filter_a_single_one_costs_eight_seconds() -> None:
    driven = at_sign(BICYCLES[:1], BUGGY)
    assert 7.5 < standing_time(driven) < 9.5
    assert driven.fronts[-1] > 150.0


@pytest.mark.parametrize(
    "other",
    [
        northbound(2, ObjectClass.PEDESTRIAN, 109.2, -6.5),
        northbound(2, ObjectClass.STATIC, 109.2, -6.5),
        bicycle(2, -12.0),
        northbound(2, ObjectClass.BICYCLE, 112.0, -6.5),
        Actor(2, ObjectClass.BICYCLE, 109.2, -7.3, heading=-math.pi / 2.0, size=(1.6, 0.65)),
    ],
    ids=["person", "static object", "far from the line", "far from the lane", "the other way"],
)
def test_nobody_else_is_watched(other: Actor) -> None:
    assert 7.5 < standing_time(at_sign((BICYCLES[0], other), BUGGY)) < 9.5


def test_those_who_stood_at_their_sign_first_go_first() -> None:
    cars = tuple(
        northbound(track, ObjectClass.VEHICLE, 106.0, front, leaves=25.0, speed=6.0)
        for track, front in ((1, -6.5), (2, -10.8))
    )
    driven = at_sign(cars)
    crossing = float(driven.states[driven.fronts > 101.0][0, 0])
    assert 25.0 < crossing < 33.0
    assert driven.clearances.min() > 2.0
    assert driven.fronts[-1] > 130.0
    assert_drivable(driven)


def test_who_comes_while_the_ego_stands_is_not_noted() -> None:
    watching = WatchList((APPROACH,), BUGGY)
    watching.step(predicted(BICYCLES[:1], 0.0).objects, is_standing=False)
    watching.step(predicted(BICYCLES, 0.1).objects, is_standing=True)
    assert watching.waits_for(0.0) == [1]


def test_who_is_lost_is_crossed_out_and_who_changes_its_number_is_not() -> None:
    watching = WatchList((APPROACH,), BUGGY)
    watching.step(predicted(BICYCLES, 0.0).objects, is_standing=False)
    watching.step(predicted((bicycle(7, -6.6), BICYCLES[1]), 0.1).objects, is_standing=True)
    assert watching.waits_for(20.0) == [2, 7]
    watching.step(predicted(BICYCLES[1:], 0.2).objects, is_standing=True)
    assert watching.waits_for(0.0) == [2]
    assert watching.waits_for(8.0) == []


@pytest.mark.parametrize("length", [4.5, 12.0, 18.0])
@pytest.mark.parametrize("before", [0.5, 4.5])
def test_who_waits_at_its_sign_is_waited_for_however_long_it_is(length: float, before: float) -> None:
    front = -6.0 - before
    waiting = Actor(7, ObjectClass.VEHICLE, 106.0, front - 0.5 * length, heading=math.pi / 2.0, size=(length, 2.5))
    watching = WatchList((APPROACH,), FIXED)
    watching.step(predicted((waiting,), 0.0).objects, is_standing=False)
    assert watching.waits_for(0.0) == [7]
