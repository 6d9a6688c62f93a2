"""The map the ADS plans on."""

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

import msgspec
import numpy as np
import numpy.typing as npt
import shapely

from dvca_sumo.roadmap.lanes import Lane
from dvca_sumo.roadmap.levels import Levels
from dvca_sumo.roadmap.reading import NetContents, read_net
from dvca_sumo.roadmap.route import Route
from dvca_sumo.roadmap.routing import route
from dvca_sumo.roadmap.walkways import Walkways


class RoadMap:
    """All lanes of a net, which are near a point, and routes through them. Immutable."""

    def __init__(self, net: NetContents) -> None:
        self._net = net
        self._near = [lane for lane in net.lanes.values() if not lane.is_crossing]
        counts = [len(lane.line) for lane in self._near]
        lines = shapely.linestrings(
            np.concatenate([lane.line.points for lane in self._near]), indices=np.repeat(np.arange(len(counts)), counts)
        )
        self._tree = shapely.STRtree(lines)
        self._levels = Levels(net, self._near, self._tree)

    @classmethod
    def load(cls, path: Path, vehicle_class: str = "passenger") -> "RoadMap":
        """Read a SUMO net (.net.xml or .net.xml.gz) as a driver of `vehicle_class` sees it.

        Raises RoadMapError when the file is missing or no net, or the class is unknown to SUMO.
        """
        return cls(read_net(path, vehicle_class))

    @property
    def lanes(self) -> MappingProxyType[str, Lane]:
        """Every lane by id: normal and internal lanes, and pedestrian crossings."""
        return MappingProxyType(self._net.lanes)

    @cached_property
    def walkways(self) -> Walkways:
        """Where people walk."""
        return Walkways(self._net)

    def lanes_near(self, points: npt.ArrayLike, radius: float) -> list[tuple[str, ...]]:
        """For each of `points` (m, 2), the lanes with their centre line within `radius` [m], nearest first.

        Internal lanes count, pedestrian crossings do not; lanes equally far are in the net's order.
        """
        spots = shapely.points(np.asarray(points, dtype=np.float64).reshape(-1, 2))
        rows, found = self._tree.query(spots, predicate="dwithin", distance=radius)
        distances = shapely.distance(spots[rows], self._tree.geometries[found])
        order = np.lexsort((found, distances, rows))
        ends = np.searchsorted(rows[order], np.arange(len(spots) + 1))
        ids = [self._near[index].id for index in found[order]]
        return [tuple(ids[ends[row] : ends[row + 1]]) for row in range(len(spots))]

    def route(
        self,
        edges: Sequence[str],
        start_lane: str,
        start_position: float,
        arrival_lane: str | None,
        arrival_position: float,
    ) -> Route:
        """The route along `edges` (normal edges, in order; one may come again), from one lane position to another.

        Positions are SUMO's [m], of the front bumper; where `arrival_lane` is None, any lane of the last
        edge will do. Raises RouteError when the edges do not connect for the vehicle class, or not by
        the lanes given.
        """
        found = route(self._net, edges, (start_lane, start_position), (arrival_lane, arrival_position))
        return msgspec.structs.replace(found, overpasses=self._levels.overpasses(found))
