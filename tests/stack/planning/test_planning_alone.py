"""Nobody else on the road: limits, curves, signals, signs, the destination."""

import math

import msgspec
import numpy as np
import pytest
from planned_drives import LIMIT, SHAPE, Drive, assert_drivable, curve_points, drive, road, stop_line

from dvca_sumo.messages import Floats, SignalColour
from dvca_sumo.roadmap.route import Control, Crossing, Route
from dvca_sumo.stack.planning import PlanningConfig


def test_free_road_is_driven_at_the_limit_and_not_above() -> None:
    driven = drive(road(), 20.0)
    assert driven.speeds[-1] > 0.95 * LIMIT
    assert driven.speeds.max() <= LIMIT
    assert set(driven.decisions) == {"cruise"}
    assert_drivable(driven)


def test_a_lower_limit_is_kept_from_where_the_front_bumper_enters_it() -> None:
    free = road()
    limits = np.where(free.line.stations >= 200.0, 8.3, 13.9)
    driven = drive(_with_limits(free, limits), 25.0, speed=13.0)
    inside = driven.fronts > 200.0
    assert inside.any()
    assert driven.speeds[inside].max() <= 8.3
    assert driven.speeds[inside][-1] > 7.5
    assert driven.speeds[~inside].max() > 13.0


@pytest.mark.parametrize("limit", [LIMIT, 33.3])
def test_however_high_the_limit_no_more_is_left_to_it_than_control_overshoots(limit: float) -> None:
    driven = drive(road(limit=limit), 5.0, speed=limit - 1.0)
    assert limit - 0.45 < driven.speeds[-1]
    assert driven.speeds.max() < limit


def _with_limits(route: Route, limits: Floats) -> Route:
    return msgspec.structs.replace(route, speed_limits=limits)


@pytest.mark.parametrize("radius", [10.0, 25.0])
def test_curve_is_taken_slowly_and_on_the_line(radius: float) -> None:
    route = road(curve_points(radius))
    driven = drive(route, 30.0, speed=13.0)
    _, offsets = route.line.project(driven.states[:, 1:3])
    assert np.abs(offsets).max() < 0.1
    lateral = driven.speeds**2 * np.abs(driven.states[:, 6])
    assert lateral.max() < 1.2 * PlanningConfig().lateral_acceleration
    assert driven.speeds[driven.states[:, 6] > 0.9 / radius].max() > 0.7 * math.sqrt(2.0 * radius)
    assert_drivable(driven)


def test_gentle_curve_is_not_slowed_for() -> None:
    driven = drive(road(curve_points(150.0)), 15.0, speed=13.4)
    assert driven.speeds.min() > 13.0


def test_stops_at_the_destination() -> None:
    driven = drive(road(destination=150.0), 25.0, speed=10.0)
    assert abs(driven.fronts[-1] - 150.0) < 0.5
    assert driven.speeds[-1] == 0.0
    assert driven.decisions[-1] == "stop destination"
    assert driven.states[:, 5].min() > -2.6
    assert_drivable(driven)


def test_destination_at_the_very_end_of_the_map() -> None:
    driven = drive(road(destination=600.0), 20.0, speed=13.0, station=500.0)
    assert abs(driven.fronts[-1] - 600.0) < 0.5
    assert driven.speeds[-1] == 0.0


def at_signal(colour_at: dict[float, SignalColour], seconds: float = 20.0, *, speed: float = 13.0) -> Drive:
    """Approach a signal whose line is at x = 120; colours by the time from which they show."""

    def signals(time: float) -> dict[str, SignalColour]:
        shown = [colour for since, colour in sorted(colour_at.items()) if since <= time]
        return {"J/2": shown[-1]} if shown else {}

    route = road(stop_lines=[stop_line(120.0, Control.SIGNAL)])
    return drive(route, seconds, speed=speed, signals=signals)


def test_red_light_is_stopped_at_before_the_line() -> None:
    driven = at_signal({0.0: SignalColour.RED})
    assert 0.2 < 120.0 - driven.fronts[-1] < 3.0
    assert driven.speeds[-1] == 0.0
    assert driven.decisions[-1] == "stop red J/2"
    assert_drivable(driven)


@pytest.mark.parametrize(
    ("crossing", "kept"),
    [((120.0, 124.0), 1.5), ((120.5, 124.5), 1.0), ((123.0, 127.0), 0.8), ((116.0, 124.0), 1.5), ((112.0, 118.0), 0.8)],
)
def test_room_is_left_to_people_on_a_crossing_behind_the_line(crossing: tuple[float, float], kept: float) -> None:
    route = road(stop_lines=[stop_line(120.0, Control.SIGNAL)], crossings=[Crossing("c", *crossing)])
    driven = drive(route, 20.0, speed=13.0, signals=lambda _: {"J/2": SignalColour.RED})
    assert driven.speeds[-1] == 0.0
    assert 120.0 - driven.fronts[-1] == pytest.approx(kept, abs=0.15)


