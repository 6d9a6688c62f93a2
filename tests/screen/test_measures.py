"""What is measured."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from moments import LANE_Y, Row, cruise, moment, places

from dvca_sumo.roadmap import RoadMap
from dvca_sumo.screen.measures import Measures
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import Moment


@pytest.fixture(scope="module")
def roads(street: Path) -> RoadMap:
    return RoadMap.load(street)


def measured(moments: Sequence[Moment], roads: RoadMap) -> Measures:
    found = Measures(places(roads), Thresholds())
    for one in moments:
        found.see(one)
    return found


def test_way_and_time_are_those_of_the_drive(roads: RoadMap) -> None:
    found = measured(cruise(5.0, 10.0), roads)
    assert found.distance == pytest.approx(50.0)
    assert found.duration == pytest.approx(5.0)
    assert (found.hard_brakings, found.least_ttc) == (0, None)


def test_each_episode_of_hard_braking_counts_once(roads: RoadMap) -> None:
    speeds = [12.0, 12.0, 11.6, 11.2, 10.8, 10.8, 10.4, 10.1, 9.8]  # 4 m/s^2, nothing, 4 m/s^2, then 3 m/s^2
    moments = [moment(0.1 * k, 40.0 + k, speed) for k, speed in enumerate(speeds)]
    assert measured(moments, roads).hard_brakings == 2


def test_past_a_contact_only_the_way_and_the_time_go_on_and_are_told_apart(roads: RoadMap) -> None:
    lead: Row = ("lead", (40.0 + 8.0 + 2.3, LANE_Y), 0.0)
    before, after = cruise(0.4, 10.0), cruise(1.0, 10.0, [lead])[5:]
    braking = moment(1.1, 50.5, 5.0, [lead])
    found = measured(before, roads)
    found.touch()
    for one in (*after, braking):
        found.see(one)
    assert (found.distance, found.duration) == pytest.approx((10.5, 1.1))
    assert (found.distance_after, found.duration_after) == pytest.approx((6.5, 0.7))
    assert (found.hard_brakings, found.least_ttc) == (0, None)


def test_the_least_time_to_collision_is_one_that_lasted(roads: RoadMap) -> None:
    lead: Row = ("lead", (40.0 + 20.0 + 2.3, LANE_Y), 0.0)
    found = measured(cruise(1.0, 10.0, [lead]), roads)
    assert found.least_ttc == pytest.approx(1.2)  # 1.0 s at last, 1.2 s two moments before
    seen_twice = [*cruise(0.2, 10.0), *[moment(0.3 + 0.1 * k, 43.0 + k, 10.0, [lead]) for k in range(2)]]
    assert measured(seen_twice, roads).least_ttc is None
