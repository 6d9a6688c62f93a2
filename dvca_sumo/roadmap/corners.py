"""Turns past the corners of junctions where people wait: the lane there is moved over, off them."""

from collections.abc import Iterable, Sequence

import numpy as np
import shapely

from dvca_sumo.geometry.polyline import Floats, Polyline
from dvca_sumo.roadmap.areas import narrowed, walking_corners
from dvca_sumo.roadmap.lanes import Movement
from dvca_sumo.roadmap.reading import NetContents

_OFF_CORNER = 0.5  # [m] that a lane keeps off the ground of people, who stand up to its edge
_OFF_CENTRE = 1.4  # [m] that it keeps off the centre of a lane beside: half a car, and a margin
_SWEPT = 4.0  # [m] before and after a place over which a car that is there may reach


def off_corners(
    net: NetContents, line: Polyline, passages: Iterable[tuple[Movement, slice]], room: tuple[Floats, Floats]
) -> tuple[Floats, Floats]:
    """The lane's edges to the left and to the right of each point of `line` [m], `room` without regard to people.

    Where the ground of people at a corner reaches into the lane it is moved over as a whole, as far as others who drive
    beside it have room. `passages` are the movements on the way, and the points on their junctions.
    """
    left, right = room[0].copy(), room[1].copy()
    poses = line.poses(line.stations)
    for movement, rows in passages:
        junction = net.junctions[movement.junction]
        if not junction.walking:
            continue
        lanes = [net.lanes[name] for other in junction.movements for name in other.internal]
        ground = walking_corners(junction.walking.values(), [(lane.line.points, lane.width) for lane in lanes])
        beside = shapely.MultiLineString(_beside(net, movement, junction.movements))
        points, headings, stations = line.points[rows], poses[rows, 2], line.stations[rows]
        swept = np.stack([stations.searchsorted(stations + reach) for reach in (-_SWEPT, _SWEPT)], axis=1).tolist()
        for edge, other in ((left, right), (right, left)):
            side = np.sign(other[rows])
            wanted = side * (narrowed(edge[rows], points, headings, ground, _OFF_CORNER) - edge[rows])
            most = other[rows] + side * wanted.max(initial=0.0)
            free = side * (narrowed(most, points, headings, beside, _OFF_CENTRE) - other[rows])
            free = np.array([free[begin:end].min() for begin, end in swept])
            moved = side * np.clip(free, 0.0, wanted)
            edge[rows] += moved
            other[rows] += moved
    return left, right


def _beside(net: NetContents, movement: Movement, others: Sequence[Movement]) -> list[Floats]:
    """The centre lines (n, 2) of ways beside `movement`: from its edge or onto it, from and to other lanes."""
    source, target = (net.lanes[name].edge for name in (movement.from_lane, movement.to_lane))
    return [
        net.lanes[name].line.points
        for other in others
        if other.from_lane != movement.from_lane and other.to_lane != movement.to_lane
        if net.lanes[other.from_lane].edge == source or net.lanes[other.to_lane].edge == target
        for name in other.internal
    ]
