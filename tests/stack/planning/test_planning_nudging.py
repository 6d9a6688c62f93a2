"""Around what stands in the way."""

import math
from itertools import pairwise

import msgspec
import numpy as np
import pytest
from planned_drives import (
    SHAPE,
    Actor,
    Drive,
    assert_drivable,
    car,
    cone,
    curve_points,
    drive,
    person,
    predicted,
    road,
    stop_line,
    sweeps,
)

from dvca_sumo.geometry.boxes import box_of, distances, outlines
from dvca_sumo.messages import Floats, ObjectClass
from dvca_sumo.roadmap.route import Control
from dvca_sumo.stack.planning import PlanningConfig
from dvca_sumo.stack.planning.blockers import blockers
from dvca_sumo.stack.planning.moves import Lateral
from dvca_sumo.stack.planning.nudging import NudgeDecider
from dvca_sumo.stack.planning.reference import Reference
from dvca_sumo.stack.planning.scene import scene_in
from dvca_sumo.stack.planning.situation import Situation
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.world import VehicleLimits


def offsets(driven: Drive) -> tuple[float, float]:
    return float(driven.states[:, 2].min()), float(driven.states[:, 2].max())


def front_left(driven: Drive) -> Floats:
    """The offset of that corner of the body, on a straight road along x."""
    headings = driven.states[:, 3]
    corners: Floats = driven.states[:, 2] + SHAPE.front * np.sin(headings) + 0.5 * SHAPE.width * np.cos(headings)
    return corners


@pytest.mark.parametrize("side", [0.0, -0.5, -1.2])
def test_cone_in_the_lane_is_passed_on_the_free_lane_and_the_ego_returns(side: float) -> None:
    driven = drive(road(lanes_left=1), 20.0, speed=13.0, actors=[cone(5, 120.0, side)])
    assert driven.clearances.min() >= 0.4
    assert driven.fronts[-1] > 200.0
    assert abs(driven.states[-1, 2]) < 0.05
    assert driven.decisions[50] == "nudge left 5"
    assert_drivable(driven)


def test_cone_in_a_single_lane_is_stopped_for() -> None:
    driven = drive(road(), 20.0, speed=13.0, actors=[cone(5, 120.0)])
    assert 3.0 < driven.clearances[-1] < 7.0
    assert offsets(driven) == pytest.approx((0.0, 0.0), abs=0.05)


def test_small_object_at_the_edge_of_a_single_lane_is_passed_within_it() -> None:
    driven = drive(road(), 20.0, speed=13.0, actors=[cone(5, 120.0, -1.4)])
    assert driven.fronts[-1] > 180.0
    assert driven.clearances.min() > 0.3
    assert offsets(driven)[1] + 0.5 * SHAPE.width < 1.6


def test_object_well_beside_the_lane_changes_nothing() -> None:
    driven = drive(road(lanes_left=1), 12.0, speed=13.0, actors=[car(5, 80.0, -3.4)])
    assert set(driven.decisions) == {"cruise"}
    assert driven.speeds.min() > 12.9


def test_parked_car_that_juts_into_the_lane_is_passed_with_clearance() -> None:
    driven = drive(road(lanes_left=1), 20.0, speed=13.0, actors=[car(5, 120.0, -2.2)])
    assert driven.clearances.min() > 0.55
    assert driven.fronts[-1] > 200.0
    assert_drivable(driven)


def test_standing_car_is_passed_once_it_has_stood_for_a_while() -> None:
    driven = drive(road(lanes_left=1), 40.0, speed=10.0, actors=[car(5, 50.0)])
    assert not any(decision.startswith("nudge") for decision in driven.decisions[:30])
    assert driven.clearances.min() >= 0.4
    assert driven.fronts[-1] > 100.0
    assert_drivable(driven)


def test_ego_that_has_stopped_behind_a_car_can_still_pull_out() -> None:
    driven = drive(road(lanes_left=1), 30.0, speed=7.0, actors=[car(5, 27.0)])
    assert driven.speeds.min() < 3.0
    assert driven.clearances.min() >= 0.3
    assert driven.fronts[-1] > 80.0
    assert_drivable(driven)


def test_ego_that_pulls_out_keeps_its_front_on_the_road() -> None:
    van = car(5, 16.2, -1.85, size=(5.0, 2.0))
    driven = drive(road(), 20.0, actors=[van])
    assert driven.clearances.min() > 0.4
    assert driven.fronts[-1] > 80.0
    assert front_left(driven).max() < 1.62
    assert_drivable(driven)


@pytest.mark.parametrize(("beside", "ahead"), [(-1.75, 5.0), (-1.75, 7.0), (-1.95, 5.0), (-1.95, 9.0)])
def test_ego_that_sets_off_does_not_swing_out_over_the_edge_for_who_comes_along_the_other_one(
    beside: float, ahead: float
) -> None:
    walker = person(5, 20.0 + SHAPE.front + ahead, beside, heading=math.pi, speed=1.3)
    driven = drive(road(limit=8.0), 12.0, station=20.0, actors=[walker])
    assert front_left(driven).max() < 1.62
    assert driven.clearances.min() > 0.5
    assert driven.fronts[-1] > 90.0


