"""The path between bounds that standing objects move in."""

import math

import pytest
from planned_drives import Actor, assert_drivable, car, cone, curve_points, drive, road

from dvca_sumo.stack.bugs import build_with
from dvca_sumo.stack.reference import StackConfig

BUGGY = build_with("planfuzz-v1", StackConfig()).planning
BESIDE = 1.85  # [m] a cone whose near side is 0.05 m off the lane
GATE = (cone(1, 120.0, BESIDE), cone(2, 121.0, -BESIDE))


def test_a_lane_between_two_cones_beside_it_is_driven_through() -> None:
    driven = drive(road(), 20.0, speed=12.0, actors=GATE)
    assert driven.speeds.min() > 8.0
    assert driven.fronts[-1] > 150.0
    assert_drivable(driven)


def test_too_wide_a_buffer_blocks_a_lane_that_two_cones_leave_free() -> None:
    driven = drive(road(), 20.0, speed=12.0, actors=GATE, config=BUGGY)
    assert driven.speeds[-1] == 0.0
    assert 4.0 < 120.0 - driven.fronts[-1] < 8.0
    assert driven.decisions[-1] == "stop behind 2"
    assert_drivable(driven)


@pytest.mark.parametrize(
    "actors", [GATE[:1], (cone(1, 120.0, BESIDE), cone(2, 130.0, -BESIDE))], ids=["one side", "one after the other"]
)
def test_even_a_wide_buffer_leaves_room_beside_one_cone_at_a_time(actors: tuple[Actor, ...]) -> None:
    assert drive(road(), 20.0, speed=12.0, actors=actors, config=BUGGY).fronts[-1] > 150.0


def test_the_neighbouring_lane_is_room_too() -> None:
    assert drive(road(lanes_left=1), 20.0, speed=12.0, actors=GATE[1:], config=BUGGY).fronts[-1] > 150.0


def test_a_gap_narrower_than_the_ego_is_stopped_at_without_any_buffer() -> None:
    gate = (cone(1, 120.0, 1.05), cone(2, 120.0, -1.05))
    driven = drive(road(), 20.0, speed=12.0, actors=gate)
    assert driven.speeds[-1] == 0.0
    assert driven.fronts[-1] < 116.0


def test_ends_of_a_long_vehicle_inside_a_bend_are_not_driven_into() -> None:
    """Its middle leaves room beside the bend's line; its ends, straight on, do not."""
    route = road(curve_points(20.0))
    middle = 100.0 + 5.0 + 0.25 * math.pi * 20.0
    x, y, heading = route.line.poses([middle], 0.9 + 0.6 + 1.25)[0].tolist()
    driven = drive(route, 40.0, speed=8.0, actors=[car(7, x, y, heading=heading, size=(12.0, 2.5))])
    assert driven.clearances.min() > 0.2
    assert_drivable(driven)
