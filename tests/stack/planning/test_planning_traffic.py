"""Others on the road: leading, crossing, merging, walking."""

import math

import msgspec
import numpy as np
import pytest
from planned_drives import (
    SHAPE,
    Actor,
    Drive,
    Winding,
    assert_drivable,
    believed,
    bent_points,
    car,
    curve_points,
    drive,
    person,
    predicted,
    road,
    stop_line,
)

from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.messages import PREDICTION_TIMES, Floats, ObjectClass, SignalColour
from dvca_sumo.roadmap.route import Control, Crossing, Overpass, Route
from dvca_sumo.stack.planning import Planner, PlanningConfig

UP, DOWN = math.pi / 2.0, -math.pi / 2.0


def test_slower_leader_is_followed_at_a_headway() -> None:
    driven = drive(road(), 30.0, speed=13.0, actors=[car(3, 60.0, speed=8.0)])
    assert driven.speeds[-1] == pytest.approx(8.0, abs=0.2)
    assert 1.2 < driven.clearances[-1] / 8.0 < 2.6
    assert driven.clearances.min() > 10.0
    assert driven.decisions[50] == "follow 3"
    assert_drivable(driven)


def test_faster_leader_is_let_go() -> None:
    driven = drive(road(), 15.0, speed=13.0, actors=[car(3, 60.0, speed=16.0)])
    assert driven.speeds.min() > 12.9


def test_back_from_a_turn_that_swings_out_the_ego_lets_those_pass_who_drive_where_it_turns_to() -> None:
    """They come across the beginning of its turn, behind it, and are not behind it in its lane."""
    curvature = np.repeat([0.0, 0.182, -0.04, 0.0], [60, 19, 18, 100])
    headings = np.cumsum(curvature)
    turn = np.column_stack((np.cumsum(np.cos(headings)), np.cumsum(np.sin(headings))))
    for y, passes in ((3.6, True), (-30.0, False)):
        other = car(3, 67.0, y, heading=2.76, speed=6.6)
        driven = drive(road(turn), 0.8, station=74.5, actors=[other])
        assert bool(driven.speeds[-1] < 0.3) == passes


@pytest.mark.parametrize(("behind", "speed"), [(14.0, 6.0), (18.0, 7.5), (22.0, 7.5), (22.0, 9.0)])
def test_before_a_turn_that_swings_out_the_ego_lets_those_pass_who_come_up_in_the_lane_that_it_has_left(
    behind: float, speed: float
) -> None:
    """They are in its way behind it, leave that where it swings out, and come across it where it turns."""
    driven = drive(swung_out(0.04, 5.3), 6.0, station=80.0, actors=[car(3, 78.0 - behind, speed=speed)])
    assert driven.clearances.min() > 1.0
    assert driven.speeds[-1] > 1.0  # it goes when they have passed


@pytest.mark.parametrize(("behind", "speed"), [(14.0, 7.0), (18.0, 9.0), (22.0, 12.0), (26.0, 12.0)])
def test_before_a_turn_that_swings_out_the_ego_lets_those_pass_whose_lane_parts_from_its_own_there(
    behind: float, speed: float
) -> None:
    """It swings out less than its own width: they are in its way all the time."""
    passing = car(3, 78.0 - behind, speed=speed, lanes=("ego_0", "beside_0"))
    driven = drive(swung_out(0.025, 3.3), 6.0, station=78.0, speed=2.5, actors=[passing])
    assert driven.clearances.min() > 0.2
    assert driven.speeds[-1] > 1.0


def swung_out(curvature: float, width: float) -> Route:
    """A road whose line swings out to the right, of a lane so wide [m], in bends of `curvature` [1/m], to turn left."""
    bends = np.repeat([0.0, -curvature, curvature, 0.0, 0.18, 0.0], [60, 9, 9, 4, 17, 100])
    route = road(bent_points(bends))
    is_out = (route.line.stations > 65.0) & (route.line.stations < 105.0)
    left, right = np.where(is_out, width, route.lane_left), np.where(is_out, -0.1, route.lane_right)
    return msgspec.structs.replace(route, lane_left=left, road_left=left, lane_right=right, road_right=right - 1.0)


def test_who_comes_onto_the_junction_aslant_and_does_not_wait_is_braked_for_at_once() -> None:
    """On a roundabout, say: it comes nearly along, and is on the ego's way in less than a second."""
    line = stop_line(80.0, Control.PRIORITY, yields_to=frozenset(), exit_station=120.0)
    joining = car(3, 103.0, -6.4, heading=0.9, speed=5.0, lanes=("minor_0",))
    driven = drive(road(stop_lines=[line]), 1.0, station=93.0, speed=6.3, actors=[joining])
    assert driven.states[-1, 5] < -1.5
    assert "yield 3" in driven.decisions


@pytest.mark.parametrize(("y", "heading", "speed"), [(3.0, -0.3, 7.0), (3.4, -0.4, 7.0), (3.4, -0.5, 9.0)])
def test_a_slow_ego_stops_at_once_for_who_comes_into_its_way_beside_its_front(
    y: float, heading: float, speed: float
) -> None:
    """However fast it gets away: until its rear is past, the ego would drive into its side."""
    joining = car(3, 23.0, y, heading=heading, speed=speed)
    driven = drive(road(), 1.5, station=20.0, speed=3.5, actors=[joining])
    assert driven.clearances.min() > 0.1
    assert driven.speeds[-1] < 0.1


@pytest.mark.parametrize(("y", "heading"), [(4.5, 0.3), (5.0, 0.3), (5.0, 0.45), (5.5, 0.45)])
def test_a_standing_ego_does_not_set_off_towards_a_bus_that_swings_into_its_way(y: float, heading: float) -> None:
    bus = car(3, 33.0, y, heading=math.pi + heading, speed=6.5, size=(12.0, 2.5))
    driven = drive(road(), 1.0, station=20.0, actors=[bus])
    assert driven.clearances[0] > 3.0
    assert driven.speeds.max() == 0.0


def test_leader_that_stops_is_stopped_behind() -> None:
    driven = drive(road(), 30.0, speed=10.0, actors=[car(3, 45.0, speed=9.0, stays_from=8.0)])
    assert driven.speeds[-1] == 0.0
    assert driven.clearances.min() > 1.0
    assert_drivable(driven)


def test_leader_that_starts_again_is_followed() -> None:
    driven = drive(road(), 30.0, actors=[car(3, 25.0, speed=7.0, leaves=12.0)])
    assert driven.speeds[100] == 0.0
    assert driven.speeds[-1] == pytest.approx(7.0, abs=0.5)


def test_standing_car_in_a_single_lane_is_stopped_behind() -> None:
    driven = drive(road(), 25.0, speed=13.0, actors=[car(5, 120.0)])
    assert 3.0 < driven.clearances[-1] < 7.0
    assert driven.speeds[-1] == 0.0
    assert driven.decisions[-1] == "stop behind 5"
    assert driven.states[:, 5].min() > -2.6
    assert_drivable(driven)


@pytest.mark.parametrize(("room", "front"), [(9.8, 96.8), (8.8, 96.6), (8.2, 79.2)])
def test_behind_a_queue_past_a_junction_the_ego_closes_up_or_stays_out(room: float, front: float) -> None:
    """The junction is from 80 m to 92 m, and the ego 4.6 m long: never does it stand on it."""
    line = stop_line(80.0, Control.PRIORITY, yields_to=frozenset())
    driven = drive(road(stop_lines=[line]), 40.0, speed=8.0, actors=[car(3, 92.0 + room + 2.25)])
    assert driven.speeds[-1] == 0.0
    assert driven.fronts[-1] == pytest.approx(front, abs=0.15)


def test_car_behind_is_no_reason_to_do_anything() -> None:
    driven = drive(road(), 10.0, speed=13.0, actors=[car(4, -15.0, speed=15.0)])
    assert set(driven.decisions) == {"cruise"}


def test_car_in_the_next_lane_is_no_reason_to_do_anything() -> None:
    driven = drive(road(lanes_left=1), 10.0, speed=13.0, actors=[car(4, 40.0, 3.2, speed=5.0), car(6, 70.0, 3.2)])
    assert set(driven.decisions) == {"cruise"}


def test_oncoming_car_in_the_opposite_lane_is_no_reason_to_do_anything() -> None:
    driven = drive(road(), 10.0, speed=13.0, actors=[car(4, 150.0, 3.2, heading=math.pi, speed=13.0)])
    assert set(driven.decisions) == {"cruise"}


