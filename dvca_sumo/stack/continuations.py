"""Where lanes lead on: the continuations of a lane that are likely, told from the map alone."""

import enum
import heapq
from typing import NamedTuple

from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.messages import ObjectClass
from dvca_sumo.roadmap import Lane, RoadMap

_BICYCLE = int(ObjectClass.BICYCLE)
_BUS_LENGTH = 9.0  # [m]

_STRAIGHT = 0.35  # [rad] less turning than this goes straight on
_STRAIGHT_WEIGHT = 3.0  # going straight against turning
_TURNAROUND = 2.6  # [rad]
_TURNAROUND_WEIGHT = 0.1
_LEAST = 0.05  # probability of a way at a fork that is looked at in any case
_MOST = 2000  # ends looked at: among short edges there are more than can be


class Traffic(enum.IntEnum):
    """Who has ways that are closed to others: the lanes kept for them."""

    CARS = 0
    BUSES = 1
    BICYCLES = 2

    @staticmethod
    def of(object_class: int, length: float) -> "Traffic":
        """What an object `length` [m] long may be: a long one a bus."""
        if object_class == _BICYCLE:
            return Traffic.BICYCLES
        return Traffic.BUSES if length >= _BUS_LENGTH else Traffic.CARS

    def may_use(self, lane: Lane) -> bool:
        """Whether `lane` is the ego's kind of lane, or one for this kind of traffic."""
        is_kept_for_it = (False, lane.is_for_buses, lane.is_for_bicycles)[self]
        return lane.is_drivable or is_kept_for_it


class _End(NamedTuple):
    """How far a continuation is known."""

    traffic: Traffic
    probability: float
    lanes: tuple[str, ...]
    covered: float  # [m]


class Continuations:
    """Of the lanes of a map. Straight on is likelier than a turn, and turning back unlikely."""

    def __init__(self, roadmap: RoadMap, max_branches: int) -> None:
        self._lanes = roadmap.lanes
        self._max_branches = max_branches

    def of(self, lane: str, length: float, traffic: Traffic) -> list[tuple[float, tuple[str, ...]]]:
        """Probabilities, not normalized, and lanes from `lane` on until `length` [m] are covered, or the road ends.

        They are the likeliest ones open to `traffic`, and of each way at the first fork at least the likeliest: those
        of a way share its probability.
        """
        fork = self._fork(lane, length, traffic)
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

    def _fork(self, lane: str, length: float, traffic: Traffic) -> _End:
        """As far as there is one way only, up to `length` [m]."""
        end = _End(traffic, 1.0, (lane,), self._lanes[lane].line.length)
        while end.covered < length and len(onward := self._onward(end)) == 1:
            end = onward[0]
        return end

    def _likeliest(self, begin: _End, length: float, count: int) -> list[tuple[float, tuple[str, ...]]]:
        """Best-first search: the first ones to reach `length` [m] are the likeliest.

        After `_MOST` steps the likeliest so far go on by the likeliest way at each fork.
        """
        likely: list[tuple[float, tuple[str, ...]]] = []
        open_ends = [(-begin.probability, begin)]
        steps = 0
        while open_ends and len(likely) < count:
            if steps == _MOST:
                open_ends = heapq.nsmallest(count - len(likely), open_ends)
            _, end = heapq.heappop(open_ends)
            onward = self._onward(end) if end.covered < length else []
            if not onward:
                likely.append((end.probability, end.lanes))
            elif steps >= _MOST:
                onward = [max(onward, key=lambda further: further.probability)]
            for further in onward:
                heapq.heappush(open_ends, (-further.probability, further))
            steps += 1
        return likely

    def _onward(self, end: _End) -> list[_End]:
        """One lane further."""
        weights = self._weights(end.lanes[-1], end.traffic)
        total = sum(weights.values())
        return [
            end._replace(
                probability=end.probability * weight / total,
                lanes=(*end.lanes, lane),
                covered=end.covered + self._lanes[lane].line.length,
            )
            for lane, weight in weights.items()
        ]

    def _weights(self, lane: str, traffic: Traffic) -> dict[str, float]:
        """How likely each successor is, against the others. Off the ego's kind of lane, all ways are open."""
        lanes = self._lanes
        open_ways = [name for name in lanes[lane].successors if traffic.may_use(lanes[name])]
        followed = open_ways if open_ways and lanes[lane].is_drivable else lanes[lane].successors
        weights = {}
        for name in followed:
            turn = abs(wrapped(self._heading_past(name) - float(lanes[lane].line.headings[-1])))
            weight = _STRAIGHT_WEIGHT if turn < _STRAIGHT else 1.0
            weights[name] = weight if turn < _TURNAROUND else _TURNAROUND_WEIGHT
        return weights

    def _heading_past(self, name: str) -> float:
        """Where a lane leads [rad]: across a junction, the way of those who wait on it being in parts, its last one."""
        lane = self._lanes[name]
        if not lane.is_internal:
            return float(lane.line.headings[0])
        while len(lane.successors) == 1 and self._lanes[lane.successors[0]].is_internal:
            lane = self._lanes[lane.successors[0]]
        return float(lane.line.headings[-1])
