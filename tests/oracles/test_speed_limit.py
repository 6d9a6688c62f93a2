import math
from types import SimpleNamespace
from typing import ClassVar, cast

import numpy as np
import pytest
from oracle_scenes import BareMap, drive, judged, moment, straight_road

from dvca_sumo.oracles.place import Places
from dvca_sumo.oracles.speed_limit import SpeedLimit
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.violations import Answer, Ending


def test_driving_above_limit_and_tolerance_is_a_violation_after_the_dwell_time() -> None:
    (violation,) = judged(SpeedLimit, drive(20.0, 80.0, 15.0)).violations
    assert violation.kind == "speed_limit"
    assert violation.time == pytest.approx(1.0)
    assert (violation.value, violation.threshold) == (15.0, 13.9)


def test_driving_just_inside_the_tolerance_is_fine() -> None:
    assert judged(SpeedLimit, drive(20.0, 80.0, 14.89)).answer is Answer.KEPT


def test_an_excess_shorter_than_the_dwell_time_is_fine() -> None:
    moments = [moment(0.1 * k, 20.0 + k, 15.5 if k % 10 else 13.0) for k in range(50)]
    assert judged(SpeedLimit, moments).answer is Answer.KEPT


def test_two_episodes_are_two_violations() -> None:
    moments = [moment(0.1 * k, 20.0 + k, 13.0 if 15 < k < 20 else 16.0) for k in range(40)]
    assert len(judged(SpeedLimit, moments).violations) == 2


def test_a_slower_lane_counts_from_its_line_on() -> None:
    route = straight_road(limits=lambda station: 13.9 if station < 100.0 else 8.3)
    assert judged(SpeedLimit, drive(60.0, 99.9, 13.0), route).answer is Answer.KEPT
    (violation,) = judged(SpeedLimit, drive(60.0, 130.0, 13.0), route).violations
    assert violation.time == pytest.approx((100.0 - 60.0) / 13.0 + 1.0, abs=0.15)


def test_the_driving_advice_inside_a_junction_is_no_limit() -> None:
    def limits(station: float) -> float:
        return 5.0 if 100.0 <= station < 120.0 else 13.9

    inside = straight_road(limits=limits, lane=lambda station: ":c_0_0" if 100.0 <= station < 120.0 else "in_0")
    assert judged(SpeedLimit, drive(60.0, 140.0, 10.0), inside).answer is Answer.KEPT
    assert judged(SpeedLimit, drive(60.0, 140.0, 10.0), straight_road(limits=limits)).answer is Answer.VIOLATED


class TwoLanes(BareMap):
    """The route's lane, and on its left a faster one of the same road."""

    lanes: ClassVar = {
        name: SimpleNamespace(id=name, edge="in", is_internal=False, speed_limit=limit)
        for name, limit in (("in_0", 13.9), ("in_1", 27.8))
    }

    def lanes_near(self, points: np.ndarray, radius: float) -> list[tuple[str, ...]]:  # noqa: ARG002
        return [("in_1",) if y > 1.6 else ("in_0",) for _, y in points.tolist()]


@pytest.mark.parametrize(
    ("offset", "signed", "answer"),
    [(0.0, "", Answer.VIOLATED), (3.2, "", Answer.KEPT), (3.2, "in_1", Answer.UNKNOWN), (0.0, "in_1", Answer.VIOLATED)],
)
def test_on_another_lane_of_the_road_the_limit_is_that_lanes(offset: float, signed: str, answer: Answer) -> None:
    oracle = SpeedLimit(Places(straight_road(), cast("RoadMap", TwoLanes()), frozenset({signed})), Thresholds())
    for each in drive(20.0, 80.0, 20.0, offset=offset):
        oracle.observe(each)
    assert oracle.conclude(Ending.TIME_OVER).answer is answer


@pytest.mark.parametrize("speed", [10.0, 20.0])
def test_it_cannot_tell_the_limit_that_a_variable_sign_sets(speed: float) -> None:
    """Nor within the junction after such a lane, where the limit of the lane before holds."""
    lanes = [(100.0, "in_0"), (120.0, "signed_0"), (140.0, ":c_0_0"), (math.inf, "out_0")]
    route = straight_road(lane=lambda station: next(lane for end, lane in lanes if station < end))
    signed = frozenset({"signed_0"})
    for begin, end, answer in ((60.0, 99.0, None), (101.0, 119.0, "1"), (121.0, 139.0, "1"), (141.0, 180.0, None)):
        found = judged(SpeedLimit, drive(begin, end, speed), route, signed_lanes=signed)
        if answer:
            assert (found.answer, found.violations) == (Answer.UNKNOWN, ())
            assert found.reason == "the ego was on lane signed_0, whose limit a variable sign sets, at 0.0 s"
        else:
            assert found.answer is (Answer.KEPT if speed < 13.9 else Answer.VIOLATED)
    whole = judged(SpeedLimit, drive(60.0, 180.0, 10.0), route, signed_lanes=signed)
    assert (whole.answer, whole.reason[-10:]) == (Answer.UNKNOWN, ", at 4.0 s")


def test_it_cannot_tell_the_limit_off_the_route() -> None:
    moments = [moment(0.1 * k, 20.0 + k, 10.0, offset=20.0) for k in range(20)]
    found = judged(SpeedLimit, moments)
    assert found.answer is Answer.UNKNOWN
    assert "off its route" in found.reason