@pytest.mark.parametrize(("gap", "x", "most"), [(0.2, 9.8, 0.25), (0.5, 9.0, 0.0)])
def test_who_stands_before_the_nose_is_passed_at_what_can_be_reached_by_then(gap: float, x: float, most: float) -> None:
    """Not at all the clearance wanted, which would be reached only when they are behind the ego."""
    beside = -0.5 * SHAPE.width - 0.3 - gap
    driven = drive(road(lanes_left=1), 30.0, actors=[person(5, x, beside)])
    assert driven.fronts[-1] > 60.0
    assert driven.clearances.min() > 0.39
    assert offsets(driven)[0] > -0.01
    assert offsets(driven)[1] < most + 0.01


def test_neighbouring_lane_is_not_used_while_somebody_is_on_it() -> None:
    overtaking = [car(k, 110.0 - 25.0 * k, 3.2, speed=9.0) for k in range(1, 9)]
    driven = drive(road(lanes_left=1), 45.0, speed=9.0, actors=[cone(50, 110.0), *overtaking])
    assert driven.clearances.min() > 0.4
    assert driven.speeds.min() < 0.1
    assert driven.fronts[-1] > 130.0


@pytest.mark.parametrize("line", [120.0, 190.0])
def test_car_that_queues_at_a_signal_or_may_hide_a_queue_up_to_it_is_not_passed(line: float) -> None:
    route = road(lanes_left=1, stop_lines=[stop_line(line, Control.SIGNAL)])
    driven = drive(route, 30.0, speed=10.0, actors=[car(5, 114.0)])
    assert offsets(driven) == pytest.approx((0.0, 0.0), abs=0.05)
    assert driven.speeds[-1] == 0.0


def test_car_that_queues_behind_others_up_to_a_signal_is_not_passed() -> None:
    route = road(lanes_left=1, stop_lines=[stop_line(120.0, Control.SIGNAL)])
    queue = [car(k, 116.0 - 8.0 * k, 0.0) for k in range(6)]
    driven = drive(route, 25.0, speed=10.0, actors=queue)
    assert offsets(driven) == pytest.approx((0.0, 0.0), abs=0.05)
    assert driven.speeds[-1] == 0.0


def test_lane_is_not_left_for_a_person_who_waits_by_a_crossing_unless_they_do_for_long() -> None:
    route = road(lanes_left=1, stop_lines=[stop_line(120.0, Control.PRIORITY, yields_to=frozenset())])
    driven = drive(route, 30.0, speed=10.0, actors=[person(5, 117.0, -1.35), person(6, 118.0, -1.3)])
    before = driven.states[:, 2] < 0.1
    assert driven.speeds[before].min() < 0.5
    assert driven.clearances.min() > 0.35
    assert driven.fronts[-1] > 125.0
    patient = msgspec.structs.replace(PlanningConfig(), person_patience=30.0)
    waiting = drive(route, 30.0, speed=10.0, actors=[person(5, 117.0, -1.35)], config=patient)
    assert offsets(waiting)[1] < 0.85
    assert waiting.speeds[-1] == 0.0
    apart = drive(road(lanes_left=1), 30.0, speed=10.0, actors=[person(5, 117.0, -1.35)])
    assert offsets(apart)[1] > 1.0
    assert apart.fronts[-1] > 150.0


def test_person_who_stands_in_the_lane_by_a_crossing_is_no_queue() -> None:
    route = road(lanes_left=1, stop_lines=[stop_line(120.0, Control.PRIORITY, yields_to=frozenset())])
    driven = drive(route, 40.0, speed=10.0, actors=[person(5, 117.0, -1.0)])
    assert driven.speeds[driven.fronts < 116.0].min() < 0.5
    assert driven.clearances.min() > 0.35
    assert driven.fronts[-1] > 135.0


def test_person_is_passed_within_the_lane_where_the_next_one_is_not_free() -> None:
    oncoming = [car(10 + i, 200.0 + 12.0 * i, 3.2, heading=math.pi, speed=8.0) for i in range(40)]
    driven = drive(road(lanes_left=1), 30.0, speed=8.0, actors=[person(5, 117.0, -1.2), *oncoming])
    assert driven.fronts[-1] > 130.0
    assert driven.states[:, 2].max() < 0.85
    assert driven.clearances.min() > 0.35


@pytest.mark.parametrize(("heading", "begin"), [(math.pi, 130.0), (0.0, -380.0)])
def test_who_comes_by_close_to_the_lane_is_left_as_much_room_as_who_stands_at_its_other_edge(
    heading: float, begin: float
) -> None:
    """Within its lane, too, the ego does not move towards others for a wider berth than it needs."""
    busy = [car(10 + i, begin + 12.0 * i, 2.6, heading=heading, speed=12.0) for i in range(40)]
    driven = drive(road(lanes_left=1), 25.0, speed=8.0, actors=[person(5, 117.0, -1.4), *busy])
    assert driven.fronts[-1] > 130.0
    assert driven.clearances.min() > 0.35


