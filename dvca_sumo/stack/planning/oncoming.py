"""Who comes towards the ego where its body cannot keep to its lane: it waits before that stretch, not on it."""

import math

import numpy as np

from dvca_sumo.messages import Flags, Floats, VehicleShape
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.junctions import LineView
from dvca_sumo.stack.planning.reference import BEHIND, Window
from dvca_sumo.stack.planning.scene import ALONG, Extents, extents
from dvca_sumo.stack.planning.speed import HARD_GAP, STEP_TIMES, Profile, Stop
from dvca_sumo.stack.planning.st_graph import Graph

_RECENT = 4  # last times of a future, over which its speed is taken
_COMES = 0.5  # [m/s] slower ones are not expected to get there
_SHORT = 5.0  # [m] of such a stretch: all of it is seen within a prediction
_NEAR = 1.0  # [m] from a place, or past it, an ego at walking pace still stops there
_CREEPS = 1.0  # [m/s] of the ego beyond the end of its profile, at least


def waits(
    graph: Graph, views: list[LineView], profile: Profile, shape: VehicleShape, config: PlanningConfig
) -> list[Stop]:
    """Places to wait for those whom an ego that drives `profile` would meet on a stretch beyond its lane's edge.

    They are looked for farther than they are predicted, at the speed they have then. What is begun is gone on with. On
    junctions, and with people on foot, the rules of meeting hold. An ego that would stand on a junction for it, in the
    way of others, waits before that; where it is too late for that, and the stretch is short, those rules hold, too.
    """
    left, right = _beyond_lane(graph, graph.window, views)
    if left.max() <= 0.0 and right.max() <= 0.0:
        return []
    window, scene = graph.window.up_to_fold(), graph.scene
    futures, begun = scene.futures, slice(0, int(shape.front) + 1)
    if window is not graph.window:
        left, right = _beyond_lane(graph, window, views)
        futures = extents(window, scene.boxes, scene.poses, scene.owners[: scene.moving])
    directions = futures.directions[: scene.moving]
    comes: Flags = (directions[:, 0] < -ALONG) | (directions[:, -1] < -ALONG)
    comes &= ~scene.is_person[: scene.moving]
    if np.count_nonzero(comes):  # who has passed the ego does not come any more
        noses = futures.stations[: scene.moving] + futures.half_lengths[: scene.moving]
        comes &= noses.max(axis=1) > -shape.rear_overhang
    if not np.count_nonzero(comes):
        return []
    found = []
    for row in comes.nonzero()[0].tolist():
        spare, is_left = _spare(row, futures, window)
        beyond = left if is_left else right
        meets = beyond > np.maximum(spare - config.object_margin, 0.0)
        if not meets.any() or (beyond[begun] > np.maximum(spare[begun], 0.0)).any():
            continue
        begin, end = _first(meets, shape.length + config.yield_gap)
        nose, tail = float(graph.path.arcs[begin]) - shape.front, float(graph.path.arcs[end]) + shape.rear_overhang
        arrives, leaves = _passage(row, futures, scene.times, begin, end)
        free = leaves + config.clear_margin
        if arrives < _time(profile, tail) + config.pass_margin and _time(profile, nose) < free:
            place = _place(nose, tail, float(profile.speeds[0]), views, shape, config)
            if place is not None:
                found.append(Stop(*place, f"yield {graph.track(row)}", free))
    return found


def _place(
    nose: float, tail: float, speed: float, views: list[LineView], shape: VehicleShape, config: PlanningConfig
) -> tuple[float, float] | None:
    """Where to wait, and how much further hard braking may take the ego [m]; None where it goes on.

    At arcs `nose` and `tail` [m] its bumpers come to the stretch and are past it.
    """
    usual = nose - config.yield_gap
    for view in views:
        if view.line.crosses and view.distance < usual < view.exit_distance + shape.length:
            needed = speed * speed / (2.0 * max(view.waiting_distance + view.gap, _NEAR))
            if view.may_wait and needed < config.comfort_braking:
                return view.waiting_distance, view.gap
            if tail - nose < shape.length + _SHORT:
                return None
    return usual, config.yield_gap - HARD_GAP


def _beyond_lane(graph: Graph, window: Window, views: list[LineView]) -> tuple[Floats, Floats]:
    """How far the body on its path is beyond the left and the right edge of its lane, by metre ahead [m]."""
    count = window.rows.shape[1]
    left, right = graph.path.left[:count] - window.lane_left, window.lane_right - graph.path.right[:count]
    for view in views:
        junction = window.span(view.line.station - window.station, view.line.exit_station - window.station)
        left[junction] = right[junction] = -math.inf
    return left[BEHIND:], right[BEHIND:]


def _spare(row: int, futures: Extents, window: Window) -> tuple[Floats, bool]:
    """How far beyond the lane's edge who comes, as future `row` has it, stays by metre ahead [m]; whether on the left.

    Where it does not get to within its future: as far as at the nearest place that it does get to.
    """
    ahead = futures.stations[row] > 0.0
    if not ahead.any():
        ahead[0] = True
    stations, offsets = futures.stations[row, ahead], futures.offsets[row, ahead]
    is_left = bool(offsets[-1] > 0.0)
    places = window.index(stations)
    sideways = offsets - window.lane_left[places] if is_left else window.lane_right[places] - offsets
    spare = sideways - futures.half_widths[row, ahead]
    nearest_first = np.argsort(stations, kind="stable")
    metres = np.arange(window.rows.shape[1] - BEHIND)
    return np.interp(metres, stations[nearest_first], spare[nearest_first]), is_left


def _first(meets: Flags, bridged: float) -> tuple[int, int]:
    """The first stretch of `meets`, with what follows it so closely that there is no room to wait in between [m]."""
    rows = meets.nonzero()[0]
    breaks = (np.diff(rows) > bridged).nonzero()[0]
    return int(rows[0]), int(rows[breaks[0]] if breaks.size else rows[-1])


def _passage(row: int, futures: Extents, times: Floats, begin: float, end: float) -> tuple[float, float]:
    """When who comes is on the stretch from station `begin` to `end` [m]: from, until [s]; inf for never."""
    stations, half_length = futures.stations[row], futures.half_lengths[row]
    pace = float(stations[-1 - _RECENT] - stations[-1]) / float(times[-1] - times[-1 - _RECENT])

    def reached(ends: Floats, place: float) -> float:
        there = (ends <= place).nonzero()[0]
        if there.size:
            return float(times[there[0]])
        return float(times[-1] + (ends[-1] - place) / pace) if pace > _COMES else math.inf

    return reached(stations - half_length, end), reached(stations + half_length, begin)


def _time(profile: Profile, arc: float) -> float:
    """When the ego is at `arc` [s]; after the end of its profile at the speed it has then, or creeping."""
    if arc > profile.arcs[-1]:
        return float(STEP_TIMES[-1]) + (arc - float(profile.arcs[-1])) / max(float(profile.speeds[-1]), _CREEPS)
    return float(STEP_TIMES[int(np.searchsorted(profile.arcs, arc))])
