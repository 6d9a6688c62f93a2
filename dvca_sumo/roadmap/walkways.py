"""Ground for people on foot: pavements, the walking areas of junctions, and the crossings between them."""

from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

from dvca_sumo.geometry.polyline import Floats
from dvca_sumo.roadmap.areas import grounds
from dvca_sumo.roadmap.lanes import Lane
from dvca_sumo.roadmap.reading import NetContents

_KERB = 0.25  # [m] beyond its edge one is still on a ground
_TOUCHING = 0.5  # [m] between grounds that are next to each other, at most


class Way(NamedTuple):
    """A crossing, straight from one of its ends."""

    lane: str
    entry: tuple[float, float]  # [m] the middle of that end
    direction: tuple[float, float]  # of unit length, across the road
    half_width: float  # [m]


class Ground(NamedTuple):
    """One pavement or walking area."""

    lane: str
    edges: Floats  # (k, 4) [m] of it and of the grounds next to it, together: where each begins, and on from there
    ways: tuple[Way, ...]  # the crossings that begin here: at walking areas only


class Walkways:
    """Which ground or crossing somebody is on, and where they may go from there."""

    def __init__(self, net: NetContents) -> None:
        crossings = [lane for lane in net.lanes.values() if lane.is_crossing]
        shapes = {lane.id: _strip(lane) for lane in crossings}
        shapes |= {lane.id: _strip(lane) for lane in net.lanes.values() if lane.is_pavement}
        self._ways: dict[str, list[Way]] = defaultdict(list)
        for junction in net.junctions.values():
            names = [name for movement in junction.movements for name in movement.internal]
            strips = [(net.lanes[name].line.points, net.lanes[name].width) for name in names]
            areas = dict(zip(junction.walking, grounds(junction.walking.values(), strips), strict=True))
            shapes |= areas
            for name in junction.crossings:
                for way in _ways(net.lanes[name]):
                    self._ways[_nearest(areas, way.entry)].append(way)
        self._lanes = list(shapes)
        self._tree = shapely.STRtree(list(shapes.values()))
        self._crossings = len(crossings)  # come first
        self._known: dict[int, Ground] = {}

    def under(self, points: Floats) -> list[Ground | str | None]:
        """For each of `points` (n, 2) the ground it lies on, else the lane id of the crossing; None on neither."""
        places: list[Ground | str | None] = [None] * len(points)
        rows, found = self._tree.query(shapely.points(points), predicate="dwithin", distance=_KERB)
        for row, number in sorted(zip(rows.tolist(), found.tolist(), strict=True)):
            is_crossing = number < self._crossings
            places[row] = self._lanes[number] if is_crossing else self._ground(number)
        return places

    def _ground(self, number: int) -> Ground:
        if number not in self._known:
            shape = self._tree.geometries[number]
            near = np.sort(self._tree.query(shape, predicate="dwithin", distance=_TOUCHING))
            grounds = self._tree.geometries[near[near >= self._crossings]]
            grown = shapely.union_all(shapely.buffer(grounds, 0.5 * _TOUCHING, join_style="mitre"))
            together = shapely.buffer(grown, -0.5 * _TOUCHING, join_style="mitre")
            lane = self._lanes[number]
            self._known[number] = Ground(lane, _edges(together), tuple(self._ways.get(lane, ())))
        return self._known[number]


def room(points: Floats, directions: Floats, lengths: Floats, grounds: Sequence[Ground]) -> Floats:
    """How far one gets from `points` (n, 2) along unit `directions` (n, 2) before the ground ends (n,) [m].

    At most `lengths` (n,).
    """
    counts = np.array([len(ground.edges) for ground in grounds])
    owners, edges = np.repeat(np.arange(len(grounds)), counts), np.concatenate([ground.edges for ground in grounds])
    (gap_x, gap_y), (edge_x, edge_y) = (edges[:, :2] - points[owners]).T, edges[:, 2:].T
    x, y = directions[owners].T
    crosses = x * edge_y - y * edge_x
    with np.errstate(divide="ignore", invalid="ignore"):  # of parallel ones
        along, across = (gap_x * edge_y - gap_y * edge_x) / crosses, (gap_x * y - gap_y * x) / crosses
    is_met = (along >= 0.0) & (across >= 0.0) & (across <= 1.0)
    nearest = np.minimum.reduceat(np.where(is_met, along, np.inf), counts.cumsum() - counts)
    found: Floats = np.minimum(nearest, lengths)
    return found


def _edges(shape: shapely.Geometry) -> Floats:
    points, parts = shapely.get_coordinates(shapely.get_parts(shapely.boundary(shape)), return_index=True)
    edges: Floats = np.hstack((points[:-1], np.diff(points, axis=0)))[np.diff(parts) == 0]
    return edges if len(edges) else np.full((1, 4), np.nan)  # of nothing


def _nearest(areas: dict[str, shapely.Geometry], entry: tuple[float, float]) -> str:
    """Which walking area of a junction a crossing there comes to, whose drawn end may lie metres off it; "" of none."""
    point = shapely.Point(entry)
    return min(areas, key=lambda name: float(shapely.distance(point, areas[name])), default="")


def _strip(lane: Lane) -> shapely.Geometry:
    return shapely.buffer(shapely.linestrings(lane.line.points), 0.5 * lane.width, cap_style="flat")


def _ways(lane: Lane) -> tuple[Way, Way]:
    begin, end = lane.line.points[0], lane.line.points[-1]
    x, y = ((end - begin) / np.hypot(*(end - begin))).tolist()
    half = 0.5 * lane.width
    return Way(lane.id, tuple(begin.tolist()), (x, y), half), Way(lane.id, tuple(end.tolist()), (-x, -y), half)
