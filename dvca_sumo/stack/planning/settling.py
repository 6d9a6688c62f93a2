"""Moves onto the line of another lane end where they were to end when they began."""

from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.moves import Lateral, blend_length
from dvca_sumo.stack.planning.path import Plateau

_LEAP = 0.5  # [m] from one cycle to the next: the line is that of another lane


class Settling:
    """Remembers where the move ends that is under way. Planned anew to its full length again and again it would not."""

    def __init__(self, config: PlanningConfig) -> None:
        self._config = config
        self._offset = 0.0  # [m] of the last cycle
        self._end: float | None = None  # [m] route station

    def step(self, lateral: Lateral, station: float, speed: float) -> list[Plateau]:
        """Where the ego, `lateral` to the line of this cycle at the route's `station` [m], has to be on it; or none."""
        if abs(lateral.offset - self._offset) > _LEAP:
            self._end = station + blend_length(lateral.unsettled, speed, self._config)
        self._offset = lateral.offset
        if self._end is None or self._end <= station:
            self._end = None
            return []
        return [Plateau(self._end - station, self._end - station, 0.0)]
