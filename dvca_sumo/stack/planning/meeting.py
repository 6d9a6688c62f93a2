"""Whose turn it is where the ways of the ego and of somebody else meet: pass before, or yield."""

from collections.abc import Iterable

import msgspec
import numpy as np

from dvca_sumo.messages import Floats, ObjectClass, VehicleShape
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.junctions import LineView, has_priority
from dvca_sumo.stack.planning.scene import Scene
from dvca_sumo.stack.planning.speed import STEP_TIMES, Profile, Stop
from dvca_sumo.stack.planning.st_graph import ALONG, Graph

_PRESENT = 0.3  # [s] what occupies the path within this time is there already
_CUTS_IN = 0.5  # [m] moved sideways before the meeting: the other comes into our lane, not we into theirs
_HARD_GAP = 0.5  # [m] to the other's way, defended by hard braking
_CLEAR_GAP = 0.5  # [m] lengthwise behind somebody who has passed
_AT_LINE = 0.5  # [m] past the stop line the ego may still wait at it


class Demand(msgspec.Struct, frozen=True):
    """What one meeting asks for."""

    row: int  # of the graph
    stop: Stop
    follows: bool  # whether the other drives on ahead of the ego afterwards


class Meetings:
    """Decides about the futures that cross or join the path; remembers whom the ego passes in front of."""

    def __init__(self, shape: VehicleShape, config: PlanningConfig) -> None:
        self._shape = shape
        self._config = config
        self._passing: frozenset[int] = frozenset()

    def settle(self, passing: Iterable[int]) -> None:
        """End a cycle in which the ego passes in front of the tracks `passing`."""
        self._passing = frozenset(passing)

    def demand(
        self, row: int, graph: Graph, scene: Scene, views: list[LineView], station: float, profile: Profile
    ) -> Demand | None:
        """What future `row` asks of an ego that would otherwise drive `profile`; None when nothing.

        `station` is the window's origin on the route [m].
        """
        first, config = graph.first[row], self._config
        entry = float(scene.times[first])
        others_first = self._others_first(row, graph, scene, views, station)
        if others_first is False:
            if self._cuts_in(row, graph, scene):
                return self._cut_in(row, graph, scene, profile)
            speed = float(scene.speeds[scene.owners[row]])
            if entry > _PRESENT and speed / (2.0 * entry) < config.expected_braking:
                return None
        margin = config.pass_margin if others_first else config.pass_margin_prior
        if scene.ids[scene.owners[row]] in self._passing:
            margin -= config.pass_hold
        if self.passes(row, graph, scene, profile, margin) or self._comes_after(row, graph, scene, profile):
            return None
        stop = self._stop(row, graph, scene, views)
        room = stop.at + stop.give
        if room <= 0.0:  # beside the ego already, or nearly: stopping there would not help
            return None
        if profile.speeds[0] ** 2 / (2.0 * room) > config.hard_braking and self.passes(row, graph, scene, profile, 0.0):
            return None
        return Demand(row, stop, follows=self._joins(row, graph, scene))

    def passes(self, row: int, graph: Graph, scene: Scene, profile: Profile, margin: float) -> bool:
        """Whether the ego has left every place that future `row` occupies `margin` [s] before it comes there."""
        columns = np.flatnonzero(graph.occupied[row])
        rear = np.interp(scene.times[columns] - margin, STEP_TIMES, profile.arcs) - self._shape.rear_overhang
        return bool((rear > graph.high[row, columns]).all())

    def _comes_after(self, row: int, graph: Graph, scene: Scene, profile: Profile) -> bool:
        columns = np.flatnonzero(graph.occupied[row])
        times: Floats = scene.times[columns] + self._config.clear_margin
        front = np.interp(times, STEP_TIMES, profile.arcs) + self._shape.front
        return bool((front < graph.low[row, columns] - _CLEAR_GAP).all())

    def _others_first(self, row: int, graph: Graph, scene: Scene, views: list[LineView], station: float) -> bool | None:
        """Whether the other has priority. People have; on junctions the map tells; who leaves its lane has not."""
        if scene.classes[scene.owners[row]] == ObjectClass.PEDESTRIAN:
            return True
        first = graph.first[row]
        told = has_priority(views, station + float(graph.low[row, first]), scene.lanes[row])
        if told is not None:
            return told
        return not self._cuts_in(row, graph, scene)

    def _cuts_in(self, row: int, graph: Graph, scene: Scene) -> bool:
        futures, first = scene.futures, graph.first[row]
        is_along = futures.directions[row, 0] > ALONG and futures.directions[row, first] > ALONG
        return bool(is_along and abs(futures.offsets[row, first] - futures.offsets[row, 0]) > _CUTS_IN)

    def _cut_in(self, row: int, graph: Graph, scene: Scene, profile: Profile) -> Demand | None:
        """Who cuts in with its nose ahead of ours becomes the leader; who does not has to see to it."""
        first = graph.first[row]
        entry = float(scene.times[first])
        front = float(np.interp(entry, STEP_TIMES, profile.arcs)) + self._shape.front
        if graph.high[row, first] < front:
            return None
        label = f"follow {scene.ids[scene.owners[row]]}"
        return Demand(row, Stop(float(graph.low[row, first]), 0.0, label, until=0.0), follows=True)

    def _joins(self, row: int, graph: Graph, scene: Scene) -> bool:
        """Whether the other drives along the path once it is on it."""
        directions = scene.futures.directions[row]
        return bool(directions[graph.last[row]] > ALONG and graph.last[row] > graph.first[row] + 2)

    def _stop(self, row: int, graph: Graph, scene: Scene, views: list[LineView]) -> Stop:
        """Before the other's way until it is clear; at the stop line while the ego has not crossed it."""
        config, front = self._config, self._shape.front
        first, last = graph.first[row], graph.last[row]
        is_person = scene.classes[scene.owners[row]] == ObjectClass.PEDESTRIAN
        gap = config.person_gap if is_person else config.yield_gap
        columns = np.flatnonzero(graph.occupied[row])
        if self._joins(row, graph, scene):
            nearest, until = float(graph.low[row, first]), float(scene.times[first])
        else:
            nearest = float(graph.low[row, columns].min())
            until = float(scene.times[last]) + config.clear_margin
            if last == len(scene.times) - 1:
                until = float("inf")
        at = nearest - gap - front
        for line, distance, _, _ in views:
            within = distance - 1.0 <= nearest - front <= distance + line.exit_station - line.station
            if within and distance > -_AT_LINE:
                at = min(at, distance - config.stop_line_gap)
        label = f"yield {scene.ids[scene.owners[row]]}"
        return Stop(at, max(nearest - _HARD_GAP - front - at, 0.0), label, until)
