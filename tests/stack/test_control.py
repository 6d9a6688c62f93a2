"""The controller on the vehicle model: replanned at 10 Hz from the believed pose, as a planner would."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

from dvca_sumo.messages import TRAJECTORY_TIMES, Floats, LocalizationEstimate, Trajectory, VehicleShape
from dvca_sumo.stack.control import ControlConfig, TrackingController
from dvca_sumo.truth import EgoTruth
from dvca_sumo.world.vehicle import Vehicle, VehicleLimits

SHAPE = VehicleShape(length=4.5, width=1.8, wheelbase=2.7, rear_overhang=0.9)
CONFIG = ControlConfig()


class Path(NamedTuple):
    """A path sampled every 0.05 m: stations, x, y, heading, curvature."""

    rows: Floats

    @classmethod
    def from_curvature(cls, curvature: Callable[[Floats], Floats], length: float) -> "Path":
        s = np.arange(0.0, length, 0.05)
        k = curvature(s)
        heading = np.concatenate([[0.0], np.cumsum(0.5 * (k[1:] + k[:-1]) * 0.05)])
        middle = 0.5 * (heading[1:] + heading[:-1])
        x = np.concatenate([[0.0], np.cumsum(np.cos(middle) * 0.05)])
        y = np.concatenate([[0.0], np.cumsum(np.sin(middle) * 0.05)])
        return cls(np.stack([s, x, y, heading, k], axis=1))

    def station(self, x: float, y: float) -> float:
        return float(self.rows[np.argmin(np.hypot(self.rows[:, 1] - x, self.rows[:, 2] - y)), 0])

    def offset(self, x: float, y: float) -> float:
        return float(np.min(np.hypot(self.rows[:, 1] - x, self.rows[:, 2] - y)))

    def trajectory(self, time: float, stations: Floats, speeds: Floats, accelerations: Floats) -> Trajectory:
        x, y, heading, k = (np.interp(stations, self.rows[:, 0], self.rows[:, c]) for c in (1, 2, 3, 4))
        points = np.stack([TRAJECTORY_TIMES, x, y, heading, speeds, accelerations, k], axis=1)
        return Trajectory(time, points, "test")


def bend(radius: float, start: float, end: float, ramp: float) -> Callable[[Floats], Floats]:
    """Straight, clothoid of length `ramp`, arc, clothoid, straight."""
    return lambda s: np.interp(s, [start, start + ramp, end - ramp, end], [0.0, 1 / radius, 1 / radius, 0.0])


def lane_change(start: float, end: float) -> Callable[[Floats], Floats]:
    """3.5 m to the left: one period of a sine."""
    length = end - start
    peak = 2.0 * math.pi * 3.5 / length**2
    return lambda s: peak * np.sin(2.0 * np.pi * (np.clip(s, start, end) - start) / length)


def believed(truth: EgoTruth) -> LocalizationEstimate:
    return LocalizationEstimate(
        truth.time, truth.x, truth.y, truth.heading, truth.speed, truth.acceleration, truth.yaw_rate
    )


def at_rest_or_speed(speed: float, y: float = 0.0, heading: float = 0.0) -> Vehicle:
    return Vehicle(SHAPE, VehicleLimits(), EgoTruth(0.0, 0.0, y, heading, speed, 0.0, 0.0, 0.0))


def drive(
    vehicle: Vehicle,
    plan: Callable[[EgoTruth], Trajectory | None],
    seconds: float,
) -> list[EgoTruth]:
    controller = TrackingController(CONFIG, SHAPE)
    passed = []
    trajectory = None
    for index in range(round(seconds * 100)):
        if index % 10 == 0:
            trajectory = plan(vehicle.truth) or trajectory
        command = controller.step(believed(vehicle.truth), trajectory)
        passed.append(vehicle.advance(command, 0.01))
    return passed


def constant_speed(path: Path, speed: float) -> Callable[[EgoTruth], Trajectory]:
    """Replans from where the ego is along the path, on the path."""

    def plan(truth: EgoTruth) -> Trajectory:
        s = path.station(truth.x, truth.y) + speed * TRAJECTORY_TIMES
        return path.trajectory(truth.time, s, np.full(81, speed), np.zeros(81))

    return plan


@pytest.mark.parametrize(
    ("path", "speed", "seconds", "allowed"),
    [
        (Path.from_curvature(lambda s: 0.0 * s, 500.0), 35.0, 6.0, 0.01),
        (Path.from_curvature(bend(20.0, 15.0, 80.0, 5.0), 150.0), 6.0, 15.0, 0.15),
        (Path.from_curvature(bend(-20.0, 15.0, 80.0, 1.0), 150.0), 6.0, 15.0, 0.2),
        (Path.from_curvature(bend(8.0, 10.0, 24.6, 2.0), 80.0), 4.0, 12.0, 0.25),
        (Path.from_curvature(bend(400.0, 20.0, 300.0, 30.0), 500.0), 30.0, 10.0, 0.15),
        (Path.from_curvature(lane_change(30.0, 75.0), 300.0), 15.0, 8.0, 0.15),
    ],
    ids=["straight at 35", "radius 20", "radius 20, abrupt", "junction turn", "motorway bend", "lane change"],
)
def test_stays_on_the_path(path: Path, speed: float, seconds: float, allowed: float) -> None:
    passed = drive(at_rest_or_speed(speed), constant_speed(path, speed), seconds)
    assert max(path.offset(t.x, t.y) for t in passed[::5]) < allowed + 0.025  # half a sample of the path
    assert passed[-1].speed == pytest.approx(speed, abs=0.2)


@pytest.mark.parametrize("speed", [0.5, 2.0, 8.0, 20.0, 35.0])
def test_a_lateral_error_dies_out_without_swinging(speed: float) -> None:
    path = Path.from_curvature(lambda s: 0.0 * s, 600.0)
    passed = drive(at_rest_or_speed(speed, y=0.5, heading=0.02), constant_speed(path, speed), max(6.0, 16.0 / speed))
    assert abs(passed[-1].y) < 0.05
    assert min(t.y for t in passed) > -0.1
    assert abs(passed[-1].heading) < 0.02


@pytest.mark.parametrize(("y", "heading"), [(8.0, 0.0), (-4.0, 1.2), (0.0, -2.5)])
def test_far_off_the_path_it_comes_back(y: float, heading: float) -> None:
    path = Path.from_curvature(lambda s: 0.0 * s, 300.0)
    passed = drive(at_rest_or_speed(6.0, y=y, heading=heading), constant_speed(path, 6.0), 15.0)
    assert abs(passed[-1].y) < 0.1


def stopping(path: Path, at: float, *, replanned: bool) -> Callable[[EgoTruth], Trajectory | None]:
    """Brakes at a constant rate to a stop at station `at`; made anew each time, or once only."""

    def plan(truth: EgoTruth) -> Trajectory | None:
        if truth.time > 0.0 and not replanned:
            return None
        s = path.station(truth.x, truth.y)
        v = truth.speed
        room = max(at - s, 1e-3)
        rate = v * v / (2.0 * room)
        end = v / rate if v > 0.0 else 0.0
        t = np.minimum(TRAJECTORY_TIMES, end)
        moving = end > TRAJECTORY_TIMES
        speeds, accelerations = np.where(moving, v - rate * t, 0.0), np.where(moving, -rate, 0.0)
        return path.trajectory(truth.time, s + v * t - 0.5 * rate * t * t, speeds, accelerations)

    return plan


@pytest.mark.parametrize("replanned", [True, False])
@pytest.mark.parametrize(("speed", "at"), [(10.0, 25.0), (13.9, 50.0), (3.0, 6.0), (5.0, 5.0)])
def test_stops_at_the_standing_end_and_stays(speed: float, at: float, *, replanned: bool) -> None:
    path = Path.from_curvature(lambda s: 0.0 * s, 100.0)
    passed = drive(at_rest_or_speed(speed), stopping(path, at, replanned=replanned), 7.9)
    assert passed[-1].x == pytest.approx(at, abs=0.3)
    assert [t.x for t in passed[-50:]] == [passed[-1].x] * 50


def test_a_trajectory_that_stands_a_little_ahead_is_not_crept_towards() -> None:
    path = Path.from_curvature(lambda s: 0.0 * s, 100.0)
    standing = path.trajectory(0.0, np.full(81, 0.8), np.zeros(81), np.zeros(81))
    passed = drive(at_rest_or_speed(0.0), lambda _: standing, 5.0)
    assert passed[-1].x == 0.0


@pytest.mark.parametrize(("set_off", "seconds"), [(0.5, 0.75), (0.7, 0.6), (1.0, 0.65)])
def test_told_to_stand_while_it_sets_off_it_does_at_once(set_off: float, seconds: float) -> None:
    """By a trajectory that brakes as hard as tyres allow: it ends before the brakes answer."""
    path, braking = Path.from_curvature(lambda s: 0.0 * s, 100.0), 5.0

    def plan(truth: EgoTruth) -> Trajectory:
        t = TRAJECTORY_TIMES if truth.time < set_off - 0.01 else np.minimum(TRAJECTORY_TIMES, truth.speed / braking)
        rate = 2.0 if truth.time < set_off - 0.01 else -braking
        speeds = truth.speed + rate * t
        accelerations = np.where(truth.speed + rate * TRAJECTORY_TIMES > 0.0, rate, 0.0)
        return path.trajectory(truth.time, truth.x + truth.speed * t + 0.5 * rate * t * t, speeds, accelerations)

    passed = drive(at_rest_or_speed(0.0), plan, set_off + seconds)
    assert passed[round(100 * set_off) - 1].speed > 0.4
    assert passed[-1].speed == 0.0


def test_sets_off_from_standstill_and_reaches_the_speed_asked_for() -> None:
    path = Path.from_curvature(lambda s: 0.0 * s, 200.0)

    def plan(truth: EgoTruth) -> Trajectory:
        v = np.minimum(8.0, truth.speed + 1.5 * TRAJECTORY_TIMES)
        s = path.station(truth.x, truth.y) + np.concatenate([[0.0], np.cumsum(0.05 * (v[1:] + v[:-1]))])
        return path.trajectory(truth.time, s, v, np.where(v < 8.0, 1.5, 0.0))

    passed = drive(at_rest_or_speed(0.0), plan, 10.0)
    assert passed[-1].speed == pytest.approx(8.0, abs=0.1)
    assert max(t.speed for t in passed) < 8.3
    assert passed[100].speed > 0.8


def test_behind_the_trajectory_it_catches_up() -> None:
    path = Path.from_curvature(lambda s: 0.0 * s, 300.0)
    ahead = path.trajectory(0.0, 2.0 + 10.0 * TRAJECTORY_TIMES, np.full(81, 10.0), np.zeros(81))
    passed = drive(at_rest_or_speed(10.0), lambda _: ahead, 7.9)
    assert passed[-1].x - 10.0 * passed[-1].time == pytest.approx(2.0, abs=0.4)


@pytest.mark.parametrize(
    "trajectory",
    [
        None,
        Path.from_curvature(bend(8.0, 0.0, 50.0, 1.0), 100.0).trajectory(
            -8.1, 4.0 * TRAJECTORY_TIMES, np.full(81, 4.0), np.zeros(81)
        ),
    ],
    ids=["none", "past its horizon"],
)
def test_with_nothing_to_follow_it_stops_straight_ahead(trajectory: Trajectory | None) -> None:
    passed = drive(at_rest_or_speed(10.0), lambda _: trajectory, 6.0)
    assert passed[-1].speed == 0.0
    assert min(t.acceleration for t in passed) == pytest.approx(-CONFIG.stop_braking, abs=0.01)
    assert all(t.steering == 0.0 for t in passed)


@pytest.mark.parametrize("broken", ["pose", "trajectory"])
def test_a_pose_or_trajectory_that_is_not_finite_is_not_followed(broken: str) -> None:
    path = Path.from_curvature(lambda s: 0.0 * s, 300.0)
    trajectory = path.trajectory(0.0, 10.0 * TRAJECTORY_TIMES, np.full(81, 10.0), np.zeros(81))
    if broken == "trajectory":
        trajectory.points[40, 2] = math.nan
    pose = LocalizationEstimate(0.1, 1.0, math.nan if broken == "pose" else 0.5, 0.0, 10.0, 0.0, 0.0)
    command = TrackingController(CONFIG, SHAPE).step(pose, trajectory)
    assert (command.acceleration, command.steering) == (-CONFIG.stop_braking, 0.0)


def test_just_within_its_horizon_a_trajectory_is_still_followed() -> None:
    path = Path.from_curvature(lambda s: 0.0 * s, 300.0)
    trajectory = path.trajectory(0.0, 10.0 * TRAJECTORY_TIMES, np.full(81, 10.0), np.zeros(81))
    controller = TrackingController(CONFIG, SHAPE)
    at_end = LocalizationEstimate(8.0, 80.0, 0.0, 0.0, 10.0, 0.0, 0.0)
    assert controller.step(at_end, trajectory).acceleration == pytest.approx(0.0, abs=1e-9)


def test_commands_stay_within_the_limits_however_wrong_the_pose() -> None:
    path = Path.from_curvature(bend(20.0, 5.0, 80.0, 5.0), 150.0)
    trajectory = path.trajectory(0.0, 6.0 * TRAJECTORY_TIMES, np.full(81, 6.0), np.zeros(81))
    controller = TrackingController(CONFIG, SHAPE)
    for x, y, heading, speed in [(500.0, -300.0, 3.0, 35.0), (-50.0, 40.0, -3.0, 0.0), (10.0, 0.0, 1.6, 20.0)]:
        command = controller.step(LocalizationEstimate(1.0, x, y, heading, speed, 0.0, 0.0), trajectory)
        assert -CONFIG.max_braking <= command.acceleration <= CONFIG.max_acceleration
        curvature = math.tan(command.steering) / SHAPE.wheelbase
        assert abs(curvature) * speed * speed <= CONFIG.max_lateral_acceleration + 1e-9
        assert abs(command.steering) <= CONFIG.max_steering


def test_a_heading_given_in_another_turn_changes_nothing() -> None:
    path = Path.from_curvature(lambda s: 0.0 * s, 300.0)
    trajectory = path.trajectory(0.0, 10.0 * TRAJECTORY_TIMES, np.full(81, 10.0), np.zeros(81))
    turned = Trajectory(0.0, trajectory.points + np.array([0, 0, 0, 2 * np.pi, 0, 0, 0]), "test")
    pose = LocalizationEstimate(0.5, 5.0, 0.3, -0.05, 10.0, 0.0, 0.0)
    straight = TrackingController(CONFIG, SHAPE).step(pose, trajectory)
    assert TrackingController(CONFIG, SHAPE).step(pose, turned).steering == pytest.approx(straight.steering)


def test_a_trajectory_through_west_is_followed_across_the_wrap_of_its_heading() -> None:
    path = Path.from_curvature(bend(20.0, 0.0, 90.0, 5.0), 150.0)
    plan = constant_speed(path, 6.0)

    def wrapping(truth: EgoTruth) -> Trajectory:
        points = plan(truth).points.copy()
        points[:, 3] = np.angle(np.exp(1j * points[:, 3]))
        return Trajectory(truth.time, points, "test")

    passed = drive(at_rest_or_speed(6.0), wrapping, 15.0)
    assert max(path.offset(t.x, t.y) for t in passed[::5]) < 0.15