def test_person_crossing_is_yielded_to_with_distance() -> None:
    driven = drive(road(), 25.0, speed=13.0, actors=[person(3, 100.0, -8.0, heading=UP, speed=1.4, leaves=2.0)])
    assert driven.clearances.min() > 1.0
    assert "yield 3" in driven.decisions
    assert driven.states[:, 5].min() > -3.0
    assert driven.fronts[-1] > 150.0
    assert_drivable(driven)


def test_person_who_steps_out_late_is_braked_for_beyond_comfort() -> None:
    driven = drive(road(), 15.0, speed=13.0, actors=[person(3, 45.0, -3.5, heading=UP, speed=1.5, leaves=1.0)])
    assert driven.clearances.min() > 0.3
    assert driven.states[:, 5].min() < -4.0
    assert_drivable(driven)


def test_person_who_stays_in_the_lane_is_stopped_for() -> None:
    driven = drive(road(), 25.0, speed=13.0, actors=[person(3, 100.0, 0.0)])
    assert driven.speeds[-1] == 0.0
    assert driven.clearances.min() > 2.0


@pytest.mark.parametrize(
    ("speed", "x", "y", "stays"), [(13.0, 70.0, -2.0, 2.5), (10.0, 70.0, -3.0, 3.0), (10.0, 80.0, -4.0, 4.0)]
)
def test_before_a_person_who_walks_off_its_way_the_ego_could_stop_should_they_stay_there(
    speed: float, x: float, y: float, stays: float
) -> None:
    walker = person(3, x, y, heading=UP, speed=1.2, stays_from=stays)
    driven = drive(road(), 12.0, station=20.0, speed=speed, actors=[walker])
    assert driven.clearances.min() > 0.9
    assert driven.states[:, 5].min() > -5.1


def test_person_standing_off_the_road_is_just_passed() -> None:
    driven = drive(road(), 15.0, speed=13.0, actors=[person(3, 80.0, -3.5)])
    assert driven.speeds.min() > 12.5


def test_person_standing_at_the_kerb_is_passed_slowly() -> None:
    driven = drive(road(), 20.0, speed=13.0, actors=[person(3, 100.0, -2.0)])
    beside = np.abs(driven.fronts - 100.0) < 2.0
    assert 3.0 < driven.speeds[beside].max() < 11.0
    assert driven.clearances.min() > 0.6
    assert driven.fronts[-1] > 150.0


@pytest.mark.parametrize(("y", "passes"), [(-1.53, True), (-1.4, False)])
def test_past_a_person_who_stands_very_close_to_its_way_the_ego_creeps(y: float, *, passes: bool) -> None:
    """Each may be waiting for the other. The road has no room to swerve."""
    route = road()
    edge = np.full_like(route.road_left, 0.95)
    narrow = msgspec.structs.replace(route, lane_left=edge, road_left=edge)
    driven = drive(narrow, 40.0, speed=8.0, actors=[person(3, 100.0, y)])
    beside = np.abs(driven.fronts - 101.0) < 3.0
    assert bool(driven.fronts[-1] > 110.0) == passes
    assert driven.speeds[beside].max(initial=0.0) < 1.2
    assert driven.clearances.min() > 0.25


def test_person_walking_along_the_road_is_just_passed() -> None:
    driven = drive(road(), 15.0, speed=13.0, actors=[person(3, 80.0, -3.5, speed=1.4)])
    assert driven.speeds.min() > 12.5


@pytest.mark.parametrize(("speed", "leaves"), [(2.5, 0.9), (3.0, 0.6), (3.5, 0.6)])
def test_slow_ego_stops_for_a_person_who_walks_off_beside_its_front_corner(speed: float, leaves: float) -> None:
    beside = person(3, 23.0 + SHAPE.front, -2.3, heading=UP, speed=1.4, leaves=leaves)
    driven = drive(road(), 8.0, station=20.0, speed=speed, actors=[beside])
    touched = driven.clearances <= 0.0
    assert driven.speeds[touched].max(initial=0.0) < 1.0
    assert driven.fronts[-1] > 30.0


@pytest.mark.parametrize("x", [103.0, 103.4, 104.2])
def test_ego_does_not_start_while_a_person_walks_up_to_its_front_corner(x: float) -> None:
    driven = drive(road(), 12.0, station=100.0, actors=[person(3, x, -4.0, heading=UP, speed=1.2)])
    within_the_way = (driven.states[:, 0] > 1.0) & (driven.states[:, 0] < 4.0)
    assert driven.speeds[within_the_way].max() == 0.0
    assert driven.fronts[-1] > 120.0


@pytest.mark.parametrize(
    ("x", "y", "heading"),
    [
        *((x, -1.75, math.pi - 0.2) for x in (103.5, 102.5, 101.5)),
        *((x, -1.90, math.pi - 0.1) for x in (103.5, 102.5)),  # by it, at 0.3 m
    ],
)
def test_ego_does_not_start_while_a_person_walks_along_its_side_and_into_it(x: float, y: float, heading: float) -> None:
    """Standing, it is walked into; moving, it would be the one that touches the person."""
    walker = person(3, x, y, heading=heading, speed=1.2)
    driven = drive(road(), 12.0, station=100.0, actors=[walker])
    is_alongside = driven.states[:, 0] < (x - 99.1) / 1.2
    assert driven.speeds[is_alongside].max() == 0.0
    assert driven.fronts[-1] > 120.0


@pytest.mark.parametrize("gap", [0.3, 0.4, 0.45])
@pytest.mark.parametrize(("x", "heading"), [(103.0, math.pi), (101.5, math.pi), (101.5, 0.0)])
def test_ego_at_rest_does_not_start_while_a_person_walks_slowly_along_its_side(
    x: float, heading: float, gap: float
) -> None:
    """Who walks may sway by as much as is left in a step."""
    walker = person(3, x, -(0.5 * (SHAPE.width + 0.6) + gap), heading=heading, speed=0.8)
    driven = drive(road(), 14.0, station=100.0, actors=[walker])
    along = driven.states[:, 0] * 0.8 * math.cos(heading) + x
    assert driven.speeds[(along > 100.0 - SHAPE.rear_overhang) & (along < 100.0 + SHAPE.front)].max() == 0.0
    assert driven.fronts[-1] > 120.0


class Hesitating(Actor, frozen=True):
    """Who walks on slowly, and for a moment seems to stand."""

    def speed_at(self, time: float) -> float:
        return 0.2 if 0.25 < time < 0.35 else super().speed_at(time)


@pytest.mark.parametrize("x", [19.5, 20.4, 21.5, 22.5])
def test_standing_ego_does_not_set_off_beside_a_person_who_walks_up_slowly_and_hesitates(x: float) -> None:
    walker = Hesitating(3, ObjectClass.PEDESTRIAN, x, -1.85, heading=math.pi / 2.0, speed=0.45, size=(0.5, 0.6))
    driven = drive(road(), 1.5, station=20.0, actors=[walker])
    assert driven.speeds[-1] == 0.0
    assert driven.fronts[-1] - driven.fronts[0] < 0.02


@pytest.mark.parametrize("gap", [0.6, 0.8, 1.0])
@pytest.mark.parametrize("leaves", [0.4, 0.6])
def test_ego_that_has_just_set_off_stops_at_once_for_a_person_who_turns_into_its_side(
    leaves: float, gap: float
) -> None:
    walker = person(3, 20.5, -(0.5 * (SHAPE.width + 0.6) + gap), heading=UP, speed=1.2, leaves=leaves)
    driven = drive(road(), 3.0, station=20.0, actors=[walker])
    touched = driven.clearances <= 0.0
    assert touched.any()
    assert driven.speeds[touched].max() < 0.05


def test_person_who_is_long_across_before_the_ego_comes_is_no_reason_to_stop() -> None:
    driven = drive(road(), 15.0, speed=10.0, actors=[person(3, 140.0, -2.0, heading=UP, speed=1.4)])
    assert driven.speeds.min() > 9.5


def test_person_about_to_use_a_crossing_is_waited_for_before_it() -> None:
    crossing = Crossing("c", 98.0, 102.0)
    driven = drive(
        road(crossings=[crossing]), 25.0, speed=10.0, actors=[person(3, 100.0, -6.0, heading=UP, speed=1.2, leaves=3.0)]
    )
    assert driven.clearances.min() > 1.0
    assert "yield 3" in driven.decisions
    assert driven.fronts[-1] > 120.0


@pytest.mark.parametrize(
    ("pace", "is_stopped_for"),
    [
        (0.4, False),  # the ego is gone before they are at its side
        (1.6, True),
    ],
)
def test_slow_ego_drives_on_where_it_is_gone_before_a_person_comes_up_to_its_side(
    pace: float,
    is_stopped_for: bool,  # noqa: FBT001
) -> None:
    """They step off a crossing's kerb, its front past."""
    comes = person(3, 21.9, -2.1, heading=UP, speed=pace)
    driven = drive(road(crossings=[Crossing("c", 20.0, 24.0)]), 2.0, station=20.0, speed=2.4, actors=[comes])
    assert bool(driven.speeds.min() < 2.0) is is_stopped_for
    assert is_stopped_for or driven.clearances.min() > 0.2


