"""The path between bounds that standing objects move in."""

import pytest
from planned_drives import Actor, assert_drivable, cone, drive, road

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