def test_ego_does_not_begin_to_pull_out_while_now_and_then_somebody_seems_to_come_alongside() -> None:
    class Indistinct(Actor, frozen=True):
        """Stays, but up to `stays_from` looks, half of the time, as if it came."""

        def speed_at(self, time: float) -> float:
            return 8.0 if time < self.stays_from and math.sin(9.0 * time) > 0.0 else 0.0

    seen = Indistinct(7, ObjectClass.VEHICLE, 150.0, 3.2, heading=math.pi, stays_from=12.0)
    driven = drive(road(lanes_left=1), 30.0, speed=8.0, station=60.0, actors=[cone(5, 110.0), seen])
    up_to_then = driven.states[:, 0] < 12.0
    assert np.abs(driven.states[up_to_then, 2]).max() < 0.05
    assert driven.fronts[-1] > 120.0
    assert_drivable(driven)


def test_where_the_next_lane_is_busy_the_ego_passes_closer_and_keeps_off_it() -> None:
    busy = [car(10 + i, 200.0 + 12.0 * i, 3.3, heading=math.pi, speed=8.0) for i in range(40)]
    driven = drive(road(lanes_left=1), 30.0, speed=8.0, actors=[person(5, 117.0, -0.6), *busy])
    assert driven.fronts[-1] > 130.0
    assert driven.clearances.min() > 0.3


def test_who_starts_right_behind_the_ego_follows_it_and_does_not_keep_it_from_pulling_out() -> None:
    follower = car(7, 101.3, speed=1.0, leaves=3.3, stays_from=4.3)
    driven = drive(road(lanes_left=1), 10.0, station=106.0, actors=[person(5, 115.0, -0.5), follower])
    begun = next(i for i, decision in enumerate(driven.decisions) if decision.startswith("nudge"))
    assert not any(decision.startswith("stop") for decision in driven.decisions[begun:])
    assert driven.fronts[-1] > 125.0


@pytest.mark.parametrize(("x", "heading"), [(120.0, math.pi), (60.0, 0.0)])
@pytest.mark.parametrize("beside", [-1.25, -1.5])
def test_people_who_walk_along_the_edge_of_the_lane_are_given_room_within_it(
    x: float, heading: float, beside: float
) -> None:
    driven = drive(road(limit=8.0), 25.0, speed=5.0, actors=[person(3, x, beside, heading=heading, speed=1.3)])
    assert driven.clearances.min() > 0.45
    assert offsets(driven)[1] + 0.5 * SHAPE.width < 1.7
    assert driven.fronts[-1] > 150.0
    assert abs(driven.states[-1, 2]) < 0.05


def test_room_for_who_walks_where_the_lane_is_wider_is_not_made_beyond_its_edge_before() -> None:
    wide = road(limit=8.0)
    edge = np.where(wide.line.stations > 100.0, 3.0, 1.6)
    route = msgspec.structs.replace(wide, lane_left=edge, road_left=edge)
    driven = drive(route, 25.0, speed=5.0, actors=[person(3, 118.0, -0.9, heading=math.pi, speed=0.6)])
    before = driven.fronts < 100.0
    assert driven.states[before, 2].max() + 0.5 * SHAPE.width < 1.75


def test_road_is_not_left_on_the_way_to_where_it_is_wider() -> None:
    wide = road(lanes_left=1)
    edge = np.where(wide.line.stations < 112.0, 1.6, wide.road_left)
    route = msgspec.structs.replace(wide, road_left=edge)
    driven = drive(route, 30.0, speed=8.0, actors=[person(3, 118.0, -0.7)])
    before = driven.fronts < 112.0
    assert driven.states[before, 2].max() + 0.5 * SHAPE.width < 1.7
    later = drive(route, 30.0, speed=8.0, actors=[person(3, 132.0, -0.7)])
    assert later.fronts[-1] > 140.0


@pytest.mark.parametrize("narrows", [20.0, 28.0])  # [m] behind the beginning of the queue, within which
def test_road_that_narrows_beside_a_queue_is_not_left_for_who_needs_less_room_than_the_first(narrows: float) -> None:
    wide = road()
    edge = np.interp(wide.line.stations, [100.0, 100.0 + narrows], [-4.8, -1.6])
    route = msgspec.structs.replace(wide, lane_right=edge, road_right=edge)
    queue = [car(1, 103.0, 1.0), car(2, 110.5, 1.8), car(3, 118.0, 2.5), car(4, 125.5, 3.1)]
    driven = drive(route, 30.0, speed=8.0, station=50.0, actors=queue)
    assert driven.fronts[-1] > 150.0
    assert driven.clearances.min() > 0.4
    bodies = np.array([box_of(x, y, heading, SHAPE) for x, y, heading in driven.states[:, 1:4].tolist()])
    x, y = outlines(bodies, 6).reshape(-1, 2).T
    assert (np.interp(x, route.line.stations, edge) - y).max() < Thresholds().lane_tolerance


@pytest.mark.parametrize("x", [20.5, 22.0, 23.5])
def test_ego_does_not_start_past_a_person_who_has_come_to_stand_right_beside_it(x: float) -> None:
    close = person(5, x, -1.35, heading=math.pi / 2.0, speed=-1.3, leaves=6.0)
    driven = drive(road(), 15.0, station=20.0, actors=[close])
    assert driven.clearances[0] < 0.25
    assert driven.speeds[:60].max() < 0.1
    assert driven.fronts[-1] > 40.0


