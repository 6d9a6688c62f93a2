"""Where plans begin, and what a trajectory promises."""

import math

import msgspec
import numpy as np
import pytest
from planned_drives import SHAPE, believed, car, curve_points, drive, person, predicted, road, sweeps

from dvca_sumo.messages import TRAJECTORY_TIMES, Trajectory
from dvca_sumo.stack.planning import Planner, PlanningConfig
from dvca_sumo.stack.planning.moves import Lateral
from dvca_sumo.stack.planning.path import Plateau, path_along, way_back
from dvca_sumo.stack.planning.reference import BEHIND, Reference
from dvca_sumo.stack.planning.start import StartState

NOBODY = predicted([], 0.0)


def planner() -> Planner:
    return Planner(PlanningConfig(), road(), SHAPE)


def test_row_0_is_the_believed_state_at_its_time() -> None:
    trajectory = planner().step(believed(50.0, 0.4, 0.05, 9.0, time=3.5), NOBODY, {})
    assert trajectory.time == 3.5
    assert np.abs(trajectory.points[0, 1:5] - [50.0, 0.4, 0.05, 9.0]).max() < 1e-3
    assert (trajectory.points[:, 0] == TRAJECTORY_TIMES).all()


def test_small_deviation_goes_on_from_the_previous_trajectory() -> None:
    plan = planner()
    first = plan.step(believed(50.0, speed=10.0), NOBODY, {})
    second = plan.step(believed(50.6, 0.3, 0.05, 9.5, time=0.1), NOBODY, {})
    assert np.abs(second.points[0, 1:5] - first.points[1, 1:5]).max() < 1e-6


def test_ego_that_stands_sets_off_from_where_it_is() -> None:
    """What control left when it stopped would stay between the plan and the body, beside whom it passes."""
    plan, waits = planner(), predicted([car(3, 58.0)], 0.0)
    plan.step(believed(50.0), waits, {})
    beside = believed(50.2, 0.2, -0.1, time=0.1)
    points = plan.step(beside, waits, {}).points
    assert np.abs(points[0, 1:5] - [50.2, 0.2, -0.1, 0.0]).max() < 1e-3
    for cycle in range(2, 12):
        points = plan.step(msgspec.structs.replace(beside, time=0.1 * cycle), NOBODY, {}).points
    assert points[0, 4] > 1.0  # though nobody reports that it moves


def test_far_deviation_starts_again_from_the_believed_state() -> None:
    for believed_state in (
        believed(51.0, 0.8, 0.0, 10.0, time=0.1),
        believed(53.5, 0.0, 0.0, 10.0, time=0.1),
        believed(51.0, 0.0, 0.3, 10.0, time=0.1),
        believed(51.0, 0.0, 0.0, 5.0, time=0.1),
        believed(51.0, 0.0, 0.0, 10.0, time=20.0),
    ):
        plan = planner()
        plan.step(believed(50.0, speed=10.0), NOBODY, {})
        points = plan.step(believed_state, NOBODY, {}).points
        state = [believed_state.x, believed_state.y, believed_state.heading, believed_state.speed]
        assert np.abs(points[0, 1:5] - state).max() < 1e-3


def test_ego_beside_its_lane_is_led_back_to_it() -> None:
    points = planner().step(believed(50.0, 1.5, 0.1, 8.0), NOBODY, {}).points
    assert abs(points[-1, 2]) < 0.01
    assert points[:, 2].max() < 2.5
    assert np.abs(points[:, 6]).max() < 0.15


@pytest.mark.parametrize("aside", [0.0, 0.45])
@pytest.mark.parametrize("station", [66.0, 69.0])
@pytest.mark.parametrize("radius", [6.5, 8.0])
def test_ego_that_sets_off_in_a_bend_swings_out_no_farther_than_one_that_comes_along(
    radius: float, station: float, aside: float
) -> None:
    route = road(curve_points(radius, before=60.0), limit=8.0)
    comes_along = sweeps(drive(route, 15.0, station=40.0), route)
    sets_off = sweeps(drive(route, 10.0, station=station, aside=aside), route)
    assert sets_off.min() > comes_along.min() - 0.05


@pytest.mark.parametrize("radius", [5.0, 5.5, 6.5])
def test_ego_that_runs_wide_where_the_wheels_hardly_turn_farther_turns_back_at_once(radius: float) -> None:
    """A move that spared the wheels would hardly turn for tens of metres."""
    window = Reference(road(curve_points(radius, before=50.0)), SHAPE, PlanningConfig()).window(60.0, 40.0)
    back = way_back(Lateral(-0.3, -0.27, -0.06), 0.0, 3.6, window, SHAPE, PlanningConfig())
    assert back.length < 12.0


