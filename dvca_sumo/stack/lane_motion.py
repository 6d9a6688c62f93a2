"""How an object moves along a lane path: distance over time, and its way back to the lane's centre."""

import msgspec
import numpy as np

from dvca_sumo.messages import PREDICTION_TIMES, Floats
from dvca_sumo.stack.lane_paths import LanePaths, Stretches

_HORIZON = float(PREDICTION_TIMES[-1])
_CRAWL = 0.05  # [m/s] slower is standing still, within a prediction's horizon
_LATE = 100.0  # [s] later than any prediction time


class MotionModelConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How traffic is taken to drive."""

    trend_duration: float = 2.0  # [s] acceleration or braking seen now goes on for so long
    speeding: float = 1.1  # traffic drives up to so many times the limit, or as it does now where that is more
    bend_acceleration: float = 5.5  # [m/s^2] lateral, in bends; netconvert limits speeds on junctions by as much
    brisk: float = 1.5  # who is faster in a bend now is so in the next ones too, up to so many times
    braking: float = 2.5  # [m/s^2] for bends and lower limits
    settling_time: float = 3.0  # [s] to the lane's centre
    max_slant: float = 0.3  # [rad] against the lane on the way there: slow objects take longer
    max_lateral_speed: float = 1.5  # [m/s] a higher one is not believed


class LaneMotion:
    """The motion model on a table of lane paths."""

    def __init__(self, config: MotionModelConfig, paths: LanePaths) -> None:
        self._config = config
        self._paths = paths
        # By how much the squares of speeds in bends, and limits, are exceeded, at least and at most.
        self._freedom = np.array([[1.0], [config.speeding**2]])
        self._most_freedom = np.array([[config.brisk**2], [np.inf]])

    def reach(self, speeds: Floats, trends: Floats) -> Floats:
        """No object gets farther than this within the horizon [m]."""
        return np.maximum(speeds, speeds + trends * self._config.trend_duration) * _HORIZON + 10.0

    def travelled(self, paths: Stretches, stations: Floats, speeds: Floats, trends: Floats, farthest: float) -> Floats:
        """Stations at PREDICTION_TIMES (h, t) of objects at `stations` (h,), `trends` being accelerations (h,).

        None of them gets farther than `farthest` [m], by their `reach`.

        Speed over distance s is v^2 = v0^2 + 2 a s until the trend has run its course, capped by bends and limits;
        distance over time follows by integrating ds / v, metre by metre.
        """
        config = self._config
        rows, count = len(stations), int(farthest) + 2
        metres = np.arange(count, dtype=np.float64)
        # All in squares of speeds, so that one root is taken.
        squares = speeds * speeds
        caps = self._paths.caps(paths, stations, count)
        caps *= np.minimum(np.maximum(squares / caps[:, :, 0], self._freedom), self._most_freedom)[:, :, None]
        # A trend has run its course after as many metres; one that ends in standing stands sooner.
        course = 0.5 * config.trend_duration * (speeds + np.maximum(speeds + trends * config.trend_duration, 0.0))
        squares = squares[:, None]
        free = squares + (2.0 * trends)[:, None] * np.minimum(metres, course[:, None])
        slowing = squares - 2.0 * config.braking * metres
        capped = np.minimum(free, np.maximum(np.minimum(caps[0], caps[1]), slowing))
        profile = np.sqrt(np.maximum(capped, _CRAWL * _CRAWL))
        times = np.empty((rows, count))
        times[:, 0] = _LATE
        np.divide(2.0, profile[:, 1:] + profile[:, :-1], out=times[:, 1:])
        # All rows in one interpolation: they follow each other on one time axis.
        known, begins = times.cumsum(), np.arange(0, rows * count, count)
        wanted = known[begins][:, None] + PREDICTION_TIMES
        reached = np.interp(wanted, known, np.arange(rows * count, dtype=np.float64))
        return reached + (stations - begins)[:, None]

    def settled(
        self, offsets: Floats, targets: Floats, lateral_speeds: Floats, speeds: Floats
    ) -> tuple[Floats, Floats]:
        """Offsets at PREDICTION_TIMES (h, t) on the way to `targets` (h,), and slants against the path [rad] (h, t).

        A cubic that starts with the lateral speed seen and ends level after the settling time.
        """
        config = self._config
        ways = offsets - targets
        durations = np.maximum(config.settling_time, np.abs(ways) / (config.max_slant * np.maximum(speeds, 0.1)))
        most = config.max_lateral_speed
        rates = np.minimum(np.maximum(lateral_speeds, -most), most)[:, None]
        ways, durations = ways[:, None], durations[:, None]
        share = np.minimum(PREDICTION_TIMES / durations, 1.0)
        left = 1.0 - share
        moved = targets[:, None] + left * left * (ways * (1.0 + 2.0 * share) + rates * durations * share)
        change = left * (rates * (1.0 - 3.0 * share) - 6.0 * ways * share / durations)
        return moved, np.arctan2(change, np.maximum(speeds, 1.0)[:, None])