@pytest.mark.parametrize(
    ("lanes", "yields_to", "is_waited_for"),
    [
        (("pavement", "c"), frozenset({"c"}), True),  # about to use a crossing where people go first
        (("pavement", "c"), frozenset(), False),  # ... and one where they have to wait
        (("c",), frozenset(), True),  # on it, they always go first
        ((), frozenset(), True),
    ],
)
def test_people_go_first_but_before_a_crossing_where_they_have_to_wait(
    lanes: tuple[str, ...],
    yields_to: frozenset[str],
    is_waited_for: bool,  # noqa: FBT001
) -> None:
    line = stop_line(90.0, Control.PRIORITY, yields_to=yields_to, crosses=frozenset({"c"}))
    walker = person(3, 96.0, -5.0, heading=UP, speed=1.2, stays_from=1.0, lanes=lanes)
    route = road(stop_lines=[line], crossings=[Crossing("c", 94.0, 98.0)])
    driven = drive(route, 1.0, station=55.0, speed=12.0, actors=[walker])
    assert ("yield 3" in driven.decisions) is is_waited_for


@pytest.mark.parametrize(("yields_to", "is_slow"), [(frozenset({"c"}), True), (frozenset(), False)])
def test_past_people_at_the_kerb_of_a_crossing_where_they_have_priority_the_ego_could_stop(
    yields_to: frozenset[str],
    is_slow: bool,  # noqa: FBT001
) -> None:
    line = stop_line(112.0, Control.YIELD, yields_to=yields_to, crosses=frozenset({"c"}))
    route = road(stop_lines=[line], crossings=[Crossing("c", 114.0, 118.0)])
    waiting = person(3, 117.0, -2.4, heading=UP)
    driven = drive(route, 12.0, station=70.0, speed=12.0, actors=[waiting])
    before = (driven.fronts > 112.0) & (driven.fronts < 116.0)
    assert bool(driven.speeds[before].max() < 4.7) is is_slow
    assert driven.speeds[-1] > 8.0


@pytest.mark.parametrize(
    ("speed", "control", "is_slow"),
    [
        (1.0, Control.PRIORITY, True),  # they may set off as the ego does
        (10.0, Control.PRIORITY, False),  # they let it pass
        (1.0, Control.SIGNAL, False),  # they have red
    ],
)
def test_past_people_at_the_kerb_of_a_crossing_the_ego_does_not_speed_up(
    speed: float,
    control: Control,
    is_slow: bool,  # noqa: FBT001
) -> None:
    line = stop_line(112.0, control, yields_to=frozenset(), crosses=frozenset({"c"}))
    route = road(stop_lines=[line], crossings=[Crossing("c", 114.0, 118.0)])
    green = {line.signal_id: SignalColour.GREEN} if line.signal_id else {}
    waiting = person(3, 117.0, -2.4, heading=UP)
    driven = drive(route, 12.0, station=106.0, speed=speed, actors=[waiting], signals=lambda _: green)
    before = (driven.fronts > 112.0) & (driven.fronts < 116.0)
    assert bool(driven.speeds[before].max() < 1.7) is is_slow
    assert driven.speeds[-1] > 8.0


def test_behind_people_who_walk_away_the_ego_drives_on() -> None:
    """They are 0.6 m beside its way."""
    crossing = Crossing("c", 108.0, 112.0)
    walker = person(3, 110.0, 1.8, heading=UP, speed=1.2)
    driven = drive(road(crossings=[crossing]), 1.0, station=100.0, actors=[walker])
    assert driven.speeds[-1] > 1.0


def test_car_with_priority_from_a_side_road_is_yielded_to() -> None:
    driven = drive(
        road(stop_lines=[stop_line(100.0, Control.YIELD)]),
        25.0,
        speed=13.0,
        actors=[car(3, 106.0, -80.0, heading=UP, speed=10.0, lanes=("major_0",))],
    )
    assert "yield 3" in driven.decisions
    assert driven.clearances.min() > 2.0
    assert driven.fronts[-1] > 150.0
    assert_drivable(driven)


@pytest.mark.parametrize(("between", "waits_at"), [(0.5, 100.0), (12.0, 124.0)])
def test_ego_waits_before_two_junctions_with_no_room_to_stand_in_between(between: float, waits_at: float) -> None:
    first = stop_line(100.0, Control.PRIORITY, yields_to=frozenset(), crosses=frozenset({"minor_0"}))
    second = stop_line(112.0 + between, Control.YIELD)
    stream = [
        car(3 + row, 118.0 + between, -45.0 - 25.0 * row, heading=UP, speed=10.0, lanes=("major_0",))
        for row in range(8)
    ]
    driven = drive(road(stop_lines=[first, second]), 35.0, station=60.0, speed=8.0, actors=stream)
    stands = driven.speeds < 0.2
    assert stands.any()
    assert driven.fronts[stands] == pytest.approx(waits_at - 0.8, abs=0.5)
    assert driven.fronts[-1] > 150.0
    assert driven.clearances.min() > 1.0


@pytest.mark.parametrize("ahead", [30.0, 40.0, 50.0])
@pytest.mark.parametrize("radius", [10.0, 12.0])
def test_ego_half_way_round_a_left_turn_waits_for_who_comes_past_it_and_then_across(
    radius: float, ahead: float
) -> None:
    junction = stop_line(101.0, Control.YIELD, exit_station=126.0)
    oncoming = car(3, 106.0 + ahead, 3.0, heading=math.pi - 0.03, speed=13.0, lanes=("major_0",))
    driven = drive(road(curve_points(radius), stop_lines=[junction]), 12.0, station=106.0, actors=[oncoming])
    assert driven.clearances.min() > 0.5
    assert driven.states[-1, 2] > 40.0
    assert_drivable(driven)


@pytest.mark.parametrize(
    ("radius", "station", "y", "heading", "speed"),
    [
        (10.0, 106.0, 3.6, 0.0, 6.0),
        (10.0, 106.0, 6.0, 0.1, 4.0),
        (12.0, 108.0, 4.2, 0.0, 4.0),
        (12.0, 110.0, 5.4, 0.0, 6.0),
    ],
)
def test_ego_that_stands_in_a_left_turn_stays_there_while_a_bus_passes_close_before_its_nose(
    radius: float, station: float, y: float, heading: float, speed: float
) -> None:
    junction = stop_line(101.0, Control.YIELD, exit_station=126.0)
    bus = car(3, 130.0, y, heading=math.pi + heading, speed=speed, size=(12.0, 2.5), lanes=("major_0",))
    driven = drive(road(curve_points(radius), stop_lines=[junction]), 15.0, station=station, actors=[bus])
    assert driven.clearances.min() > 0.2
    assert driven.states[-1, 2] > 40.0


@pytest.mark.parametrize(
    ("radius", "y", "heading"), [(12.0, 3.2, 0.1), (12.0, 4.0, 0.1), (12.0, 4.0, 0.26), (14.0, 3.2, 0.26)]
)
def test_ego_that_stands_in_a_left_turn_stays_there_while_who_comes_slows_down_in_its_way(
    radius: float, y: float, heading: float
) -> None:
    """That one may do so for the ego, and drive on."""
    junction = stop_line(101.0, Control.YIELD, exit_station=126.0)
    oncoming = car(3, 122.0, y, heading=math.pi + heading, speed=5.0, braking=2.0, lanes=("major_0",))
    driven = drive(road(curve_points(radius), stop_lines=[junction]), 2.2, station=106.0, actors=[oncoming])
    assert oncoming.speed_at(2.2) > 0.5
    assert math.dist(driven.states[0, 1:3], driven.states[-1, 1:3]) < 0.02


@pytest.mark.parametrize(
    ("radius", "speed", "oncoming", "distance"),
    [(14.0, 3.0, 10.0, 60.0), (20.0, 6.0, 14.0, 45.0), (26.0, 6.0, 10.0, 60.0)],
)
def test_ego_in_a_left_turn_stops_before_the_way_of_a_bus_that_first_comes_past_close_beside_it(
    radius: float, speed: float, oncoming: float, distance: float
) -> None:
    junction = stop_line(96.0, Control.YIELD, exit_station=140.0)
    y = 3.0 + distance * math.sin(0.1)
    bus = car(3, 100.0 + distance, y, heading=math.pi + 0.1, speed=oncoming, size=(12.0, 2.5), lanes=("major_0",))
    route = road(curve_points(radius), stop_lines=[junction])
    driven = drive(route, 20.0, station=100.0, speed=speed, actors=[bus])
    assert driven.clearances.min() > 0.4
    assert driven.states[-1, 2] > 40.0


