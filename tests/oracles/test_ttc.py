import math
from types import SimpleNamespace
from typing import ClassVar, cast

import msgspec
import numpy as np
import pytest
from oracle_scenes import FRONT, BareMap, Row, car, drive, judged, moment, moment_at, road_along, straight_road

from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.oracles.place import Places
from dvca_sumo.oracles.ttc import TimeToCollision
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Answer, Ending

AT_ONCE = Thresholds(ttc_dwell=0.0)


def test_closing_in_on_a_standing_car_too_fast_is_a_violation() -> None:
    found = judged(TimeToCollision, drive(40.0, 49.5, 10.0, objects=[car("lead", 50.0)]))
    (violation,) = found.violations
    assert (violation.kind, violation.object) == ("ttc", "lead")
    assert violation.value == pytest.approx(0.2)
    assert violation.threshold == 0.5


def test_closing_in_just_slowly_enough_is_fine() -> None:
    moments = [moment(0.1 * k, 45.0, 10.0, objects=[car("lead", 50.001, speed=0.0)]) for k in range(5)]
    assert judged(TimeToCollision, moments).answer is Answer.KEPT
    moments = [moment(0.1 * k, 45.0, 10.0, objects=[car("lead", 49.999, speed=0.0)]) for k in range(5)]
    assert judged(TimeToCollision, moments).answer is Answer.VIOLATED


def test_of_one_that_stands_aslant_what_reaches_into_the_way_counts() -> None:
    aslant: Row = ("aslant", (57.0, 2.0, -0.6, 5.0, 1.8), (0.0, 0.0))
    reaches_in = 57.014  # [m] the station at which its side comes into the ego's way; that of its corner is 54.428
    for gap, expected in ((5.01, Answer.KEPT), (4.99, Answer.VIOLATED)):
        moments = [moment(0.0, reaches_in - gap, 10.0, objects=[aslant])]
        assert judged(TimeToCollision, moments, thresholds=AT_ONCE).answer is expected


def test_a_contact_that_is_near_for_a_moment_only_is_fine() -> None:
    def passing(moments: int) -> list[Moment]:
        """Two cars in a bend that point at each other for so many moments."""
        return [
            moment(0.1 * k, 50.0, 10.0, objects=[car("oncoming", 54.0, y=0.0 if k < moments else 3.0)])
            for k in range(5)
        ]

    assert judged(TimeToCollision, passing(2)).answer is Answer.KEPT
    assert judged(TimeToCollision, passing(3)).answer is Answer.VIOLATED


def test_a_small_gap_at_equal_speed_is_fine() -> None:
    moments = [moment(0.1 * k, 50.0 + k, 10.0, objects=[car("lead", 50.5 + k, speed=10.0)]) for k in range(20)]
    assert judged(TimeToCollision, moments).answer is Answer.KEPT


@pytest.mark.parametrize(("cross_speed", "expected"), [(5.0, Answer.VIOLATED), (40.0, Answer.KEPT)])
def test_crossing_traffic_counts_when_both_are_there_at_once(cross_speed: float, expected: Answer) -> None:
    # The crossing box covers the ego's strip at y in +-0.9 while the ego's front is 4 m away from it.
    crossing: Row = ("cross", (55.0, -0.9 - 2.0 - 1.5, math.pi / 2.0, 4.0, 2.0), (0.0, cross_speed))
    assert judged(TimeToCollision, [moment(0.0, 50.0, 10.0, objects=[crossing])], thresholds=AT_ONCE).answer is expected


def test_oncoming_traffic_in_its_own_lane_is_fine_and_in_ours_is_not() -> None:
    for y, expected in ((3.2, Answer.KEPT), (0.5, Answer.VIOLATED)):
        oncoming: Row = ("oncoming", (58.0, y, math.pi, 4.6, 1.8), (-10.0, 0.0))
        assert (
            judged(TimeToCollision, [moment(0.0, 50.0, 10.0, objects=[oncoming])], thresholds=AT_ONCE).answer
            is expected
        )


def test_a_follower_that_closes_in_is_its_own_hazard() -> None:
    follower = car("late", 50.0 - 4.6 - 6.0, speed=20.0)
    assert (
        judged(TimeToCollision, [moment(0.0, 50.0, 10.0, objects=[follower])], thresholds=AT_ONCE).answer is Answer.KEPT
    )


def test_a_standing_ego_is_not_judged() -> None:
    moments = [moment(0.1 * k, 50.0, 0.0, objects=[car("other", 51.0, speed=-5.0)]) for k in range(3)]
    assert judged(TimeToCollision, moments).answer is Answer.KEPT


