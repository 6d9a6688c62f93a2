"""The route as the planner sees it from where the ego is: a window of reference line, 1 m between rows."""

import math

import msgspec
import numpy as np

from dvca_sumo.messages import Floats, Integers, VehicleShape
from dvca_sumo.roadmap.route import Route
from dvca_sumo.stack.planning.config import PlanningConfig

BEHIND = 20  # rows of a window that lie behind its origin
_BEYOND = 400  # [m] straight continuation of the line past its end, so that a window is never cut
_OUTLOOK = 200  # [m]
_NODES = 6  # rows between the points searched first when projecting
_ITERATIONS = 6
_CONVERGED = 1e-4  # [m]
_TURNED_BACK = 2.4  # [rad]
_NEAREST_CENTRE = 0.3  # of the distance to the centre of curvature, closest at which a point is still projected

_X, _Y, _COS, _SIN, _HEADING, _CURVATURE, _LIMIT, _LANE_LEFT, _LANE_RIGHT, _ROAD_LEFT, _ROAD_RIGHT = range(11)
_SWEPT_LEFT, _SWEPT_RIGHT, _COLUMNS = 11, 12, 13


class Window(msgspec.Struct, frozen=True, eq=False):
    """Rows of the reference line: row BEHIND lies at `station`, the others 1 m apart before and after it.

    Stations given to and by a window count from its origin, `station`.
    """

    station: float  # [m] on the route
    rows: Floats  # (13, n), all of the following
    x: Floats  # (n,) [m]
    y: Floats  # (n,) [m]
    cosines: Floats  # (n,) of the heading
    sines: Floats  # (n,) of the heading
    headings: Floats  # (n,) [rad], continuous
    curvatures: Floats  # (n,) [1/m]
    speed_limits: Floats  # (n,) [m/s] the lowest under any part of the ego whose rear axle is there
    lane_left: Floats  # (n,) [m]
    lane_right: Floats  # (n,) [m]
    road_left: Floats  # (n,) [m]
    road_right: Floats  # (n,) [m]
    swept_left: Floats  # (n,) [m] leftmost offset of the body, its rear axle on the line: farther out in bends
    swept_right: Floats  # (n,) [m] rightmost

    def span(self, low: float, high: float) -> slice:
        """The rows from `low` to `high`, at least one."""
        last = self.rows.shape[1]
        first = min(max(int(low) + BEHIND, 0), last - 1)
        return slice(first, min(max(int(high) + BEHIND + 1, first + 1), last))

    def index(self, stations: Floats) -> Integers:
        """The nearest row of each station."""
        rows: Integers = np.rint(stations).astype(np.int64)
        rows += BEHIND
        np.maximum(rows, 0, out=rows)
        np.minimum(rows, self.rows.shape[1] - 1, out=rows)
        return rows

    def up_to_fold(self) -> "Window":
        """The part before the line turns back: who is beside that may be nearer to what comes after the turn."""
        turns = np.abs(self.headings[BEHIND:] - self.headings[BEHIND]) > _TURNED_BACK
        if not np.count_nonzero(turns):
            return self
        rows = self.rows[:, : BEHIND + max(int(turns.argmax()), 1)]
        return Window(self.station, rows, *rows)

    def moved(self, offsets: Floats, begin: int, width: float) -> "Window":
        """The window of a line beside this one, at `offsets` (n,) [m], from row `begin` on along a lane so wide [m].

        Its stations are those of this line.
        """
        slopes = np.gradient(offsets)
        scale = 1.0 - self.curvatures * offsets
        headings = self.headings + np.arctan2(slopes, scale)
        rows = np.empty_like(self.rows)
        rows[_X] = self.x - offsets * self.sines
        rows[_Y] = self.y + offsets * self.cosines
        rows[_COS], rows[_SIN], rows[_HEADING] = np.cos(headings), np.sin(headings), headings
        rows[_CURVATURE] = np.gradient(headings) / np.hypot(slopes, scale)
        rows[_LIMIT] = self.speed_limits
        rows[_LANE_LEFT], rows[_LANE_RIGHT] = self.lane_left, self.lane_right
        rows[_LANE_LEFT, begin:], rows[_LANE_RIGHT, begin:] = 0.5 * width, -0.5 * width
        rows[_ROAD_LEFT], rows[_ROAD_RIGHT] = self.road_left - offsets, self.road_right - offsets
        rows[_SWEPT_LEFT], rows[_SWEPT_RIGHT] = self.swept_left, self.swept_right
        return Window(self.station, rows, *rows)

    def project(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Stations, offsets and the line's heading there, of points (m, 2).

        The same as `Polyline.project` within a centimetre, for hundreds of points at a fraction of the
        cost. Behind its beginning the line goes on straight: who follows the ego is in its lane there, too.
        Offsets of points beyond its end hold the distance to that.
        """
        nodes = self.rows[:2, ::_NODES].copy()
        x, y = nodes
        nearness = points @ nodes
        nearness -= 0.5 * (x * x + y * y)  # minus half the squares of the distances, but for the points' own
        nearest = nearness.argmax(axis=1) * _NODES
        ahead, across, curvatures, _ = self._seen(points, nearest)
        rough = ahead / np.maximum(1.0 - curvatures * across, _NEAREST_CENTRE)
        rows = np.minimum(np.maximum(rough, -_NODES, out=rough), _NODES, out=rough)
        rows += nearest
        np.rint(rows, out=rows)
        np.minimum(np.maximum(rows, 0.0, out=rows), self.rows.shape[1] - 1.0, out=rows)
        ahead, across, curvatures, headings = self._seen(points, rows.astype(np.int64))
        scale = np.maximum(1.0 - curvatures * across, _NEAREST_CENTRE)
        step = np.minimum(np.maximum(ahead / scale, -1.0), 1.0)
        turn = curvatures * step
        missed = ahead - step * scale
        offsets = across - 0.5 * turn * step
        stations, is_behind = step + (rows - BEHIND), (rows == 0.0) & (ahead < -1.0)
        beyond = ((np.abs(missed) > 1.0) & ~is_behind).nonzero()[0]
        if beyond.size:
            offsets[beyond] = np.copysign(np.hypot(missed[beyond], offsets[beyond]), offsets[beyond])
        if np.count_nonzero(is_behind):
            stations[is_behind], offsets[is_behind], turn[is_behind] = ahead[is_behind] - BEHIND, across[is_behind], 0.0
        return stations, offsets, headings + turn

    def _seen(self, points: Floats, rows: Integers) -> tuple[Floats, Floats, Floats, Floats]:
        x, y, cosines, sines, headings, curvatures = self.rows[:6].take(rows, axis=1, mode="clip")
        x = points[:, 0] - x
        y = points[:, 1] - y
        return x * cosines + y * sines, y * cosines - x * sines, curvatures, headings


class Reference:
    """A route, prepared so that a window is cut out by slicing."""

    def __init__(self, route: Route, shape: VehicleShape, config: PlanningConfig) -> None:
        line = route.line
        stations = np.arange(-BEHIND - 2, line.length + _BEYOND)
        inside = np.clip(stations, 0.0, line.length)
        poses = line.poses(inside)
        outside = stations - inside
        table = np.empty((_COLUMNS, len(stations)))
        table[_COS], table[_SIN], table[_HEADING] = np.cos(poses[:, 2]), np.sin(poses[:, 2]), poses[:, 2]
        table[_X] = poses[:, 0] + outside * table[_COS]
        table[_Y] = poses[:, 1] + outside * table[_SIN]
        columns = (route.curvatures, route.lane_left, route.lane_right, route.road_left, route.road_right)
        rows = (_CURVATURE, _LANE_LEFT, _LANE_RIGHT, _ROAD_LEFT, _ROAD_RIGHT)
        for row, column in zip(rows, columns, strict=True):
            table[row] = np.interp(inside, line.stations, column)
        table[_CURVATURE, outside != 0.0] = 0.0
        body = (-shape.rear_overhang - 1.0, shape.front + 1.0)
        table[_LIMIT] = _lowest_within(inside, line.stations, _limits(route, config), body)
        line_rows = table[[_X, _Y, _COS, _SIN]]
        table[_SWEPT_LEFT:] = swept(table[:2], table[_HEADING], line_rows, shape)
        self._table = table
        limits = np.pad(table[_LIMIT], (0, _OUTLOOK - 1), mode="edge")
        self._fastest = np.lib.stride_tricks.sliding_window_view(limits, _OUTLOOK).max(axis=1)
        self._steps = table[:, 1:] - table[:, :-1]
        self._end = line.length + _BEYOND - _OUTLOOK

    def locate(self, x: float, y: float, near: float) -> tuple[float, float, float] | None:
        """Station, offset and the line's heading there of a point within some metres of station `near`.

        Newton's method; None where that does not converge on the line, or far past its end.
        """
        station = near
        for _ in range(_ITERATIONS):
            row = min(max(int(station) + BEHIND + 2, 0), self._table.shape[1] - 2)
            part = station + BEHIND + 2 - row
            east, north, cosine, sine, heading, curvature = [
                low + part * (high - low) for low, high in self._table[:6, row : row + 2].tolist()
            ]
            ahead = (x - east) * cosine + (y - north) * sine
            across = (y - north) * cosine - (x - east) * sine
            if abs(ahead) < _CONVERGED:
                return (station, across, heading) if 0.0 <= station <= self._end else None
            station += ahead / max(1.0 - curvature * across, _NEAREST_CENTRE)
        return None

    def fastest(self, station: float) -> float:
        """The highest speed limit within the next _OUTLOOK [m/s]."""
        return float(self._fastest[int(station) + BEHIND + 2])

    def window(self, station: float, length: float) -> Window:
        """From BEHIND before `station` to at least `length` past it, interpolated linearly."""
        first = station + 2.0
        whole = int(first)
        part = slice(whole, whole + BEHIND + int(length) + 2)
        rows = self._steps[:, part] * (first - whole)
        rows += self._table[:, part][:, : rows.shape[1]]
        return Window(station, rows, *rows)


def swept(points: Floats, headings: Floats, line: Floats, shape: VehicleShape) -> Floats:
    """Where the sides of the body pass each station: leftmost and rightmost offset (2, n) from the line [m].

    The rear axle comes through `points` (2, n), one beside each of the rows x, y, cosine and sine of `line` (4, n), 1 m
    apart. The body is straight ahead of the rear axle, however the line bends.
    """
    metres, stations = math.ceil(shape.front) + 1, len(headings)
    count = stations - metres + 1
    ahead = np.minimum(np.arange(metres, dtype=np.float64), shape.front)[:, None]  # of the axle, each a station farther
    # One row for what is so far ahead of the axle, in two layouts: by station, and each one place longer, by axle.
    spots = np.empty((2, metres * (stations + 1)))
    by_station = spots[:, : metres * stations].reshape(2, metres, stations)
    by_axle = spots.reshape(2, metres, stations + 1)[:, :, :count]
    by_station[:] = points[:, None]  # where the axle has come from too near
    np.multiply(ahead, np.cos(headings[:count]), out=by_axle[0])
    np.multiply(ahead, np.sin(headings[:count]), out=by_axle[1])
    by_axle += points[:, None, :count]
    by_station -= line[:2, None]
    offsets = by_station[1] * line[2]
    offsets -= by_station[0] * line[3]
    sides = np.empty((2, stations))
    np.add(np.maximum.reduce(offsets), 0.5 * shape.width, out=sides[0])
    np.subtract(np.minimum.reduce(offsets), 0.5 * shape.width, out=sides[1])
    return sides


def _limits(route: Route, config: PlanningConfig) -> Floats:
    """The speed limit at each point of the line [m/s]; where the map has none, what the type of the road suggests."""
    limits, stations = route.speed_limits.copy(), route.line.stations
    for gap in route.unmapped_limits:
        usual = config.motorway_limit if gap.is_motorway else config.urban_limit
        limits[(stations >= gap.start_station) & (stations <= gap.end_station)] = (
            config.speed_bound if config.unmapped_at_bound else usual
        )
    return limits


def _lowest_within(stations: Floats, known: Floats, limits: Floats, reach: tuple[float, float]) -> Floats:
    """The lowest of `limits`, given at the `known` stations, from reach[0] to reach[1] around each station."""
    first = np.maximum(known.searchsorted(stations + reach[0]) - 1, 0)
    last = np.minimum(known.searchsorted(stations + reach[1]), len(known) - 1)
    return np.array([limits[low : high + 1].min() for low, high in zip(first, last, strict=True)])
