"""Passing on the next lane: where there is something to gain, a gap, and room to come back."""

import msgspec
import numpy as np
import pytest
from planned_drives import SHAPE, Actor, Drive, assert_drivable, car, cone, drive, predicted, road, straight_points

from dvca_sumo.messages import PREDICTION_TIMES, ObjectClass
from dvca_sumo.roadmap import Route
from dvca_sumo.roadmap.route import PassingLane
from dvca_sumo.stack.planning import PlanningConfig
from dvca_sumo.stack.planning.lane_changing import is_caught
from dvca_sumo.stack.planning.lane_gaps import Gaps, Neighbours
from dvca_sumo.stack.planning.passing import Passing
from dvca_sumo.stack.planning.reference import Reference

WIDTH = 3.2  # [m] of a lane
END = 900.0  # [m] of the lane to pass on


def beside(
    *, leads_on: bool = True, end: float = END, side: int = 1, halts: tuple[tuple[float, float], ...] = ()
) -> Route:
    """Straight along x, with a lane to pass on at the left (side 1) or right (-1)."""
    found = road(straight_points(1200.0), lanes_left=1 if side > 0 else 0)
    if side < 0:
        found = msgspec.structs.replace(found, road_right=found.road_right - WIDTH)
    stations = found.line.stations[found.line.stations <= end]
    lane = PassingLane(
        lane_ids=("ego_1",) * len(stations),
        widths=(WIDTH, WIDTH),
        stations=stations,
        offsets=np.full(len(stations), side * WIDTH),
        leads_on=leads_on,
        halts=halts,
    )
    return msgspec.structs.replace(found, passing_lanes=(lane,))


def queue(speed: float, count: int = 12) -> list[Actor]:
    """Cars that creep along the ego's lane from 300 m on."""
    return [car(1000 + number, 300.0 + 8.0 * number, speed=speed) for number in range(count)]


def lanes(driven: Drive) -> list[int]:
    """The lanes the ego's middle was on, one after the other; 0 is its own."""
    on = np.rint(driven.states[:, 2] / WIDTH).astype(int)
    return [int(lane) for lane in on[np.concatenate(([True], on[1:] != on[:-1]))]]


@pytest.mark.parametrize("side", [1, -1])
def test_who_is_slow_is_passed_and_the_ego_comes_back(side: int) -> None:
    driven = drive(beside(side=side), 60.0, speed=13.0, actors=[car(7, 80.0, speed=8.5)])
    assert lanes(driven) == [0, side, 0]
    assert driven.clearances.min() > 1.0
    assert driven.speeds.min() > 10.0
    assert_drivable(driven)


def test_who_is_as_fast_is_followed() -> None:
    driven = drive(beside(), 40.0, speed=13.0, actors=[car(7, 60.0, speed=12.5)])
    assert lanes(driven) == [0]


def test_a_queue_is_passed_where_it_cannot_be_for_where_the_ego_goes() -> None:
    driven = drive(beside(), 60.0, speed=13.0, actors=queue(1.0))
    assert lanes(driven) == [0, 1, 0]
    assert driven.clearances.min() > 1.0


def test_a_queue_that_may_be_for_where_the_ego_goes_is_joined() -> None:
    assert lanes(drive(beside(leads_on=False), 60.0, speed=13.0, actors=queue(1.0))) == [0]


def test_where_it_has_to_come_back_it_does_though_that_is_on_a_junction() -> None:
    """A dense platoon keeps it from coming back before; when that has gone by, nobody is in its way."""
    ahead, behind = (
        [car(track, x, speed=8.6) for track, x in rows] for rows in (_platoon(35.0, 110), _platoon(-9.0, 20, -1))
    )
    route = beside(leads_on=False, halts=((END - 20.0, END - 5.0),))
    driven = drive(route, 120.0, speed=8.6, station=10.0, actors=[*ahead, *behind])
    assert "wait to change lanes" in driven.decisions
    assert lanes(driven) == [0, 1, 0]
    assert driven.fronts[-1] > END + 100.0
    assert driven.clearances.min() > 1.0