@pytest.mark.parametrize("ahead", [1.0, 2.0, 3.0])
def test_no_room_is_made_for_who_is_met_before_there_can_be_any(ahead: float) -> None:
    walker = person(5, 20.0 + SHAPE.front + ahead, -1.7, heading=math.pi, speed=1.7)
    driven = drive(road(limit=8.0), 14.0, station=20.0, actors=[walker])
    assert driven.clearances.min() > 0.35
    assert offsets(driven)[1] < 0.1
    assert driven.fronts[-1] > 60.0


@pytest.mark.parametrize("beside", [-1.6, -1.75])
def test_where_there_is_no_time_for_all_the_room_wanted_the_ego_makes_part_of_it(beside: float) -> None:
    walker = person(5, 20.0 + SHAPE.front + 6.0, beside, heading=math.pi, speed=1.3)
    driven = drive(road(limit=8.0), 10.0, station=20.0, speed=6.0, actors=[walker])
    centred = -beside - 0.5 * (SHAPE.width + 0.6)
    assert driven.clearances.min() > centred + 0.25
    assert_drivable(driven)
    assert driven.fronts[-1] > 80.0


@pytest.mark.parametrize(("heading", "ahead"), [(math.pi, 1.0), (math.pi, 3.0), (0.0, 0.0)])
@pytest.mark.parametrize("gap", [0.4, 0.45])
def test_ego_that_stands_does_not_set_off_while_somebody_walks_close_by_its_front(
    heading: float, ahead: float, gap: float
) -> None:
    def setting_off(gap: float) -> int:
        y = -(0.5 * (SHAPE.width + 0.6) + gap)
        walker = person(5, 20.0 + SHAPE.front + ahead, y, heading=heading, speed=1.3)
        driven = drive(road(limit=8.0), 16.0, station=20.0, actors=[walker])
        assert driven.fronts[-1] > 80.0
        return int((driven.speeds > 0.3).argmax())

    assert setting_off(0.65) < 6
    assert setting_off(gap) >= 10


@pytest.mark.parametrize("beside", [-1.35, -1.0])
def test_lane_that_gets_narrower_is_not_left_for_who_walks_along_it(beside: float) -> None:
    straight = road(limit=8.0, lanes_left=1)
    edge = np.interp(straight.line.stations, [60.0, 140.0], [1.7, 1.5])
    route = msgspec.structs.replace(straight, lane_left=edge)
    driven = drive(route, 20.0, speed=5.0, actors=[person(3, 125.0, beside, heading=math.pi, speed=0.8)])
    assert offsets(driven)[1] + 0.5 * SHAPE.width < 1.8
    assert driven.clearances.min() > 0.3


def test_ego_that_stands_close_to_a_person_beside_its_way_drives_on() -> None:
    driven = drive(road(), 15.0, station=20.0, actors=[person(5, 24.6, -1.62)])
    assert driven.clearances.min() > 0.35
    assert driven.fronts[-1] > 60.0


def test_two_cones_one_behind_the_other_are_passed_in_one_go() -> None:
    driven = drive(road(lanes_left=1), 25.0, speed=12.0, actors=[cone(5, 110.0), cone(6, 125.0)])
    between = (driven.fronts > 113.0) & (driven.fronts < 125.0)
    assert driven.states[between, 2].min() > 1.0
    assert driven.clearances.min() >= 0.4


def test_what_follows_on_the_same_side_is_passed_without_turning_back_towards_it() -> None:
    """It leaves room also on the line: but the front, on its way back there, would take that."""
    actors = [person(3, 110.7, -1.2), car(1, 123.5, -2.34, size=(8.0, 1.8))]
    driven = drive(road(), 30.0, speed=8.0, station=60.0, actors=actors)
    assert driven.fronts[-1] > 150.0
    assert driven.clearances.min() > 0.4
    beside = (driven.fronts > 113.0) & (driven.states[:, 1] < 127.0)
    assert driven.states[beside, 2].min() > 0.3
    assert driven.states[beside, 5].min() > -1.0


@pytest.mark.parametrize(
    "actors",
    [
        [cone(1, 71.5, 1.53), car(2, 78.8, -2.19, size=(8.0, 1.8))],
        [person(1, 84.7, -1.46), cone(2, 90.7, 1.68)],
        [person(1, 88.6, 1.76), car(2, 98.1, -2.09)],
        [car(1, 74.7, -2.53, size=(8.0, 1.8)), car(2, 86.6, 2.06, size=(8.0, 1.8))],
    ],
    ids=["cone, car", "person, cone", "person, car", "cars"],
)
@pytest.mark.parametrize("speed", [3.0, 8.0])
def test_those_on_either_side_one_soon_after_the_other_are_passed_as_far_aside_as_both_allow(
    actors: list[Actor], speed: float
) -> None:
    """With all the room wanted beside the first, the second could not be reached."""
    route = road()
    wide = msgspec.structs.replace(route, road_left=route.road_left + 0.5, road_right=route.road_right - 0.5)
    driven = drive(wide, 40.0, speed=speed, station=40.0, actors=actors)
    assert driven.fronts[-1] > 110.0
    assert driven.clearances.min() > 0.3
    assert driven.states[:, 5].min() > -3.5


