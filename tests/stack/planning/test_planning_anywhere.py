"""What holds on any road, whoever stands along it: drawn bends, lanes, people, cones and parked cars."""

import math

import msgspec
import numpy as np
import pytest
from planned_drives import SHAPE, Actor, bent_points, car, cone, drive, person, road, sweeps

from dvca_sumo.messages import Floats
from dvca_sumo.roadmap.route import Route
from dvca_sumo.world import VehicleLimits

LANE, EDGE = 3.2, 1.6  # [m]
LENGTH, BEFORE, EASING = 300, 40, 4  # [m]


def drawn_points(draws: np.random.Generator) -> Floats:
    """A straight begin, then up to three bends, tight ones too, with short straight pieces between."""
    curvatures, begin = np.zeros(LENGTH), BEFORE
    for _ in range(draws.integers(1, 4)):
        radius, angle, side = draws.choice([7.0, 9.0, 12.0, 16.0, 25.0]), draws.uniform(0.5, 1.4), draws.choice([-1, 1])
        metres = int(radius * angle) + EASING
        bend = np.interp(
            np.arange(metres + 2 * EASING), [0, EASING, metres + EASING, metres + 2 * EASING], [0, 1, 1, 0]
        )
        curvatures[begin : begin + len(bend)] = side * bend / radius
        begin += len(bend) + int(draws.integers(2, 25))
    return bent_points(curvatures)


def drawn_route(draws: np.random.Generator) -> tuple[Route, int, int]:
    """A route that does not come by itself again, and how many lanes are left and right of its own."""
    while True:
        points = drawn_points(draws)
        stations = np.arange(len(points))
        apart = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
        if apart[np.abs(stations[:, None] - stations[None]) > 25].min() > 15.0:
            break
    left, right = int(draws.integers(0, 2)), int(draws.integers(0, 2))
    route = road(points, lanes_left=left)
    return msgspec.structs.replace(route, road_right=route.road_right - LANE * right, start=20.0), left, right


def drawn_actors(draws: np.random.Generator, route: Route) -> list[Actor]:
    """Up to three who stand in the lane or beside it, some aslant, none of them just before the ego."""
    actors = []
    for track in range(draws.integers(0, 4)):
        station, aside = draws.uniform(40.0, 100.0), draws.uniform(1.2, 3.6) * draws.choice([-1, 1])
        x, y, along = route.line.poses(np.array([station]), np.array([aside]))[0].tolist()
        heading = along + draws.choice([0.0, 0.0, 0.3, -0.3])
        size = (float(draws.choice([4.5, 8.0])), 1.8)
        kinds = (person(track, x, y), cone(track, x, y), car(track, x, y, heading=heading, size=size))
        actors.append(kinds[draws.integers(0, 3)])
    return actors


TOO_SHARP = pytest.mark.xfail(strict=True, reason="from one nudge to the next, how the line bends is not counted in")


@pytest.mark.parametrize("seed", [*range(48), pytest.param(48, marks=TOO_SHARP), *range(49, 60)])
def test_body_touches_nobody_and_stays_on_the_road_and_the_wheels_turn_no_farther_than_they_go(seed: int) -> None:
    """From rest on the ego's own lane or the next one."""
    draws = np.random.default_rng(seed)
    route, left, right = drawn_route(draws)
    actors, aside = drawn_actors(draws, route), LANE * draws.integers(-right, left + 1)
    driven = drive(route, 25.0, station=20.0, aside=aside, actors=actors)
    usual = sweeps(drive(route, 25.0, station=20.0), route)
    swept = sweeps(driven, route)
    assert driven.clearances.min() > 0.25
    assert swept.max() < max(EDGE + LANE * left, usual.max()) + 0.1
    assert swept.min() > min(-EDGE - LANE * right, usual.min()) - 0.1
    farthest = math.tan(VehicleLimits().max_steering) / SHAPE.wheelbase
    assert max(float(np.abs(plan.points[:, 6]).max()) for plan in driven.trajectories) < farthest + 0.02
