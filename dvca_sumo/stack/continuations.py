"""Where lanes lead on: the continuations of a lane that are likely, told from the map alone."""

import heapq
from typing import NamedTuple

from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.roadmap import RoadMap

_STRAIGHT = 0.35  # [rad] less turning than this goes straight on
_STRAIGHT_WEIGHT = 3.0  # going straight against turning
_TURNAROUND = 2.6  # [rad]
_TURNAROUND_WEIGHT = 0.1
_LEAST = 0.05  # probability of a way at a fork that is looked at in any case


class _End(NamedTuple):
    """How far a continuation is known."""

    probability: float
    lanes: tuple[str, ...]
    covered: float  # [m]


class Continuations:
    """Of the lanes of a map. Straight on is likelier than a turn, and turning back unlikely."""

    def __init__(self, roadmap: RoadMap, max_branches: int) -> None:
        self._lanes = roadmap.lanes
        self._max_branches = max_branches

    def of(self, lane: str, length: float) -> list[tuple[float, tuple[str, ...]]]:
        """Probabilities, not normalized, and lanes from `lane` on until `length` [m] are covered, or the road ends.

        They are the likeliest ones, and of each way at the first fork at least the likeliest: those of a way share
        its probability.
        """
        fork = self._fork(lane, length)
        likeliest = self._likeliest(fork, length, self._max_branches)
        if fork.covered >= length:
            return likeliest
        found = []
        for way in self._onward(fork):
            if way.probability >= _LEAST:
                taken = [each for each in likeliest if each[1][: len(way.lanes)] == way.lanes]
                taken = taken or self._likeliest(way, length, 1)
                total = sum(probability for probability, _ in taken)
                found += [(way.probability * probability / total, lanes) for probability, lanes in taken]
        return found or likeliest

    def _fork(self, lane: str, length: float) -> _End:
        """As far as there is one way only, up to `length` [m]."""
        end = _End(1.0, (lane,), self._lanes[lane].line.length)
        while end.covered < length and len(onward := self._onward(end)) == 1:
            end = onward[0]
        return end

    def _likeliest(self, begin: _End, length: float, count: int) -> list[tuple[float, tuple[str, ...]]]:
        """Best-first search: the first ones to reach `length` [m] are the likeliest."""
        likely: list[tuple[float, tuple[str, ...]]] = []
        open_ends = [(-begin.probability, begin)]
        while open_ends and len(likely) < count:
            _, end = heapq.heappop(open_ends)
            onward = self._onward(end) if end.covered < length else []
            if not onward:
                likely.append((end.probability, end.lanes))
            for further in onward:
                heapq.heappush(open_ends, (-further.probability, further))
        return likely

    def _onward(self, end: _End) -> list[_End]:
        """One lane further."""
        weights = self._weights(end.lanes[-1])
        total = sum(weights.values())
        return [
            _End(end.probability * weight / total, (*end.lanes, lane), end.covered + self._lanes[lane].line.length)
            for lane, weight in weights.items()
        ]

    def _weights(self, lane: str) -> dict[str, float]:
        """How likely each successor is, against the others. Off the ego's kind of lane, all ways are open."""
        lanes = self._lanes
        drivable = [name for name in lanes[lane].successors if lanes[name].is_drivable]
        followed = drivable if drivable and lanes[lane].is_drivable else lanes[lane].successors
        weights = {}
        for name in followed:
            headings = lanes[name].line.headings
            turn = abs(wrapped(float(headings[-1 if lanes[name].is_internal else 0] - lanes[lane].line.headings[-1])))
            weight = _STRAIGHT_WEIGHT if turn < _STRAIGHT else 1.0
            weights[name] = weight if turn < _TURNAROUND else _TURNAROUND_WEIGHT
        return weights
