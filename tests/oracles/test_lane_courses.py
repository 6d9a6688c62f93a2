"""Where vehicles get to that go on along their lanes."""

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.oracles.lane_courses import lane_courses
from dvca_sumo.roadmap import RoadMap

TURN = math.radians(30.0)
AFTER = (50.0 + 40.0 * math.cos(TURN), 40.0 * math.sin(TURN))


class Fork:
    """A lane east to (50, 0), then one on by 30 degrees to the left, and maybe one straight on."""

    def __init__(self, *, goes_straight_on: bool = False) -> None:
        onward = ("left_0", "on_0") if goes_straight_on else ("left_0",)
        self.lanes: dict[str, Any] = {
            "in_0": SimpleNamespace(line=Polyline([(0.0, 0.0), (50.0, 0.0)]), successors=onward),
            "left_0": SimpleNamespace(line=Polyline([(50.0, 0.0), AFTER]), successors=()),
            "on_0": SimpleNamespace(line=Polyline([(50.0, 0.0), (90.0, 0.0)]), successors=()),
        }

    def lanes_near(self, points: list[np.ndarray], radius: float) -> list[tuple[str, ...]]:
        """Only asked for rears, on the first lane."""
        return [("in_0",) if abs(y) < radius and x < 50.0 else () for x, y in points]


def courses(box: tuple[float, float, float], lane: str, speed: float = 10.0, *, forks: bool = False) -> list[Any]:
    found = lane_courses(
        cast("RoadMap", Fork(goes_straight_on=forks)), lane, np.array([*box, 5.0, 1.8]), speed, horizon=1.0
    )
    return [course(1.0) for course in found]


def test_on_a_lane_it_goes_on_beside_its_middle_as_now() -> None:
    (pose,) = courses((20.0, 0.4, 0.0), "in_0")
    assert pose == pytest.approx((30.0, 0.4, 0.0))


def test_past_the_end_of_its_lane_it_goes_on_along_the_next_one() -> None:
    """Its front, 2 m before that end, gets 8 m along the next lane, its rear 3 m."""
    (pose,) = courses((45.5, 0.0, 0.0), "in_0")
    assert pose == pytest.approx((50.0 + 5.5 * math.cos(TURN), 5.5 * math.sin(TURN), TURN), abs=1e-6)


def test_with_its_rear_still_on_the_lane_before_it_drives_along_both() -> None:
    front = np.array([50.0 + 3.5 * math.cos(TURN), 3.5 * math.sin(TURN)])
    heading = 0.5 * TURN
    middle = front - 2.5 * np.array([math.cos(heading), math.sin(heading)])
    (pose,) = courses((*middle.tolist(), heading), "left_0")
    assert pose == pytest.approx((50.0 + 11.0 * math.cos(TURN), 11.0 * math.sin(TURN), TURN), abs=1e-6)


def test_where_lanes_part_it_may_go_either_way() -> None:
    assert sorted(pose[1] for pose in courses((45.5, 0.0, 0.0), "in_0", forks=True)) == pytest.approx(
        [0.0, 5.5 * math.sin(TURN)], abs=1e-6
    )


@pytest.mark.parametrize(
    ("box", "lane"),
    [
        ((20.0, 0.0, 0.2), "in_0"),  # leaves it
        ((70.0, 12.0, TURN + 0.2), "left_0"),
        ((54.0, 3.0, TURN + 0.2), "left_0"),  # turned more than either of those under it
        ((20.0, 0.0, 0.0), "nowhere_0"),
    ],
)
def test_who_leaves_its_lane_has_no_such_course(box: tuple[float, float, float], lane: str) -> None:
    assert courses(box, lane) == []