def test_who_is_stopped_for_costs_nobody_before_them_the_room_they_want() -> None:
    line = stop_line(128.0, Control.SIGNAL)
    actors = [person(3, 110.0, -1.2), car(1, 120.5)]
    driven = drive(road(stop_lines=[line]), 20.0, speed=8.0, station=60.0, actors=actors)
    assert driven.speeds[-1] == 0.0
    beside = (driven.fronts > 110.0) & (driven.states[:, 1] < 110.0)
    assert driven.states[beside, 2].min() > 0.3


@pytest.mark.parametrize("gap", [8.0, 12.0])
@pytest.mark.parametrize("beside", [-1.35, -1.5])
def test_who_stands_across_the_lane_is_not_passed_as_far_aside_as_a_person_before_them_nor_costs_that_one_room(
    beside: float, gap: float
) -> None:
    driven = drive(road(), 20.0, speed=8.0, station=60.0, actors=[person(3, 100.0, beside), car(4, 102.5 + gap)])
    by_person = (driven.fronts > 99.0) & (driven.states[:, 1] < 101.0)
    assert driven.clearances[by_person].min() > 0.6
    assert "nudge left 4" not in driven.decisions
    assert driven.speeds[-1] == 0.0


def test_gap_between_two_objects_that_is_too_narrow_is_stopped_for() -> None:
    driven = drive(road(lanes_left=1), 25.0, speed=12.0, actors=[cone(5, 110.0, -0.9), cone(6, 110.0, 2.05)])
    assert driven.speeds[-1] == 0.0
    assert driven.clearances.min() > 2.0


@pytest.mark.parametrize("speed", [0.0, 5.0, 9.0])
@pytest.mark.parametrize(("ahead", "passes"), [(12.0, False), (15.0, True)])
def test_way_round_one_keeps_clear_of_who_stands_beside_the_way_there(
    ahead: float, speed: float, *, passes: bool
) -> None:
    beside, in_way = car(1, 42.0, 3.15, size=(8.0, 1.8)), car(2, 42.0 + ahead, -1.2)
    driven = drive(road(lanes_left=1), 40.0, speed=speed, station=20.0, actors=[beside, in_way])
    assert driven.clearances.min() > 0.4
    assert driven.states[:, 5].min() > -4.0
    assert (driven.fronts[-1] > 200.0) == passes
    assert (driven.decisions[-1] == "stop behind 2") != passes
    assert_drivable(driven)


def test_object_on_the_left_is_passed_on_the_right() -> None:
    route = road()
    wide = msgspec.structs.replace(route, road_right=route.road_right - 3.2)
    driven = drive(wide, 20.0, speed=13.0, actors=[cone(5, 120.0, 0.6)])
    assert "nudge right 5" in driven.decisions
    assert driven.clearances.min() >= 0.4


def test_side_does_not_change_while_the_object_seems_to_move_about() -> None:
    class Wobbling(Actor, frozen=True):
        def box_at(self, time: float) -> list[float]:
            return [120.0, 0.15 * np.sin(37.0 * time), 0.0, 0.4, 0.4]

    route = road(lanes_left=1)
    wide = msgspec.structs.replace(route, road_right=route.road_right - 3.2)
    seen = Wobbling(5, ObjectClass.STATIC, 120.0, 0.0)
    driven = drive(wide, 9.0, speed=13.0, actors=[seen])
    assert len({decision for decision in driven.decisions if decision.startswith("nudge")}) == 1


def test_standing_car_whose_measured_speed_flickers_is_passed_all_the_same() -> None:
    class Flickering(Actor, frozen=True):
        def speed_at(self, time: float) -> float:
            return 0.4 + 0.3 * math.sin(41.0 * time)

    driven = drive(road(lanes_left=1), 30.0, speed=10.0, actors=[Flickering(5, ObjectClass.VEHICLE, 80.0, 0.0)])
    assert driven.clearances.min() >= 0.4
    assert driven.fronts[-1] > 150.0


def test_person_who_stands_in_the_lane_is_passed_with_more_clearance() -> None:
    driven = drive(road(lanes_left=1), 40.0, speed=8.0, actors=[person(5, 80.0, -0.8)])
    assert driven.fronts[-1] > 100.0
    assert driven.clearances.min() > 1.0


@pytest.mark.parametrize("leaves", [18.0, 19.0, 20.0, 21.0])
def test_a_bus_that_starts_while_it_is_passed_is_not_cut_off(leaves: float) -> None:
    bus = car(4, 100.0, size=(12.0, 2.5), speed=4.5, leaves=leaves)
    driven = drive(road(lanes_left=1, limit=5.0), 35.0, speed=5.0, actors=[bus])
    at_start = driven.fronts[round(10.0 * leaves)]
    assert 94.0 < at_start < 115.0
    assert driven.clearances.min() > 0.4
    assert_drivable(driven)


