"""Localization: wheel odometry and inertial unit (100 Hz) fused with satellite fixes (10 Hz).

An extended Kalman filter over x, y, heading, odometry scale and yaw-rate bias. The mean moves at
100 Hz in plain floats. The covariance moves once per fix, and loses nothing by it: over the interval
between fixes an error in heading turns the whole travelled increment rigidly, and an error in scale
stretches it, so the accumulated increment is all that the interval's Jacobian needs.
"""

import math

import msgspec
import numpy as np

from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.messages import Floats, LocalizationEstimate, VehicleShape
from dvca_sumo.stack.protocols import GnssFix, OdometryReading


class LocalizationConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the filter takes its sensors and its vehicle to be."""

    position_sigma: float = 0.25  # [m] of a fix, each axis
    first_position_sigma: float = 0.05  # [m] of the first fix, each axis
    heading_sigma: float = 0.005  # [rad] of a fix
    scale_sigma: float = 0.01  # share of the speed: odometry scale before anything is known
    yaw_bias_sigma: float = 0.005  # [rad/s] yaw-rate bias before anything is known
    speed_noise: float = 0.005  # share of the speed, each odometry reading
    acceleration_sigma: float = 0.1  # [m/s^2] each inertial reading
    acceleration_time: float = 0.05  # [s] time constant of the smoothed acceleration
    position_walk: float = 0.03  # [m/sqrt(s)] slip and whatever else dead reckoning does not know
    heading_walk: float = 0.001  # [rad/sqrt(s)]
    yaw_bias_walk: float = 1e-4  # [rad/s/sqrt(s)]
    gate: float = 16.27  # squared Mahalanobis distance of the most distant fix believed (chi2, 3 dof, 99.9 %)
    lost_fixes: int = 10  # fixes refused in a row after which the filter starts anew from the next
    largest_steering: float = 0.7  # [rad] bounds the yaw rate at a given speed


class LocalizationFilter:
    """Believed pose from odometry and fixes."""

    def __init__(self, config: LocalizationConfig, shape: VehicleShape) -> None:
        self._config = config
        self._largest_curvature = math.tan(config.largest_steering) / shape.wheelbase
        self._measurement_noise = np.diag([config.position_sigma**2] * 2 + [config.heading_sigma**2])
        self._walks = np.diag(
            [config.position_walk**2, config.position_walk**2, config.heading_walk**2, 0.0, config.yaw_bias_walk**2]
        )
        # Unknown until the first fix.
        self._x = self._y = self._heading = math.nan
        self._scale = 1.0
        self._yaw_bias = 0.0
        self._covariance = np.zeros((5, 5))
        self._refused = 0
        # The last reading and, since the last fix: the way made in map axes, the time it took, and how much
        # of that time the measured yaw rate was believed.
        self._time = math.nan
        self._wheel_speed = 0.0
        self._wheel_variance = 1.0
        self._acceleration = 0.0
        self._yaw_rate = 0.0
        self._way_x = self._way_y = self._way_time = self._turning_time = 0.0

    def step(self, odometry: OdometryReading, fix: GnssFix | None) -> LocalizationEstimate:
        """One cycle. Until the first fix has come the pose is unknown: x, y and heading are nan."""
        self._advance(odometry)
        if fix is not None:
            if math.isnan(self._x):
                self._start(fix, self._config.first_position_sigma)
            else:
                self._correct(fix)
        return LocalizationEstimate(
            odometry.time,
            self._x,
            self._y,
            self._heading,
            self._wheel_speed * self._scale,
            self._acceleration,
            self._yaw_rate,
        )

    def _advance(self, odometry: OdometryReading) -> None:
        """Dead reckoning from the last reading to this one, by the mean speed and yaw rate of both."""
        if math.isnan(self._time):
            self._time, self._wheel_speed, self._acceleration = odometry.time, odometry.speed, odometry.acceleration
            return
        dt = odometry.time - self._time
        speed_before, yaw_rate_before = self._wheel_speed, self._yaw_rate
        self._time = odometry.time
        self._fuse_speed(odometry, dt)
        self._bound_yaw_rate(odometry, dt)

        turn = 0.5 * (yaw_rate_before + self._yaw_rate) * dt
        way = 0.5 * (speed_before + self._wheel_speed) * self._scale * dt
        direction = self._heading + 0.5 * turn
        dx, dy = way * math.cos(direction), way * math.sin(direction)
        self._x += dx
        self._y += dy
        self._heading = wrapped(self._heading + turn)
        self._way_x += dx
        self._way_y += dy
        self._way_time += dt

    def _fuse_speed(self, odometry: OdometryReading, dt: float) -> None:
        """Scalar Kalman filter: accelerated by the inertial unit, corrected by the wheels (which are exact at rest)."""
        config = self._config
        predicted = self._wheel_speed + odometry.acceleration * dt
        variance = self._wheel_variance + (config.acceleration_sigma * dt) ** 2 + 1e-12
        gain = variance / (variance + (config.speed_noise * odometry.speed) ** 2)
        self._wheel_speed = predicted + gain * (odometry.speed - predicted)
        self._wheel_variance = (1.0 - gain) * variance
        self._acceleration += (odometry.acceleration - self._acceleration) * dt / (dt + config.acceleration_time)

    def _bound_yaw_rate(self, odometry: OdometryReading, dt: float) -> None:
        """The measured yaw rate within what the steering allows: a car that stands does not turn."""
        bound = abs(odometry.speed) * self._largest_curvature
        measured = odometry.yaw_rate - self._yaw_bias
        self._yaw_rate = min(max(measured, -bound), bound)
        if self._yaw_rate == measured:
            self._turning_time += dt

    def _start(self, fix: GnssFix, position_sigma: float) -> None:
        config = self._config
        self._x, self._y, self._heading = fix.x, fix.y, fix.heading
        self._covariance = np.diag(
            [
                position_sigma**2,
                position_sigma**2,
                config.heading_sigma**2,
                config.scale_sigma**2,
                config.yaw_bias_sigma**2,
            ]
        )
        self._refused = 0
        self._way_x = self._way_y = self._way_time = self._turning_time = 0.0

    def _correct(self, fix: GnssFix) -> None:
        """Kalman update with a fix, unless it is too far off to be believed."""
        covariance = self._propagated_covariance()
        self._way_x = self._way_y = self._way_time = self._turning_time = 0.0
        self._covariance = covariance
        residual = np.array([fix.x - self._x, fix.y - self._y, wrapped(fix.heading - self._heading)])
        information = _inverse(covariance[:3, :3] + self._measurement_noise)
        if residual @ information @ residual > self._config.gate:
            self._refused += 1
            if self._refused >= self._config.lost_fixes:
                self._start(fix, self._config.position_sigma)
            return
        self._refused = 0
        gain = covariance[:, :3] @ information
        self._covariance = covariance - gain @ covariance[:3]
        dx, dy, turn, stretch, yaw_bias = (gain @ residual).tolist()
        self._x += dx
        self._y += dy
        self._heading = wrapped(self._heading + turn)
        self._scale += stretch
        self._yaw_bias += yaw_bias

    def _propagated_covariance(self) -> Floats:
        """Covariance at the time of this fix, from that after the last one: F P F' + Q.

        A bias acts on heading as minus the time it was integrated, and so on position as a turn of the way
        by half of that (exact at steady speed).
        """
        way_x, way_y, turning = self._way_x, self._way_y, self._turning_time
        jacobian = np.array(
            [
                [1.0, 0.0, -way_y, way_x, 0.5 * turning * way_y],
                [0.0, 1.0, way_x, way_y, -0.5 * turning * way_x],
                [0.0, 0.0, 1.0, 0.0, -turning],
                [0.0, 0.0, 0.0, 1.0, 0.0],
                [0.0, 0.0, 0.0, 0.0, 1.0],
            ]
        )
        propagated: Floats = jacobian @ self._covariance @ jacobian.T + self._walks * self._way_time
        return propagated


def _inverse(symmetric: Floats) -> Floats:
    """Of a symmetric matrix (3, 3), by its cofactors."""
    (a, b, c), (_, d, e), (_, _, f) = symmetric.tolist()
    aa, ab, ac = d * f - e * e, c * e - b * f, b * e - c * d
    bb, bc, cc = a * f - c * c, b * c - a * e, a * d - b * b
    inverse: Floats = np.array([[aa, ab, ac], [ab, bb, bc], [ac, bc, cc]]) / (a * aa + b * ab + c * ac)
    return inverse