@pytest.mark.parametrize(("first", "apart"), [(0.0, 3.0), (-2.0, 3.0), (-4.0, 3.5), (0.0, 2.5)])  # [s]
def test_ego_goes_between_those_who_swing_over_its_lane_from_the_next_where_the_map_gives_nobody_priority(
    first: float, apart: float
) -> None:
    curvatures = np.zeros(90)
    curvatures[36:40], curvatures[41:53] = -0.6 / 4.0, 2.0 / 12.0
    line = Polyline(bent_points(curvatures) + np.array([0.0, 3.6]))
    stream = [
        Winding(
            3 + k, ObjectClass.VEHICLE, 0.0, 3.6, speed=8.0, leaves=first + apart * k, lanes=("minor_0",), line=line
        )
        for k in range(9)
    ]
    driven = drive(road(), 20.0, speed=5.0, actors=stream)
    assert driven.fronts[-1] > 60.0
    assert driven.clearances.min() > 0.8


def test_who_drives_along_on_the_inner_lane_of_a_roundabout_is_no_reason_to_slow_down() -> None:
    """Its box, at an angle to the ego's line, is wider across it than it is anywhere beside the ego."""
    bends = [0.0, 0.0, 0.0, -0.005, -0.017, -0.031, -0.048, -0.074, -0.096, -0.068, -0.033, -0.01, 0.013, 0.042, 0.071]
    stations = np.arange(0.0, 90.5)
    headings = 0.36 + np.concatenate(
        ([0.0], np.cumsum(np.interp(stations[:-1] + 0.5, 30.0 + 2.0 * np.arange(15), bends)))
    )
    middles = 0.5 * (headings[1:] + headings[:-1])
    line = np.column_stack([np.cumsum(np.append(0.0, np.cos(middles))), np.cumsum(np.append(0.0, np.sin(middles)))])
    line += np.array([427.6, 521.7]) - line[30]
    inner = [(439.51, 544.36, -1.68), (439.2, 541.22, -1.63), (439.25, 538.55, -1.38), (440.17, 536.38, -1.05)]
    inner += [(441.31, 534.55, -1.03), (442.42, 532.72, -1.03), (443.64, 530.97, -0.84), (445.26, 529.6, -0.58)]
    inner += [(447.07, 528.46, -0.52), (448.92, 527.38, -0.53), (450.79, 526.35, -0.46), (452.75, 525.49, -0.37)]
    known = PREDICTION_TIMES[-1] * np.linspace(0.0, 1.0, len(inner))
    poses = np.column_stack([np.interp(PREDICTION_TIMES, known, column) for column in zip(*inner, strict=True)])
    ring = predicted([car(3, 439.51, 544.36, heading=-1.68, speed=6.0, size=(5.0, 1.8), lanes=("major_0",))], 0.0)
    future = msgspec.structs.replace(ring, poses=poses[None])
    planner = Planner(PlanningConfig(), road(line, stop_lines=[stop_line(45.0, Control.YIELD)]), SHAPE)
    trajectory = planner.step(believed(427.6, 521.7, heading=0.36, speed=7.7), future, {})
    assert trajectory.decision == "cruise"


def round_a_roundabout(radius: float) -> Floats:
    """80 m straight on, the upper half of a ring to the left, from its lowest to its highest point, straight back."""
    stations = np.arange(0.0, 80.0 + math.pi * radius + 60.5)
    return bent_points(np.where((stations >= 80.0) & (stations < 80.0 + math.pi * radius), 1.0 / radius, 0.0))


def past_a_roundabout(round_ring: float, station: float) -> Drive:
    """From `station` on, past who drives round it, so far past the lowest point [of half the ring]."""
    radius = 14.0
    angles = np.arange(0.0, 3.0 * math.pi, 0.05) + (round_ring - 0.5) * math.pi
    ring = Polyline(radius * np.column_stack([np.cos(angles), np.sin(angles)]) + np.array([80.0, radius]))
    other = Winding(3, ObjectClass.VEHICLE, 0.0, 0.0, speed=8.0, lanes=("major_0", "ego_0"), line=ring)
    route = road(round_a_roundabout(radius), stop_lines=[stop_line(70.0, Control.YIELD)])
    return drive(route, 25.0, speed=8.0, station=station, actors=[other])


@pytest.mark.parametrize(("round_ring", "station"), [(0.7, 25.0), (0.8, 35.0), (0.85, 35.0)])
def test_who_drives_where_the_ego_will_leave_a_roundabout_and_passes_its_entry_before_is_yielded_to(
    round_ring: float, station: float
) -> None:
    """It is on the ego's way, far ahead, and would lead it there; but where they meet is the entry."""
    driven = past_a_roundabout(round_ring, station)
    assert driven.decisions[0] == "yield 3"
    assert driven.clearances.min() > 2.0
    assert driven.states[:, 5].min() > -3.0
    assert_drivable(driven)


@pytest.mark.parametrize(("round_ring", "station"), [(0.6, 5.0), (0.8, 15.0), (0.95, 25.0)])
def test_behind_who_passes_the_entry_of_a_roundabout_the_ego_enters_with_room_to_follow(
    round_ring: float, station: float
) -> None:
    """It would come close to its tail, faster, and brake hard for it."""
    driven = past_a_roundabout(round_ring, station)
    assert driven.clearances.min() > 3.0
    assert driven.states[:, 5].min() > -3.0
    assert_drivable(driven)


@pytest.mark.parametrize(("speed", "x"), [(0.0, 105.0), (1.0, 105.4), (2.0, 105.8), (2.0, 106.2)])
def test_ego_stops_at_once_for_a_car_that_comes_out_right_before_its_bumper(speed: float, x: float) -> None:
    junction = stop_line(98.0, Control.PRIORITY, yields_to=frozenset())
    coming = car(3, x, -3.0, heading=UP, speed=2.5, lanes=("minor_0",))
    driven = drive(road(stop_lines=[junction]), 8.0, speed=speed, station=100.0, actors=[coming])
    assert driven.clearances.min() > 0.1
    assert driven.fronts[-1] > 110.0
    assert_drivable(driven)


@pytest.mark.parametrize("x", [101.0, 102.5, 104.0])
@pytest.mark.parametrize("crawls", [0.0, 0.3])
def test_a_slow_ego_in_the_way_of_a_bus_that_comes_stands(x: float, crawls: float) -> None:
    """It does not get out of the way any more; moving, it would be the one that drives into the bus."""
    bus = car(3, x, -10.5, heading=UP, speed=3.0, size=(12.0, 2.5), lanes=("minor_0",))
    driven = drive(road(), 3.0, station=100.0, speed=crawls, actors=[bus])
    touched = driven.clearances <= 0.0
    assert touched.any()
    assert driven.speeds[touched].max() < 0.1


@pytest.mark.parametrize("arrives", [1.0, 1.75])
@pytest.mark.parametrize("crawls", [0.8, 1.3])
def test_a_creeping_ego_stops_before_somebody_with_priority_comes_into_whose_way_it_has_got(
    arrives: float, crawls: float
) -> None:
    coming = car(3, 105.6, -8.0 * arrives - 3.4, heading=UP, speed=8.0, lanes=("major_0",))
    junction = stop_line(98.0, Control.YIELD)
    driven = drive(road(stop_lines=[junction]), 8.0, station=101.0, speed=crawls, actors=[coming])
    assert driven.decisions[0] == "yield 3"
    assert driven.speeds[driven.clearances < 0.5].max() < 0.1
    assert driven.fronts[-1] > 115.0


@pytest.mark.parametrize("speed", [5.0, 14.0])
def test_a_standing_ego_does_not_start_towards_who_comes_past_it_with_hardly_room(speed: float) -> None:
    driven = drive(
        road(), 12.0, station=100.0, actors=[car(3, 106.0 + 2.5 * speed, 2.0, heading=-math.pi, speed=speed)]
    )
    assert driven.speeds[driven.states[:, 0] < 2.0].max() < 0.2
    assert driven.fronts[-1] > 120.0


@pytest.mark.parametrize("speed", [1.0, 3.0, 6.0])
@pytest.mark.parametrize(("x", "y"), [(103.5, 1.95), (105.0, 2.05)])
def test_for_who_comes_by_beside_its_front_with_hardly_room_a_moving_ego_does_not_stop(
    speed: float, x: float, y: float
) -> None:
    """It would not get farther from the other's way, but stay beside it for longer."""
    coming = car(3, x, y, heading=-math.pi, speed=2.0)
    driven = drive(road(), 4.0, station=100.0, speed=speed, actors=[coming])
    assert driven.clearances[0] < PlanningConfig().object_margin
    assert driven.states[:, 5].min() > -PlanningConfig().comfort_braking
    assert driven.speeds.min() >= speed - 0.1


