"""Switches of real bugs in the planner: what each does wrong, and that the fixed planner does not."""

import msgspec
import numpy as np
import pytest
from planned_drives import LIMIT, SHAPE, Drive, car, cone, drive, person, road, stop_line

from dvca_sumo.messages import ObjectClass
from dvca_sumo.roadmap.route import Control, UnmappedLimit
from dvca_sumo.stack.planning import PlanningConfig

LANE_ROOM = PlanningConfig(trusts_lane_room=True)
AT_AXLE = PlanningConfig(lines_at_rear_axle=True)
UNMAPPED = PlanningConfig(unmapped_at_bound=True)
PAST = PlanningConfig(stops_past_objects=True)


def beside(right_free: float, config: PlanningConfig | None = None, kind: ObjectClass = ObjectClass.VEHICLE) -> Drive:
    """Towards a car that stands on the right and leaves so much of a single lane of 3.2 m free [m]."""
    parked = msgspec.structs.replace(car(5, 120.0, 1.6 - right_free - 0.9), kind=kind)
    return drive(road(), 20.0, speed=13.0, actors=[parked], config=config)


def test_a_narrow_gap_is_stopped_before_although_the_lane_is_wide_enough() -> None:
    assert 3.0 < beside(2.25).clearances.min() < 7.0


def test_with_trust_in_the_lanes_width_the_narrow_gap_is_driven_into() -> None:
    driven = beside(2.25, LANE_ROOM)
    assert driven.clearances.min() == 0.0
    assert driven.fronts[-1] > 180.0


def test_with_trust_in_the_lanes_width_a_blocked_lane_is_still_stopped_in() -> None:
    assert 3.0 < beside(2.0, LANE_ROOM).clearances.min() < 7.0  # narrower than the ego and 0.3 m
    on_the_line = drive(road(), 20.0, speed=13.0, actors=[cone(5, 120.0)], config=LANE_ROOM)
    assert 3.0 < on_the_line.clearances.min() < 7.0


def test_trust_in_the_lanes_width_is_for_neither_people_nor_bicycles() -> None:
    assert beside(2.25, LANE_ROOM, ObjectClass.BICYCLE).clearances.min() > 2.0
    waiting = drive(road(), 20.0, speed=13.0, actors=[person(5, 120.0, -0.9)], config=LANE_ROOM)
    assert waiting.clearances.min() > 2.0


@pytest.mark.parametrize(("config", "past"), [(None, -0.8), (AT_AXLE, SHAPE.front - 0.8)])
def test_where_the_front_bumper_stops_for_a_stop_sign(config: PlanningConfig | None, past: float) -> None:
    line = stop_line(150.0, Control.STOP)
    driven = drive(road(stop_lines=[line]), 30.0, speed=10.0, station=60.0, config=config)
    stood = driven.fronts[driven.speeds < 0.05]
    assert stood[0] == pytest.approx(150.0 + past, abs=0.5)
    assert driven.fronts[-1] > 170.0


@pytest.mark.parametrize(("is_motorway", "usual"), [(False, 13.89), (True, 27.78)])
def test_without_a_limit_on_the_map_the_usual_one_of_the_roads_type_holds(is_motorway: bool, usual: float) -> None:  # noqa: FBT001
    gap = UnmappedLimit(50.0, 550.0, is_motorway)
    driven = drive(road(limit=8.0, unmapped_limits=[gap]), 40.0, speed=7.0)
    assert 0.9 * usual < driven.speeds.max() <= usual


def test_with_the_bound_in_place_of_an_unmapped_limit_only_that_stretch_is_too_fast() -> None:
    gap = UnmappedLimit(150.0, 350.0, is_motorway=False)
    driven = drive(road(unmapped_limits=[gap]), 40.0, speed=13.0, config=UNMAPPED)
    is_within = (driven.fronts > 150.0) & (driven.states[:, 1] - SHAPE.rear_overhang < 350.0)
    assert driven.speeds[is_within].max() > 1.4 * LIMIT
    assert driven.speeds[~is_within].max() <= LIMIT


def test_a_stop_past_an_object_ends_in_it() -> None:
    driven = drive(road(), 20.0, speed=10.0, actors=[car(5, 120.0)], config=PAST)
    assert driven.clearances.min() == 0.0
    assert driven.speeds[np.flatnonzero(driven.clearances == 0.0)[0]] > 3.0  # [m/s] at impact


def test_the_fixed_planner_stops_as_far_before_an_object() -> None:
    assert drive(road(), 20.0, speed=10.0, actors=[car(5, 120.0)]).clearances.min() == pytest.approx(5.0, abs=0.5)
