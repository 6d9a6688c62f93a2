"""The bicycle model against circle and straight-line formulas, its limits, and its refusals."""

import math

import pytest

from dvca_sumo.messages import ControlCommand, PoseStep, VehicleShape
from dvca_sumo.truth import EgoTruth
from dvca_sumo.world.vehicle import ControlCommandError, Vehicle, VehicleLimits

SHAPE = VehicleShape(length=4.5, width=1.8, wheelbase=2.7, rear_overhang=0.9)
LIMITS = VehicleLimits()


def standing_or_rolling(*, speed: float = 0.0, acceleration: float = 0.0, steering: float = 0.0) -> Vehicle:
    yaw_rate = speed * math.tan(steering) / SHAPE.wheelbase
    start = EgoTruth(0.0, 0.0, 0.0, 0.0, speed, acceleration, yaw_rate, steering)
    return Vehicle(SHAPE, LIMITS, start)


def driven(vehicle: Vehicle, acceleration: float, steering: float, steps: int) -> EgoTruth:
    for _ in range(steps):
        vehicle.advance(ControlCommand(vehicle.truth.time, acceleration, steering), 0.01)
    return vehicle.truth


def test_held_steering_drives_a_circle_of_the_bicycle_radius() -> None:
    radius = SHAPE.wheelbase / math.tan(0.2)
    vehicle = standing_or_rolling(speed=5.0, steering=0.2)
    for _ in range(500):
        truth = driven(vehicle, 0.0, 0.2, 1)
        assert math.hypot(truth.x, truth.y - radius) == pytest.approx(radius, abs=1e-9)
    assert truth.yaw_rate == pytest.approx(5.0 / radius)


def test_a_coarse_step_ends_where_many_fine_ones_do_on_an_arc() -> None:
    coarse, fine = (standing_or_rolling(speed=5.0, steering=0.3) for _ in range(2))
    coarse.advance(ControlCommand(0.0, 0.0, 0.3), 1.0)
    end = driven(fine, 0.0, 0.3, 100)
    assert (coarse.truth.x, coarse.truth.y, coarse.truth.heading) == pytest.approx((end.x, end.y, end.heading))


def test_acceleration_lags_by_its_time_constant() -> None:
    truth = driven(standing_or_rolling(), 2.0, 0.0, 20)
    assert truth.acceleration == pytest.approx(2.0 * (1.0 - math.exp(-1.0)))


def test_commands_beyond_the_limits_are_cut() -> None:
    vehicle = standing_or_rolling(speed=30.0)
    truth = driven(vehicle, -50.0, 5.0, 10)
    assert truth.steering == pytest.approx(LIMITS.max_steering_rate * 0.1)
    truth = driven(vehicle, -50.0, 5.0, 200)
    assert truth.steering <= LIMITS.max_steering
    assert truth.acceleration == pytest.approx(-LIMITS.max_braking, rel=1e-3)
    assert driven(standing_or_rolling(), 50.0, 0.0, 300).acceleration == pytest.approx(LIMITS.max_acceleration)


def test_braking_ends_at_standstill_after_the_braking_distance_and_never_reverses() -> None:
    vehicle = standing_or_rolling(speed=10.0, acceleration=-4.0)
    positions = [driven(vehicle, -4.0, 0.0, 1).x for _ in range(400)]
    assert positions == sorted(positions)
    assert positions[-1] == pytest.approx(10.0**2 / (2 * 4.0), abs=1e-6)
    assert vehicle.truth.speed == vehicle.truth.acceleration == vehicle.truth.yaw_rate == 0.0


def test_standing_without_acceleration_nothing_moves_but_time() -> None:
    truth = driven(standing_or_rolling(), 0.0, 0.0, 100)
    assert (truth.x, truth.y, truth.heading, truth.speed) == (0.0, 0.0, 0.0, 0.0)
    assert truth.time == 1.0


def test_an_exact_step_is_made_exactly_in_the_frame_before_it() -> None:
    vehicle = Vehicle(SHAPE, LIMITS, EgoTruth(3.0, 10.0, 20.0, math.pi / 2, 8.0, 0.0, 0.0, 0.0))
    step = PoseStep(forward=1.0, left=0.5, turn=math.pi, acceleration=-7.0)
    truth = vehicle.advance(ControlCommand(3.0, 2.0, 0.5, step), 0.1)
    assert (truth.x, truth.y, truth.time) == pytest.approx((9.5, 21.0, 3.1))
    assert truth.heading == pytest.approx(-math.pi / 2)
    assert (truth.speed, truth.acceleration, truth.yaw_rate) == pytest.approx((10.0, -7.0, 10.0 * math.pi))
    assert truth.steering == LIMITS.max_steering


def test_after_an_exact_step_the_actuators_go_on_from_it() -> None:
    vehicle = standing_or_rolling(speed=8.0)
    vehicle.advance(ControlCommand(0.0, 0.0, 0.0, PoseStep(0.08, 0.0, 0.004, -2.0)), 0.01)
    truth = driven(vehicle, -2.0, math.atan(SHAPE.wheelbase * 0.05), 1)
    assert truth.acceleration == pytest.approx(-2.0)
    assert truth.yaw_rate == pytest.approx(truth.speed * 0.05)


@pytest.mark.parametrize(
    "command",
    [
        ControlCommand(1.0, math.nan, 0.0),
        ControlCommand(1.0, 0.0, math.inf),
        ControlCommand(1.0, 0.0, 0.0, PoseStep(math.nan, 0.0, 0.0, 0.0)),
    ],
)
def test_a_command_that_is_not_finite_is_refused_and_changes_nothing(command: ControlCommand) -> None:
    vehicle = standing_or_rolling(speed=8.0)
    before = vehicle.truth
    with pytest.raises(ControlCommandError, match=r"nan|inf"):
        vehicle.advance(command, 0.01)
    assert vehicle.truth is before
