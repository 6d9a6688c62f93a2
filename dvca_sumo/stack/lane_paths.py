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

from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.messages import Floats, Integers
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.stack.continuations import Continuations

_X, _Y, _HEADING = range(3)  # columns of poses
_BEND_SPEED, _LIMIT, _HALF_WIDTH, _TURNED = range(4)  # rows of rules

_TAIL = 300  # [m] beyond a dead end or the net's edge, traffic is taken to go straight on
_LENGTH_STEP = 40.0  # [m] continuations are kept by length in such steps
_BEND = 2  # rows (metres) to either side over which curvature is taken
_WINDOW = np.arange(-8, 9)  # rows (metres) around a guessed station that a projection searches


class LanePath(msgspec.Struct, frozen=True, eq=False):
    """Lanes in driving order, as rows `first` ... `first + count - 1` of the table."""

    lanes: tuple[str, ...]
    starts: tuple[float, ...]  # [m] station at which each lane begins
    first: int
    count: int

    def lane_at(self, station: float) -> int:
        """Index in `lanes` of the lane at `station` [m]."""
        return max(0, bisect_right(self.starts, station) - 1)

    def lanes_between(self, start: float, end: float) -> tuple[str, ...]:
        """The lanes from station `start` to station `end` [m]."""
        return self.lanes[self.lane_at(start) : self.lane_at(end) + 1]


class Placements(NamedTuple):
    """Points seen from paths, one row each."""

    stations: Floats  # (h,) [m]
    offsets: Floats  # (h,) [m] to the left
    headings: Floats  # (h,) [rad] of the path there
    half_widths: Floats  # (h,) [m] of the lane there
    beyond: Floats  # (h,) [m] how far outside the searched stretch the point lies, 0 within


