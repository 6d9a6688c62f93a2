import math

import numpy as np
import pytest

from dvca_sumo.interventions import Futures, Track, recorded_futures
from dvca_sumo.messages import PREDICTION_TIMES
from interventions.scenes import Thing, ego, moment


def track(times: list[float], xs: list[float], lanes: list[str] | None = None) -> Futures:
    poses = np.zeros((len(times), 3))
    poses[:, 0] = xs
    return Futures({"car": Track(np.array(times), poses, tuple(lanes or [""] * len(times)))})


def places(futures: Futures, time: float) -> list[float]:
    known = futures.of("car", time)
    assert known is not None
    poses, _ = known
    assert poses.shape == (len(PREDICTION_TIMES), 3)
    return [float(x) for x in poses[:, 0]]


def test_between_two_records_an_object_is_in_between() -> None:
    futures = track([0.0, 2.0, 10.0], [0.0, 10.0, 90.0])
    assert places(futures, 1.0)[:3] == pytest.approx([5.0, 6.25, 7.5])
    assert places(futures, 1.0)[8] == pytest.approx(20.0)  # 3 s: 1 s past the second record


def test_after_the_end_of_its_record_an_object_keeps_its_last_velocity() -> None:
    futures = track([0.0, 1.0, 2.0], [0.0, 1.0, 4.0])
    assert places(futures, 2.0) == pytest.approx((4.0 + 3.0 * PREDICTION_TIMES).tolist())


def test_an_object_that_was_seen_once_stays_there() -> None:
    assert places(track([5.0], [7.0]), 5.0) == pytest.approx([7.0] * 25)


@pytest.mark.parametrize(("time", "is_known"), [(0.9, False), (0.96, True), (1.0, True), (3.0, True), (3.01, False)])
def test_nothing_is_known_of_an_object_outside_its_record(time: float, *, is_known: bool) -> None:
    assert (track([1.0, 2.0, 3.0], [0.0, 1.0, 2.0]).of("car", time) is not None) is is_known


def test_nothing_is_known_of_an_object_that_was_never_recorded() -> None:
    assert Futures().of("car", 0.0) is None


def test_lanes_are_those_taken_within_the_horizon_once_each() -> None:
    futures = track([0.0, 1.0, 2.0, 3.0, 20.0], [0.0] * 5, ["a_0", "a_0", "", "b_0", "c_0"])
    known = futures.of("car", 0.0)
    assert known is not None
    assert known[1][:2] == ("a_0", "b_0")
    late = futures.of("car", 3.0)
    assert late is not None
    assert "a_0" not in late[1]


def test_a_turn_through_the_back_is_not_a_spin() -> None:
    headings = [math.pi - 0.1, -math.pi + 0.1]
    moments = [
        moment([Thing("car", 0.0, 0.0, heading=heading)], ego(time=time))
        for time, heading in zip((0.0, 1.0), headings, strict=True)
    ]
    known = recorded_futures(moments).of("car", 0.0)
    assert known is not None
    assert known[0][:5, 2] == pytest.approx(np.linspace(math.pi - 0.1, math.pi + 0.1, 5))


def test_a_run_is_recorded_object_by_object_as_they_come_and_go() -> None:
    early, late = Thing("early", 50.0, 0.0, (10.0, 0.0)), Thing("late", 90.0, 2.0)
    moments = [
        moment([early.after(0.1 * step)] * (step < 3) + [late] * (step >= 2), ego(time=0.1 * step)) for step in range(5)
    ]
    tracks = recorded_futures(moments).tracks
    assert tracks["early"].times == pytest.approx([0.0, 0.1, 0.2])
    assert tracks["early"].poses[:, 0] == pytest.approx([50.0, 51.0, 52.0])
    assert tracks["late"].times == pytest.approx([0.2, 0.3, 0.4])
    assert tracks["late"].lanes == ("in_0",) * 3


@pytest.mark.parametrize(("begin", "end"), [(0.0, math.inf), (4.0, 12.0), (4.06, 12.06), (9.5, 15.5), (math.inf, 6.0)])
def test_a_part_of_the_records_answers_the_same_within_it(begin: float, end: float) -> None:
    things = {"from the start": (0.0, 8.0), "all along": (0.0, 20.0), "later": (5.0, 11.0), "at last": (12.5, 20.0)}
    times = [round(0.1 * step, 1) for step in range(200)]
    whole = recorded_futures(
        [
            moment([Thing(name, time**1.1, 0.0) for name, (a, b) in things.items() if a <= time <= b], ego(time=time))
            for time in times
        ]
    )
    part = whole.between(begin, end)
    for time in times:
        if begin <= time <= end - PREDICTION_TIMES[-1]:
            for name in things:
                assert repr(part.of(name, time)) == repr(whole.of(name, time))
    kept = sum(len(track.times) for track in part.tracks.values())
    assert kept <= len(things) * max(min(end, 20.0) - begin + 0.4, 0.0) * 10
