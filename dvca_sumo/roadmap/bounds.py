"""How much room there is to either side of a route's line, and where lanes run beside it."""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence

import msgspec
import numpy as np
import numpy.typing as npt

from dvca_sumo.geometry.polyline import Floats, Polyline
from dvca_sumo.roadmap.drawing import Change
from dvca_sumo.roadmap.lanes import Lane
from dvca_sumo.roadmap.route import LaneChange

_JUNCTION_MARGIN = 0.5  # [m] of drivable surface beside a lane on a junction
_EVENED = 5  # [m] to either side over which offsets of lanes are averaged
_INSIDE = 0.1  # [m] of room there is on either side in any case: a turn too tight for a car takes the line off its lane


class Bounds(msgspec.Struct, frozen=True, eq=False):
    """Offsets of edges from the line, at each of its points [m]; left > 0 > right."""

    lane_left: Floats
    lane_right: Floats
    road_left: Floats
    road_right: Floats


def bounds(
    lanes: Mapping[str, Lane], line: Polyline, followed: Sequence[tuple[Lane, slice]], changes: Sequence[Change]
) -> Bounds:
    """The edges along `line`, whose points follow these lanes; during a change all lanes touched count."""
    found = Bounds(*(np.zeros(len(line)) for _ in range(4)))
    for lane, rows in followed:
        _put(found, lanes, line, lane, rows, is_first=True)
    for change in changes:
        rows = slice(int(np.searchsorted(line.stations, change.begin)), int(np.searchsorted(line.stations, change.end)))
        for lane in change.lanes:
            _put(found, lanes, line, lane, rows, is_first=False)
    for array, sign in (
        (found.lane_left, 1.0),
        (found.lane_right, -1.0),
        (found.road_left, 1.0),
        (found.road_right, -1.0),
    ):
        array[array * sign < _INSIDE] = sign * _INSIDE
        array.setflags(write=False)
    return found


def lane_change(line: Polyline, change: Change, junctions: Iterable[tuple[float, float]]) -> LaneChange:
    """Where the lanes of `change`, whose stations are on `line`, run beside it; likewise all `junctions` on the way."""
    first, last = np.searchsorted(line.stations, (change.begin, change.latest))
    rows = slice(int(first), max(int(last), int(first)) + 1)
    beside_line = [way_beside(line, way, rows) for way in change.ways]
    offsets = np.stack([evened(np.where(is_there, centres, 0.0)) for centres, is_there, _ in beside_line])
    offsets.setflags(write=False)
    return LaneChange(
        lanes=tuple(ids for _, _, ids in beside_line),
        widths=tuple(min(lane.width for lane in way) for way in change.ways),
        start_station=change.begin,
        latest_station=change.latest,
        stations=line.stations[rows],
        offsets=offsets,
        junctions=tuple((begin, end) for begin, end in junctions if change.begin < begin < change.latest),
    )


def way_beside(
    line: Polyline, way: Sequence[Lane], rows: slice
) -> tuple[Floats, npt.NDArray[np.bool_], tuple[str, ...]]:
    """Offsets of lanes that lead from one to the next from the points `rows` of `line` [m]; where they are; which.

    Where they are not beside the line, the offset is that of their end.
    """
    offsets, is_beside, stations = _beside(line, Polyline(np.concatenate([lane.line.points for lane in way])), rows)
    gaps = [math.dist(lane.line.points[-1], after.line.points[0]) for lane, after in itertools.pairwise(way)]
    ends = np.cumsum([lane.line.length + gap for lane, gap in zip(way, gaps, strict=False)])
    places = ends.searchsorted(stations, side="right")
    return offsets, is_beside, tuple(way[place].id for place in places.tolist())


def evened(offsets: Floats) -> Floats:
    """Without the kinks of the net's shapes, at points 1 m apart."""
    reach = min(_EVENED, len(offsets) - 1)
    kernel = np.hanning(2 * reach + 3)[1:-1]
    padded = np.concatenate((np.full(reach, offsets[0]), offsets, np.full(reach, offsets[-1])))
    return np.convolve(padded, kernel / kernel.sum(), mode="valid")


def _put(found: Bounds, lanes: Mapping[str, Lane], line: Polyline, lane: Lane, rows: slice, *, is_first: bool) -> None:
    centre = _centre(line, lane, rows)
    left, right = centre + 0.5 * lane.width, centre - 0.5 * lane.width
    margin = _JUNCTION_MARGIN if lane.is_internal else 0.0
    sides = (left, right, left + _room(lanes, lane, "left") + margin, right - _room(lanes, lane, "right") - margin)
    for array, side, widest in zip(msgspec.structs.astuple(found), sides, (np.maximum, np.minimum) * 2, strict=True):
        array[rows] = side if is_first else widest(array[rows], side)


def _centre(line: Polyline, lane: Lane, rows: slice) -> Floats:
    """Offset of the lane's centre from the line; 0 where the lane does not reach (curves joining lanes)."""
    offsets, is_beside, _ = _beside(line, lane.line, rows)
    return np.where(is_beside, offsets, 0.0)


def _beside(line: Polyline, other: Polyline, rows: slice) -> tuple[Floats, npt.NDArray[np.bool_], Floats]:
    """Offsets of `other` from the points `rows` of `line` [m], where it is beside them at all, and its stations there.

    Stations are on `other` [m].
    """
    points, headings = line.points[rows], line.headings[rows]
    stations, _ = other.project(points)
    gaps = other.poses(stations)[:, :2] - points
    offsets = gaps[:, 1] * np.cos(headings) - gaps[:, 0] * np.sin(headings)
    return offsets, (stations > 0.0) & (stations < other.length), stations


def _room(lanes: Mapping[str, Lane], lane: Lane, side: str) -> float:
    """Width of all lanes on that side which the ego may use [m]."""
    width = 0.0
    neighbour = getattr(lane, side)
    while neighbour is not None:
        width += lanes[neighbour].width
        neighbour = getattr(lanes[neighbour], side)
    return width
