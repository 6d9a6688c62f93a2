"""Where the ego has to stop whoever has the right of way: destination, lines, what stands, and occupied exits."""

import math
from collections.abc import Iterator

import numpy as np

from dvca_sumo.geometry.boxes import corners
from dvca_sumo.messages import Flags, Integers, VehicleShape
from dvca_sumo.stack.planning.bounds import blocking
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.exits import ahead, is_blocked, may_wait_at
from dvca_sumo.stack.planning.junctions import LineView
from dvca_sumo.stack.planning.speed import Stop
from dvca_sumo.stack.planning.st_graph import Graph

_OCCUPIED = "stop exit occupied"
_HERE = 0.1  # [m] is as near to a place as being at it
_GIVE_AT_DESTINATION = 1.0  # [m]
_GIVE_AT_OBJECT = 1.0  # [m] of the distance to it is never spent


def nearest_stop(
    to_destination: float,
    speed: float,
    graph: Graph,
    views: list[LineView],
    shape: VehicleShape,
    config: PlanningConfig,
) -> Stop:
    """The first place where the ego has to stop whatever others do: destination, line, object, occupied exit.

    `to_destination` counts from the front bumper [m]; `speed` is the ego's [m/s].
    """
    stops = [Stop(to_destination, _GIVE_AT_DESTINATION, "stop destination")]
    stops += [_at_line(view, view.stop) for view in views if view.stop]
    obstacle = _obstacle(graph, shape, config)
    if obstacle is not None:
        label = f"stop behind {graph.track(obstacle)}"
        gap = -config.object_gap if config.stops_past_objects else config.object_gap
        usual = float(graph.low[obstacle, 0]) - shape.front - gap
        closer = _closing_up(usual, views, shape, config)
        stops.append(Stop(usual + closer, config.object_gap - closer - _GIVE_AT_OBJECT, label))
    places = [place for view in views for place in _before_junction(view, speed, config)]
    if places and _is_beyond(min(min(distance, view.exit_distance) for view, distance, _ in places), graph, shape):
        those = ahead(graph, speed, shape, config)
        stops += [stop for view, distance, stop in places if is_blocked(view, distance, those, shape, config)]
    return min(stops, key=lambda stop: stop.at)


def _before_junction(view: LineView, speed: float, config: PlanningConfig) -> Iterator[tuple[LineView, float, Stop]]:
    """Where an ego at `speed` [m/s] may wait for it to clear, as a distance from the front bumper [m] and as a stop.

    That is at the line, and at the place on the junction where others are let pass, if there is one.
    """
    if may_wait_at(view, view.distance, speed):
        yield view, view.distance, _at_line(view, _OCCUPIED)
    place = view.waiting_distance
    if place > view.distance and view.may_wait and may_wait_at(view, max(place, _HERE), speed):
        yield view, max(place, _HERE), Stop(place, config.stop_line_gap, _OCCUPIED)


def _is_beyond(distance: float, graph: Graph, shape: VehicleShape) -> bool:
    """Whether anybody is on the path, or comes to it, farther than `distance` [m] ahead of the front bumper."""
    return any(
        graph.occupied.item(row, column) and graph.low.item(row, column) - shape.front > distance
        for row, column in enumerate(graph.first)
    )


def _closing_up(usual: float, views: list[LineView], shape: VehicleShape, config: PlanningConfig) -> float:
    """How much further than at a `usual` place the front bumper stops, so that the rear one is off a junction [m]."""
    for view in views:
        left = view.exit_distance - (usual - shape.length)
        if view.line.crosses and 0.0 < left <= config.object_gap - config.follow_gap:
            return left
    return 0.0


def _at_line(view: LineView, label: str) -> Stop:
    return Stop(view.standing_distance, view.gap, label)


def _obstacle(graph: Graph, shape: VehicleShape, config: PlanningConfig) -> int | None:
    """The nearest future that stands in the way, as a row; not one that the front bumper has cleared already.

    In the way is also what leaves the path no room between its bounds, and what the body, beside it, would touch:
    people nearly so.
    """
    scene, blocker = graph.scene, blocking(graph, shape, config)
    still = slice(scene.moving, None)
    occupied = graph.occupied[still, 0]
    if blocker is None and not np.count_nonzero(occupied):
        return None
    low = graph.low[still, 0]
    nearest = np.where(scene.is_person[still], config.person_least, 0.0)
    is_beside = occupied & (low <= shape.front) & (graph.gaps[still, 0] < nearest)
    if is_beside.any():
        is_beside[is_beside] = ~_is_behind(graph, scene.owners[still][is_beside], shape)
    in_way = is_beside | (occupied & (low > shape.front))
    if blocker is not None:
        in_way |= scene.owners[still] == blocker
    return scene.moving + int(np.where(in_way, low, np.inf).argmin()) if in_way.any() else None


def _is_behind(graph: Graph, rows: Integers, shape: VehicleShape) -> Flags:
    """Whether objects, as `rows` (k,) of the scene, are wholly behind the rear bumper, however near: (k,)."""
    path = graph.path
    spots = corners(graph.scene.boxes[rows]) - np.array([path.x[0], path.y[0]])
    ahead = spots @ np.array([math.cos(path.headings[0]), math.sin(path.headings[0])])
    behind: Flags = ahead.max(axis=1) < -shape.rear_overhang
    return behind
