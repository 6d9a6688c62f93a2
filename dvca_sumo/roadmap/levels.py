"""Bridges and underpasses: where a lane passes over or under another, which a flat net does not say.

Lanes whose centre lines cross do not meet where their edges share no junction. Lines of a net that are drawn
carelessly cross too, close to the ends of their lanes or at a small angle, and lanes of two junctions that lie close
together: these do not count. Nor do paths: people cross roads where a net has no junction.
"""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence

import shapely

from dvca_sumo.roadmap.lanes import Lane
from dvca_sumo.roadmap.reading import NetContents
from dvca_sumo.roadmap.route import Overpass, Route
from dvca_sumo.roadmap.runs import runs

_INSIDE = 5.0  # [m] from the ends of a lane that is crossed, but for the short ones on junctions
_ANGLE = 0.25  # [rad] at least between lanes that cross
_BESIDE = 5.0  # [m] of the route's line a crossing of its lanes is at most
_SLACK = 5.0  # [m] before and after the part of a lane that the route follows


class Levels:
    """Which lanes of a net pass over or under a route."""

    def __init__(self, net: NetContents, lanes: Sequence[Lane], tree: shapely.STRtree) -> None:
        """Of `lanes` of the net, whose centre lines are the geometries of `tree`."""
        self._lanes = lanes
        self._tree = tree
        self._rows = {lane.id: row for row, lane in enumerate(lanes)}
        self._junctions: dict[str, set[str]] = defaultdict(set)  # that an edge meets others at, by edge
        for movements in net.movements.values():
            for movement in movements:
                for lane in (movement.from_lane, *movement.internal, movement.to_lane):
                    self._junctions[net.lanes[lane].edge].add(movement.junction)

    def overpasses(self, route: Route) -> tuple[Overpass, ...]:
        """By station, then lane."""
        found = [
            Overpass(lane.id, station, (x, y))
            for part, rows in runs(route.lane_ids)
            for lane, x, y in self._crossed(self._lanes[self._rows[part]])
            for station in _stations(route, (x, y), rows)
        ]
        return tuple(sorted(found, key=lambda one: (one.station, one.lane)))

    def _crossed(self, lane: Lane) -> Iterator[tuple[Lane, float, float]]:
        """The lanes on another level that cross `lane`, and where [m]."""
        lines = self._tree.geometries
        own = lines[self._rows[lane.id]]
        for row in sorted(self._tree.query(own, predicate="crosses").tolist()):
            other = self._lanes[row]
            if not other.is_drivable:
                continue
            if (lane.is_internal and other.is_internal) or self._junctions[lane.edge] & self._junctions[other.edge]:
                continue
            for x, y in shapely.get_coordinates(shapely.intersection(own, lines[row])).tolist():
                if _is_inside(lane, x, y) and _is_inside(other, x, y) and _angle(lane, other, x, y) > _ANGLE:
                    yield other, x, y


def _stations(route: Route, position: tuple[float, float], rows: slice) -> Iterator[float]:
    """The station [m] abreast of a position along some rows of the route, if there is one."""
    first, last = route.line.stations[[rows.start, rows.stop - 1]].tolist()
    stations, offsets = route.line.project([position], between=(first - _SLACK, last + _SLACK))
    if abs(float(offsets[0])) <= _BESIDE:
        yield float(stations[0])


def _is_inside(lane: Lane, x: float, y: float) -> bool:
    stations, _ = lane.line.project([(x, y)])
    return lane.is_internal or _INSIDE <= float(stations[0]) <= lane.line.length - _INSIDE


def _angle(one: Lane, other: Lane, x: float, y: float) -> float:
    """Between two lines that cross there [rad], from 0 to pi/2."""
    headings = [float(lane.line.poses(lane.line.project([(x, y)])[0])[0, 2]) for lane in (one, other)]
    return abs(math.asin(min(max(math.sin(headings[0] - headings[1]), -1.0), 1.0)))