def test_car_that_was_seen_driving_is_passed_only_after_long_far_from_any_junction_too() -> None:
    driven = drive(road(lanes_left=1), 170.0, speed=10.0, actors=[car(5, 45.0, speed=2.0, stays_from=12.0)])
    assert np.abs(driven.states[:1200, 2]).max() < 0.2
    assert driven.fronts[-1] > 200.0


def test_car_that_only_seemed_to_move_when_first_seen_is_passed_as_a_parked_one() -> None:
    seemed = car(5, 119.0, speed=2.0, stays_from=0.5)
    driven = drive(road(lanes_left=1), 30.0, speed=13.0, actors=[seemed])
    assert driven.fronts[-1] > 200.0
    assert driven.clearances.min() > 0.4


@pytest.mark.parametrize("station", [63.0, 66.0, 69.0])
@pytest.mark.parametrize("radius", [8.0, 14.0])
def test_person_on_the_outside_of_a_tight_bend_is_passed_with_room_for_the_body_that_swings_out(
    radius: float, station: float
) -> None:
    route = road(curve_points(radius, before=60.0), lanes_left=1)
    x, y, heading = route.line.poses(np.array([station]))[0].tolist()
    beside = person(3, x + 1.5 * math.sin(heading), y - 1.5 * math.cos(heading))
    driven = drive(route, 30.0, speed=5.0, station=30.0, actors=[beside])
    assert driven.clearances.min() > 1.1
    assert driven.states[-1, 2] > 100.0


@pytest.mark.parametrize("beside", [1.4, 1.7, 2.2])
@pytest.mark.parametrize("radius", [8.0, 12.0])
def test_body_that_swings_out_in_a_bend_stays_on_the_road_when_it_passes_a_person_on_the_inside(
    radius: float, beside: float
) -> None:
    route = road(curve_points(radius, before=60.0))
    x, y, heading = route.line.poses(np.array([70.0 + 0.3 * radius]))[0].tolist()
    inside = person(3, x - beside * math.sin(heading), y + beside * math.cos(heading))
    driven = drive(route, 25.0, speed=6.0, station=30.0, actors=[inside])
    assert sweeps(driven, route).min() > -1.65
    assert driven.clearances.min() > 0.35
    assert (driven.states[-1, 2] > 50.0) == (beside > 1.5)


@pytest.mark.parametrize("beside", [1.45, 1.55])
@pytest.mark.parametrize("station", [60.0, 63.0])
@pytest.mark.parametrize("radius", [6.5, 8.0])
def test_for_people_who_stand_beside_it_on_the_inside_of_a_bend_the_ego_moves_as_little_as_it_can(
    radius: float, station: float, beside: float
) -> None:
    """Each of them would be passed with what all need, not one of them with all the clearance wanted."""
    route = road(curve_points(radius, before=60.0))
    route = msgspec.structs.replace(route, road_right=route.road_right - 2.4)
    people = []
    for track, (ahead, farther) in enumerate([(1.5, 0.2), (2.0, 0.0), (2.4, 0.12), (2.9, 0.02)]):
        x, y, heading = route.line.poses(np.array([station + ahead]))[0].tolist()
        aside = beside + farther
        people.append(person(track, x - aside * math.sin(heading), y + aside * math.cos(heading)))
    driven, alone = (drive(route, 20.0, station=station, actors=actors) for actors in (people, []))
    assert sweeps(driven, route).min() > sweeps(alone, route).min() - 0.2
    assert driven.clearances.min() > 0.25
    assert driven.states[-1, 2] > 100.0


@pytest.mark.parametrize("speed", [2.0, 4.0])
@pytest.mark.parametrize("aside", [2.0, 2.1])
def test_for_a_car_that_it_goes_by_already_in_a_bend_the_ego_does_not_turn_the_wheels_farther_than_they_go(
    aside: float, speed: float
) -> None:
    """To the right, and the car on the left: a move away from it adds to the bend."""
    route = road(curve_points(6.5, before=60.0) * [1.0, -1.0])
    x, y, heading = route.line.poses(np.array([65.0]), np.array([aside]))[0].tolist()
    driven = drive(route, 8.0, speed=speed, station=66.0, actors=[car(3, x, y, heading=heading + math.pi)])
    farthest = math.tan(VehicleLimits().max_steering) / SHAPE.wheelbase
    assert max(float(np.abs(plan.points[:, 6]).max()) for plan in driven.trajectories) < farthest + 0.02
    assert driven.clearances.min() == driven.clearances[0]
    assert driven.speeds[-1] > 5.0


@pytest.mark.parametrize("nearer", [0.3, 0.5])
def test_a_move_for_one_that_it_goes_by_already_is_not_cut_short_when_that_one_seems_nearer(nearer: float) -> None:
    """Though the offset changes."""
    config, route = PlanningConfig(), road(curve_points(6.5, before=60.0) * [1.0, -1.0])
    route = msgspec.structs.replace(route, lane_right=route.lane_right - 1.0, road_right=route.road_right - 1.0)
    window, decider = Reference(route, SHAPE, config).window(63.0, 60.0), NudgeDecider(SHAPE, config)
    begins = []
    for cycle in range(40):
        aside = 2.3 - (nearer if cycle >= 35 else 0.0)
        x, y, heading = route.line.poses(np.array([66.0]), np.array([aside]))[0].tolist()
        time, beside = 0.1 * cycle, car(3, x, y, heading=heading + math.pi)
        scene = scene_in(window, predicted([beside], time), time, decider.stood, (), config)
        nudges, _ = decider.step(Situation(time, 2.0, Lateral(0.0, 0.0, 0.0), window, scene, []))
        begins += [nudge.plateau.begin for nudge in nudges]
    assert begins
    assert begins == [begins[0]] * len(begins)