def test_stream_with_priority_is_waited_for_at_the_line() -> None:
    stream = [car(k, 106.0, -60.0 - 25.0 * k, heading=UP, speed=10.0, lanes=("major_0",)) for k in range(8)]
    driven = drive(road(stop_lines=[stop_line(100.0, Control.YIELD)]), 40.0, speed=13.0, actors=stream)
    standing = driven.speeds < 0.05
    assert standing.sum() > 10
    assert 0.2 < 100.0 - driven.fronts[standing][-1] < 3.0
    assert driven.clearances.min() > 2.0
    assert driven.fronts[-1] > 150.0


@pytest.mark.parametrize(("way", "braking", "decision"), [(29.0, 1.5, "yield 3"), (36.0, 1.0, "cruise")])
def test_ego_counts_on_nobody_with_priority_to_lose_time_by_slowing_down(
    way: float, braking: float, decision: str
) -> None:
    """As it is predicted the ego would be gone 1.5 s before it comes; at its present speed, it would hardly be."""
    coming = car(3, 106.0, -2.5 - way, heading=UP, speed=10.0, braking=braking, lanes=("major_0",))
    planner = Planner(PlanningConfig(), road(stop_lines=[stop_line(100.0, Control.YIELD)]), SHAPE)
    assert planner.step(believed(84.3, speed=8.0), predicted([coming], 0.0), {}).decision == decision


@pytest.mark.parametrize(
    ("control", "nose", "slowest"),
    [
        (Control.YIELD, 99.0, (1.0, 2.6)),
        (Control.YIELD, 102.0, (1.0, 2.3)),
        (Control.YIELD, 92.0, (7.0, 9.0)),
        (Control.PRIORITY, 99.0, (12.0, 14.0)),
    ],
)
def test_past_who_waits_beside_at_a_line_the_ego_feels_its_way(
    control: Control, nose: float, slowest: tuple[float, float]
) -> None:
    """What comes may be hidden behind that one, who has hardly come to stand when the ego is there."""
    beside = car(3, nose - 2.25 - 6.0, 3.2, speed=2.0, stays_from=3.0)
    driven = drive(road(lanes_left=1, stop_lines=[stop_line(100.0, control)]), 20.0, speed=13.0, actors=[beside])
    at_line = (driven.fronts > min(nose, 99.5) - 0.5) & (driven.fronts < max(nose, 100.5))
    assert slowest[0] < driven.speeds[at_line].min() < slowest[1]
    assert driven.fronts[-1] > 130.0


def test_ego_feels_its_way_past_who_will_have_stopped_beside_when_it_is_there() -> None:
    """Who comes has priority, and that one brakes for it: slowing down only once it is slow would be too late."""
    beside = car(3, 70.0, 3.2, speed=13.0, braking=13.0**2 / (2.0 * 27.0))
    driven = drive(
        road(lanes_left=1, stop_lines=[stop_line(100.0, Control.YIELD)]),
        20.0,
        station=58.0,
        speed=13.0,
        actors=[beside],
    )
    at_line = (driven.fronts > 98.5) & (driven.fronts < 100.5)
    assert 1.0 < driven.speeds[at_line].min() < 2.6
    assert driven.fronts[-1] > 130.0


@pytest.mark.parametrize("nose", [99.0, 102.0])
def test_ego_feels_its_way_until_the_middle_of_its_body_is_abreast_of_who_hides_what_comes(nose: float) -> None:
    beside = car(3, nose - 2.25 - 6.0, 3.2, speed=2.0, stays_from=3.0)
    driven = drive(road(lanes_left=1, stop_lines=[stop_line(100.0, Control.YIELD)]), 20.0, speed=13.0, actors=[beside])
    peers = (driven.fronts > 100.5) & (driven.states[:, 1] + SHAPE.centre < nose)
    assert peers.any()
    assert driven.speeds[peers].max() < 2.6


@pytest.mark.parametrize(
    ("lane", "heading", "slowest"),
    [("major_0", UP, (2.5, 3.5)), ("minor_0", UP, (6.0, 10.0)), ("major_0", DOWN, (6.0, 10.0))],
    ids=["may set off", "has to wait", "has crossed"],
)
def test_before_the_nose_of_who_has_priority_and_stands_the_ego_is_slow(
    lane: str, heading: float, slowest: tuple[float, float]
) -> None:
    waiting = car(3, 106.0, -4.6, heading=heading, lanes=(lane,))
    driven = drive(road(stop_lines=[stop_line(100.0, Control.YIELD)]), 20.0, speed=13.0, actors=[waiting])
    beside = (driven.fronts > 104.0) & (driven.fronts < 108.0)
    assert slowest[0] < driven.speeds[beside].min() < slowest[1]
    assert driven.fronts[-1] > 150.0


@pytest.mark.parametrize("leaves", np.arange(4.0, 8.0, 0.25))
def test_who_sets_off_right_before_the_ego_is_not_hit(leaves: float) -> None:
    waiting = car(3, 106.0, -4.6, heading=UP, speed=2.0, leaves=leaves, lanes=("major_0",))
    driven = drive(road(stop_lines=[stop_line(100.0, Control.YIELD)]), 20.0, speed=13.0, actors=[waiting])
    assert driven.clearances.min() > 0.2


@pytest.mark.parametrize("x", [99.3, 106.0])
def test_car_that_has_to_wait_is_passed(x: float) -> None:
    """Also where a part of it is on this side of the ego's stop line."""
    driven = drive(
        road(stop_lines=[stop_line(100.0, Control.PRIORITY, yields_to=frozenset())]),
        20.0,
        speed=13.0,
        actors=[car(3, x, -80.0, heading=UP, speed=10.0, stays_from=6.0, lanes=("minor_0",))],
    )
    assert driven.speeds.min() > 12.9


@pytest.mark.parametrize(
    ("heading", "is_waited_for"),
    [
        (UP, True),
        (math.pi - 0.8, True),  # turns left, from where the ego is going
        (0.3, False),  # drives the ego's way
    ],
)
def test_a_junction_is_not_entered_while_somebody_stands_on_it_across_the_way(
    heading: float,
    is_waited_for: bool,  # noqa: FBT001
) -> None:
    """Who stands there waits for others, who would wait for an ego on the junction: nobody would get on."""
    line = stop_line(100.0, Control.PRIORITY, yields_to=frozenset(), exit_station=120.0)
    driven = drive(road(stop_lines=[line]), 15.0, speed=10.0, station=40.0, actors=[car(3, 114.0, heading=heading)])
    assert driven.speeds[-1] == 0.0
    assert bool(driven.fronts[-1] < 100.0) is is_waited_for


def test_who_should_have_waited_is_stopped_for_before_its_way_not_at_the_line() -> None:
    """The ego has priority: at the line it would only hold up those behind it."""
    late = car(3, 112.0, -2.5, heading=UP, speed=0.8, lanes=("minor_0",))
    route = road(stop_lines=[stop_line(100.0, Control.PRIORITY, yields_to=frozenset())])
    driven = drive(route, 12.0, speed=4.0, station=86.0, actors=[late])
    stands = driven.fronts[driven.speeds < 0.1]
    assert len(stands)
    assert 104.0 < stands.min() < 111.0
    assert driven.clearances.min() > 0.5


@pytest.mark.parametrize(
    ("x", "y", "aslant", "speed"), [(108.0, 5.4, 0.5, 1.0), (108.0, 5.4, 0.5, 1.5), (112.0, 4.6, 0.3, 2.0)]
)
def test_before_who_comes_aslant_the_ego_passes_where_only_a_corner_would_come_into_its_way(
    x: float, y: float, aslant: float, speed: float
) -> None:
    """The rest of that lorry reaches much farther along the ego's way, beside it."""
    lorry = car(3, x, y, heading=math.pi + aslant, speed=speed, size=(7.1, 2.4), lanes=("major_0",))
    route = road(stop_lines=[stop_line(80.0, Control.PRIORITY, exit_station=120.0)])
    driven = drive(route, 4.0, speed=7.0, station=90.0, actors=[lorry])
    assert driven.states[:, 5].min() > -0.5
    assert driven.clearances.min() > 0.3


