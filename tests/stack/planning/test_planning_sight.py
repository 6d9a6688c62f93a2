"""Who hides whom at a stop line: a lane with priority comes from the south, and crosses the ego's way at x = 106."""

import functools
import math

import msgspec
import numpy as np
import pytest
from planned_drives import LIMIT, SHAPE, Actor, car, drive, predicted, road, stop_line

from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.messages import Floats, SignalColour
from dvca_sumo.roadmap.route import Approach, Control, Route
from dvca_sumo.stack.planning import PlanningConfig
from dvca_sumo.stack.planning.junctions import Junctions, LineView
from dvca_sumo.stack.planning.path import Path
from dvca_sumo.stack.planning.sight import Sights

UP = math.pi / 2.0
MAJOR = Approach("major_0", Polyline(np.array([[106.0, -86.0], [106.0, -6.0]])), 3.2, LIMIT)
LORRY = {"size": (6.0, 2.5)}
BESIDE = car(3, 79.5, -5.5, size=(50.0, 2.5))  # hides the lane until the ego's middle is as far as its front


def straight(begin: float) -> Path:
    """Along the road from a rear axle at x = `begin`."""
    x: Floats = np.arange(begin, begin + 100.0)
    zeros = np.zeros(len(x))
    rows = np.array((x - begin, x, zeros, zeros, zeros))
    return Path(rows, x - begin, x, zeros, zeros, zeros, left=zeros, right=zeros)


@functools.cache
def crossing(control: Control) -> Route:
    return road(stop_lines=[stop_line(100.0, control, prior=(MAJOR,))])


def seen_at(nose: float, control: Control = Control.YIELD, speed: float = 8.0) -> list[LineView]:
    junctions = Junctions(crossing(control), SHAPE, PlanningConfig())
    return junctions.step(0.0, nose, nose - SHAPE.length, speed, {}, predicted([], 0.0).objects)


def blind(nose: float, *actors: Actor, control: Control = Control.YIELD, speed: float = 8.0) -> list[float]:
    """From where to where [m] an ego with its front bumper at x = `nose` sees nobody come; nothing where it does."""
    sights = Sights(SHAPE, PlanningConfig())
    found = sights.blind(seen_at(nose, control, speed), straight(nose - SHAPE.front), speed, predicted(actors, 0.0))
    return [nose + end for stretch in found for end in stretch]


@pytest.mark.parametrize(("nose", "speed"), [(75.0, 8.0), (90.0, 8.0), (100.0, 2.0), (103.0, 2.0)])
def test_ego_does_not_see_who_comes_until_it_is_past_who_hides_it(nose: float, speed: float) -> None:
    begin, end = blind(nose, BESIDE, speed=speed)
    assert begin == pytest.approx(100.0)
    assert 103.0 < end <= 106.0


def test_where_the_map_has_no_limit_who_comes_is_taken_to_be_as_fast_as_in_a_town() -> None:
    config, found = PlanningConfig(), []
    for limit in (math.inf, config.urban_limit):
        prior = (msgspec.structs.replace(MAJOR, speed_limit=limit),)
        junctions = Junctions(road(stop_lines=[stop_line(100.0, Control.YIELD, prior=prior)]), SHAPE, config)
        sights = Sights(SHAPE, config)
        for time in (0.0, 0.1, 0.2):
            look = predicted([BESIDE], time)
            views = junctions.step(time, 90.0, 85.4, 8.0, {}, look.objects)
            found.append(sights.blind(views, straight(90.0 - SHAPE.front), 8.0, look))
    assert found[:3] == found[3:]
    assert all(found)


@pytest.mark.parametrize(
    ("nose", "control", "hider"),
    [
        (50.0, Control.YIELD, BESIDE),
        (106.5, Control.YIELD, BESIDE),
        (90.0, Control.PRIORITY, BESIDE),
        (90.0, Control.ALL_WAY_STOP, BESIDE),
        (90.0, Control.YIELD, car(3, 101.5, 5.5, **LORRY)),
        (90.0, Control.YIELD, car(3, 109.5, -60.0, heading=UP, **LORRY)),
        (90.0, Control.YIELD, car(3, 101.5, -5.5, size=(6.0, 0.6))),
    ],
    ids=["far before", "past", "others wait", "all stop", "other side", "on the next lane", "bicycle"],
)
def test_it_sees_who_comes(nose: float, control: Control, hider: Actor) -> None:
    assert blind(nose, hider, control=control) == []


