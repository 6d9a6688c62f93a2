"""The rough reference line: lane centre lines joined end to end, lane changes blended in."""

from collections.abc import Sequence

import msgspec
import numpy as np

from dvca_sumo.geometry.polyline import Floats, Polyline
from dvca_sumo.roadmap.lanes import Lane

_JOINT = 0.5  # [m] ends of consecutive lanes closer than this are taken to be one point
_HANDLE = 0.4  # of the gap between two lanes: length of the connecting Bezier curve's handles


class Stretch(msgspec.Struct, frozen=True, eq=False):
    """From here on, up to the next stretch, the line follows `lane`."""

    lane: Lane
    begin: float  # [m] station


class Change(msgspec.Struct, frozen=True, eq=False):
    """Between these stations the line crosses over `lanes`, from the first to the last."""

    ways: tuple[tuple[Lane, ...], ...]  # each of the lanes, and those it leads on to beside the others, end to end
    begin: float  # [m] station
    end: float  # [m]
    latest: float  # [m] where the ways end

    @property
    def lanes(self) -> tuple[Lane, ...]:
        """Those of the edge on which the line crosses over."""
        return tuple(way[0] for way in self.ways)


class Drawing:
    """Draws the line from lane to lane, and remembers which part follows which lane.

    Lanes that do not meet (a net without internal lanes) are joined by a smooth curve, half of which
    belongs to either lane.
    """

    def __init__(self) -> None:
        self.stretches: list[Stretch] = []
        self.changes: list[Change] = []
        self.length = 0.0  # [m] so far
        self._parts: list[Floats] = []

    @property
    def points(self) -> Floats:
        """(n, 2) of the line so far."""
        return np.concatenate(self._parts)

    def follow(self, lane: Lane) -> tuple[float, float]:
        """Draw `lane` from end to end; returns the stations of both ends [m]."""
        begin = self._join(lane)
        self._append(lane.line.points)
        return begin, self.length

    def cross(self, lanes: Sequence[Lane], blend: tuple[float, float]) -> tuple[float, float]:
        """Draw the edge of neighbouring `lanes`, changing from the first to the last.

        The change takes place between the stations `blend` of the first lane; the lateral motion has
        neither speed nor acceleration at its ends (quintic). Returns the stations of the edge's ends [m].
        """
        first, last = lanes[0], lanes[-1]
        begin = self._join(first)
        self._append(_cut(first.line, 0.0, blend[0]))
        origin = self.length
        along = np.linspace(*blend, max(int(blend[1] - blend[0]), 16 * len(lanes)) + 1)
        share = np.linspace(0.0, 1.0, len(along))
        weight = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        source = first.line.poses(along)[:, :2]
        reached, _ = last.line.project(source)
        points = source + weight[:, None] * (last.line.poses(reached)[:, :2] - source)
        nearest = np.rint(weight * (len(lanes) - 1))
        for index in range(1, len(lanes)):
            row = int(np.searchsorted(nearest, index))
            self._append(points[:row] if index == 1 else points[int(np.searchsorted(nearest, index - 1)) : row])
            self.stretches.append(Stretch(lanes[index], self.length))
        self._append(points[int(np.searchsorted(nearest, len(lanes) - 1)) :])
        end = self.length
        self._append(_cut(last.line, float(reached[-1]), last.line.length))
        self.changes.append(Change(tuple((lane,) for lane in lanes), origin, end, self.length))
        return begin, self.length

    def _join(self, lane: Lane) -> float:
        """Bring the line to the begin of `lane`; returns the station there [m]."""
        begin = self.length
        if self._parts:
            tip, target = self._parts[-1][-1], lane.line.points[0]
            gap = float(np.hypot(*(target - tip)))
            if gap > _JOINT:
                self._append(_connector(tip, self.stretches[-1].lane.line, lane.line, _HANDLE * gap))
                self.stretches.append(Stretch(lane, 0.5 * (begin + self.length)))
                return self.length
        self.stretches.append(Stretch(lane, begin))
        return begin

    def _append(self, points: Floats) -> None:
        if not self._parts:
            self._parts.append(points[:1])
        tip = self._parts[-1][-1:]
        if np.hypot(*(points[:1] - tip)[0]) <= _JOINT:
            points = points[1:]
        if len(points):
            steps = np.diff(np.concatenate((tip, points)), axis=0)
            self.length += float(np.hypot(steps[:, 0], steps[:, 1]).sum())
            self._parts.append(points)


def _cut(line: Polyline, begin: float, end: float) -> Floats:
    """(n, 2) the part of `line` between two stations."""
    inner = line.stations[(line.stations > begin) & (line.stations < end)]
    return line.poses(np.concatenate(([begin], inner, [end])))[:, :2]


def _connector(tip: Floats, before: Polyline, after: Polyline, handle: float) -> Floats:
    """(n, 2) a cubic Bezier curve from `tip` to the begin of `after`, tangential at both ends."""
    target = after.points[0]
    leaving, arriving = (np.array([np.cos(h), np.sin(h)]) for h in (before.headings[-1], after.headings[0]))
    share = np.linspace(0.0, 1.0, 25)[:, None]
    rest = 1.0 - share
    controls = (tip, tip + handle * leaving, target - handle * arriving, target)
    weights = (rest**3, 3.0 * rest**2 * share, 3.0 * rest * share**2, share**3)
    return np.asarray(sum(w * c for w, c in zip(weights, controls, strict=True)))