def test_a_contact_is_no_longer_a_time_to_collision() -> None:
    assert (
        judged(TimeToCollision, [moment(0.0, 50.0, 10.0, objects=[car("hit", 49.0)])], thresholds=AT_ONCE).answer
        is Answer.KEPT
    )


def test_a_leader_round_the_bend_is_found_along_the_route() -> None:
    radius = 12.0
    angles = np.linspace(0.0, math.pi, 61)
    route = road_along(Polyline(np.column_stack([radius * np.sin(angles), radius * (1.0 - np.cos(angles))])))
    front, ahead = 0.6, 0.6 + 6.0 / radius  # [rad] seen from the centre
    leader: Row = ("lead", (radius * math.sin(ahead), radius * (1.0 - math.cos(ahead)), ahead, 0.5, 0.5), (0.0, 0.0))
    x = radius * math.sin(front) - FRONT * math.cos(front)
    y = radius * (1.0 - math.cos(front)) - FRONT * math.sin(front)
    seen = moment_at(0.0, x, y, front, speed=12.0, objects=[leader])
    (violation,) = judged(TimeToCollision, [seen], route, thresholds=AT_ONCE).violations
    assert violation.value == pytest.approx((6.0 - 0.25) / 12.0, abs=0.03)


def test_each_object_is_reported_once() -> None:
    objects = [car("left", 50.0, y=1.0), car("right", 50.0, y=-1.0)]
    found = judged(TimeToCollision, drive(40.0, 49.5, 10.0, objects=objects))
    assert sorted(violation.object or "" for violation in found.violations) == ["left", "right"]


def test_the_threshold_is_a_parameter() -> None:
    moments = [moment(0.0, 30.0, 10.0, objects=[car("lead", 50.0)])]
    assert judged(TimeToCollision, moments, thresholds=Thresholds(ttc=2.1, ttc_dwell=0.0)).answer is Answer.VIOLATED
    assert judged(TimeToCollision, moments, thresholds=Thresholds(ttc=1.9, ttc_dwell=0.0)).answer is Answer.KEPT


def test_nothing_is_known_of_a_run_without_moments() -> None:
    assert judged(TimeToCollision, []).answer is Answer.UNKNOWN


@pytest.mark.parametrize(("turn_rate", "expected"), [(0.0, Answer.VIOLATED), (-1.0, Answer.KEPT)])
def test_two_cars_that_turn_past_each_other_are_no_hazard(turn_rate: float, expected: Answer) -> None:
    """The oncoming car points at the ego, but turns: in half a second it is past it."""
    moments = []
    for step in range(4):
        time = 0.1 * step
        course = math.pi + 0.35 + turn_rate * (time - 0.2)
        velocity = (6.0 * math.cos(course), 6.0 * math.sin(course))
        oncoming: Row = ("oncoming", (56.5 - 0.2 * step, 2.9, course, 4.6, 1.8), velocity)
        moments.append(moment(time, 50.0, 3.0, objects=[oncoming]))
    assert judged(TimeToCollision, moments).answer is expected


@pytest.mark.parametrize(("drifts", "expected"), [(False, Answer.KEPT), (True, Answer.VIOLATED)])
def test_who_drives_round_the_corner_of_its_own_lane_is_no_hazard(*, drifts: bool, expected: Answer) -> None:
    """Lanes of a map are straight pieces: up to the corner the oncoming car points at the ego and does not turn."""
    slope = math.radians(32.0)
    begin = [73.9, 3.0 if drifts else 3.0 + 22.0 * math.tan(slope)]
    lane = Polyline([begin, [51.9, 3.0], [0.0, 3.0]])

    class Map(BareMap):
        """One lane."""

        lanes: ClassVar = {"out_0": SimpleNamespace(line=lane, successors=())}

    oracle = TimeToCollision(Places(straight_road(), cast("RoadMap", Map())), Thresholds())
    course = math.pi + slope
    for step in range(4):
        way = 1.2 * step
        oncoming: Row = (
            "oncoming",
            (57.0 + way * math.cos(course), 3.0 + 5.1 * math.tan(slope) + way * math.sin(course), course, 5.0, 1.8),
            (12.0 * math.cos(course), 12.0 * math.sin(course)),
        )
        one = moment(0.1 * step, 48.0 + 0.7 * step, 7.0, objects=[oncoming])
        oracle.observe(msgspec.structs.replace(one, objects=msgspec.structs.replace(one.objects, lanes=("out_0",))))
    assert oracle.conclude(Ending.TIME_OVER).answer is expected
