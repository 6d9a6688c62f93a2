"""How far behind its place SUMO is told that an ego stands, where it finds no lane for the place itself.

On the outer side of the joint of two lanes that meet at an angle, neither is abreast of a body's front. What is on no
lane SUMO's drivers do not see: who is behind drives through it.
"""

import math

_SLOW = 2.0  # [m/s] above, an ego is past such a place at once
_STEP = 0.5  # [m] tried more
_MOST = 2.0  # [m]: who finds no lane within this is beside the road
_ELSEWHERE = 1.0  # [m] from where it was lost


class Setback:
    """One ego's, at one world step after another."""

    def __init__(self) -> None:
        self._distance = 0.0  # [m]
        self._lost: tuple[float, float] | None = None  # [m] where no lane was found

    def at(self, x: float, y: float, speed: float, *, is_on_lane: bool) -> float:
        """The distance [m] to tell it behind (x, y), after SUMO did or did not find a lane where it was told last."""
        if self._lost is not None and (speed > _SLOW or math.dist(self._lost, (x, y)) > _ELSEWHERE):
            self._distance, self._lost = 0.0, None
        if not is_on_lane and speed <= _SLOW and (self._lost is None or self._distance > 0.0):
            self._lost = self._lost or (x, y)
            self._distance = self._distance + _STEP if self._distance < _MOST else 0.0
        return self._distance
