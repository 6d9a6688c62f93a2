"""Stop lines ahead: who goes first by signal, sign and rule, and where the ego has to stand for it."""

from bisect import bisect_left
from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from dvca_sumo.messages import SignalColour, TrackedObjects, VehicleShape
from dvca_sumo.roadmap import is_inner
from dvca_sumo.roadmap.lanes import TURNS_BACK
from dvca_sumo.roadmap.route import Control, Crossing, Route, StopLine
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.watching import WatchList

_AHEAD = 200.0  # [m] lines further away are not looked at
_OVERRUN = 0.5  # [m] the front bumper may be past a line and still wait at it
_STANDING = 0.2  # [m/s]
_AT_PLACE = 1.3  # [m] past the place to let others pass, the ego may still wait there
_AT_LINE = 4.0  # [m] before the line, where standing counts as having stopped at it
_ROLLING = 2.0  # [m/s] below this speed the ego always manages to stop at a red light
_NOBODY: frozenset[str] = frozenset()
_BY_RULE = frozenset({Control.YIELD, Control.PRIORITY, Control.RIGHT_BEFORE_LEFT})
_GREENS = (SignalColour.GREEN, SignalColour.PERMISSIVE)
_SWUNG = 1.0  # [m] that a line leads aside to turn back, from which on who stands there is across the next lane
_STRAIGHT = 0.1  # [m] of the rear axle beside the middle of its lane, with which the body is in it
_SWING = 25.0  # [m] before a line, within which one swings out to turn back
_ON_YELLOW = 2.0  # [s] for which yellow lasts: who has swung out, and comes to the line within, goes on
_MERGE_REACH = 10.0  # [m] past the junction, where traffic from other approaches still joins


class LineView(NamedTuple):
    """What a stop line asks of the ego now."""

    line: StopLine
    distance: float  # [m] from the front bumper
    gap: float  # [m] that the ego keeps before it, at least
    standing_distance: float  # [m] from the front bumper to where it stands for it
    stop: str | None  # why the ego must not cross it, if it must not
    goes_first: frozenset[str]  # lanes whose traffic has priority
    waiting_distance: float  # [m] from the front bumper to where it is let pass

    @property
    def exit_distance(self) -> float:
        """From the front bumper to where the junction behind the line ends [m]."""
        return self.distance + self.line.exit_station - self.line.station

    @property
    def may_wait(self) -> bool:
        """Whether the ego has not yet passed that place, or is still at it."""
        return self.waiting_distance > -_AT_PLACE


class Junctions:
    """Reads signals and signs along the route; remembers what was decided at each line until it is passed."""

    def __init__(self, route: Route, shape: VehicleShape, config: PlanningConfig) -> None:
        self._config = config
        self._lines = _with_room_between(route.stop_lines, shape.length)
        self._exits = [line.exit_station for line in self._lines]
        self._gaps = [_gap(line, route.crossings, config) for line in self._lines]
        self._swings = [_swing(line, route, shape) for line in self._lines]
        self._seen: dict[str, tuple[float, SignalColour]] = {}
        self._yellow: dict[int, float] = {}  # since when the light of a line shows it
        self._entered: set[int] = set()  # lines crossed on yellow, for which it was too late to stop
        self._kept: set[int] = set()  # lines that it has begun to stop at on yellow or red
        self._standing: dict[int, float] = {}  # since when the ego stands at a line
        self._released: set[int] = set()  # lines at which standing was enough
        self._watching = [WatchList(line.stop_signs, config) for line in self._lines]

    def step(
        self,
        time: float,
        front: float,
        rear: float,
        speed: float,
        signals: dict[str, SignalColour],
        objects: TrackedObjects,
    ) -> list[LineView]:
        """The lines of the junctions the ego is in or comes to; `front`, `rear`: route stations of the bumpers."""
        for signal, colour in signals.items():
            self._seen[signal] = (time, colour)
        views = []
        for index in range(bisect_left(self._exits, rear), len(self._lines)):
            distance = self._lines[index].station - front
            if distance > _AHEAD:
                break
            if distance < _AT_LINE and speed < _STANDING:
                self._standing.setdefault(index, time)
            else:
                self._standing.pop(index, None)
            if distance < _AT_LINE and index not in self._released:
                self._watching[index].step(objects, is_standing=index in self._standing)
            views.append(self._view(index, distance, time, speed))
        return views

    def _view(self, index: int, distance: float, time: float, speed: float) -> LineView:
        line, gap = self._lines[index], self._gaps[index]
        standing_distance = waiting_distance = distance - gap
        if line.control is Control.SIGNAL:
            stop, goes_first = self._at_signal(index, distance, time, speed)
            colour = self._colour(line.signal_id or "", time)
            if colour is not None and not self._is_swinging(index, distance):
                standing_distance = min(standing_distance, distance - self._swings[index])
            if line.waiting_station is not None and (distance < 0.0 or colour in _GREENS):
                waiting_distance = distance + line.waiting_station - line.station
        else:
            stop, goes_first = None, line.yields_to
            if line.control in (Control.STOP, Control.ALL_WAY_STOP) and index not in self._released:
                stop = self._at_sign(index, time)
        stop = stop if distance > -_OVERRUN else None
        return LineView(line, distance, gap, standing_distance, stop, goes_first, waiting_distance)

    def _is_swinging(self, index: int, distance: float) -> bool:
        """Whether the ego, so far before a line [m], has left its lane to turn back at it."""
        return 0.0 < distance < self._swings[index] - _OVERRUN

    def _at_sign(self, index: int, time: float) -> str | None:
        """Whether to stand on: for a while, and for those who were there first."""
        stood = time - self._standing.get(index, time)
        others = self._watching[index].waits_for(stood)
        if stood >= self._config.sign_wait and not others:
            self._released.add(index)
            return None
        label = f"stop sign {self._lines[index].lane}"
        return f"{label} for {', '.join(map(str, others))}" if others else label

    def _at_signal(self, index: int, distance: float, time: float, speed: float) -> tuple[str | None, frozenset[str]]:
        """Why to stop, if that is so, and who goes first."""
        line = self._lines[index]
        signal = line.signal_id or ""
        colour = self._colour(signal, time)
        needed = speed * speed / (2.0 * max(distance, 0.1))
        most = self._config.hard_braking if index in self._kept else self._config.yellow_braking
        left = self._yellow_left(index, colour, time)
        is_in_way = self._is_swinging(index, distance) and distance < left * speed
        if colour is SignalColour.YELLOW and (needed > most or is_in_way):
            self._entered.add(index)
        elif distance > 0.0 and needed < self._config.comfort_braking:
            self._entered.discard(index)  # somebody else has made it slow down
        if colour is SignalColour.RED and speed > _ROLLING:
            needed = speed * speed / (2.0 * max(distance + _OVERRUN, 0.1))
            if needed > self._config.hard_braking:
                self._entered.add(index)
        if colour in (SignalColour.RED, SignalColour.YELLOW):
            # Who is slow on the junction at red is too late to clear it: the others have green.
            is_late = colour is SignalColour.RED and speed < _ROLLING
            goes_first = line.yields_to | line.crosses if is_late else _NOBODY
            if index in self._entered:
                return None, goes_first
            self._kept.add(index)
            return f"stop {colour.value} {signal}", goes_first
        self._kept.discard(index)
        if colour is not None:
            return None, _NOBODY if colour is SignalColour.GREEN else line.yields_to
        reach = speed * speed / (2.0 * self._config.comfort_braking) + self._config.unseen_reach
        if distance > reach or index in self._entered or self._stood(index, time, self._config.unseen_patience):
            return None, line.yields_to
        return f"stop unseen {signal}", line.yields_to

    def _yellow_left(self, index: int, colour: SignalColour | None, time: float) -> float:
        """How long the light of a line is taken to be yellow yet [s]; 0 while it is not."""
        if colour is not SignalColour.YELLOW:
            self._yellow.pop(index, None)
            return 0.0
        return self._yellow.setdefault(index, time) + _ON_YELLOW - time

    def _colour(self, signal: str, time: float) -> SignalColour | None:
        seen, colour = self._seen.get(signal, (-1e9, None))
        return colour if time - seen <= self._config.signal_memory else None

    def _stood(self, index: int, time: float, wait: float) -> bool:
        """Whether the ego has stood at the line for `wait` seconds, now or earlier."""
        if time - self._standing.get(index, time) >= wait:
            self._released.add(index)
        return index in self._released