@pytest.mark.parametrize(("speed", "decision"), [(1.0, "cruise"), (3.0, "cruise"), (8.0, "yield 3")])
def test_ego_that_could_only_stop_in_the_way_of_who_should_wait_goes_on_while_that_one_still_can(
    speed: float, decision: str
) -> None:
    """The lorry gets faster, and would be in the ego's way after a second."""
    ways = speed * PREDICTION_TIMES + 0.5 * PREDICTION_TIMES**2
    y = 4.75 + float(np.interp(1.0, PREDICTION_TIMES, ways))
    places = np.column_stack((np.full(len(ways), 20.0), y - ways, np.full(len(ways), DOWN)))
    starting = car(3, 20.0, y, heading=DOWN, speed=speed, size=(7.1, 2.4), lanes=("minor_0",))
    future = msgspec.structs.replace(predicted([starting], 0.0), poses=places[None])
    line = stop_line(12.0, Control.PRIORITY, yields_to=frozenset(), exit_station=40.0)
    planner = Planner(PlanningConfig(), road(stop_lines=[line]), SHAPE)
    assert planner.step(believed(14.0, speed=4.0), future, {}).decision == decision


def test_car_that_should_wait_but_cannot_any_more_is_yielded_to() -> None:
    driven = drive(
        road(stop_lines=[stop_line(100.0, Control.PRIORITY, yields_to=frozenset())]),
        20.0,
        speed=13.0,
        actors=[car(3, 106.0, -110.0, heading=UP, speed=14.0, lanes=("minor_0",))],
    )
    assert driven.clearances.min() > 1.0
    assert driven.states[:, 5].min() < -2.0


@pytest.mark.parametrize("lane", ["major_0", "minor_0"])
def test_ego_that_is_slow_on_the_junction_at_red_lets_the_others_go(lane: str) -> None:
    route = road(stop_lines=[stop_line(22.0, Control.SIGNAL)])
    stream = [car(k, 30.0, -60.0 - 30.0 * k, heading=UP, speed=10.0, lanes=(lane,)) for k in range(4)]
    red: dict[str, SignalColour] = {"J/2": SignalColour.RED}
    driven = drive(route, 30.0, station=20.0, actors=stream, signals=lambda _: red)
    assert driven.fronts[0] > 22.5
    assert driven.clearances.min() > 1.0
    assert driven.fronts[-1] > 60.0


@pytest.mark.parametrize(("waiting", "stands"), [(None, (97.0, 100.0)), (106.0, (102.0, 107.0))])
def test_oncoming_traffic_is_let_pass_at_green_where_the_junction_has_a_place_to_wait(
    waiting: float | None, stands: tuple[float, float]
) -> None:
    route = road(stop_lines=[stop_line(100.0, Control.SIGNAL, waiting_station=waiting)])
    stream = [car(k, 110.0, -60.0 - 22.0 * k, heading=UP, speed=8.0, lanes=("major_0",)) for k in range(1, 9)]
    driven = drive(route, 40.0, speed=8.0, actors=stream, signals=lambda _: {"J/2": SignalColour.PERMISSIVE})
    standing = driven.fronts[driven.speeds < 0.05]
    assert stands[0] < standing.min() <= standing.max() < stands[1]
    assert driven.clearances.min() > 1.0
    assert driven.fronts[-1] > 130.0


def test_who_waits_on_the_junction_keeps_its_place_when_the_signal_is_behind_it() -> None:
    route = road(stop_lines=[stop_line(100.0, Control.SIGNAL, waiting_station=104.0)])
    stream = [car(k, 110.0, -60.0 - 22.0 * k, heading=UP, speed=8.0, lanes=("major_0",)) for k in range(1, 9)]

    def signals(time: float) -> dict[str, SignalColour]:
        return {"J/2": SignalColour.PERMISSIVE} if time < 16.0 else {}

    driven = drive(route, 40.0, speed=8.0, actors=stream, signals=signals)
    standing = driven.fronts[driven.speeds < 0.05]
    assert 102.0 < standing.min() <= standing.max() < 104.5
    assert len(standing) > 80
    assert driven.fronts[-1] > 130.0


def test_who_waits_on_the_junction_leaves_it_when_the_oncoming_traffic_has_to_stop() -> None:
    route = road(stop_lines=[stop_line(100.0, Control.SIGNAL, waiting_station=106.0)])
    stream = [
        car(k, 110.0, -40.0 - 22.0 * k, heading=UP, speed=8.0, lanes=("major_0",), stays_from=18.0) for k in range(1, 9)
    ]

    def signals(time: float) -> dict[str, SignalColour]:
        shown = SignalColour.PERMISSIVE if time < 16.0 else SignalColour.YELLOW if time < 19.0 else SignalColour.RED
        return {"J/2": shown}

    driven = drive(route, 30.0, speed=8.0, actors=stream, signals=signals)
    assert 102.0 < driven.fronts[160] < 107.0
    assert driven.clearances.min() > 1.0
    assert driven.fronts[-1] > 130.0


def test_who_was_late_for_yellow_and_then_has_to_stop_before_the_line_waits_there() -> None:
    def signals(time: float) -> dict[str, SignalColour]:
        return {"J/2": SignalColour.GREEN if time < 6.8 else SignalColour.YELLOW if time < 8.0 else SignalColour.RED}

    def driven(*actors: Actor) -> Drive:
        route = road(stop_lines=[stop_line(120.0, Control.SIGNAL)])
        return drive(route, 25.0, speed=13.0, actors=actors, signals=signals)

    assert driven().fronts[-1] > 200.0
    stopped = driven(person(5, 116.0, -3.0, heading=UP, speed=1.4, leaves=6.8))
    assert stopped.fronts[-1] < 120.0
    assert stopped.clearances.min() > 0.2


def swinging_out(station: float) -> Route:
    """A road whose line leads 4 m out of its lane within the last 20 m before a light, to turn back there."""
    route = road(stop_lines=[stop_line(station, Control.SIGNAL, direction="t", yields_to=frozenset())])
    ahead = np.interp(route.line.stations, [station - 20.0, station - 10.0, station], [0.0, 4.0, 0.0])
    return msgspec.structs.replace(
        route, lane_left=np.maximum(1.6 + ahead, 0.1), lane_right=np.minimum(-1.6 + ahead, -0.1)
    )


def test_who_has_to_stop_at_a_light_does_not_swing_out_before_to_turn_back() -> None:
    """It would stand across the next lane."""
    driven = drive(swinging_out(100.0), 25.0, speed=10.0, signals=lambda _: {"J/2": SignalColour.RED})
    assert driven.speeds[-1] == 0.0
    assert 80.0 - 1.0 < driven.states[-1, 1] < 80.0 + 0.5
    assert_drivable(driven)


def test_when_it_is_green_it_goes_on_to_the_line() -> None:
    def signals(time: float) -> dict[str, SignalColour]:
        return {"J/2": SignalColour.RED if time < 20.0 else SignalColour.GREEN}

    driven = drive(swinging_out(100.0), 30.0, speed=10.0, signals=signals)
    assert driven.fronts[-1] > 100.0


def test_a_light_that_nobody_sees_is_passed_after_a_stop_at_its_line() -> None:
    assert drive(swinging_out(100.0), 40.0, speed=10.0).fronts[-1] > 100.0


@pytest.mark.parametrize(("station", "passes"), [(91.0, True), (88.5, False), (82.0, False)])
def test_who_has_swung_out_goes_on_at_yellow_where_it_comes_to_the_line_in_time(
    station: float, *, passes: bool
) -> None:
    def signals(time: float) -> dict[str, SignalColour]:
        return {"J/2": SignalColour.YELLOW if time < 2.0 else SignalColour.RED}

    driven = drive(swinging_out(100.0), 8.0, station=station, speed=3.0, signals=signals)
    assert (driven.fronts[-1] > 100.0) == passes


def test_junction_is_not_entered_while_a_person_stands_in_the_way_on_it() -> None:
    route = road(stop_lines=[stop_line(100.0, Control.PRIORITY, yields_to=frozenset())])
    driven = drive(route, 20.0, speed=10.0, actors=[person(3, 110.0, 0.0)])
    assert driven.speeds[-1] == 0.0
    assert 98.0 < driven.fronts[-1] < 100.0


def test_ego_that_waits_on_the_junction_stays_at_its_place_while_a_person_stands_in_the_way_beyond() -> None:
    route = road(stop_lines=[stop_line(100.0, Control.SIGNAL, waiting_station=104.0)])
    stream = [car(k, 108.0, -40.0 - 22.0 * k, heading=UP, speed=8.0, lanes=("major_0",)) for k in range(1, 4)]
    comes = person(9, 111.0, -9.0, heading=UP, speed=1.0, leaves=3.0, stays_from=12.0)
    driven = drive(route, 25.0, speed=8.0, actors=[*stream, comes], signals=lambda _: {"J/2": SignalColour.PERMISSIVE})
    assert driven.speeds[-1] == 0.0
    assert 102.0 < driven.fronts[-1] < 104.5