def test_goes_when_red_turns_green() -> None:
    driven = at_signal({0.0: SignalColour.RED, 15.0: SignalColour.GREEN}, 25.0)
    assert driven.fronts[149] < 120.0
    assert driven.fronts[-1] > 150.0
    assert_drivable(driven)


def test_green_light_is_passed_at_speed() -> None:
    assert at_signal({0.0: SignalColour.GREEN}).speeds.min() > 12.9


def test_yellow_is_stopped_at_where_that_is_comfortable() -> None:
    driven = at_signal({0.0: SignalColour.GREEN, 5.0: SignalColour.YELLOW, 8.0: SignalColour.RED})
    assert driven.fronts[-1] < 120.0
    assert driven.states[:, 5].min() > -3.4


def test_late_yellow_is_passed_even_when_red_follows() -> None:
    driven = at_signal({0.0: SignalColour.GREEN, 6.8: SignalColour.YELLOW, 7.5: SignalColour.RED})
    assert driven.fronts[68] < 118.0
    assert driven.speeds.min() > 12.9
    assert driven.fronts[-1] > 150.0


@pytest.mark.parametrize("yellow", [1.2, 1.6, 2.0, 2.4, 2.8])
def test_who_begins_to_stop_for_yellow_while_it_speeds_up_does_stop(yellow: float) -> None:
    def signals(time: float) -> dict[str, SignalColour]:
        return {"J/2": SignalColour.GREEN if time < yellow else SignalColour.YELLOW}

    route = road(stop_lines=[stop_line(120.0, Control.SIGNAL)])
    driven = drive(route, 12.0, speed=0.0, station=108.0, signals=signals)
    has_stopped = driven.fronts[-1] < 120.0
    assert has_stopped == ("stop yellow J/2" in driven.decisions)


def test_green_that_goes_out_of_view_is_remembered_for_a_moment() -> None:
    driven = at_signal({0.0: SignalColour.GREEN})
    route = road(stop_lines=[stop_line(120.0, Control.SIGNAL)])
    blinded = drive(
        route,
        12.0,
        speed=13.0,
        signals=lambda time: {"J/2": SignalColour.GREEN} if driven.fronts[int(time * 10)] < 105.0 else {},
    )
    assert blinded.speeds.min() > 12.9


def test_signal_never_seen_is_stopped_at_and_passed_with_care_later() -> None:
    driven = at_signal({}, 40.0)
    standing = driven.speeds < 0.05
    assert 4.0 < 0.1 * standing.sum() < 12.0
    assert 0.2 < 120.0 - driven.fronts[standing][0] < 3.0
    assert driven.fronts[-1] > 150.0
    assert "stop unseen J/2" in driven.decisions


@pytest.mark.parametrize("control", [Control.STOP, Control.ALL_WAY_STOP])
def test_stop_sign_means_standing_for_a_second(control: Control) -> None:
    driven = drive(road(stop_lines=[stop_line(100.0, control)]), 25.0, speed=10.0)
    standing = driven.speeds < 0.05
    assert 0.9 <= 0.1 * standing.sum() < 3.0
    assert 0.2 < 100.0 - driven.fronts[standing][0] < 3.0
    assert driven.fronts[-1] > 120.0
    assert_drivable(driven)


def test_empty_yield_line_is_passed_slowly_and_without_stopping() -> None:
    driven = drive(road(stop_lines=[stop_line(100.0, Control.YIELD)]), 20.0, speed=13.0)
    at_line = np.abs(driven.fronts - 100.0) < 2.0
    assert 6.0 < driven.speeds[at_line].min() < 9.0
    assert driven.fronts[-1] > 150.0


def test_priority_road_is_not_slowed_for() -> None:
    driven = drive(road(stop_lines=[stop_line(100.0, Control.PRIORITY, yields_to=frozenset())]), 15.0, speed=13.4)
    assert driven.speeds.min() > 13.0


def test_out_of_a_sharp_turn_the_ego_goes_no_faster_than_its_wheels_turn() -> None:
    """The line turns back and straightens as quickly as one is drawn: 0.05 1/m of curvature more or less a metre."""
    bends = np.interp(np.arange(0.0, 200.0), [60.0, 63.6, 78.0, 83.0, 86.0, 92.0], [0.0, 0.18, 0.18, -0.07, -0.07, 0.0])
    headings = np.cumsum(bends)
    line = np.column_stack((np.cumsum(np.cos(headings)), np.cumsum(np.sin(headings))))
    driven = drive(road(line), 17.0, station=40.0, speed=5.0)
    turned = SHAPE.wheelbase * np.abs(driven.states[5:, 6] - driven.states[:-5, 6]) / 0.5
    assert turned.max() < 0.55
    assert driven.speeds[-1] > 10.0
