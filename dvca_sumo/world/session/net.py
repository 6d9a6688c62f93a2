"""The road net of the simulation."""

import libsumo
import shapely

from dvca_sumo.world.net import Link

_TURNS_BACK = ("t", "T")  # SUMO's letters; the second one is for left-hand traffic


class SumoNet:
    """See `Net`."""

    def __init__(self) -> None:
        self._middles: dict[str, tuple[shapely.LineString, float]] = {}

    def lanes(self) -> tuple[str, ...]:
        return tuple(libsumo.lane.getIDList())

    def links(self, lane: str) -> list[Link]:
        return [Link(to, via, way in _TURNS_BACK) for to, _, _, _, via, _, way, _ in libsumo.lane.getLinks(lane)]

    def foes(self, lane: str) -> tuple[str, ...]:
        return tuple(libsumo.lane.getInternalFoes(lane))

    def adjacent(self, lane: str) -> list[str]:
        edge, _, index = lane.rpartition("_")
        count = libsumo.edge.getLaneNumber(edge)
        return [f"{edge}_{next_to}" for next_to in (int(index) - 1, int(index) + 1) if 0 <= next_to < count]

    def allowed(self, lane: str) -> tuple[str, ...]:
        return tuple(libsumo.lane.getAllowed(lane))

    def middle(self, lane: str) -> tuple[shapely.LineString, float]:
        if lane not in self._middles:
            shape = libsumo.lane.getShape(lane)
            line = shapely.LineString([shape[0], *shape])  # of two points at least, however short the lane
            self._middles[lane] = line, libsumo.lane.getWidth(lane)
        return self._middles[lane]

    def lanes_of(self, road: str) -> list[str]:
        return [f"{road}_{index}" for index in range(libsumo.edge.getLaneNumber(road))]

    def junctions_of(self, road: str) -> tuple[str, str]:
        return libsumo.edge.getFromJunction(road), libsumo.edge.getToJunction(road)
