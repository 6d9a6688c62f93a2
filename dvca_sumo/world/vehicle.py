"""The ego's motion: a kinematic bicycle at the rear axle behind lagging, limited actuators."""

import math

import msgspec

from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.messages import ControlCommand, PoseStep, VehicleShape
from dvca_sumo.truth import EgoTruth


class ControlCommandError(ValueError):
    """A command held a number that no actuator can follow."""


class VehicleLimits(msgspec.Struct, frozen=True):
    """What the actuators can do."""

    max_steering: float = 0.55  # [rad] front wheel angle, to either side
    max_steering_rate: float = 0.6  # [rad/s] at the road wheel
    steering_lag: float = 0.1  # [s] time constant
    max_acceleration: float = 3.0  # [m/s^2]
    max_braking: float = 8.0  # [m/s^2] positive number
    acceleration_lag: float = 0.2  # [s] time constant


class Vehicle:
    """The ego's body between two world steps.

    It never reverses under actuator commands, and it stands still until it is accelerated. Time is kept
    to the nanosecond, so that sub-steps add up to the world's step without drift.
    """

    def __init__(self, shape: VehicleShape, limits: VehicleLimits, start: EgoTruth) -> None:
        self._wheelbase = shape.wheelbase
        self._limits = limits
        self._drive = start.acceleration  # [m/s^2] what the drive train asks for, also while standing
        self._truth = start

    @property
    def truth(self) -> EgoTruth:
        """The true motion after the last advance."""
        return self._truth

    def advance(self, command: ControlCommand, dt: float) -> EgoTruth:
        """Moves on by `dt` [s] under `command` and returns the new truth.

        Raises:
            ControlCommandError: a number in the command is not finite; the vehicle has not moved.
        """
        if command.exact is not None:
            self._truth = self._moved_exactly(command.exact, dt)
        else:
            self._truth = self._driven(command, dt)
        return self._truth

    def _driven(self, command: ControlCommand, dt: float) -> EgoTruth:
        if not (math.isfinite(command.acceleration) and math.isfinite(command.steering)):
            raise ControlCommandError(
                f"control command at {command.time:.2f} s: acceleration and steering must be finite, "
                f"got {command.acceleration} m/s^2 and {command.steering} rad"
            )
        before = self._truth
        steering = self._steered(command.steering, dt)
        drive = self._driven_at(command.acceleration, dt)
        speed = before.speed + drive * dt
        if speed > 0.0:
            distance, acceleration = 0.5 * (before.speed + speed) * dt, drive
        else:  # comes to rest within the step, or stays so
            distance = before.speed * before.speed / (-2.0 * drive) if before.speed > 0.0 else 0.0
            speed = acceleration = 0.0
        # Steering is held over the step at its mean, so the path is an arc: exact by its chord.
        turn = distance * math.tan(0.5 * (before.steering + steering)) / self._wheelbase
        half = 0.5 * turn
        chord = distance * math.sin(half) / half if half else distance
        self._drive = drive
        return EgoTruth(
            time=round(before.time + dt, 9),
            x=before.x + chord * math.cos(before.heading + half),
            y=before.y + chord * math.sin(before.heading + half),
            heading=wrapped(before.heading + turn),
            speed=speed,
            acceleration=acceleration,
            yaw_rate=speed * math.tan(steering) / self._wheelbase,
            steering=steering,
        )

    def _steered(self, wanted: float, dt: float) -> float:
        """The road wheel angle after `dt`: first-order lag, then rate limit."""
        limits, steering = self._limits, self._truth.steering
        target = min(limits.max_steering, max(-limits.max_steering, wanted))
        change = (target - steering) * (1.0 - math.exp(-dt / limits.steering_lag))
        most = limits.max_steering_rate * dt
        return steering + min(most, max(-most, change))

    def _driven_at(self, wanted: float, dt: float) -> float:
        """The drive train's acceleration after `dt`: first-order lag towards what is possible."""
        limits = self._limits
        target = min(limits.max_acceleration, max(-limits.max_braking, wanted))
        return self._drive + (target - self._drive) * (1.0 - math.exp(-dt / limits.acceleration_lag))

    def _moved_exactly(self, step: PoseStep, dt: float) -> EgoTruth:
        if not math.isfinite(step.forward + step.left + step.turn + step.acceleration):
            raise ControlCommandError(f"exact control command: every number must be finite, got {step}")
        before, most = self._truth, self._limits.max_steering
        cos, sin = math.cos(before.heading), math.sin(before.heading)
        steering = math.atan2(self._wheelbase * step.turn, step.forward) if step.forward > 0.0 else before.steering
        self._drive = step.acceleration
        return EgoTruth(
            time=round(before.time + dt, 9),
            x=before.x + step.forward * cos - step.left * sin,
            y=before.y + step.forward * sin + step.left * cos,
            heading=wrapped(before.heading + step.turn),
            speed=max(0.0, step.forward / dt),
            acceleration=step.acceleration,
            yaw_rate=step.turn / dt,
            steering=min(most, max(-most, steering)),
        )