def _platoon(begin: float, count: int, side: int = 1) -> list[tuple[int, float]]:
    """Tracks and places [m] of cars 7 m from nose to nose."""
    return [(side * (1000 + row), begin + side * 7.0 * row) for row in range(count)]


def test_behind_a_queue_that_may_be_for_where_the_ego_goes_it_comes_back() -> None:
    """Those whom it is about to pass come up to the end of one."""
    slow = [car(7 + row, 80.0 + 50.0 * row, speed=8.5, stays_from=(318.0 - 42.0 * row) / 8.5) for row in range(1, 4)]
    standing = [car(30 + row, 430.0 + 8.0 * row, speed=0.8) for row in range(40)]
    driven = drive(beside(leads_on=False), 40.0, speed=13.0, actors=[*slow, *standing])
    assert lanes(driven) == [0, 1, 0]
    assert driven.fronts[-1] < 430.0
    assert driven.clearances.min() > 1.0


@pytest.mark.parametrize("braking", [0.0, 2.0])
def test_who_is_going_to_be_slow_is_passed_while_there_is_a_gap(braking: float) -> None:
    """Before the ego is at the end of a queue that it could not leave any more."""
    ahead = predicted([car(7, 70.0, speed=12.0), car(8, 70.0, WIDTH, speed=12.5)], 0.0)
    slowing = np.minimum(PREDICTION_TIMES, 2.0)
    ahead.poses[0, :, 0] -= braking * slowing * (PREDICTION_TIMES - 0.5 * slowing)
    route, config = beside(), PlanningConfig()
    window = Reference(route, SHAPE, config).window(40.0, 150.0)
    gaps = Gaps(route.line, route.line.length, SHAPE, config)
    choice = Passing(route.passing_lanes, gaps, SHAPE, config).step(window, 0.0, 13.0, ahead)
    assert (choice is not None and choice.keeping is not None) == (braking > 0.0)


def test_what_only_stands_about_is_passed_within_the_lane_or_next_to_it() -> None:
    across = car(7, 150.0, -2.4, heading=np.pi / 2.0, size=(4.0, 1.8))
    driven = drive(beside(), 40.0, speed=13.0, actors=[across, cone(8, 300.0, -1.0)])
    assert lanes(driven) == [0]
    assert driven.clearances.min() > 0.3


def test_nobody_is_passed_where_there_is_no_room_to_come_back() -> None:
    driven = drive(beside(end=180.0), 40.0, speed=13.0, actors=[car(7, 80.0, speed=8.5)])
    assert lanes(driven) == [0]


def test_nobody_is_passed_on_a_lane_that_is_as_slow() -> None:
    slow = [car(7, 80.0, speed=8.5), car(8, 90.0, WIDTH, speed=9.0)]
    assert lanes(drive(beside(), 40.0, speed=13.0, actors=slow)) == [0]


def test_who_comes_up_fast_from_behind_on_the_next_lane_goes_first() -> None:
    driven = drive(beside(), 60.0, speed=13.0, actors=[car(7, 80.0, speed=8.0), car(8, -20.0, WIDTH, speed=18.0)])
    fast = -20.0 + 18.0 * driven.states[:, 0]
    is_over = np.abs(driven.states[:, 2]) > 1.0
    assert is_over.any()
    assert fast[is_over.argmax()] > driven.fronts[is_over.argmax()]
    assert driven.clearances.min() > 1.0


def test_beside_dense_traffic_it_slows_down_in_time_for_a_gap_past_the_queue() -> None:
    platoon = [car(number, 40.0 - 18.0 * number, WIDTH, speed=13.0) for number in range(1, 4)]
    driven = drive(beside(), 60.0, speed=13.0, actors=[*platoon, *queue(1.0)])
    assert lanes(driven) == [0, 1, 0]
    assert driven.speeds.min() > 2.0
    assert driven.clearances.min() > 1.0


