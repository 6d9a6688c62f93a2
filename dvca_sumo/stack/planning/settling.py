"""Moves onto the line of another lane end where they were to end when they began."""

from dvca_sumo.messages import VehicleShape
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.moves import Lateral, blend_length
from dvca_sumo.stack.planning.path import Plateau, way_back
from dvca_sumo.stack.planning.reference import Window

_LEAP = 0.5  # [m] from one cycle to the next: the line is that of another lane


class Settling:
    """Remembers where the move ends that is under way. Planned anew to its full length again and again it would not."""

    def __init__(self, shape: VehicleShape, config: PlanningConfig) -> None:
        self._shape = shape
        self._config = config
        self._offset = 0.0  # [m] of the last cycle
        self._end: float | None = None  # [m] route station

    def step(self, lateral: Lateral, window: Window, speed: float, plateaus: list[Plateau]) -> list[Plateau]:
        """The `plateaus` of a cycle, and before them where the ego has to be on the line.

        It is `lateral` to the line of this cycle, at the origin of `window`. Whom it has to get round before, or right
        behind that, it gets round first.
        """
        station = window.station
        if abs(lateral.offset - self._offset) > _LEAP:
            self._end = station + way_back(lateral, 0.0, speed, window, self._shape, self._config).length
        self._offset = lateral.offset
        if self._end is None or self._end <= station:
            self._end = None
            return plateaus
        ahead = self._end - station
        if plateaus and plateaus[0].begin - blend_length(plateaus[0].offset, speed, self._config) < ahead:
            self._offset, self._end = 0.0, None  # the move begins anew after them
            return plateaus
        return [Plateau(ahead, ahead, 0.0), *plateaus]
