"""Control: believed pose and trajectory -> actuator command, 100 times a second.

Lateral: the error of a rear axle against a path obeys e'' = curvature - path curvature per metre driven
(small angles), a double integrator; its linear-quadratic regulator is known in closed form (gains 1/d^2
on offset and sqrt(2)/d on heading for a settling distance d), so no Riccati equation is solved. The
path's own curvature is fed forward, taken as far ahead as the steering lags.
Longitudinal: the trajectory's acceleration is fed forward; PI on speed and P on position correct it.
"""

import math
from bisect import bisect_right

import msgspec
import numpy as np

from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.messages import HEADING, ControlCommand, LocalizationEstimate, T, Trajectory, VehicleShape, X

_SQRT2 = math.sqrt(2.0)
_READ = 16  # rows of a trajectory that are read at first


class ControlConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Gains and limits of the tracking controller."""

    period: float = 0.01  # [s] from step to step
    settling_time: float = 0.6  # [s] settling distance of a lateral error, by speed
    min_settling_distance: float = 3.0  # [m] and at least
    max_approach_angle: float = 0.4  # [rad] to the path, when far off it
    steering_preview: float = 0.15  # [s] the path's curvature is taken this far ahead
    max_steering: float = 0.55  # [rad]
    max_lateral_acceleration: float = 6.0  # [m/s^2]
    acceleration_preview: float = 0.2  # [s] the trajectory's acceleration is taken this far ahead: the brakes' lag
    position_gain: float = 0.6  # [1/s^2]
    max_position_error: float = 3.0  # [m] larger ones count as this
    speed_gain: float = 1.5  # [1/s]
    speed_integral_gain: float = 0.1  # [1/s^2]
    max_integral: float = 0.3  # [m/s^2] the integral's share of the acceleration
    max_acceleration: float = 3.0  # [m/s^2]
    max_braking: float = 8.0  # [m/s^2] positive number
    standstill_speed: float = 0.1  # [m/s] a trajectory slower than this, that far ahead, wants to stand ...
    standstill_preview: float = 0.5  # [s] ... unless it is faster this much ahead
    standstill_braking: float = 2.0  # [m/s^2] held while standing
    stop_braking: float = 3.0  # [m/s^2] when there is nothing (any more) to follow


Pose = tuple[float, float, float]  # x, y, heading (unwrapped)
Place = tuple[int, float]  # row of a trajectory, and how far on to the next one, in [0, 1]


class _Track:
    """A trajectory as plain numbers, looked up by time or by distance along it; ends are held.

    They are read as far as anything is looked up: most of it is replaced before its time comes.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        points = trajectory.points
        columns = np.zeros((8, len(points)))
        columns[:7] = points.T
        poses = columns[X : HEADING + 1]
        east, north, turned = poses[:, 1:] - poses[:, :-1]
        columns[HEADING, 1:] -= 2.0 * math.pi * np.rint(turned / (2.0 * math.pi)).cumsum()  # np.unwrap, but fast
        np.hypot(east, north).cumsum(out=columns[7, 1:])
        self.source = trajectory
        self.is_finite = bool(np.isfinite(points).all())
        self.end = float(points[-1, T])  # [s]
        self._rest = columns[:, _READ:]
        self._lists = columns[:, :_READ].tolist()
        self.times, self._x, self._y, self._headings = self._lists[:4]
        self.speeds, self.accelerations, self.curvatures, self.stations = self._lists[4:]

    def place(self, knots: list[float], value: float) -> Place:
        """Where `value` lies among `knots`, the times or the stations."""
        if value >= knots[-1] and self._rest.size:
            for numbers, more in zip(self._lists, self._rest.tolist(), strict=True):
                numbers.extend(more)
            self._rest = self._rest[:, :0]
        i = bisect_right(knots, value, 1, len(knots) - 1) - 1
        start = knots[i]
        width = knots[i + 1] - start
        share = (value - start) / width if width > 0.0 else 1.0
        if share >= 1.0:
            return i, 1.0
        if share > 0.0:
            return i, share
        return i, 0.0

    def pose(self, place: Place) -> Pose:
        """The pose at `place`."""
        i, share = place
        x, y, heading = self._x[i], self._y[i], self._headings[i]
        i += 1
        return (
            x + share * (self._x[i] - x),
            y + share * (self._y[i] - y),
            heading + share * (self._headings[i] - heading),
        )


def _at(place: Place, values: list[float]) -> float:
    """What lies at `place`, one of `values` being given for each row."""
    i, share = place
    return values[i] + share * (values[i + 1] - values[i])