def test_it_comes_back_before_its_lane_to_pass_on_ends() -> None:
    slow = [car(7, 80.0, speed=10.0), car(8, 110.0, speed=10.0)]
    driven = drive(beside(end=500.0, leads_on=False), 60.0, speed=13.0, actors=slow)
    assert lanes(driven) == [0, 1, 0]
    over = driven.fronts[np.abs(driven.states[:, 2]) > 0.5 * WIDTH]
    assert over.max() < 500.0
    assert driven.clearances.min() > 1.0


@pytest.mark.parametrize(("leads_on", "expected"), [(True, [0, 1, 0]), (False, [0])])
def test_where_the_ego_has_to_come_back_there_has_to_be_room_for_that_too(
    *, leads_on: bool, expected: list[int]
) -> None:
    driven = drive(beside(end=290.0, leads_on=leads_on), 60.0, speed=13.0, actors=[car(7, 80.0, speed=9.0)])
    assert lanes(driven) == expected


def test_nobody_is_passed_shortly_before_a_junction() -> None:
    driven = drive(beside(halts=((200.0, 215.0),)), 60.0, speed=13.0, actors=[car(7, 80.0, speed=8.5)])
    assert lanes(driven) == [0, 1, 0]
    first = np.flatnonzero(np.abs(driven.states[:, 2]) > 0.5)[0]
    assert driven.fronts[first] - SHAPE.length > 215.0


def test_beside_a_queue_it_goes_on_over_a_junction() -> None:
    junction = (480.0, 495.0)
    driven = drive(beside(halts=(junction,)), 60.0, speed=13.0, actors=queue(1.0, 36))
    assert lanes(driven) == [0, 1, 0]
    assert driven.speeds.min() > 8.0
    is_on = (driven.fronts > junction[0]) & (driven.fronts - SHAPE.length < junction[1])
    assert np.abs(driven.states[is_on, 2] - WIDTH).max() < 0.4
    assert driven.clearances.min() > 1.0


@pytest.mark.parametrize(("hides", "expected"), [(False, [0, 1]), (True, [0])])
def test_from_a_queue_it_pulls_out_only_where_it_sees_far_enough_back(hides: bool, expected: list[int]) -> None:  # noqa: FBT001
    """The one behind hides whoever comes on the next lane."""
    behind = [car(9, 97.0, speed=1.7, size=(7.1, 2.4))] if hides else []
    ahead = [car(7, 118.0, speed=1.5), car(6, 130.0, speed=1.5), car(8, 130.0, WIDTH, speed=12.0)]
    driven = drive(beside(), 8.0, station=105.0, actors=[*ahead, *behind])
    assert lanes(driven) == expected


def test_a_move_to_the_next_lane_ends_where_it_was_to_end_when_it_began() -> None:
    """From standstill, close behind a queue: a move that grew longer as the ego gets faster would graze its tail."""
    front = 105.0 + SHAPE.front
    creeping = [car(7 + number, front + 4.5 + 2.25 + 8.0 * number, speed=0.6) for number in range(12)]
    driven = drive(beside(), 8.0, station=105.0, actors=creeping)
    assert driven.clearances.min() > 1.0
    assert driven.states[:, 2].max() < WIDTH + 0.05
    assert driven.speeds[-1] > 7.0
    assert_drivable(driven)


@pytest.mark.parametrize(
    ("speed", "gap", "behind", "slow"), [(13.0, 26.0, 40.0, 1.0), (13.0, 32.0, 30.0, 0.3), (13.0, 40.0, 30.0, 1.0)]
)
def test_a_change_begun_is_gone_on_with_where_falling_back_would_ask_more_of_the_ego_than_of_who_comes(
    speed: float, gap: float, behind: float, slow: float
) -> None:
    """Who comes up on the next lane brakes for the ego, as it would have to."""
    line = [car(10 + row, 5.0 + SHAPE.front + gap + 2.25 + 8.0 * row, speed=slow) for row in range(4)]
    other = car(3, 5.0 - behind, WIDTH, speed=24.0, braking=2.5)
    driven = drive(beside(), 8.0, speed=speed, actors=[*line, other])
    assert driven.clearances.min() > 0.5


