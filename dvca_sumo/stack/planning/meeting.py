"""Whose turn it is where the ways of the ego and of somebody else meet: pass before, or yield."""

import enum
import math
from collections.abc import Container

import msgspec
import numpy as np

from dvca_sumo.messages import Flags, Floats, Integers, VehicleShape
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.junctions import LineView, has_priority
from dvca_sumo.stack.planning.scene import ALONG, SOON, SOON_TIME
from dvca_sumo.stack.planning.speed import HARD_GAP, STEP_TIMES, Profile, Stop
from dvca_sumo.stack.planning.st_graph import PRESENT, Graph

_SPEEDS_UP = 0.4  # [m/s] faster over the next second than now
_CUTS_IN = 0.5  # [m] sideways before the meeting: the other comes into our lane, not we into theirs
_STAYS = 2  # columns of the graph, after which somebody is on the path to drive along it
_STILL_TO_CROSS = 2  # lanes of a person's future: a pavement, then a crossing
_LEAST_ROOM = 0.1  # [m]
_SLOW = 4.0  # [m/s] no faster, an ego stops for people who come up to its side: ...
_BESIDE_PERSON = 1.0  # ... [m] behind its front bumper, and all along it ...
_BRUSHING = 0.2  # ... for those who would come so near to it, before it has passed them [m]: one at rest can wait
_SLOWS = 1.0  # [s] that others are foreseen to lose in bends and by braking, and may not lose
_CLEAR_GAP = 0.5  # [m] lengthwise behind somebody who has passed


class _Turn(enum.Enum):
    """Who goes first where two ways meet."""

    OURS = enum.auto()  # the other has to give way
    THEIRS = enum.auto()  # it has priority
    NOBODYS = enum.auto()  # both keep their lanes, which the map draws one on the other: who is there first
    CUT_IN = enum.auto()  # the other comes into our lane, off the junctions, and has to see to it


class Demand(msgspec.Struct, frozen=True):
    """What one meeting asks for."""

    row: int  # of the graph
    stop: Stop
    follows: bool  # whether the other drives on ahead of the ego afterwards