@pytest.mark.parametrize("speed", [2.0, 4.0])
@pytest.mark.parametrize("gap", [6.5, 7.5])
def test_the_next_one_is_not_passed_as_far_aside_before_the_ego_is_as_far_aside(gap: float, speed: float) -> None:
    """As above, with another car behind the first one."""
    route = road(curve_points(6.5, before=60.0) * [1.0, -1.0])
    poses = route.line.poses(np.array([65.0, 65.0 + gap]), np.array([2.1, 2.4])).tolist()
    cars = [car(3 + row, x, y, heading=heading + math.pi) for row, (x, y, heading) in enumerate(poses)]
    driven = drive(route, 8.0, speed=speed, station=64.0, actors=cars)
    farthest = math.tan(VehicleLimits().max_steering) / SHAPE.wheelbase
    assert max(float(np.abs(plan.points[:, 6]).max()) for plan in driven.trajectories) < farthest + 0.02
    assert driven.clearances.min() == driven.clearances[0]
    assert driven.speeds[-1] > 5.0


@pytest.mark.parametrize("station", [62.0, 68.0, 72.0])
@pytest.mark.parametrize("radius", [6.0, 8.0, 10.0])
def test_where_there_is_no_room_to_the_far_edge_the_ego_does_not_get_closer_to_what_it_passes(
    radius: float, station: float
) -> None:
    route = road(curve_points(radius, before=60.0))
    x, y, heading = route.line.poses(np.array([station]))[0].tolist()
    parked = car(3, x - 2.5 * math.sin(heading), y + 2.5 * math.cos(heading), heading=heading)
    driven = drive(route, 15.0, speed=3.0, station=45.0, actors=[parked])
    _, offsets = route.line.project(driven.states[:, 1:3])
    assert np.abs(offsets[driven.states[:, 0] < 12.0]).max() < 0.3
    assert driven.clearances.min() > 0.28
    assert "nudge left 3" not in driven.decisions


@pytest.mark.parametrize("leaves", [5.0, 6.0, 7.0])
def test_who_starts_when_the_ego_is_about_to_pass_is_passed_or_followed_without_a_touch(leaves: float) -> None:
    bus = car(5, 120.0, -0.6, size=(12.0, 2.5), speed=3.0, leaves=leaves)
    driven = drive(road(lanes_left=1), 30.0, speed=13.0, actors=[bus])
    assert driven.clearances.min() > 0.4
    assert driven.states[:, 5].min() > -4.0
    assert_drivable(driven)


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("station", [58.0, 66.0])
@pytest.mark.parametrize(("angle", "size"), [(0.3, (8.0, 2.4)), (0.5, (8.0, 2.4)), (0.3, (12.0, 2.5))])
@pytest.mark.parametrize("gap", [0.3, 0.75])
def test_who_stands_aslant_beside_a_bend_is_passed_with_the_clearance_wanted_by_its_own_outline(
    side: float, station: float, angle: float, size: tuple[float, float], gap: float
) -> None:
    """On the inner side it comes nearer than its extent across the line tells, on the outer side not so near."""
    route = road(curve_points(12.0, before=40.0))
    route = msgspec.structs.replace(route, road_left=route.road_left + 3.2, road_right=route.road_right - 3.2)
    east, north, along = route.line.poses(np.array([station]))[0].tolist()
    alone = drive(route, 14.0, speed=5.0, station=20.0)
    bodies = [box_of(x, y, heading, SHAPE) for x, y, heading in alone.states[:, 1:4].tolist()]

    def bus(aside: float) -> Actor:
        x, y = east - aside * math.sin(along), north + aside * math.cos(along)
        return car(3, x, y, heading=along - side * angle, size=size)

    def clearance(aside: float) -> float:
        return min(float(distances(body, np.array([bus(aside).box_at(0.0)]))[0]) for body in bodies)

    asides = side * np.arange(2.0, 8.0, 0.02)
    driven = drive(route, 14.0, speed=5.0, station=20.0, actors=[bus(next(a for a in asides if clearance(a) > gap))])
    assert max(gap, 0.55) < driven.clearances.min() < 0.85
    assert driven.clearances[-1] > 15.0


@pytest.mark.parametrize(("radius", "decision"), [(16.0, "nudge left 5"), (6.5, "stop behind 5")])
def test_what_stands_in_a_bend_is_passed_on_its_inner_side_where_the_wheels_turn_so_far(
    radius: float, decision: str
) -> None:
    points = curve_points(radius, before=40.0)
    middle = points[40 + round(5.0 + math.pi / 4.0 * radius)]
    driven = drive(road(points, lanes_left=1), 25.0, speed=5.0, actors=[cone(5, *middle)])
    assert decision in driven.decisions
    passes = driven.states[-1, 2] > middle[1] + 20.0
    assert passes == ("nudge left 5" in driven.decisions)
    assert driven.clearances.min() >= 0.4