class TrackingController:
    """Follows the newest trajectory in time and space; stops where there is none to follow.

    Its only memory is the speed error's integral (and the numbers of the trajectory in hand).
    """

    def __init__(self, config: ControlConfig, shape: VehicleShape) -> None:
        self._config = config
        self._wheelbase = shape.wheelbase
        self._track: _Track | None = None
        self._integral = 0.0  # [m/s^2]

    def step(self, localization: LocalizationEstimate, trajectory: Trajectory | None) -> ControlCommand:
        """One cycle.

        Without a trajectory, past the end of its horizon, or when it or the believed pose is not finite:
        brakes to a stop, wheels straight. At a standing end of a trajectory: stops and holds the brake,
        never creeps towards it.
        """
        now = localization.time
        if trajectory is None or not math.isfinite(localization.x + localization.y + localization.heading):
            return self._stop(now)
        if self._track is None or self._track.source is not trajectory:
            self._track = _Track(trajectory)
        track, age = self._track, now - trajectory.time
        if age > track.end or not track.is_finite:
            return self._stop(now)
        wanted = track.place(track.times, age)
        ahead = _along(track.pose(wanted), localization)  # [m] the ego is past where it should be by now
        # One Newton step corrects the first guess, which is off where a large error meets a bend.
        reached = _at(wanted, track.stations) + ahead
        reached += _along(track.pose(track.place(track.stations, reached)), localization)
        return ControlCommand(
            time=now,
            acceleration=self._acceleration(localization.speed, wanted, reached, track, age),
            steering=self._steering(localization, track, reached),
        )

    def _stop(self, now: float) -> ControlCommand:
        self._integral = 0.0
        return ControlCommand(time=now, acceleration=-self._config.stop_braking, steering=0.0)

    def _steering(self, localization: LocalizationEstimate, track: _Track, station: float) -> float:
        config, speed = self._config, localization.speed
        x, y, heading = track.pose(track.place(track.stations, station))
        dx, dy = localization.x - x, localization.y - y
        offset = math.cos(heading) * dy - math.sin(heading) * dx
        error = wrapped(localization.heading - heading)
        distance = max(config.min_settling_distance, speed * config.settling_time)
        # Regulated to the heading at which offset and heading terms cancel: that one is limited.
        approach = _limited(offset / (_SQRT2 * distance), config.max_approach_angle)
        ahead = track.place(track.stations, station + speed * config.steering_preview)
        curvature = _at(ahead, track.curvatures) - _SQRT2 / distance * (error + approach)
        most = config.max_lateral_acceleration / max(1.0, speed * speed)
        return _limited(math.atan(self._wheelbase * _limited(curvature, most)), config.max_steering)

    def _acceleration(self, speed: float, wanted: Place, reached: float, track: _Track, age: float) -> float:
        config = self._config
        ahead = track.place(track.times, age + config.acceleration_preview)
        if _at(ahead, track.speeds) <= config.standstill_speed:
            soon = track.place(track.times, age + config.standstill_preview)
            if _at(soon, track.speeds) <= config.standstill_speed:
                self._integral = 0.0
                return self._halting(speed, _at(soon, track.stations) - reached)
        error = _at(wanted, track.speeds) - speed
        position = _limited(_at(wanted, track.stations) - reached, config.max_position_error)
        direct = _at(ahead, track.accelerations) + self._integral
        direct += config.speed_gain * error + config.position_gain * position
        limited = min(config.max_acceleration, max(-config.max_braking, direct))
        # Anti-windup: what the actuator cannot give is not asked for more and more.
        if limited == direct:
            change = config.speed_integral_gain * error * config.period
            self._integral = _limited(self._integral + change, config.max_integral)
        return limited

    def _halting(self, speed: float, remaining: float) -> float:
        """Comes to rest within `remaining` metres, no gentler than it holds there; at once when they are gone."""
        config = self._config
        if speed <= config.standstill_speed:
            return -config.standstill_braking
        # Half a lag's way is already gone before the brake answers.
        room = remaining - 0.5 * config.acceleration_preview * speed
        needed = 0.5 * speed * speed / room if room > 0.0 else config.stop_braking + config.speed_gain * speed
        return -min(config.max_braking, max(needed, config.standstill_braking))


def _limited(value: float, most: float) -> float:
    """The value, no farther from 0 than `most`; what is not a number counts as `-most`."""
    if value >= most:
        return most
    if value > -most:
        return value
    return -most


def _along(pose: Pose, localization: LocalizationEstimate) -> float:
    """How far the ego believes to lie ahead of `pose`, along its heading [m]."""
    x, y, heading = pose
    return math.cos(heading) * (localization.x - x) + math.sin(heading) * (localization.y - y)