def test_crossing_traffic_has_no_priority_over_green_but_over_permissive_green() -> None:
    actors = [car(3, 106.0, -75.0, heading=UP, speed=8.0, stays_from=7.0, lanes=("major_0",))]
    route = road(stop_lines=[stop_line(100.0, Control.SIGNAL)])
    green = drive(route, 12.0, speed=13.0, actors=actors, signals=lambda _: {"J/2": SignalColour.GREEN})
    permissive = drive(route, 12.0, speed=13.0, actors=actors, signals=lambda _: {"J/2": SignalColour.PERMISSIVE})
    assert green.speeds.min() > 12.9
    assert permissive.speeds.min() < 9.0


def test_a_future_that_is_followed_moves_no_place_at_which_another_one_of_the_same_is_let_pass() -> None:
    one = predicted([car(7, 18.0, 3.2, speed=11.0)], 0.0)
    turning, changing = one.poses[0].copy(), one.poses[0].copy()
    changing[:, 1] = np.interp(PREDICTION_TIMES, [1.0, 2.5], [3.2, 0.0])
    turning[:, 0] -= 9.0 * np.maximum(PREDICTION_TIMES - 3.0, 0.0)
    turning[:, 1] = np.interp(PREDICTION_TIMES, [3.0, 7.0], [3.2, -4.0])
    turning[PREDICTION_TIMES > 3.0, 2] = -1.2

    def braking(*futures: Floats) -> float:
        count = len(futures)
        shares = np.full(count, 1.0 / count)
        told = msgspec.structs.replace(
            one,
            owners=np.zeros(count, dtype=np.int64),
            probabilities=shares,
            poses=np.stack(futures),
            lanes=((),) * count,
        )
        planner = Planner(PlanningConfig(), road(lanes_left=1), SHAPE)
        return float(planner.step(believed(5.0, speed=13.0), told, {}).points[:, 5].min())

    assert braking(changing, turning) == braking(turning) < -1.0


def test_car_that_cuts_in_ahead_becomes_the_leader() -> None:
    cutting = car(3, 45.0, 3.2, heading=-0.08, speed=8.0)
    driven = drive(road(lanes_left=1), 6.0, speed=12.0, actors=[cutting])
    assert "follow 3" in driven.decisions
    assert driven.clearances.min() > 3.0


def test_junction_is_not_entered_while_its_exit_is_occupied() -> None:
    line = stop_line(100.0, Control.PRIORITY, yields_to=frozenset())
    driven = drive(road(stop_lines=[line]), 20.0, speed=10.0, actors=[car(3, 118.0)])
    assert driven.speeds[-1] == 0.0
    assert driven.fronts[-1] < 100.0
    far = drive(road(stop_lines=[line]), 20.0, speed=10.0, actors=[car(3, 130.0)])
    assert far.fronts[-1] - SHAPE.length > 112.0


def test_junction_is_not_entered_behind_who_takes_the_room_that_is_left_beyond_it() -> None:
    line = stop_line(100.0, Control.PRIORITY, yields_to=frozenset())
    tail = car(3, 126.0)
    alone = drive(road(stop_lines=[line]), 20.0, speed=10.0, actors=[tail])
    assert alone.fronts[-1] - SHAPE.length > 112.0
    leader = car(4, 85.0, speed=5.0, stays_from=(119.5 - 85.0) / 5.0)
    behind = drive(road(stop_lines=[line]), 20.0, speed=5.0, station=60.0, actors=[tail, leader])
    assert behind.speeds[-1] == 0.0
    assert 98.0 < behind.fronts[-1] < 100.0


def test_who_is_too_near_a_line_to_stop_at_it_goes_on_to_the_occupied_exit() -> None:
    line = stop_line(100.0, Control.PRIORITY, yields_to=frozenset())
    driven = drive(road(stop_lines=[line]), 12.0, speed=9.0, station=92.0, actors=[car(3, 118.0)])
    assert driven.speeds[-1] == 0.0
    assert driven.fronts[-1] > 108.0
    assert driven.states[:, 5].min() > -4.0


@pytest.mark.parametrize(
    ("pace", "is_waited_for"),
    [
        (1.3, False),  # off the road when the ego gets there
        (0.0, True),
    ],
)
def test_a_junction_is_entered_while_people_walk_off_the_road_beyond_it(
    pace: float,
    is_waited_for: bool,  # noqa: FBT001
) -> None:
    line = stop_line(100.0, Control.PRIORITY, yields_to=frozenset())
    walker = person(3, 116.0, 0.0, heading=UP, speed=pace)
    driven = drive(road(stop_lines=[line]), 3.0, speed=8.0, station=70.0, actors=[walker])
    assert ("stop exit occupied" in driven.decisions) is is_waited_for
    assert driven.clearances.min() > 1.0


@pytest.mark.parametrize(("away", "is_waited_for"), [(6.0, True), (12.0, False)])
def test_a_junction_is_not_entered_when_people_come_onto_the_road_beyond_it_as_the_ego_does(
    away: float,
    is_waited_for: bool,  # noqa: FBT001
) -> None:
    line = stop_line(100.0, Control.PRIORITY, yields_to=frozenset())
    walker = person(3, 116.0, -away, heading=UP, speed=1.2)
    driven = drive(road(stop_lines=[line]), 1.0, speed=5.0, station=85.0, actors=[walker])
    assert ("stop exit occupied" in driven.decisions) is is_waited_for


def test_unlikely_future_is_ignored_and_a_likely_one_is_not() -> None:
    crossing = predicted([person(3, 60.0, -6.0, heading=UP, speed=1.4)], 0.0)
    decisions = {}
    for chance in (0.1, 0.5):
        future = msgspec.structs.replace(crossing, probabilities=np.array([chance]))
        decisions[chance] = (
            Planner(PlanningConfig(), road(), SHAPE).step(believed(5.0, speed=12.0), future, {}).decision
        )
    assert decisions == {0.1: "cruise", 0.5: "yield 3"}


@pytest.mark.parametrize(("crossing", "decision"), [(1, "cruise"), (2, "yield 3")])
def test_unlikely_futures_of_one_object_count_that_are_a_likely_one_together(crossing: int, decision: str) -> None:
    """It stays beside the road with the likely one, and crosses with one of the others, or with both."""
    moved = predicted([person(3, 60.0, -6.0, heading=UP, speed=1.4)], 0.0)
    poses = np.tile(moved.poses, (3, 1, 1))
    poses[crossing:, :, 1] = -6.0
    futures = msgspec.structs.replace(
        moved,
        owners=np.zeros(3, dtype=np.int64),
        probabilities=np.array([0.1, 0.1, 0.8]),
        poses=poses,
        lanes=moved.lanes * 3,
    )
    trajectory = Planner(PlanningConfig(), road(), SHAPE).step(believed(5.0, speed=12.0), futures, {})
    assert trajectory.decision == decision


@pytest.mark.parametrize(("chance", "decision"), [(0.25, "cruise"), (0.75, "yield 3")])
def test_for_an_unlikely_future_the_ego_does_not_stop_in_the_way_of_a_likely_one(chance: float, decision: str) -> None:
    """Who sets off beside the road crosses right behind the ego, or turns to where the ego would be next."""
    ways = 3.0 * PREDICTION_TIMES + PREDICTION_TIMES**2
    poses = np.empty((2, len(PREDICTION_TIMES), 3))
    for row, heading in enumerate((DOWN, math.atan2(-9.0, 6.0))):
        places = np.column_stack((20.0 + ways * math.cos(heading), 9.0 + ways * math.sin(heading)))
        poses[row] = np.column_stack((places, np.full(len(ways), heading)))
    futures = msgspec.structs.replace(
        predicted([car(3, 20.0, 9.0, heading=DOWN, speed=3.0)], 0.0),
        owners=np.array([0, 0]),
        probabilities=np.array([1.0 - chance, chance]),
        poses=poses,
        lanes=(("minor_0",), ("minor_0",)),
    )
    planner = Planner(PlanningConfig(), road(stop_lines=[stop_line(12.0, Control.PRIORITY)]), SHAPE)
    assert planner.step(believed(14.0, speed=6.0), futures, {}).decision == decision


def test_object_without_a_future_stays_where_it_is() -> None:
    unknown = msgspec.structs.replace(
        predicted([car(3, 30.0, speed=5.0)], 0.0),
        owners=np.array([], dtype=np.int64),
        probabilities=np.array([]),
        poses=np.empty((0, 25, 3)),
        lanes=(),
    )
    trajectory = Planner(PlanningConfig(), road(), SHAPE).step(believed(5.0, speed=8.0), unknown, {})
    assert trajectory.points[-1, 1] + SHAPE.front < 30.0 - 2.25