@pytest.mark.parametrize("speed", [0.0, 3.0])
@pytest.mark.parametrize("station", [58.0, 64.0])
@pytest.mark.parametrize("aside", [-3.2, -2.0, 2.0, 3.2])
@pytest.mark.parametrize("radius", [8.0, 12.0])
def test_move_onto_another_lane_in_a_bend_ends_on_it_and_does_not_swing_out_beyond(
    radius: float, aside: float, station: float, speed: float
) -> None:
    route = road(curve_points(radius, before=50.0))
    route = msgspec.structs.replace(route, road_left=route.road_left + 3.2, road_right=route.road_right - 3.2)
    moves, alone = (drive(route, 12.0, speed=speed, station=station, aside=offset) for offset in (aside, 0.0))
    side = -math.copysign(1.0, aside)
    swept, usual = (float((side * sweeps(driven, route)).max()) for driven in (moves, alone))
    assert swept < max(usual, 1.6) + 0.1
    assert abs(sweeps(moves, route)[-1]) < 1.0


@pytest.mark.parametrize("station", [50.0, 56.0])
def test_move_onto_another_lane_that_a_person_interrupts_begins_anew_behind_them(station: float) -> None:
    route = road(curve_points(12.0, before=40.0))
    route = msgspec.structs.replace(route, road_right=route.road_right - 3.2, start=40.0)
    x, y, heading = route.line.poses(np.array([station + 4.0]))[0].tolist()
    someone = person(1, x + 1.4 * math.sin(heading), y - 1.4 * math.cos(heading))
    driven = drive(route, 30.0, speed=5.0, station=station - 8.0, aside=-3.2, actors=[someone])
    assert sweeps(driven, route).max() < 1.6
    assert driven.clearances.min() > 0.3
    assert driven.states[-1, 2] > 100.0


@pytest.mark.parametrize("farther", [43.0, 50.0])
def test_move_onto_another_lane_is_over_before_room_is_made_for_who_is_far_ahead(farther: float) -> None:
    route = road(curve_points(25.0, before=20.0))
    route = msgspec.structs.replace(
        route, road_left=route.road_left + 3.2, road_right=route.road_right - 3.2, start=20.0
    )
    x, y, heading = route.line.poses(np.array([24.0 + farther]))[0].tolist()
    someone = person(1, x + 2.2 * math.sin(heading), y - 2.2 * math.cos(heading))
    driven = drive(route, 14.0, station=24.0, aside=-3.2, actors=[someone])
    assert sweeps(driven, route).max() < 1.6
    assert driven.states[-1, 2] > 80.0


@pytest.mark.parametrize("x", [38.0, 39.0, 40.0])
def test_move_onto_another_lane_goes_on_round_who_stands_right_behind_its_end(x: float) -> None:
    route = road(lanes_left=1)
    route = msgspec.structs.replace(route, road_right=route.road_right - 3.2)
    driven = drive(route, 20.0, station=20.0, aside=3.2, actors=[car(1, x, 2.4, heading=0.3)])
    assert driven.clearances.min() > 0.4
    assert driven.states[:, 5].min() > -3.0
    assert driven.states[-1, 1] > 100.0


@pytest.mark.parametrize("far", [12.0, 24.0, 48.0])
def test_move_that_is_on_its_way_to_the_target_does_not_swing_far_past_it(far: float) -> None:
    window = Reference(road(), SHAPE, PlanningConfig()).window(100.0, 120.0)
    start = StartState(100.0, 2.2, -0.4, 4.0, 0.0, 0.0)
    lateral = Lateral(2.2, math.tan(-0.4), 0.0)
    path = path_along(window, start, lateral, [Plateau(far, far + 8.0, 0.2)], SHAPE, PlanningConfig())
    assert path.y.min() > -0.15
    assert path.y[int(far) + 1 : int(far) + 8] == pytest.approx(0.2, abs=0.01)


@pytest.mark.parametrize("speed", [14.0, 26.0])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_move_begun_as_the_path_so_far_bends_away_does_not_go_the_other_way_first(side: float, speed: float) -> None:
    """Of 2.6 m/s^2, the bend would last over all of the move, and carry it a fifth of a metre there."""
    bend = 2.6 * side / speed**2
    window = Reference(road(), SHAPE, PlanningConfig()).window(100.0, 200.0)
    start = StartState(100.0, 3.2 * side, 0.0, speed, 0.0, bend)
    lateral = Lateral(3.2 * side, 0.0, bend)
    path = path_along(window, start, lateral, [], SHAPE, PlanningConfig())
    assert (side * path.y).max() < 3.3
    assert abs(path.y[-1]) < 0.01


def test_move_begun_on_the_way_out_goes_on_bending_as_it_does() -> None:
    window = Reference(road(), SHAPE, PlanningConfig()).window(100.0, 200.0)
    start = StartState(100.0, 1.0, 0.1, 20.0, 0.0, 0.004)
    path = path_along(window, start, Lateral(1.0, math.tan(0.1), 0.004), [], SHAPE, PlanningConfig())
    assert path.curvatures[0] == pytest.approx(0.004, rel=0.05)


def test_ego_that_points_away_from_the_line_is_led_back_slowly() -> None:
    points = planner().step(believed(50.0, 6.0, 1.5, 5.0), NOBODY, {}).points
    assert points[-1, 4] < PlanningConfig().astray_speed + 0.1
    assert points[-1, 3] < -0.1
    assert np.abs(points[:, 3]).max() < 1.0