@pytest.mark.parametrize(
    ("rear", "speed", "expected"),
    [
        (-30.0, 14.0, True),
        (-30.0, 30.0, False),  # it would have to brake harder than the ego
        (-4.0, 12.0, False),
        (0.0, 12.0, False),
        (2.0, 12.0, False),
        (15.0, 2.0, False),  # to stay behind it asks for more than staying in the lane
        (15.0, 12.0, True),
    ],
)
def test_before_who_stands_a_change_is_gone_on_with_but_not_into_who_is_beside_or_asks_for_more(
    rear: float,
    speed: float,
    expected: bool,  # noqa: FBT001
) -> None:
    def neighbours(place: float, pace: float) -> Neighbours:
        return Neighbours(np.array([place]), np.array([place + 4.5]), np.array([pace]), np.array([True]), [1])

    standing, other = neighbours(SHAPE.front + 20.0, 0.0), neighbours(rear, speed)
    assert is_caught(standing, other, 13.0, SHAPE, PlanningConfig()) == expected


def test_who_comes_faster_from_behind_on_its_own_lane_goes_first_where_it_can_come_back_later_as_well() -> None:
    slow = car(7, 80.0, speed=8.5)
    alone = drive(beside(), 20.0, speed=13.0, actors=[slow])
    times, offsets = alone.states[:, 0], alone.states[:, 2]
    row = int(((times > 10.0) & (offsets < WIDTH - 0.3)).argmax())  # the ego has begun to come back
    pace = float(alone.speeds[row]) + 2.0
    begin = float(alone.fronts[row]) - SHAPE.length - 12.0 - pace * float(times[row])

    driven = drive(beside(), 40.0, speed=13.0, actors=[slow, car(8, begin - 2.25, speed=pace)])
    is_back = (driven.states[:, 0] > times[row] - 2.0) & (driven.states[:, 2] < WIDTH - 1.0)
    assert is_back.any()
    back = int(is_back.argmax())
    assert begin + pace * driven.states[back, 0] > driven.fronts[back]
    assert driven.clearances.min() > 1.0


@pytest.mark.parametrize(("faster", "braking", "gap", "aside"), [(1.0, 0.0, 2.0, 0.6), (5.0, 2.0, 6.0, 0.5)])
def test_on_its_way_back_from_a_change_given_up_it_does_not_begin_that_again_without_a_gap(
    faster: float, braking: float, gap: float, aside: float
) -> None:
    """Somebody from the lane beyond is on the ego's own lane at once, when the ego has begun to come back to it."""
    slow = car(7, 80.0, speed=8.5)
    alone = drive(beside(), 20.0, speed=13.0, actors=[slow])
    times, offsets = alone.states[:, 0], alone.states[:, 2]
    row = int(((times > 10.0) & (offsets < WIDTH - aside)).argmax())
    since, rear = float(times[row]), float(alone.fronts[row]) - SHAPE.length

    class Cutter(Actor, frozen=True):
        def speed_at(self, time: float) -> float:
            return float(alone.speeds[row]) + faster - braking * max(time - since, 0.0)

        def box_at(self, time: float) -> list[float]:
            way = 0.5 * (self.speed_at(since) + self.speed_at(time)) * (time - since)
            nose = rear - gap + way
            return [nose - 0.5 * self.size[0], -WIDTH if time < since else 0.0, 0.0, *self.size]

    driven = drive(beside(), since + 6.0, speed=13.0, actors=[slow, Cutter(3, ObjectClass.VEHICLE, 0.0, 0.0)])
    assert driven.clearances.min() > 0.4