@pytest.mark.parametrize("lane", ["bridge_0", "side_0"])
def test_who_comes_by_a_bridge_is_no_reason_to_slow_down(lane: str) -> None:
    other = car(3, 100.0, -80.0, heading=UP, speed=12.0, lanes=(lane,))
    driven = drive(road(overpasses=[Overpass("bridge_0", 100.0, (100.0, 0.0))]), 12.0, speed=13.0, actors=[other])
    assert (driven.speeds.min() > 12.9) == (lane == "bridge_0")


@pytest.mark.parametrize("lane", ["bridge_0", "side_0"])
def test_nobody_waits_or_swerves_below_a_bridge_for_who_stands_on_it(lane: str) -> None:
    queue = [car(track, 100.0, 7.0 * track - 13.5, heading=math.pi / 2.0, lanes=(lane,)) for track in (1, 2, 3)]
    driven = drive(road(overpasses=[Overpass("bridge_0", 100.0, (100.0, 0.0))]), 12.0, speed=12.0, actors=queue)
    is_free = driven.speeds.min() > 11.9 and np.abs(driven.states[:, 2]).max() < 0.05
    assert is_free == (lane == "bridge_0")


@pytest.mark.parametrize("speed", [6.0, 8.0])
def test_where_its_line_comes_back_to_the_lane_the_ego_lets_those_on_the_lane_go_first(speed: float) -> None:
    """After a turn that swings out beside the lane, it is the ego that cuts in, whoever changes place to its line."""
    route = road()
    is_beside = route.line.stations < 45.0
    edges = {"lane_left": np.where(is_beside, 5.4, 1.6), "lane_right": np.where(is_beside, -0.1, -1.6)}
    route = msgspec.structs.replace(route, **edges)
    driven = drive(route, 12.0, station=5.0, actors=[car(7, -8.0, 5.2, heading=-0.15, speed=speed)])
    assert driven.clearances.min() > 0.4  # what is accepted beside something
    assert driven.fronts[-1] > 40.0


@pytest.mark.parametrize(("behind", "speed"), [(6.0, 9.0), (6.0, 10.0), (8.0, 10.0), (14.0, 10.0)])
def test_where_the_map_draws_two_lanes_one_on_the_other_nobody_cuts_in(behind: float, speed: float) -> None:
    """Who keeps to its own lane does not look at the ego's."""
    other = car(3, 5.0 - behind, 4.0, heading=-0.12, speed=speed, lanes=("beside_0",))
    driven = drive(road(lanes_left=1), 6.0, speed=6.0, actors=[other])
    assert driven.clearances.min() > 0.3


@pytest.mark.parametrize("station", [106.0, 108.0, 110.0])
def test_who_stands_right_behind_the_ego_in_a_tight_turn_does_not_hold_it(station: float) -> None:
    route = road(curve_points(5.0))
    x, y, heading = route.line.poses([station])[0].tolist()
    follower = car(5, x - 3.6 * math.cos(heading), y - 3.6 * math.sin(heading), heading=heading - 0.85)
    driven = drive(route, 8.0, station=station, actors=[follower])
    assert 0.3 < driven.clearances[0] < 1.0
    assert driven.speeds[-1] > 3.0


@pytest.mark.parametrize("heading", [0.8, 0.9, 1.0, 1.2])
def test_a_long_vehicle_that_comes_aslant_into_the_side_of_an_ego_at_rest_is_not_behind_it_in_its_lane(
    heading: float,
) -> None:
    nose_x, nose_y, half = 60.6, -2.6, 6.0
    x, y = nose_x - half * math.cos(heading), nose_y - half * math.sin(heading)
    bus = car(3, x, y, heading=heading, speed=3.5, size=(2.0 * half, 2.5), lanes=("aside_0",))
    driven = drive(road(), 0.6, station=60.0, actors=[bus])
    assert driven.speeds.max() < 0.05


@pytest.mark.parametrize("lanes", [(), ("ego_0",)])
def test_who_drives_straight_on_where_the_ego_turns_does_not_cut_in(lanes: tuple[str, ...]) -> None:
    """Inside its bend: it is the ego that comes into the other's way, and has to see to it."""
    other = car(3, 35.2, 3.9, heading=0.02, speed=2.5, size=(5.0, 1.8), lanes=lanes)
    driven = drive(road(curve_points(12.0, before=40.0, after=60.0)), 9.0, speed=6.0, station=10.0, actors=[other])
    assert driven.clearances.min() > 0.3


@pytest.mark.parametrize(
    ("radius", "x", "y", "heading", "length"),
    [
        (9.0, 48.3, 9.1, 1.55, 14.0),
        (16.0, 45.0, 4.2, 3.13, 14.0),
        (9.0, 44.9, 7.9, -0.01, 18.0),
        (12.0, 49.0, 12.3, 1.39, 30.0),
    ],
)
def test_the_end_of_a_long_body_that_stands_inside_a_bend_is_stopped_for(
    radius: float, x: float, y: float, heading: float, length: float
) -> None:
    """It lies across the bend, its middle beside it."""
    bus = car(3, x, y, heading=heading, size=(length, 2.5))
    driven = drive(road(curve_points(radius, before=40.0, after=60.0)), 16.0, speed=6.0, station=10.0, actors=[bus])
    assert driven.decisions[-1] == "stop behind 3"
    assert driven.clearances.min() > 1.0


def test_the_end_of_a_long_body_that_comes_into_a_bend_is_let_pass() -> None:
    bus = car(3, 52.0, 20.0, heading=-1.52, speed=0.9, size=(18.0, 2.5), lanes=("side_0",))
    driven = drive(road(curve_points(12.0, before=40.0, after=60.0)), 9.0, speed=6.0, station=10.0, actors=[bus])
    assert driven.clearances.min() > 0.5


@pytest.mark.parametrize("speed", [4.0, 6.0])
@pytest.mark.parametrize("radius", [12.0, 16.0, 30.0])
def test_behind_a_long_one_that_cuts_the_bend_on_the_next_lane_the_ego_stays_without_haste(
    radius: float, speed: float
) -> None:
    """In the bend its tail sweeps over the ego's lane; where its ends are along that, its outline does not tell."""
    points = curve_points(radius, before=40.0, after=80.0)
    line = Polyline(points)
    beside = line.poses(line.stations, np.full(len(line), 3.2))[:, :2]
    bus = Winding(3, ObjectClass.VEHICLE, 0.0, 0.0, speed=speed, size=(14.0, 2.5), line=Polyline(beside[14:]))
    driven = drive(road(points, lanes_left=1), 14.0, speed=speed + 1.0, station=10.0, actors=[bus])
    assert driven.clearances.min() > 0.5
    assert driven.states[:, 5].min() > -3.0


@pytest.mark.parametrize("behind", [25.0, 32.0, 45.0, 60.0])
@pytest.mark.parametrize("speed", [10.0, 14.0])
@pytest.mark.parametrize("route", [road(), road(curve_points(60.0, before=100.0))])
def test_an_ego_that_sets_off_does_not_wait_for_who_comes_up_behind_it(
    behind: float, speed: float, route: Route
) -> None:
    x, y, heading = route.line.poses(np.array([110.0 - behind]))[0]
    driven = drive(route, 1.5, station=110.0, actors=[car(7, x, y, heading=heading, speed=speed)])
    assert not any(decision.startswith("yield") for decision in driven.decisions)
    assert driven.speeds[-1] > 1.5


def test_who_was_gone_before_the_ego_came_and_then_slows_down_was_not_passed_in_front_of() -> None:
    """The ego goes first only where it would do so without having met that one before."""
    route = road(stop_lines=[stop_line(52.0, Control.YIELD)])

    def plan(earlier: list[float], arrives: float) -> str:
        planner = Planner(PlanningConfig(), route, SHAPE)
        for cycle, arrival in enumerate([*earlier, arrives]):
            time = 0.1 * cycle
            crossing = car(7, 60.0, -8.0 * arrival, heading=UP, speed=8.0, lanes=("major_0",))
            others = predicted([crossing], 0.0) if arrival < math.inf else predicted([], 0.0)
            others = msgspec.structs.replace(others, objects=msgspec.structs.replace(others.objects, time=time))
            planned = planner.step(believed(20.0 + 10.0 * time, speed=10.0, time=time), others, {})
        return planned.decision

    arrivals = np.arange(5.0, 8.0, 0.25).tolist()
    decisions = [plan([math.inf], arrives) for arrives in arrivals]
    assert {decision.split()[0] for decision in decisions} == {"yield", "cruise"}
    assert [plan([1.0], arrives) for arrives in arrivals] == decisions
