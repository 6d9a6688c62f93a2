"""Directed lines through points, and Frenet coordinates along them.

The position runs along straight segments. The heading turns from one segment to the next within
half a metre to a metre of the vertex (half a segment where segments are short), so that it, and
every line at a fixed offset, is continuous.
"""

import math
from bisect import bisect_left, bisect_right
from functools import cached_property

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

_TURNING_REACH = 1.0  # [m] at most so far from a vertex does the heading begin to turn
_FOLD = 0.5  # curvature times offset above which normals come too close to crossing to be told apart


class Polyline:
    """A directed line through at least two distinct points; repeated points are dropped.

    Stations are arc lengths from the first point [m]; offsets are lateral, positive to the left [m].
    All arrays are read-only. Raises ValueError for fewer than two distinct points.
    """

    def __init__(self, points: npt.ArrayLike) -> None:
        kept = np.array(points, dtype=np.float64).reshape(-1, 2)
        repeated = (kept[1:] == kept[:-1]).all(axis=1)
        if repeated.any():
            kept = kept[np.concatenate(([True], ~repeated))]
        if len(kept) < 2:
            raise ValueError(f"a polyline needs two distinct points, not {len(kept)}")
        self.points = _fixed(kept)

    def __len__(self) -> int:
        return len(self.points)

    @property
    def length(self) -> float:
        """Arc length [m]."""
        return float(self.stations[-1])

    @cached_property
    def stations(self) -> Floats:
        """(n,) arc length at each point [m], strictly increasing from 0."""
        return _fixed(np.concatenate(([0.0], np.cumsum(self._lengths))))

    @cached_property
    def headings(self) -> Floats:
        """(n,) heading at each point [rad], continuous (not wrapped)."""
        return _fixed(np.interp(self.stations, self._turn_stations, self._turn_headings))

    @cached_property
    def curvatures(self) -> Floats:
        """(n,) curvature at each point [1/m], positive to the left; that of the neighbour at either end."""
        turns = np.diff(self._directions)
        inner = turns / (0.5 * (self._lengths[1:] + self._lengths[:-1]))
        if not len(inner):
            return _fixed(np.zeros(2))
        return _fixed(np.concatenate((inner[:1], inner, inner[-1:])))

    def poses(self, stations: npt.ArrayLike, offsets: Floats | float = 0.0) -> Floats:
        """The poses at `stations` (m,), moved sideways by `offsets` (m,): (m, 3) x, y, heading (not wrapped).

        Beyond its ends the line goes on straight.
        """
        along = np.asarray(stations, dtype=np.float64)
        segments = self.stations[1:-1].searchsorted(along, side="right")
        headings = self.headings_at(along)
        centres = self.points[segments] + (along - self.stations[segments])[:, None] * self._units[segments]
        poses = np.empty((len(along), 3))
        poses[:, 0] = centres[:, 0] - offsets * np.sin(headings)
        poses[:, 1] = centres[:, 1] + offsets * np.cos(headings)
        poses[:, 2] = headings
        return poses

    def headings_at(self, stations: Floats) -> Floats:
        """The headings of `poses` alone (m,) [rad]."""
        return np.interp(stations, self._turn_stations, self._turn_headings)

    def project(self, points: npt.ArrayLike, *, between: tuple[float, float] | None = None) -> tuple[Floats, Floats]:
        """Stations and offsets (m,), (m,) of `points` (m, 2): the inverse of `poses`.

        Stations stay within [0, length], and within `between` when that is given (only this stretch is
        searched then, which tells the two passes of a loop apart and is fast). The offset is the
        distance to the line at that station, negative to the right; beyond an end it is thus not
        perpendicular.
        """
        low, high = (0.0, self.length) if between is None else self._window(*between)
        xy = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        first, nearest, squares = self._nearest(self._local(xy), low, high)
        segments = squares.argmin(axis=1)
        stations = self.stations[segments + first] + nearest[np.arange(len(xy)), segments]
        return self._refined(xy, stations, low, high)

    def project_near(self, points: Floats, stations: Floats, reach: float) -> tuple[Floats, Floats]:
        """As `project`, of points (m, 2), each looked for within `reach` of a station (m,) of its own [m]."""
        _, nearest, squares = self._nearest(self._local(points), 0.0, self.length)
        found = self.stations[:-1] + nearest
        squares[np.abs(found - stations[:, None]) > reach] = math.inf
        rows = np.arange(len(points))
        return self._refined(points, found[rows, squares.argmin(axis=1)], 0.0, self.length)

    def place(self, x: float, y: float, *, between: tuple[float, float]) -> tuple[float, float]:
        """Station and offset of one point, as `project` finds them."""
        low, high = self._window(*between)
        _, origin_x, origin_y, _, _ = self._rows[0]
        first, nearest, squares = self._nearest(np.array([[x - origin_x, y - origin_y, 1.0]]), low, high)
        segment = int(squares.argmin())
        station = self._station_list[first + segment] + nearest.item(segment)
        knots = self._turn_list
        knot = bisect_right(knots, station, 1, len(knots) - 1) - 1
        turning = self._turn_rates.item(knot)
        heading = self._turn_headings.item(knot) + turning * (station - knots[knot])
        cosine, sine = math.cos(heading), math.sin(heading)
        dx, dy = self._gap(x, y, station)
        across = dy * cosine - dx * sine
        fold = turning * across
        step = (dx * cosine + dy * sine) / (1.0 - fold) if abs(fold) < _FOLD else 0.0
        refined = min(max(station + step, low), high)
        return refined, math.copysign(math.hypot(*self._gap(x, y, refined)), across)

    def _local(self, xy: Floats) -> Floats:
        """(m, 3) points relative to the first one of the line, and 1."""
        local = np.ones((len(xy), 3))
        np.subtract(xy, self.points[0], out=local[:, :2])
        return local

    def _nearest(self, local: Floats, low: float, high: float) -> tuple[int, Floats, Floats]:
        """First segment searched, and of each one from there the nearest place along it and its squared distance.

        The squared distance (m, segments) is less the point's own square. `local` (m, 3) holds x, y
        relative to the first point, and 1.
        """
        stations = self._station_list
        first = bisect_right(stations, low, 1, len(stations) - 1) - 1
        last = max(bisect_left(stations, high, 1), first + 1)
        along = local @ self._along[:, first:last]
        nearest = np.maximum(along, 0.0)
        np.minimum(nearest, self._lengths[first:last], out=nearest)
        along *= -2.0
        along += nearest
        along *= nearest
        along += local @ self._from_start[:, first:last]
        return first, nearest, along

    def _refined(self, xy: Floats, stations: Floats, low: float, high: float) -> tuple[Floats, Floats]:
        """One Newton step from the nearest point to where the interpolated normal meets the point.

        On the nearest segment alone, stations stand still outside a vertex and jump inside it.
        """
        knots = self._turn_stations[1:-1].searchsorted(stations, side="right")
        turning = self._turn_rates[knots]
        headings = self._turn_headings[knots] + turning * (stations - self._turn_stations[knots])
        cosines, sines = np.cos(headings), np.sin(headings)
        dx, dy = self._gaps(xy, stations)
        across = dy * cosines - dx * sines
        fold = turning * across
        step = np.where(np.abs(fold) < _FOLD, (dx * cosines + dy * sines) / (1.0 - fold), 0.0)
        refined = np.minimum(np.maximum(stations + step, low), high)
        return refined, np.copysign(np.hypot(*self._gaps(xy, refined)), across)

    def _gaps(self, xy: Floats, stations: Floats) -> tuple[Floats, Floats]:
        """From the line at `stations` to the points, in x and in y [m]."""
        segments = self.stations[1:-1].searchsorted(stations, side="right")
        gaps = xy - self.points[segments] - (stations - self.stations[segments])[:, None] * self._units[segments]
        return gaps[:, 0], gaps[:, 1]

    def _gap(self, x: float, y: float, station: float) -> tuple[float, float]:
        """`_gaps` of one point."""
        segment = bisect_right(self._station_list, station, 1, len(self) - 1) - 1  # at a vertex, the one after it
        from_station, from_x, from_y, unit_x, unit_y = self._rows[segment]
        passed = station - from_station
        return x - from_x - passed * unit_x, y - from_y - passed * unit_y

    def _window(self, low: float, high: float) -> tuple[float, float]:
        low = min(max(low, 0.0), self.length)
        return low, min(max(high, low), self.length)

    @cached_property
    def _lengths(self) -> Floats:
        steps = np.diff(self.points, axis=0)
        return np.hypot(steps[:, 0], steps[:, 1])

    @cached_property
    def _units(self) -> Floats:
        return np.diff(self.points, axis=0) / self._lengths[:, None]

    @cached_property
    def _directions(self) -> Floats:
        return np.unwrap(np.arctan2(self._units[:, 1], self._units[:, 0]))

    @cached_property
    def _turn_stations(self) -> Floats:
        """Two stations around each inner vertex, between which the heading turns, and both ends."""
        halves = 0.5 * self._lengths
        reach = np.minimum(np.minimum(halves[1:], halves[:-1]), _TURNING_REACH)
        inner = self.stations[1:-1, None] + reach[:, None] * np.array([-1.0, 1.0])
        return np.concatenate(([0.0], inner.ravel(), [self.length]))

    @cached_property
    def _turn_headings(self) -> Floats:
        return np.repeat(self._directions, 2)

    @cached_property
    def _turn_rates(self) -> Floats:
        gaps = np.diff(self._turn_stations)
        return np.diff(self._turn_headings) / np.where(gaps > 0.0, gaps, np.inf)

    # Numbers looked up one at a time are quicker to reach in lists.

    @cached_property
    def _station_list(self) -> list[float]:
        stations: list[float] = self.stations.tolist()
        return stations

    @cached_property
    def _turn_list(self) -> list[float]:
        stations: list[float] = self._turn_stations.tolist()
        return stations

    @cached_property
    def _rows(self) -> list[list[float]]:
        """Where each segment begins (station, x, y), and its direction."""
        rows: list[list[float]] = np.column_stack((self.stations[:-1], self.points[:-1], self._units)).tolist()
        return rows

    @cached_property
    def _along(self) -> Floats:
        """(3, n-1): [x, y, 1] relative to the first point -> distance along each segment's direction."""
        starts = self.points[:-1] - self.points[0]
        return np.vstack((self._units.T, -(starts * self._units).sum(axis=1)))

    @cached_property
    def _from_start(self) -> Floats:
        """(3, n-1): [x, y, 1] -> squared distance to each segment's start, less the point's own square."""
        starts = self.points[:-1] - self.points[0]
        return np.vstack((-2.0 * starts.T, (starts**2).sum(axis=1)))


def _fixed(array: Floats) -> Floats:
    array.setflags(write=False)
    return array