def _gap(line: StopLine, crossings: Sequence[Crossing], config: PlanningConfig) -> float:
    """What is kept before a line, behind which a pedestrian crossing may begin [m].

    Never more than before one that begins at the line: farther away, standing would not count as having stopped at it.
    """
    ahead = (crossing for crossing in crossings if crossing.end_station > line.station)
    behind = (max(crossing.start_station - line.station, 0.0) for crossing in ahead)
    return max(config.stop_line_gap, config.crossing_gap - min(behind, default=config.crossing_gap))


def _swing(line: StopLine, route: Route, shape: VehicleShape) -> float:
    """How far before a line the front is where the ego leaves its lane, to turn back there [m]; 0 where it does not."""
    if line.direction not in TURNS_BACK:
        return 0.0
    stations = route.line.stations
    rows = np.flatnonzero((stations > line.station - _SWING) & (stations < line.station))
    aside = np.abs(0.5 * (route.lane_left[rows] + route.lane_right[rows]))
    if aside.max(initial=0.0) < _SWUNG:
        return 0.0
    straight = np.flatnonzero(aside[: int(aside.argmax())] <= _STRAIGHT)
    begin = float(stations[rows[straight[-1] if len(straight) else 0]])
    return max(line.station - begin - shape.front, 0.0)


def _with_room_between(lines: Sequence[StopLine], length: float) -> list[StopLine]:
    """The lines, those of unsignalled junctions as one where there are not even `length` [m] to stand in between."""
    found: list[StopLine] = []
    last = 0  # row of the last one with anybody to meet
    for line in lines:
        if not found or not line.crosses:
            found.append(line)
            continue
        before = found[last]
        is_one = before.crosses and {before.control, line.control} <= _BY_RULE
        if is_one and line.station - before.exit_station < length:
            found[last:] = [_as_one(before, line)]
        else:
            last = len(found)
            found.append(line)
    return found


def _as_one(first: StopLine, second: StopLine) -> StopLine:
    return msgspec.structs.replace(
        first,
        control=second.control if first.control is Control.PRIORITY else first.control,
        yields_to=first.yields_to | second.yields_to,
        crosses=first.crosses | second.crosses,
        prior=first.prior + second.prior,
        exit_station=second.exit_station,
    )


def has_priority(views: list[LineView], near: float, far: float, lanes: tuple[str, ...]) -> bool | None:
    """Whether traffic on `lanes` has priority over the ego where they meet, between two route stations.

    None where the map does not tell: they do not meet on a junction, or not on conflicting lanes. Lanes on the junction
    tell more than the approach, from which others may go first that cross the ego's way elsewhere.
    """
    for view in views:
        line = view.line
        if line.station - 1.0 <= far and near <= line.exit_station + _MERGE_REACH:
            met = [lane for lane in lanes if lane in view.goes_first or lane in line.yields_to or lane in line.crosses]
            met = [lane for lane in met if is_inner(lane)] or met
            if met:
                return not view.goes_first.isdisjoint(met)
    return None
