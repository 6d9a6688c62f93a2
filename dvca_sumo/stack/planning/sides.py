"""The way beside an object: who comes along it while the ego passes there."""

import math
from typing import NamedTuple

import numpy as np

from dvca_sumo.messages import Flags, Floats, VehicleShape
from dvca_sumo.stack.planning.blockers import SLOWEST, Blocker
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.moves import blend_length
from dvca_sumo.stack.planning.situation import Situation

_BAND_GAP = 3.0  # [m] lengthwise to others in the neighbouring lane
_CLOSING = 2.0  # [s] of closing speed kept to those who come from behind
_SURE = 1.0  # [s] for which nobody has come alongside who did before, until the way is free


class _Taken(NamedTuple):
    """Somebody comes alongside."""

    offset: float  # [m] from the line, of an ego as near to it as that, or farther off
    time: float  # [s] when that was last found


_NEVER = _Taken(math.inf, -math.inf)


class Sides:
    """Remembers beside whom the way was not free, and when."""

    def __init__(self, shape: VehicleShape, config: PlanningConfig) -> None:
        self._shape = shape
        self._config = config
        self._half = 0.5 * shape.width
        self._taken: dict[tuple[int, bool], _Taken] = {}  # by track, and whether on its left

    def see(self, situation: Situation) -> None:
        """Forget those who are not there any more."""
        self._taken = {key: taken for key, taken in self._taken.items() if key[0] in situation.scene.ids}

    def has_been_free(self, blocker: Blocker, offset: float, situation: Situation) -> bool:
        """As `_is_free`, and for a while, if it was not before: predictions that change do not move the ego about."""
        key, distance, time = (blocker.track, offset > 0.0), abs(offset), situation.time
        taken = self._taken.get(key, _NEVER)
        if not self._is_free(blocker, offset, situation):
            self._taken[key] = _Taken(min(distance, taken.offset) if time - taken.time < _SURE else distance, time)
            return False
        return time - taken.time >= _SURE or distance < taken.offset

    def _is_free(self, blocker: Blocker, offset: float, situation: Situation) -> bool:
        """Whether nobody who moves comes alongside while the ego is out of its lane; who is right behind it follows."""
        scene, now = situation.scene, situation.scene.now
        beside = self.taking(blocker, offset, self._config.object_margin, situation)
        follows = (now.stations < 0.0) & (np.abs(now.offsets - situation.lateral.offset) < now.half_widths + self._half)
        return not bool(beside[~follows[scene.owners[: scene.moving]]].any())

    def taking(self, blocker: Blocker, offset: float, margin: float, situation: Situation) -> Flags:
        """Which futures that move (moving,) come alongside, within `margin` [m], while the ego is at that offset."""
        scene = situation.scene
        futures, moving = scene.futures, slice(0, scene.moving)
        pace, length = max(situation.speed, SLOWEST), blend_length(offset, situation.speed, self._config)
        ego: Floats = pace * scene.times
        out: Flags = (ego > blocker.low - self._shape.front - length) & (ego < blocker.high + length)
        stations, lengths = futures.stations[moving], futures.half_lengths[moving]
        beside = np.abs(futures.offsets[moving] - offset) < futures.half_widths[moving] + self._half + margin
        rates = (stations[:, -1:] - stations[:, :1]) / (scene.times[-1] - scene.times[0])
        behind = self._shape.rear_overhang + _BAND_GAP + _CLOSING * np.maximum(rates - pace, 0.0)
        beside &= (stations + lengths > ego - behind) & (stations - lengths < ego + self._shape.front + _BAND_GAP)
        found: Flags = np.any(beside & out, axis=1)
        return found