class LanePaths:
    """All lane paths asked for so far; deterministic, whatever the order of asking."""

    def __init__(self, roadmap: RoadMap, *, max_branches: int, lateral_acceleration: float, braking: float) -> None:
        """Bends are driven at `lateral_acceleration` and approached braking with `braking` [m/s^2]."""
        self._lanes = roadmap.lanes
        self._continuations = Continuations(roadmap, max_branches)
        self._lateral_acceleration = lateral_acceleration
        self._braking = braking
        self._poses = np.empty((4096, 3))
        self._rules = np.empty((4, 4096))
        self._used = 0
        self._paths: dict[tuple[str, ...], LanePath] = {}
        self._branches: dict[tuple[str, int], tuple[tuple[LanePath, float], ...]] = {}

    def branches(self, lane: str, length: float) -> tuple[tuple[LanePath, float], ...]:
        """The likeliest continuations that reach `length` [m] from the start of `lane`; probabilities sum to 1."""
        key = (lane, math.ceil(length / _LENGTH_STEP))
        found = self._branches.get(key)
        if found is None:
            likely = self._continuations.of(lane, key[1] * _LENGTH_STEP)
            total = sum(probability for probability, _ in likely)
            found = tuple((self._path(lanes), probability / total) for probability, lanes in likely)
            self._branches[key] = found
        return found

    def project(self, paths: Sequence[LanePath], guesses: Floats, points: Floats) -> Placements:
        """Places `points` (h, 2) on their paths, searched around the stations guessed (h,)."""
        first, last = _extents(paths)
        rows = np.minimum(np.maximum(np.rint(guesses).astype(np.int64)[:, None] + _WINDOW, 0), last[:, None])
        near = self._poses.take(rows + first[:, None], axis=0)[:, :, :_HEADING]
        gaps = points[:, None, :] - near
        nearest = np.einsum("hwc,hwc->hw", gaps, gaps).argmin(axis=1)
        every = np.arange(len(rows))
        gap, row = gaps[every, nearest], rows[every, nearest]
        headings = self._poses[row + first, _HEADING]
        cosines, sines = np.cos(headings), np.sin(headings)
        along = gap[:, 0] * cosines + gap[:, 1] * sines
        offsets = gap[:, 1] * cosines - gap[:, 0] * sines
        # Rows are 1 m apart: unless the window missed it, the nearest is about half a metre away along the path.
        beyond = np.maximum(np.abs(along) - 1.0, 0.0)
        return Placements(row + along, offsets, headings, self._rules[_HALF_WIDTH].take(row + first), beyond)

    def caps(self, paths: Sequence[LanePath], stations: Floats, count: int) -> tuple[Floats, Floats]:
        """Speeds for bends, and speed limits, at `stations` (h,) and each of `count` metres on: (h, count) each."""
        first, last = _extents(paths)
        rows = np.maximum(np.rint(stations).astype(np.int64), 0)[:, None] + np.arange(count)
        rows = np.minimum(rows, last[:, None]) + first[:, None]
        return self._rules[_BEND_SPEED].take(rows), self._rules[_LIMIT].take(rows)

    def turned(self, paths: Sequence[LanePath], starts: Floats, ends: Floats) -> Floats:
        """How far each path turns, either way, from station to station [rad]: (h,), of (h,) and (h,)."""
        first, last = _extents(paths)
        begin, end = (np.minimum(np.maximum(np.rint(at).astype(np.int64), 0), last) for at in (starts, ends))
        turned: Floats = self._rules[_TURNED].take(end + first) - self._rules[_TURNED].take(begin + first)
        return turned

    def poses(self, paths: Sequence[LanePath], stations: Floats, offsets: Floats) -> Floats:
        """Poses at `stations` (h, t), moved to the left by `offsets` (h, t): (h, t, 3), headings not wrapped."""
        first, last = _extents(paths)
        rows = np.minimum(np.maximum(stations.astype(np.int64), 0), last[:, None] - 1)
        shares = (stations - rows)[:, :, None]
        rows += first[:, None]
        before = self._poses.take(rows, axis=0)
        poses: Floats = before + shares * (self._poses.take(rows + 1, axis=0) - before)
        poses[:, :, _X] -= offsets * np.sin(poses[:, :, _HEADING])
        poses[:, :, _Y] += offsets * np.cos(poses[:, :, _HEADING])
        return poses

    def bodies(self, paths: Sequence[LanePath], stations: Floats, offsets: Floats, lengths: Floats) -> Floats:
        """As `poses`, of the middles of bodies so long (h,) that both ends follow the path: chords in its bends."""
        half = 0.5 * lengths[:, None]
        fronts, rears = (self.poses(paths, stations + end, offsets)[:, :, :_HEADING] for end in (half, -half))
        ways = fronts - rears
        return np.concatenate((0.5 * (fronts + rears), np.arctan2(ways[:, :, _Y], ways[:, :, _X])[:, :, None]), axis=2)

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
        rules = np.stack(
            [
                self._bend_speeds(poses[:, _HEADING]),
                np.array([part.speed_limit for part in parts])[which],
                np.array([part.width / 2.0 for part in parts])[which],
                np.concatenate(([0.0], np.abs(np.diff(poses[:, _HEADING])).cumsum())),
            ]
        )
        return LanePath(lanes, tuple(starts.tolist()), self._stored(poses, rules), len(poses))

    def _bend_speeds(self, headings: Floats) -> Floats:
        """The speed at each row that leaves time to brake for the bends ahead [m/s]."""
        if len(headings) <= 2 * _BEND:
            return np.full(len(headings), np.inf)
        turns = np.abs(headings[2 * _BEND :] - headings[: -2 * _BEND]) / (2.0 * _BEND)
        squares = self._lateral_acceleration / np.maximum(np.pad(turns, _BEND, mode="edge"), 1e-6)
        # v(s)^2 <= v(s')^2 + 2 b (s' - s) for every s' ahead: a running minimum from behind.
        braking = 2.0 * self._braking * np.arange(len(headings))
        speeds: Floats = np.sqrt(np.minimum.accumulate((squares + braking)[::-1])[::-1] - braking)
        return speeds

    def _stored(self, poses: Floats, rules: Floats) -> int:
        first, self._used = self._used, self._used + len(poses)
        if self._used > len(self._poses):
            more = 2 * self._used - first
            self._poses = np.concatenate([self._poses[:first], np.empty((more, 3))])
            self._rules = np.concatenate([self._rules[:, :first], np.empty((4, more))], axis=1)
        self._poses[first : self._used] = poses
        self._rules[:, first : self._used] = rules
        return first


def _extents(paths: Sequence[LanePath]) -> tuple[Integers, Integers]:
    """First row in the table, and last row counted from it (h,), (h,)."""
    extents = np.array([(path.first, path.count - 1) for path in paths], dtype=np.int64).reshape(-1, 2)
    return extents[:, 0], extents[:, 1]
