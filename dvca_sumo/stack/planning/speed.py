"""The speed profile: a driver model rolled out over 8 s under everything that demands to be slower.

Each demand is turned into the highest acceleration it allows, in closed form; the driver takes the lowest,
within comfort, or beyond comfort where nothing else avoids a collision. Since the model depends on the
present state only, planning again from any point of a profile gives the rest of it.
Sources: intelligent driver model (Treiber, Hennecke, Helbing: Congested traffic states, 2000).
"""

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from dvca_sumo.messages import TRAJECTORY_TIMES, Floats
from dvca_sumo.stack.planning.config import PlanningConfig

STEP = 0.2  # [s]
STEPS = 40
STEP_TIMES: Floats = np.arange(STEPS + 1, dtype=np.float64) * STEP
HARD_GAP = 0.5  # [m] to another's way, defended by hard braking

_LOOK_AHEAD = 0.7  # [s] the driver steers for the speed allowed where the ego will be then
_EXPLAINED = 6  # steps in which the demand is looked for that explains the profile
_NOTICEABLE = 0.3  # [m/s^2] less than without the demand
_HOLD_SPEED = 0.3  # [m/s] slower than this, the ego does not creep on over the last `_HOLD_GAP`
_HOLD_GAP = 0.5  # [m]
_STANDSTILL = 0.02  # [m/s] off the last speeds before standing, so that they reach zero
_HOLD = -1.0  # [m/s^2]
_FIRMER = 1.1  # than the constant braking that would just do
_SAFE_GAP = 2.0  # [m] to a leader, kept by braking beyond comfort if need be
_TOUCH = 0.1  # [m] smallest distance divided by
_ONCOMING = 2.0  # [s] later, the room is looked at that who comes towards the ego leaves
_FAR = 200.0  # [m] beyond which there is no leader
_HARDER = 1.3  # than the constant braking that would just match the leader's speed
_SLOW = 5.0  # [m/s] no faster, an ego stops at once for who comes into its way beside its front
_GENTLE_CLOSING = 2.0  # [m/s^2] of braking to match a leader's speed, up to which comfort is enough


class Stop(msgspec.Struct, frozen=True):
    """Not to get past a place, for ever or up to a moment."""

    at: float  # [m] where the rear axle shall stop, along the path
    give: float  # [m] further, that hard braking is spent on not getting past
    label: str
    until: float = math.inf  # [s]


class Leader(msgspec.Struct, frozen=True):
    """Somebody ahead who moves along the path; lists by step of the profile."""

    rears: list[float]  # [m] where the ego's rear axle would be with its front bumper at the leader
    speeds: list[float]  # [m/s]
    label: str


class Profile(msgspec.Struct, frozen=True, eq=False):
    """Motion along the path at STEP_TIMES."""

    arcs: Floats  # [m]
    speeds: Floats  # [m/s]
    accelerations: Floats  # [m/s^2], linear in between
    label: str  # of the demand that shapes the beginning, "" when there is none

    def rows(self) -> tuple[Floats, Floats, Floats]:
        """Arcs, speeds and accelerations at TRAJECTORY_TIMES; arcs never decrease."""
        arcs, speeds, accelerations = np.empty((3, len(TRAJECTORY_TIMES)))
        arcs[::2], speeds[::2], accelerations[::2] = self.arcs, self.speeds, self.accelerations
        s, v, a = self.arcs[:-1], self.speeds[:-1], self.accelerations[:-1]
        half, rise = 0.5 * STEP, 0.5 * (self.accelerations[1:] - a)
        np.add(a, rise, out=accelerations[1::2])
        middles = v + half * (a + 0.5 * rise)
        if np.count_nonzero(self.speeds) < len(self.speeds):
            is_stopping = (v > 0.0) & (self.speeds[1:] == 0.0)
            middles[is_stopping] = 0.5 * v[is_stopping] - _STANDSTILL
        np.maximum(middles, 0.0, out=speeds[1::2])
        reached = s + half * (v + half * (0.5 * a + rise / 6.0))
        np.minimum(np.maximum(reached, s), self.arcs[1:], out=arcs[1::2])
        return arcs, speeds, accelerations


def slowed_before(caps: Floats, arcs: Floats, braking: float) -> Floats:
    """The highest speed at each of `arcs` from which all `caps` [m/s] further on are kept at `braking`."""
    gained = (2.0 * braking) * arcs
    lowest: Floats = np.minimum.accumulate((caps * caps + gained)[::-1])[::-1]
    return np.sqrt(np.maximum(lowest - gained, 0.0))