class Meetings:
    """Decides about the futures that cross or join the path; remembers whom the ego passes in front of."""

    def __init__(self, lanes: frozenset[str], shape: VehicleShape, config: PlanningConfig) -> None:
        """`lanes` are those of the ego's route."""
        self._lanes = lanes
        self._shape = shape
        self._config = config
        self._passing: frozenset[int] = frozenset()

    def settle(self, rows: list[int], yielding: Container[int], graph: Graph, profile: Profile) -> None:
        """End a cycle in which the ego, driving `profile`, meets the futures `rows`, and lets the tracks `yielding` go.

        It passes in front of all others, but for those who are gone before it comes.
        """
        come = ~self._comes_after(np.array(rows), graph, profile) if rows else ()
        passed = (graph.track(row) for row, is_one in zip(rows, come, strict=True) if is_one)
        self._passing = frozenset(track for track in passed if track not in yielding)

    def demands(self, rows: list[int], graph: Graph, views: list[LineView], profile: Profile) -> list[Demand]:
        """What the futures `rows` ask of an ego that would otherwise drive `profile`."""
        if not rows:
            return []
        those = np.array(rows)
        settled = self._comes_after(those, graph, profile)
        if np.count_nonzero(settled) < len(rows):
            settled |= self._passes(those, graph, profile, self._config.pass_margin)
        found = (
            self._demand(row, graph, views, profile)
            for row, is_settled in zip(rows, settled.tolist(), strict=True)
            if not is_settled
        )
        demands = [demand for demand in found if demand is not None]
        return [demand for demand in demands if not self._stops_in_way(demand, rows, graph, profile)]

    def _demand(self, row: int, graph: Graph, views: list[LineView], profile: Profile) -> Demand | None:
        config = self._config
        entry = float(graph.scene.times[graph.first[row]])
        turn = self._turn(row, graph, views)
        if turn is _Turn.CUT_IN:
            return self._cut_in(row, graph, profile)
        is_ours = turn is _Turn.OURS
        if is_ours and self._will_wait(row, entry, graph):
            return None
        margin = config.pass_margin_prior
        if turn is _Turn.THEIRS:
            margin = config.pass_margin - (config.pass_hold if graph.track(row) in self._passing else 0.0)
        if margin < config.pass_margin and self._passes([row], graph, profile, margin)[0]:
            return None
        stop = self._stop(row, graph, [] if is_ours else views)
        if self._moves_up(row, stop, graph, profile):
            stop = msgspec.structs.replace(stop, at=0.0, give=stop.at + stop.give)
        room = stop.at + stop.give
        if room <= -HARD_GAP - self._beside(row, entry, graph, profile):  # stopping there would not help
            return None
        needed = profile.speeds[0] ** 2 / (2.0 * max(room, _LEAST_ROOM))
        is_too_late = needed > config.hard_braking and (
            (is_ours and self._may_stop(row, entry, graph))  # the sooner the ego is gone, the better
            or self._passes([row], graph, profile, 0.0)[0]
        )
        if is_too_late or (needed > config.comfort_braking and self._goes_on(row, graph, profile)):
            return None
        return Demand(row, stop, follows=self._joins(row, graph))

    def _goes_on(self, row: int, graph: Graph, profile: Profile) -> bool:
        """Whether the ego, having begun to pass in front of a vehicle, still does so with the least margin."""
        if graph.scene.is_person[row] or graph.track(row) not in self._passing:
            return False
        return bool(self._passes([row], graph, profile, self._config.pass_margin_prior)[0])

    def _stops_in_way(self, demand: Demand, rows: list[int], graph: Graph, profile: Profile) -> bool:
        """Whether the ego would stop for somebody's future in the way of a likelier one, which it now passes before."""
        scene, row = graph.scene, demand.row
        front = demand.stop.at + self._shape.front
        likelier = [
            other
            for other in rows
            if scene.owners[other] == scene.owners[row]
            and scene.probabilities[other] > scene.probabilities[row]
            and graph.low[other][graph.occupied[other]].min() < front
        ]
        return bool(likelier and self._passes(likelier, graph, profile, 0.0).any())

    def _moves_up(self, row: int, stop: Stop, graph: Graph, profile: Profile) -> bool:
        """Whether the ego would set off to stop again closer to a vehicle that slows down in its way.

        That one may have slowed for the ego itself, and drive on: then the place to let it pass is here.
        """
        scene, at_rest = graph.scene, self._config.standing_speed
        is_slowing = stop.until == math.inf and scene.speeds[scene.owners[row]] > at_rest and not scene.is_person[row]
        return bool(is_slowing and profile.speeds[0] < at_rest and 0.0 < stop.at < self._shape.length)

    def _beside(self, row: int, entry: float, graph: Graph, profile: Profile) -> float:
        """How far behind the front bumper somebody may come to the ego's way, at `entry` [s], and standing helps [m].

        An ego that is slow does not get away from a vehicle any more; standing, it is seen and driven around. Past who
        is beside it already, it is no sooner when it stops.
        """
        config, scene, speed = self._config, graph.scene, float(profile.speeds[0])
        if not scene.is_person[row]:
            slow = config.creeping_speed if entry > PRESENT else config.standing_speed
            is_met = scene.probabilities[row] >= config.likely and speed < slow
            is_caught = is_met and not self._passes([row], graph, profile, 0.0)[0]
            return self._shape.length if is_caught else 0.0
        if speed >= _SLOW:
            return 0.0
        return self._shape.length if self._brushes(row, graph, profile) else _BESIDE_PERSON

    def _brushes(self, row: int, graph: Graph, profile: Profile) -> bool:
        """Whether somebody comes up to the body, as future `row` has it, while that is still there: one at rest is."""
        if profile.speeds[0] < self._config.standing_speed:
            return bool((graph.occupied[row] & (graph.gaps[row] < self._config.setting_off_margin)).any())
        near = graph.occupied[row] & (graph.gaps[row] < _BRUSHING)
        rear = np.interp(graph.scene.times[near], STEP_TIMES, profile.arcs) - self._shape.rear_overhang
        return bool((rear <= graph.high[row, near]).any())

    def _may_stop(self, row: int, entry: float, graph: Graph) -> bool:
        """Whether who is on the path at `entry` [s] may still stop before."""
        config, scene = self._config, graph.scene
        speed = float(scene.speeds[scene.owners[row]])
        left = entry - config.expected_reaction
        return entry > PRESENT and speed <= 2.0 * max(left, 0.0) * config.expected_braking

    def _will_wait(self, row: int, entry: float, graph: Graph) -> bool:
        """Whether who has to give way, and is on the path at `entry` [s], may still stop: unless it speeds up."""
        if not self._may_stop(row, entry, graph):
            return False
        futures = graph.scene.futures
        speed = float(graph.scene.speeds[graph.scene.owners[row]])
        way = math.hypot(
            float(futures.stations[row, SOON] - futures.stations[row, 0]),
            float(futures.offsets[row, SOON] - futures.offsets[row, 0]),
        )
        return way < (speed + _SPEEDS_UP) * SOON_TIME

    def _passes(self, rows: Integers | list[int], graph: Graph, profile: Profile, margin: float) -> Flags:
        """Whether the ego has left every place that a future occupies `margin` [s] before it comes there.

        It does not count on anybody to slow down: ahead of one that keeps its speed it still is, by `_SLOWS` less.
        """
        scene = graph.scene
        passes = self._is_gone(scene.times - margin, rows, graph, profile)
        if not np.count_nonzero(passes):
            return passes
        at_rest, speeds = self._config.standing_speed, scene.speeds[scene.owners[rows], None]
        stations, offsets = (part.take(rows, axis=0) for part in (scene.futures.stations, scene.futures.offsets))
        ways = np.hypot(stations[:, 1:] - stations[:, :-1], offsets[:, 1:] - offsets[:, :-1]).cumsum(axis=1)
        arrivals = np.where(speeds > at_rest, ways / np.maximum(speeds, at_rest), np.inf)
        times = np.empty(stations.shape)
        times[:, 0] = scene.times[0]
        np.minimum(scene.times[1:], arrivals, out=times[:, 1:])
        return passes & self._is_gone(times - max(margin - _SLOWS, 0.0), rows, graph, profile)

    def _is_gone(self, times: Floats, rows: Integers | list[int], graph: Graph, profile: Profile) -> Flags:
        """Whether at `times` [s] the ego has left the places that the futures `rows` occupy one after the other."""
        rear = np.interp(times, STEP_TIMES, profile.arcs) - self._shape.rear_overhang
        return _whenever_there(rows, rear > graph.ends.take(rows, axis=0), graph)

    def _comes_after(self, rows: Integers, graph: Graph, profile: Profile) -> Flags:
        """Whether the ego comes to every place that a future occupies after that has gone."""
        times = graph.scene.times + self._config.clear_margin
        front = np.interp(times, STEP_TIMES, profile.arcs) + (self._shape.front + _CLEAR_GAP)
        return _whenever_there(rows, front < graph.begins.take(rows, axis=0), graph)

    def _turn(self, row: int, graph: Graph, views: list[LineView]) -> _Turn:
        """Whose turn it is. People have priority, but before a crossing where they have to wait.

        On junctions the map tells; elsewhere, who leaves its lane has not. That is the ego itself where its line has
        left the lane, in turns that it cannot drive within, or the other, which cuts in. It is nobody's turn where the
        other keeps a lane of its own that the map draws on the ego's.
        """
        scene = graph.scene
        near, far = (graph.window.station + float(ends[row, graph.first[row]]) for ends in (graph.low, graph.high))
        told = has_priority(views, near, far, scene.lanes[row])
        if scene.is_person[row]:
            is_theirs = told is not False or len(scene.lanes[row]) < _STILL_TO_CROSS
            return _Turn.THEIRS if is_theirs else _Turn.OURS
        if told is not None:
            return _Turn.THEIRS if told else _Turn.OURS
        if graph.is_off_lane(row, self._shape.width):
            return _Turn.THEIRS
        if scene.lanes[row] and self._lanes.isdisjoint(scene.lanes[row]):
            return _Turn.NOBODYS
        return _Turn.CUT_IN if self._cuts_in(row, graph) else _Turn.THEIRS

    def _cuts_in(self, row: int, graph: Graph) -> bool:
        """Whether the other moves sideways over to the line, and not the line, in a bend, over to it."""
        scene, window, first = graph.scene, graph.window, graph.first[row]
        futures, here = scene.futures, scene.rows[0, row, 0]
        is_along = futures.directions[row, 0] > ALONG and futures.directions[row, first] > ALONG
        if not is_along or abs(futures.offsets[row, first] - futures.offsets[row, 0]) <= _CUTS_IN:
            return False
        east, north = scene.poses[row, first, :2] - scene.poses[row, 0, :2]
        return bool(abs(north * window.cosines[here] - east * window.sines[here]) > _CUTS_IN)

    def _cut_in(self, row: int, graph: Graph, profile: Profile) -> Demand | None:
        """Who cuts in with its nose ahead of ours becomes the leader; who does not has to see to it."""
        first = graph.first[row]
        front = float(np.interp(graph.scene.times[first], STEP_TIMES, profile.arcs)) + self._shape.front
        if graph.high[row, first] < front:
            return None
        label = f"follow {graph.track(row)}"
        return Demand(row, Stop(float(graph.low[row, first]), 0.0, label, until=0.0), follows=True)

    def _joins(self, row: int, graph: Graph) -> bool:
        """Whether the other drives along the path once it is on it."""
        first, last = graph.first[row], graph.last[row]
        return bool(graph.scene.futures.directions[row, last] > ALONG and last > first + _STAYS)

    def _stop(self, row: int, graph: Graph, views: list[LineView]) -> Stop:
        """Before the other's way until it is clear; on a junction of `views` at its place, if that is still ahead.

        Behind who turns into its way there, the ego comes with the room that it leaves a leader.
        """
        config, front = self._config, self._shape.front
        first, last, scene = graph.first[row], graph.last[row], graph.scene
        is_person = scene.is_person[row]
        gap = config.person_gap if is_person else config.yield_gap
        joins = self._joins(row, graph)
        if joins:
            nearest, until = float(graph.low[row, first]), float(scene.times[first])
        else:
            # Who drives along beside comes into the way with its nose, or one corner; who crosses, as wide as it is.
            places = graph.begins if scene.futures.directions[row, first] > ALONG else graph.low
            nearest = float(places[row][graph.occupied[row]].min())
            until = float(scene.times[last]) + config.clear_margin
            if last == len(scene.times) - 1:
                until = math.inf
        if nearest - HARD_GAP <= front:  # its near end comes by; what gets into the way may do so further on
            nearest, touching = graph.contacts(row)
            if nearest <= front and not is_person and touching < graph.path.arcs[-1]:
                nearest = touching  # it passes close beside the ego, then touches it further on
        met_on = [view for view in views if view.distance - 1.0 <= nearest - front <= view.exit_distance]
        if joins and met_on:
            gap = config.follow_gap
        waiting = [view.waiting_distance for view in met_on if view.may_wait]
        at = min([nearest - gap - front, *waiting])
        return Stop(at, nearest - HARD_GAP - front - at, f"yield {graph.track(row)}", until)


def _whenever_there(rows: Integers | list[int], holds: Flags, graph: Graph) -> Flags:
    """Whether something `holds` (k, t) at all times at which the futures `rows` (k,) occupy the path: (k,)."""
    always: Flags = np.logical_and.reduce(holds | ~graph.occupied.take(rows, axis=0), axis=1)
    return always