@pytest.mark.parametrize(
    ("colour", "is_blind"),
    [(SignalColour.GREEN, False), (SignalColour.PERMISSIVE, True), (SignalColour.RED, False)],
)
def test_at_a_signal_it_depends_on_who_goes_first(colour: SignalColour, is_blind: bool) -> None:  # noqa: FBT001
    junctions = Junctions(crossing(Control.SIGNAL), SHAPE, PlanningConfig())
    look = predicted([BESIDE], 0.0)
    views = junctions.step(0.0, 90.0, 85.4, 5.0, {"J/2": colour}, look.objects)
    assert bool(Sights(SHAPE, PlanningConfig()).blind(views, straight(90.0 - SHAPE.front), 5.0, look)) == is_blind


def test_an_ego_that_has_to_stop_at_a_sign_looks_from_there() -> None:
    assert seen_at(95.0, Control.STOP)[0].stop
    assert blind(95.0, BESIDE, control=Control.STOP, speed=3.0) == []


def test_ego_looks_again_on_its_way_past_the_line() -> None:
    short = car(3, 75.0, -5.5, size=(50.0, 2.5))
    assert blind(95.0, short, speed=3.0) == pytest.approx([100.0, 102.0])


def test_who_is_out_of_sight_far_away_has_come_when_the_ego_is_at_the_line() -> None:
    sights, views, path = Sights(SHAPE, PlanningConfig()), seen_at(75.0), straight(75.0 - SHAPE.front)
    assert not sights.blind(views, path, 8.0, predicted([], 0.0))
    assert sights.blind(views, path, 8.0, predicted([BESIDE], 0.1))


def test_nobody_is_hidden_by_what_hides_no_whole_car() -> None:
    assert blind(99.0, car(3, 103.0, -7.0, size=(1.5, 1.1)), speed=2.0) == []
    assert blind(99.0, car(3, 102.0, -10.0, size=(4.5, 1.8)), speed=2.0) != []


def test_who_will_have_driven_on_hides_nobody() -> None:
    assert blind(85.0, car(3, 98.0, -5.5, speed=12.0, **LORRY)) == []
    assert blind(85.0, car(3, 94.0, -5.5, speed=4.0, **LORRY)) != []


def test_whom_the_ego_has_seen_it_still_knows_of_until_others_may_have_come() -> None:
    sights, views, path = Sights(SHAPE, PlanningConfig()), seen_at(99.0), straight(99.0 - SHAPE.front)
    looks = [predicted([BESIDE] if step else [], 0.1 * step) for step in range(60)]
    is_blind = [bool(sights.blind(views, path, 2.0, look)) for look in looks]
    since = is_blind.index(True)
    assert 0.5 < 0.1 * since < MAJOR.line.length / LIMIT
    assert all(is_blind[since:])


def test_where_the_ego_was_too_far_away_to_see_everybody_somebody_may_be() -> None:
    for first, is_known in ((99.0, True), (56.0, False)):
        sights = Sights(SHAPE, PlanningConfig())
        assert not sights.blind(seen_at(first), straight(first - SHAPE.front), 8.0, predicted([], 0.0))
        found = sights.blind(seen_at(99.0), straight(99.0 - SHAPE.front), 2.0, predicted([BESIDE], 0.1))
        assert bool(found) != is_known


@pytest.mark.parametrize(("nose", "speed"), [(99.0, 8.0), (103.0, 5.0)])
def test_who_is_too_fast_to_feel_its_way_does_not_brake_where_others_come(nose: float, speed: float) -> None:
    assert blind(nose, BESIDE, speed=speed) == []


def test_who_has_seen_that_nobody_comes_and_is_past_the_line_is_not_held_up_again() -> None:
    sights, views, path = Sights(SHAPE, PlanningConfig()), seen_at(101.0), straight(101.0 - SHAPE.front)
    looks = [predicted([BESIDE] if step else [], 0.1 * step) for step in range(60)]
    assert not any(sights.blind(views, path, 1.0, look) for look in looks)


def test_behind_who_is_seen_on_the_lane_itself_nobody_gets_past() -> None:
    seen = car(4, 106.0, -9.0, heading=UP)
    ahead = car(3, 102.0, -12.0, heading=UP, **LORRY)
    assert blind(99.0, ahead, speed=2.0) != []
    assert blind(99.0, ahead, seen, speed=2.0) == []


@pytest.mark.parametrize(
    ("hider", "slowest"), [(BESIDE, (1.0, 2.6)), (car(3, 101.5, 5.5, **LORRY), (7.0, 9.0))], ids=["hidden", "in sight"]
)
def test_an_ego_that_sees_nobody_come_feels_its_way_past_the_line(hider: Actor, slowest: tuple[float, float]) -> None:
    driven = drive(crossing(Control.YIELD), 20.0, speed=13.0, actors=[hider])
    at_line = (driven.fronts > 99.5) & (driven.fronts < 103.0)
    assert slowest[0] < driven.speeds[at_line].min() < slowest[1]
    assert driven.fronts[-1] > 130.0