class Driver:
    """The driver model, under one configuration."""

    def __init__(self, config: PlanningConfig) -> None:
        self._config = config
        self._highest, self._lowest = config.acceleration, -config.comfort_braking  # [m/s^2] in comfort
        self._approach = math.sqrt(config.acceleration * config.braking)  # [m/s^2] of the intelligent driver model
        self._change, self._hard_change = config.jerk * STEP, config.hard_jerk * STEP  # [m/s^2] in one step

    def roll_out(
        self, speed: float, acceleration: float, caps: Sequence[float], stops: Sequence[Stop], leader: Leader | None
    ) -> Profile:
        """The motion from `speed` and `acceleration`; `caps` [m/s] by metre of path."""
        s, v, a = 0.0, speed, acceleration
        arcs, speeds, accelerations = [s], [v], [a]
        label, count, last = "", len(caps), caps[-1]
        highest, lowest = self._highest, self._lowest
        is_steady = leader is None and all(stop.until == math.inf for stop in stops)
        for k in range(STEPS):
            metre = int(s + v * _LOOK_AHEAD)
            free = ((caps[metre] if metre < count else last) - v) / _LOOK_AHEAD
            if free > highest:
                free = highest
            elif free < lowest:
                free = lowest
            wanted, because = free, ""
            for stop in stops:
                allowed = self._for_stop(stop, s, v, k * STEP)
                if allowed < wanted:
                    wanted, because = allowed, stop.label
            if leader is not None:
                allowed = self._for_leader(leader.rears[k] - s, v, leader.speeds[k])
                if allowed < wanted:
                    wanted, because = allowed, leader.label
            if k < _EXPLAINED and not label and wanted < free - _NOTICEABLE:
                label = because
            if is_steady and wanted <= 0.0 and v == a == 0.0:  # it stands for the rest
                arcs += [s] * (STEPS - k)
                speeds += [0.0] * (STEPS - k)
                accelerations += [0.0] * (STEPS - k)
                break
            s, v, a = self._moved(s, v, a, wanted)
            arcs.append(s)
            speeds.append(v)
            accelerations.append(a)
        motion = np.array((arcs, speeds, accelerations))
        return Profile(motion[0], motion[1], motion[2], label)

    def _for_stop(self, stop: Stop, s: float, v: float, time: float) -> float:
        """Stopping there or, where the ego need not stop to arrive no earlier than the way becomes free, that."""
        distance = stop.at - s
        if stop.until < math.inf:
            left = stop.until - time
            if left <= 0.0:
                return self._highest
            if 2.0 * distance > v * left:
                return 2.0 * (distance - v * left) / (left * left)
        if v < _HOLD_SPEED and distance < _HOLD_GAP:
            allowed = _HOLD
        elif distance > _TOUCH:
            needed = v * v / (2.0 * distance)
            allowed = max(self._highest - needed * needed / self._config.braking, -_FIRMER * needed)
        else:
            allowed = -self._config.hard_braking
        if allowed < self._lowest:
            firmest = _FIRMER * v * v / (2.0 * max(distance + stop.give, _TOUCH))
            allowed = max(allowed, -max(self._config.comfort_braking, firmest))
        return allowed

    def _for_leader(self, gap: float, v: float, leader_speed: float) -> float:
        """The intelligent driver model; beyond comfort only where the gap would not last otherwise, or there is none.

        There is none to who comes into the ego's way beside its front: faster or not, an ego that is slow lets it.
        """
        config = self._config
        if gap > _FAR:
            return self._highest
        if leader_speed < -_HOLD_SPEED:  # it comes towards the ego: what counts is the room there will be
            gap += _ONCOMING * leader_speed
        closing = v - leader_speed
        if v < _HOLD_SPEED and leader_speed < _HOLD_SPEED and gap < config.follow_gap + _HOLD_GAP:
            return _HOLD
        if gap < 0.0 and v < _SLOW:
            return -config.hard_braking
        wanted = v * config.headway + 0.5 * v * closing / self._approach
        ratio = (config.follow_gap + wanted if wanted > 0.0 else config.follow_gap) / max(gap, _TOUCH)
        allowed = self._highest * (1.0 - ratio * ratio)
        if allowed >= self._lowest:
            return allowed
        needed = closing * closing / (2.0 * max(gap - _SAFE_GAP, _TOUCH)) if closing > 0.0 else 0.0
        return max(allowed, self._lowest if needed < _GENTLE_CLOSING else -_HARDER * needed)

    def _moved(self, s: float, v: float, a: float, wanted: float) -> tuple[float, float, float]:
        """One step on, with the acceleration moving linearly towards `wanted` within the limits of jerk.

        An ego that has just set off, and is to stop, does so as fast as when it brakes beyond comfort.
        """
        is_setting_off = v < self._config.creeping_speed and wanted < 0.0 < a
        if wanted >= self._lowest and a >= self._lowest and not is_setting_off:
            change = self._change
        else:
            change, wanted = self._hard_change, max(wanted, -self._config.hard_braking)
        if wanted > a + change:
            after = a + change
        elif wanted < a - change:
            after = a - change
        else:
            after = wanted
        if v <= 0.0 and after <= 0.0:
            return s, 0.0, 0.0
        reached = v + 0.5 * STEP * (a + after)
        if reached <= 0.0:
            return s + min(v * v / -(a + after), v * STEP), 0.0, 0.0
        way = STEP * (v + STEP * (2.0 * a + after) / 6.0)
        return (s + way if way > 0.0 else s), reached, after