@pytest.mark.parametrize(("heading", "y", "decision"), [(0.0, -1.6, "nudge left 5"), (0.6, -2.8, "stop behind 5")])
def test_who_stands_aslant_at_a_junction_comes_into_the_lane_and_is_not_passed_within_it(
    heading: float, y: float, decision: str
) -> None:
    junction = stop_line(90.0, Control.PRIORITY, yields_to=frozenset(), exit_station=120.0)
    standing = car(5, 105.0, y, heading=heading, size=(4.5, 1.0))
    driven = drive(road(stop_lines=[junction]), 40.0, speed=10.0, actors=[standing])
    assert decision in driven.decisions
    assert (driven.fronts[-1] > 120.0) == (decision == "nudge left 5")


class Wavering(Actor, frozen=True):
    """As a tracker has who stands: a little to the left, then to the right."""

    def box_at(self, time: float) -> list[float]:
        x, y, *rest = super().box_at(time)
        return [x, y + (0.02 if round(10.0 * time) % 4 < 2 else -0.02), *rest]


@pytest.mark.parametrize("y", [-1.81, -1.79])
def test_a_nudge_with_hardly_room_is_carried_through_once_it_is_begun(y: float) -> None:
    """Else the ego stops and starts with every measurement, a little closer each time."""
    van = Wavering(7, ObjectClass.VEHICLE, 100.0, y, size=(5.0, 2.0))
    driven = drive(road(), 30.0, station=40.0, speed=10.0, actors=[van])
    assert driven.fronts[-1] > 150.0
    assert driven.clearances.min() > 0.35
    changes = sum(one != next_one for one, next_one in pairwise(driven.decisions))
    assert changes < 6


class Widening(Actor, frozen=True):
    """As a tracker has who is a little wider when seen from beside than from behind."""

    def box_at(self, time: float) -> list[float]:
        x, y, heading, length, width = super().box_at(time)
        return [x, y, heading, length, width + (0.3 if time >= self.leaves else 0.0)]


def test_beside_who_leaves_less_room_than_it_seemed_the_ego_does_not_turn_back_towards_them() -> None:
    van = Widening(7, ObjectClass.VEHICLE, 100.0, -1.85, size=(5.0, 2.0), leaves=4.9)
    driven = drive(road(), 30.0, station=40.0, speed=10.0, actors=[van])
    beside = (driven.fronts > 97.5) & (driven.fronts - SHAPE.length < 102.5)
    assert not beside[:48].any()
    assert beside[49]
    assert driven.states[beside, 2].min() > 0.45
    assert driven.clearances.min() > 0.2


@pytest.mark.parametrize("radius", [12.0, 30.0, 80.0, 300.0])
@pytest.mark.parametrize("size", [(0.4, 0.4), (4.5, 1.8), (12.0, 2.5)])
def test_nobody_beside_a_bend_is_taken_to_stand_clear_who_does_not(radius: float, size: tuple[float, float]) -> None:
    """Who may be near is looked for by extents first: their outlines tell, wherever they stand, and however."""
    route, config, random = road(curve_points(radius)), PlanningConfig(), np.random.default_rng(1)
    window = Reference(route, SHAPE, config).window(85.0, 80.0)
    stations, besides = random.uniform(90.0, 130.0, 200), random.uniform(1.0, 4.0, 200) * random.choice([-1, 1], 200)
    x, y, along = route.line.poses(stations).T
    headings = along + random.normal(0.0, 0.4, 200)
    spots = zip(x - besides * np.sin(along), y + besides * np.cos(along), headings, strict=True)
    actors = [car(track, east, north, heading=turned, size=size) for track, (east, north, turned) in enumerate(spots)]
    scene = scene_in(window, predicted(actors, 0.0), 0.0, (), (), config)
    found, _ = blockers(scene, window, 5.0, (), SHAPE, config)
    around, offsets, _ = window.project(outlines(scene.boxes, 4).reshape(-1, 2))
    rows = window.index(around)
    right = (offsets - window.swept_left[rows]).reshape(200, -1).min(axis=1)
    left = (offsets - window.swept_right[rows]).reshape(200, -1).max(axis=1)
    near = np.maximum(right, -left) < config.nudge_clearance
    assert 5 < np.count_nonzero(near) < 195
    assert {blocker.track for blocker in found} == set(near.nonzero()[0].tolist())


@pytest.mark.parametrize(("speed", "x"), [(0.0, 60.1), (0.0, 61.0), (3.0, 60.1), (3.0, 63.0), (8.0, 63.0)])
def test_half_way_to_its_lane_beside_who_waits_there_the_ego_goes_by_before_it_moves_over(
    speed: float, x: float
) -> None:
    driven = drive(road(lanes_left=1), 8.0, station=60.0, speed=speed, aside=2.2, actors=[car(4, x, 0.08)])
    assert driven.clearances.min() > driven.clearances[0] - 0.01
    assert driven.speeds[-1] > 10.0
    assert abs(driven.states[-1, 2]) < 0.1
