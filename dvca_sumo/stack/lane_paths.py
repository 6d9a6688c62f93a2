"""Where lanes lead: their continuations through junctions, as one table of points 1 m apart.

Hypotheses of all objects are projected, timed and placed together. That takes one array that holds
every path: equal spacing makes a station an index, so no path is searched. Paths are made when first
asked for and kept, since traffic uses the same ones again and again.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from dvca_sumo.geometry.angles import wrapped_all
from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.messages import Floats, Integers
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.stack.continuations import Continuations, Traffic

# Rows of the table, steps being those to the next column [m]; what is looked up together is adjacent.
_STEP_X, _STEP_Y, _X, _Y, _HEADING, _HALF_WIDTH, _BEND_SQUARE, _LIMIT_SQUARE, _ROWS = range(9)

_TAIL = 300  # [m] beyond a dead end or the net's edge, traffic is taken to go straight on
_LENGTH_STEP = 40.0  # [m] continuations are kept by length in such steps
_BEND = 5  # columns (metres) to either side over which curvature is taken: what nets draw as a kink is none
_WINDOW = np.arange(-8, 9)  # columns (metres) around a guessed station that a projection searches


class LanePath(msgspec.Struct, frozen=True, eq=False):
    """Lanes in driving order, as columns `first` ... `last` of the table."""

    lanes: tuple[str, ...]
    starts: tuple[float, ...]  # [m] station at which each lane begins
    first: int
    last: int

    def lane_at(self, station: float) -> int:
        """Index in `lanes` of the lane at `station` [m]."""
        return bisect_right(self.starts, station, 1) - 1

    def lanes_between(self, start: float, end: float) -> tuple[str, ...]:
        """The lanes from station `start` to station `end` [m]."""
        return self.lanes[self.lane_at(start) : self.lane_at(end) + 1]


class Stretches(NamedTuple):
    """Where paths lie in the table, one row each."""

    first: Integers  # (h,) column
    last: Integers  # (h,) column


class Placements(NamedTuple):
    """Bodies seen from paths, one row each."""

    stations: Floats  # (h,) [m] half a length along the path behind the nose
    offsets: Floats  # (h,) [m] to the left of a body there that follows the path
    headings: Floats  # (h,) [rad] of that body
    steering: Floats  # (h,) [rad] from the body seen to the path at its nose
    half_widths: Floats  # (h,) [m] of the lane at the nose
    beyond: Floats  # (h,) [m] how far outside the searched stretch the nose lies, 0 within


class LanePaths:
    """All lane paths asked for so far; deterministic, whatever the order of asking."""

    def __init__(self, roadmap: RoadMap, *, max_branches: int, lateral_acceleration: float, braking: float) -> None:
        """Bends are driven at `lateral_acceleration` and approached braking with `braking` [m/s^2]."""
        self._lanes = roadmap.lanes
        self._continuations = Continuations(roadmap, max_branches)
        self._lateral_acceleration = lateral_acceleration
        self._braking = braking
        self._table = np.empty((_ROWS, 4096))
        self._used = 0
        self._paths: dict[tuple[str, ...], LanePath] = {}
        self._branches: dict[tuple[str, int, Traffic], tuple[tuple[LanePath, float], ...]] = {}

    def branches(self, lane: str, length: float, traffic: Traffic) -> tuple[tuple[LanePath, float], ...]:
        """The likeliest continuations for `traffic` `length` [m] from the start of `lane`; probabilities sum to 1."""
        key = (lane, math.ceil(length / _LENGTH_STEP), traffic)
        found = self._branches.get(key)
        if found is None:
            likely = self._continuations.of(lane, key[1] * _LENGTH_STEP, traffic)
            total = sum(probability for probability, _ in likely)
            found = tuple((self._path(lanes), probability / total) for probability, lanes in likely)
            self._branches[key] = found
        return found

    def place(self, paths: Stretches, guesses: Floats, boxes: Floats) -> Placements:
        """Places `boxes` (h, 5) on their paths, searched around the stations guessed (h,).

        It is their noses that are sought: in a bend, the middle of what follows a path is beside it.
        """
        first, last = paths
        centre_x, centre_y, bearings, lengths, _ = boxes.T
        halves = 0.5 * lengths
        nose_x, nose_y = centre_x + halves * np.cos(bearings), centre_y + halves * np.sin(bearings)
        searched = (np.rint(guesses + halves).astype(np.int64) + first)[:, None] + _WINDOW
        searched = np.minimum(np.maximum(searched, first[:, None]), last[:, None])
        x, y = self._table[_X : _Y + 1].take(searched, axis=1)
        x, y = nose_x[:, None] - x, nose_y[:, None] - y
        nearest = searched[np.arange(len(searched)), (x * x + y * y).argmin(axis=1)]
        x, y, ahead, half_widths = self._table[_X : _HALF_WIDTH + 1].take(nearest, axis=1)
        along = (nose_x - x) * np.cos(ahead) + (nose_y - y) * np.sin(ahead)
        # Columns are 1 m apart: unless the window missed it, the nearest is about half a metre away along the path.
        beyond = np.maximum(np.abs(along) - 1.0, 0.0)
        stations = (nearest - first) + along - halves
        poses, directions = self.bodies(paths, stations[:, None], lengths)
        (x, y, headings), (cosines, sines) = poses[:, :, 0], directions[:, :, 0]
        offsets = (centre_y - y) * cosines - (centre_x - x) * sines
        return Placements(stations, offsets, headings, wrapped_all(ahead - bearings), half_widths, beyond)

    def caps(self, paths: Stretches, stations: Floats, count: int) -> Floats:
        """Squares of speeds for bends, and of limits, from `stations` (h,) on, metre by metre: (2, h, count)."""
        first, last = paths
        metres = (np.maximum(np.rint(stations).astype(np.int64), 0) + first)[:, None] + np.arange(count)
        squares: Floats = self._table[_BEND_SQUARE:].take(np.minimum(metres, last[:, None]), axis=1)
        return squares

    def bodies(self, paths: Stretches, stations: Floats, lengths: Floats) -> tuple[Floats, Floats]:
        """Poses of bodies so long (h,), noses on their paths, tails where these were a length before: (3, h, t).

        x, y and headings, and with them the headings' cosines and sines (2, h, t). `stations` (h, t) are half a length
        along the path behind the noses.
        """
        first, last = paths
        half = 0.5 * lengths[:, None]
        ends = np.empty((2, *stations.shape))  # front, rear
        np.add(stations, half, out=ends[0])
        np.subtract(stations, half, out=ends[1])
        columns = np.minimum(np.maximum(ends.astype(np.int64), 0), (last - first - 1)[:, None])
        ends -= columns
        columns += first[:, None]
        found = self._table[: _Y + 1].take(columns, axis=1)
        points, steps = found[_X:], found[:_X]
        steps *= ends
        points += steps
        directions = points[:, 0] - points[:, 1]
        x, y = directions
        poses = np.empty((3, *stations.shape))
        np.arctan2(y, x, out=poses[2])
        directions /= np.hypot(x, y)
        np.subtract(points[:, 0], half * directions, out=poses[:2])
        return poses, directions

    def _path(self, lanes: tuple[str, ...]) -> LanePath:
        found = self._paths.get(lanes)
        if found is None:
            found = self._added(lanes)
            self._paths[lanes] = found
        return found

    def _added(self, lanes: tuple[str, ...]) -> LanePath:
        parts = [self._lanes[name] for name in lanes]
        points = np.concatenate([part.line.points for part in parts])
        line = Polyline(points)
        passed = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
        begins = np.cumsum([0, *(len(part.line.points) for part in parts[:-1])])
        starts = passed[begins]
        stations = np.arange(int(line.length) + 1 + (0 if parts[-1].successors else _TAIL), dtype=np.float64)
        which = np.searchsorted(starts, stations, side="right") - 1
        poses = line.poses(stations)
        columns = np.stack(
            [
                *np.diff(poses[:, :2], axis=0, append=poses[-1:, :2]).T,
                *poses.T,
                np.array([part.width / 2.0 for part in parts])[which],
                self._bend_squares(poses[:, 2]),
                np.array([part.mapped_limit**2 for part in parts])[which],
            ]
        )
        first = self._stored(columns)
        return LanePath(lanes, tuple(starts.tolist()), first, first + len(poses) - 1)

    def _bend_squares(self, headings: Floats) -> Floats:
        """The square of the speed at each column that leaves time to brake for the bends ahead [m^2/s^2]."""
        if len(headings) <= 2 * _BEND:
            return np.full(len(headings), np.inf)
        # Where lanes are drawn over each other a line goes back a little, and may have turned all the way round then.
        turns = np.abs(wrapped_all(headings[2 * _BEND :] - headings[: -2 * _BEND])) / (2.0 * _BEND)
        squares = self._lateral_acceleration / np.maximum(np.pad(turns, _BEND, mode="edge"), 1e-6)
        # v(s)^2 <= v(s')^2 + 2 b (s' - s) for every s' ahead: a running minimum from behind.
        braking = 2.0 * self._braking * np.arange(len(headings))
        lowest: Floats = np.minimum.accumulate((squares + braking)[::-1])[::-1] - braking
        return lowest

    def _stored(self, columns: Floats) -> int:
        first, self._used = self._used, self._used + columns.shape[1]
        if self._used > self._table.shape[1]:
            self._table = np.concatenate((self._table[:, :first], np.empty((_ROWS, 2 * self._used - first))), axis=1)
        self._table[:, first : self._used] = columns
        return first


def stretches_of(paths: Sequence[LanePath]) -> Stretches:
    """Where `paths` (h,) lie in the table."""
    first = np.array([path.first for path in paths], dtype=np.int64)
    return Stretches(first, np.array([path.last for path in paths], dtype=np.int64))
