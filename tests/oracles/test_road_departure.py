import math

import numpy as np
import pytest
from oracle_scenes import drive, judged, moment, moment_at, road_along, straight_road

from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.oracles.road_departure import RoadDeparture
from dvca_sumo.roadmap import Route
from dvca_sumo.violations import Answer


def test_a_corner_beyond_the_road_edge_is_a_departure_after_the_dwell_time() -> None:
    (violation,) = judged(RoadDeparture, drive(20.0, 40.0, 10.0, offset=1.01)).violations
    assert violation.kind == "lane_departure"
    assert violation.time == pytest.approx(0.3)
    assert violation.value == pytest.approx(0.31)
    assert "left" in violation.detail


def test_a_corner_within_the_tolerance_is_fine() -> None:
    assert judged(RoadDeparture, drive(20.0, 40.0, 10.0, offset=-0.99)).answer is Answer.KEPT


def test_a_short_excursion_is_fine() -> None:
    moments = [moment(0.1 * k, 20.0 + k, 10.0, offset=1.2 if k in {5, 6, 7} else 0.0) for k in range(20)]
    assert judged(RoadDeparture, moments).answer is Answer.KEPT


def test_lanes_of_the_same_direction_may_be_used_and_the_oncoming_side_may_not() -> None:
    route = straight_road(edges=(1.6, -4.8))
    assert judged(RoadDeparture, drive(20.0, 40.0, 10.0, offset=-3.2), route).answer is Answer.KEPT
    assert judged(RoadDeparture, drive(20.0, 40.0, 10.0, offset=3.2), route).answer is Answer.VIOLATED


def test_only_the_corner_of_a_turned_ego_may_be_outside() -> None:
    moments = [moment(0.1 * k, 40.0, 1.0, offset=1.1, heading=math.radians(10.0)) for k in range(10)]
    (violation,) = judged(RoadDeparture, moments).violations
    outermost = 1.1 + 0.9 * math.cos(math.radians(10.0))
    assert violation.value == pytest.approx(outermost - 1.6)


def test_an_ego_far_off_its_route_has_departed() -> None:
    moments = [moment(0.1 * k, 40.0 + k, 10.0, offset=-20.0) for k in range(10)]
    (violation,) = judged(RoadDeparture, moments).violations
    assert "right" in violation.detail
    assert violation.lane is None


def test_what_lies_before_the_route_begins_is_not_judged() -> None:
    moments = [moment(0.1 * k, 2.0, 0.0, offset=0.5, heading=math.radians(25.0)) for k in range(10)]
    assert judged(RoadDeparture, moments).answer is Answer.KEPT


def test_it_cannot_tell_without_road_edges() -> None:
    found = judged(RoadDeparture, drive(20.0, 40.0, 10.0, offset=5.0), straight_road(edges=(math.nan, math.nan)))
    assert found.answer is Answer.UNKNOWN


def bend(radius: float) -> Route:
    """A right turn between two straights."""
    straight = np.column_stack([np.arange(20.0), np.zeros(20)])
    angles = np.arange(0.0, math.pi / 2.0, 1.0 / radius)
    arc = np.column_stack([20.0 + radius * np.sin(angles), radius * (np.cos(angles) - 1.0)])
    end = np.column_stack([np.full(20, 20.0 + radius), -radius - np.arange(20.0)])
    return road_along(Polyline(np.vstack([straight, arc, end])))


@pytest.mark.parametrize(("aside", "expected"), [(0.0, Answer.KEPT), (0.6, Answer.VIOLATED)])
def test_the_front_may_swing_out_in_a_tight_bend_as_far_as_it_must(aside: float, expected: Answer) -> None:
    route = bend(radius=3.0)
    poses = route.line.poses(np.arange(5.0, route.line.length - 4.0, 0.5), aside)
    moments = [moment_at(0.1 * k, *pose) for k, pose in enumerate(poses.tolist())]
    assert judged(RoadDeparture, moments, route).answer is expected
