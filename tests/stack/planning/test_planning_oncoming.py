"""Who comes towards the ego where its way leads beyond its lane."""

import math

import msgspec
import numpy as np
import pytest
from planned_drives import SHAPE, Drive, car, drive, person, road, stop_line

from dvca_sumo.messages import Floats
from dvca_sumo.roadmap.route import Control, Route


def hump(x: Floats, begin: float, end: float, side: float) -> Floats:
    """A move of 1.6 m to one side from `begin`, and back, finished at `end`, over 12 m each."""
    out, back = np.clip((x - begin) / 12.0, 0.0, 1.0), np.clip((x - end) / 12.0 + 1.0, 0.0, 1.0)
    moved: Floats = 0.8 * side * (np.cos(math.pi * back) - np.cos(math.pi * out))
    return moved


def swerving(side: float, end: float = 145.0) -> Route:
    """A straight lane, and a line that leaves it by 1.6 m to one side from 90 m to `end`; by less if that is near."""
    x = np.arange(0.0, 600.0)
    route = road(np.column_stack((x, hump(x, 90.0, end, side))))
    across = route.line.points[:, 1]
    return msgspec.structs.replace(
        route, lane_left=1.6 - across, lane_right=-1.6 - across, road_left=1.6 - across, road_right=-1.6 - across
    )


def meeting(x: float, speed: float, *, side: float = 1.0, beside: float = 3.2, cars: int = 1) -> Drive:
    others = [car(5 + index, x + 20.0 * index, side * beside, heading=math.pi, speed=speed) for index in range(cars)]
    return drive(swerving(side), 40.0, speed=8.0, actors=others)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("x", "speed"), [(220.0, 6.0), (240.0, 9.0), (260.0, 9.0), (300.0, 12.0)])
def test_ego_waits_before_it_leaves_its_lane_for_who_comes_towards_it(x: float, speed: float, side: float) -> None:
    driven = meeting(x, speed, side=side)
    assert driven.clearances.min() > 0.5
    assert driven.fronts[-1] > 200.0


def test_ego_goes_on_as_soon_as_who_came_towards_it_has_passed() -> None:
    driven = meeting(220.0, 6.0)
    fronts = 220.0 - 6.0 * driven.states[:, 0] - 0.5 * 4.5
    has_passed = fronts + 4.5 < driven.fronts - SHAPE.length
    goes = (driven.speeds > 1.0) & (driven.states[:, 0] > 15.0)
    assert goes.argmax() - has_passed.argmax() < 10


def behind_a_junction(end: float) -> Route:
    """The same lane, with a junction from 83 m to 95 m."""
    return msgspec.structs.replace(swerving(1.0, end), stop_lines=(stop_line(83.0, Control.YIELD),))


def standing_on_it(driven: Drive) -> Floats:
    """Where the front bumper is while the ego stands with any of it on that junction [m]."""
    fronts = driven.fronts[driven.speeds < 0.1]
    found: Floats = fronts[(fronts > 83.5) & (fronts < 95.0 + SHAPE.length)]
    return found


def test_ego_waits_before_a_junction_and_not_on_it() -> None:
    others = [car(5, 240.0, 3.2, heading=math.pi, speed=9.0)]
    driven = drive(behind_a_junction(145.0), 30.0, speed=8.0, actors=others)
    assert driven.speeds.min() < 0.1
    assert not standing_on_it(driven).size
    assert driven.clearances.min() > 0.5
    assert driven.fronts[-1] > 200.0


def test_ego_waits_on_a_junction_where_it_would_else_meet_who_comes_head_on() -> None:
    others = [car(5, 190.0, 3.2, heading=math.pi, speed=9.0)]
    driven = drive(behind_a_junction(145.0), 30.0, station=82.0, speed=5.0, actors=others)
    assert standing_on_it(driven).size
    assert driven.clearances.min() > 0.5
    assert driven.fronts[-1] > 200.0


@pytest.mark.parametrize("x", [130.0, 135.0])
def test_on_a_junction_before_a_short_such_stretch_the_ego_loses_no_more_time_than_it_has_to(x: float) -> None:
    others = [car(5, x, 3.2, heading=math.pi, speed=9.0)]
    driven = drive(behind_a_junction(108.0), 15.0, station=82.0, speed=5.0, actors=others)
    assert driven.clearances.min() > 0.5
    assert driven.fronts[85] > 105.0