def test_off_the_route_the_ego_brakes_straight_ahead() -> None:
    for lost in (believed(50.0, 30.0, 0.3, 10.0), believed(50.0, 0.0, 2.5, 10.0)):
        trajectory = planner().step(lost, NOBODY, {})
        assert trajectory.decision == "stop off route"
        points = trajectory.points
        assert points[-1, 4] == 0.0
        assert (points[:, 6] == 0.0).all()
        assert np.allclose(points[:, 3], lost.heading)
        along = (points[:, 1] - lost.x) * math.cos(lost.heading) + (points[:, 2] - lost.y) * math.sin(lost.heading)
        assert abs(along[-1] - 10.0**2 / (2.0 * PlanningConfig().comfort_braking)) < 1e-6


def test_back_on_the_route_planning_goes_on() -> None:
    plan = planner()
    plan.step(believed(50.0, 30.0, 0.0, 5.0), NOBODY, {})
    assert plan.step(believed(60.0, 0.0, 0.0, 5.0, time=0.1), NOBODY, {}).decision == "cruise"


def test_ego_just_before_the_start_of_the_line_can_plan() -> None:
    assert planner().step(believed(-1.0), NOBODY, {}).decision == "cruise"


def test_old_predictions_are_taken_on_to_the_present() -> None:
    leader = predicted([car(3, 40.0, speed=10.0)], 0.0)
    early = planner().step(believed(10.0, speed=10.0), leader, {})
    late = planner().step(believed(10.0, speed=10.0, time=0.5), leader, {})
    assert late.points[-1, 1] > early.points[-1, 1] + 1.0


def test_same_input_gives_the_same_trajectories() -> None:
    def driven() -> list[Trajectory]:
        plan = planner()
        inputs = predicted([car(3, 40.0, speed=8.0), car(5, 90.0, -2.3)], 0.0)
        return [plan.step(believed(10.0 + k, speed=10.0, time=0.1 * k), inputs, {}) for k in range(5)]

    for one, other in zip(driven(), driven(), strict=True):
        assert one.decision == other.decision
        assert (one.points == other.points).all()


def test_path_is_as_curved_as_it_turns_however_short_a_move_aside() -> None:
    """Control steers by the curvature: of a move that ends within a metre or two, a row says nothing by itself."""
    window = Reference(road(), SHAPE, PlanningConfig()).window(100.0, 50.0)
    start = StartState(100.0, 0.0, 0.0, 4.0, 0.0, 0.0)
    path = path_along(window, start, Lateral(0.0, 0.02, 0.0), [Plateau(1.4, 8.0, 0.06)], SHAPE, PlanningConfig())
    turned = (path.headings[2:] - path.headings[:-2]) / (path.arcs[2:] - path.arcs[:-2])
    assert np.abs(path.curvatures[1:-1] - turned).max() < 0.005


def test_planned_again_and_again_it_turns_as_much_as_its_curvatures_say() -> None:
    states = drive(road(curve_points(6.5, 40.0)), 14.0, station=25.0, speed=4.0).states
    ways = np.hypot(np.diff(states[:, 1]), np.diff(states[:, 2]))
    told = np.cumsum(0.5 * (states[1:, 6] + states[:-1, 6]) * ways)
    turned = states[1:, 3] - states[0, 3]
    assert turned[-1] > 1.5
    assert np.abs(turned - told).max() < math.radians(0.3)


def test_window_projects_like_the_line_itself() -> None:
    route = road(curve_points(12.0))
    window = Reference(route, SHAPE, PlanningConfig()).window(90.3, 80.0)
    draws = np.random.default_rng(1)
    stations, sideways = draws.uniform(75.0, 165.0, 400), draws.uniform(-6.0, 6.0, 400)
    points = route.line.poses(stations, sideways)
    found, offsets, headings = window.project(points[:, :2])
    assert np.abs(found + 90.3 - stations).max() < 0.05
    assert np.abs(offsets - sideways).max() < 0.02
    assert np.abs(headings - points[:, 2]).max() < 0.02


def test_window_tells_points_beyond_its_ends_from_points_on_the_line() -> None:
    window = Reference(road(), SHAPE, PlanningConfig()).window(100.0, 50.0)
    stations, offsets, _ = window.project(np.array([[200.0, 0.5], [120.0, 0.5]]))
    assert abs(offsets[0]) > 5.0
    assert (stations[1], offsets[1]) == (20.0, 0.5)


def test_behind_its_beginning_the_line_of_a_window_goes_on_straight() -> None:
    window = Reference(road(), SHAPE, PlanningConfig()).window(100.0, 50.0)
    behind = np.array([[100.0 - BEHIND - 0.4, 1.0], [100.0 - BEHIND - 1.6, 1.0], [30.0, -3.0]])
    stations, offsets, headings = window.project(behind)
    np.testing.assert_allclose(stations, behind[:, 0] - 100.0, atol=1e-9)
    np.testing.assert_allclose(offsets, behind[:, 1], atol=1e-9)
    np.testing.assert_allclose(headings, 0.0, atol=1e-9)