@pytest.mark.parametrize(("aside", "away"), [(3.3, 39.0), (3.6, 38.0), (3.9, 38.0)])
def test_ego_that_passes_in_front_of_somebody_does_not_brake_hard_for_it_on_its_way(aside: float, away: float) -> None:
    x, y = 104.0 + away * math.cos(0.4), aside + away * math.sin(0.4)
    others = [car(5, x, y, heading=math.pi + 0.4, speed=9.0, lanes=("major_0",))]
    driven = drive(behind_a_junction(108.0), 8.0, station=82.0, speed=5.0, actors=others)
    assert driven.speeds.min() > 4.0
    assert driven.clearances.min() > 1.5


def test_all_who_come_one_behind_the_other_are_waited_for() -> None:
    driven = meeting(260.0, 9.0, cars=3)
    assert driven.clearances.min() > 0.5
    assert driven.fronts[-1] > 200.0


def test_who_comes_only_after_the_ego_is_back_in_its_lane_is_not_waited_for() -> None:
    driven = meeting(340.0, 9.0)
    assert driven.speeds.min() > 7.0


@pytest.mark.parametrize("x", [70.0, 80.0, 90.0])
@pytest.mark.parametrize(("y", "aside"), [(-0.5, 0.3), (-0.5, 0.15), (0.5, -0.3), (-3.0, 0.3)])
def test_who_comes_aslant_across_the_way_and_is_off_it_in_time_is_not_stopped_for(
    x: float, y: float, aside: float
) -> None:
    bus = car(5, x, y, heading=math.pi - aside, speed=14.0, size=(10.0, 2.5))
    driven = drive(road(), 8.0, station=20.0, speed=13.0, actors=[bus])
    assert driven.speeds.min() > 8.0
    assert driven.clearances.min() > 0.5


def test_people_who_walk_towards_the_ego_beside_its_way_are_met_there() -> None:
    driven = drive(swerving(1.0), 40.0, speed=8.0, actors=[person(5, 150.0, 3.05, heading=math.pi, speed=1.4)])
    assert driven.fronts[-1] > 200.0
    assert driven.clearances.min() > 0.2


def test_who_comes_far_enough_to_the_side_is_not_waited_for() -> None:
    driven = meeting(260.0, 9.0, beside=4.6)
    assert driven.speeds.min() > 5.0
    assert driven.clearances.min() > 0.5


@pytest.mark.parametrize(("x", "speed"), [(125.0, 9.0), (135.0, 9.0), (150.0, 11.0)])
def test_room_is_told_where_the_ego_needs_it_and_not_where_its_lane_is_wider(x: float, speed: float) -> None:
    route = swerving(1.0)
    edge = route.lane_left + np.where(route.line.stations < 88.0, 1.2, 0.0)
    route = msgspec.structs.replace(route, lane_left=edge, road_left=edge)
    others = [car(5, x, 4.4, heading=math.pi, speed=speed)]
    driven = drive(route, 15.0, station=70.0, speed=8.0, actors=others)
    assert driven.speeds.min() > 7.0
    assert driven.clearances.min() > 0.5


def test_who_comes_is_waited_for_where_the_ego_itself_will_come_back_on_that_lane() -> None:
    x = np.arange(0.0, 116.0)
    aside = 1.8 * (1.0 - np.cos(math.pi * np.clip((x - 102.0) / 13.0, 0.0, 1.0)))
    angles = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 12)[1:]
    turn = np.column_stack((115.0 + 3.4 * np.cos(angles), -0.2 + 3.4 * np.sin(angles)))
    home = np.column_stack((np.arange(114.0, -100.0, -1.0), np.full(214, 3.2)))
    route = road(np.concatenate((np.column_stack((x, hump(x, 60.0, 102.0, 1.0) - aside)), turn, home)))
    across = np.where(route.line.stations < 103.0, route.line.points[:, 1], 0.0)
    route = msgspec.structs.replace(route, lane_left=1.6 - across, lane_right=-1.6 - across)
    driven = drive(route, 30.0, speed=8.0, actors=[car(5, 150.0, 3.2, heading=math.pi, speed=8.0)])
    assert driven.clearances.min() > 0.5
    assert driven.states[-1, 2] == pytest.approx(3.2, abs=0.1)  # on its way back
