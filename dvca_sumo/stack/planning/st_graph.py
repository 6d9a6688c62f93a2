"""The ST graph: when each future occupies which part of the path, and what that asks of the ego."""

import math

import msgspec
import numpy as np

from dvca_sumo.messages import PREDICTION_STEP, PREDICTION_TIMES, Flags, Floats, ObjectClass, VehicleShape
from dvca_sumo.roadmap.route import Crossing, Overpass, Route
from dvca_sumo.stack.planning.closeness import hidden_depths, moved_beside, outlined, stood_beside
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.path import Path
from dvca_sumo.stack.planning.reference import BEHIND, Window
from dvca_sumo.stack.planning.scene import ALONG, BRIDGE, Scene
from dvca_sumo.stack.planning.speed import STEP_TIMES, Leader

PRESENT = 0.3  # [s] what occupies the path within this time is there already
AT_CROSSING = 1.5  # [m] before and after a pedestrian crossing

_BICYCLE, _PERSON = int(ObjectClass.BICYCLE), int(ObjectClass.PEDESTRIAN)
_WALKS_ACROSS = 0.3  # [m/s] sideways
_COLUMNS = np.arange(len(PREDICTION_TIMES))
_NEVER = 1e4  # [m] for places where there is no leader
_LANE_ROOM = 0.3  # [m] of lane beside the ego's width that is enough for `trusts_lane_room`
_OFF_LANE = 0.5  # [m] of the body beyond the edge of its lane, by the line, not by what it swerves for
_GRAZING = 0.6  # [m] of overlap of who moves and the body, up to which the outline is looked at
_BACK = 15.0  # [m] along the line in one step of a prediction: farther than anybody comes who drives towards the ego


class Graph(msgspec.Struct, frozen=True, eq=False):
    """Occupation of `path` by each future of `scene`; places are arcs of the path [m]."""

    window: Window
    path: Path
    scene: Scene
    occupied: Flags  # (h, t)
    margins: Floats  # (h,) [m] sideways, within which a future counts as in the way
    gaps: Floats  # (h, t) [m] sideways between body and object, negative where they would overlap
    low: Floats  # (h, t) [m] the object's near end along the path
    high: Floats  # (h, t) [m] its far end
    begins: Floats  # (h, t) [m] as `low`, but of that part of its outline which is in the way, where it grazes that
    ends: Floats  # (h, t) [m] as `high`, but of the same
    first: list[int]  # (h,) column in which occupation begins; 0 where there is none
    last: list[int]  # (h,) column in which it ends
    returning: frozenset[int]  # rows of those who are on the path farther on, and come to it again, nearer, by then
    rear_overhang: float  # [m] of the ego

    def track(self, row: int) -> int:
        """Id of the object whose future row `row` is."""
        track: int = self.scene.ids[self.scene.owners[row]]
        return track

    def is_off_lane(self, row: int, width: float) -> bool:
        """Whether the line takes the ego, so wide [m], off its lane here, or where future `row` meets it."""
        window, futures, first = self.window, self.scene.futures, self.first[row]
        middle, half = futures.stations[row, first], futures.half_lengths[row, first]
        rows = [BEHIND, *window.index(np.array([middle - half, middle, middle + half])).tolist()]
        room = min(float(window.lane_left[rows].min()), -float(window.lane_right[rows].max()))
        return 0.5 * width - room > _OFF_LANE

    def contacts(self, row: int) -> tuple[float, float]:
        """The first arcs at which who moves, as future `row` has it, is within its margin of the body's way, and in it.

        They may lie beyond the near end of what passes aslant beside the ego, and draws near only further on. They are
        0 for all that is beside the ego's rear; the path's last arc where that is nowhere.
        """
        scene, columns = self.scene, self.occupied[row].nonzero()[0]
        boxes = np.tile(scene.boxes[scene.owners[row]], (len(columns), 1))
        boxes[:, :3] = scene.poses[row, columns]
        stations, gaps = outlined(boxes, self.window, self.path)
        count, is_there = len(self.path.arcs), stations > -self.rear_overhang
        nearest = [stations[(gaps < margin) & is_there].min(initial=count) for margin in (self.margins[row], 0.0)]
        within, touching = np.interp(nearest, np.arange(count), self.path.arcs).tolist()
        return within, touching


def graph_of(
    scene: Scene,
    window: Window,
    path: Path,
    route: Route,
    speed: float,
    shape: VehicleShape,
    config: PlanningConfig,
) -> Graph:
    """What comes within its margin of where the ego's body passes, at or ahead of the rear bumper, on its level.

    `speed` is the ego's [m/s].
    """
    futures, rows = scene.futures, scene.rows
    gaps = futures.gaps(np.maximum.reduce(path.left.take(rows)), np.minimum.reduce(path.right.take(rows)))
    count, still = len(path.arcs), slice(scene.moving, None)
    hidden = hidden_depths(scene, window)
    beyond, begins, ends = stood_beside(gaps[still], hidden[still, 0], scene, window, path, config)
    stretch = np.zeros(BEHIND + count)
    stretch[BEHIND:] = path.arcs - np.arange(count, dtype=np.float64)
    centres = futures.stations + stretch.take(rows[0])
    low, high = centres - futures.half_lengths, centres + futures.half_lengths
    low[beyond], high[beyond] = np.minimum(low[beyond], begins), np.maximum(high[beyond], ends)
    margins = _margins(scene, gaps, window, route.crossings, speed, config)
    occupied = gaps < margins[:, None]
    if hidden[: scene.moving].any():
        occupied[: scene.moving] |= (gaps < margins[:, None] + hidden)[: scene.moving]
    _let_leave(occupied, scene, gaps, config)
    occupied &= (high > -shape.rear_overhang) & (futures.stations < count - 2)
    for overpass in route.overpasses:
        _pass_over(occupied, overpass, scene, window)
    grazing = (occupied[: scene.moving] & (gaps[: scene.moving] > -_GRAZING)).nonzero()
    begins, ends = low, high
    if grazing[0].size:
        begins, ends = low.copy(), high.copy()
        nearest, begins[grazing], ends[grazing] = moved_beside(scene, window, path, margins[grazing[0]], *grazing)
        is_ahead = (gaps[grazing] < margins[grazing[0]]) | (ends[grazing] > -shape.rear_overhang)
        gaps[grazing] = nearest
        occupied[grazing] = (nearest < margins[grazing[0]]) & is_ahead
    if config.trusts_lane_room:
        occupied[still][_has_lane_room(scene, window, shape)] = False
    returning = _let_return(occupied[: scene.moving], futures.stations[: scene.moving])
    last = occupied.shape[1] - 1 - occupied[:, ::-1].argmax(axis=1)
    first = occupied.argmax(axis=1).tolist()
    return Graph(
        window=window,
        path=path,
        scene=scene,
        occupied=occupied,
        margins=margins,
        gaps=gaps,
        low=low,
        high=high,
        begins=begins,
        ends=ends,
        first=first,
        last=last.tolist(),
        returning=returning,
        rear_overhang=shape.rear_overhang,
    )


def _pass_over(occupied: Flags, overpass: Overpass, scene: Scene, window: Window) -> None:
    """Free the path of those who get to it by a lane that passes over or under it."""
    ahead = overpass.station - window.station
    if not -BRIDGE < ahead < window.rows.shape[1] - BEHIND + BRIDGE:
        return
    rows = [row for row, lanes in enumerate(scene.lanes) if overpass.lane in lanes]
    occupied[rows] &= np.abs(scene.futures.stations[rows] - ahead) > BRIDGE


def _has_lane_room(scene: Scene, window: Window, shape: VehicleShape) -> Flags:
    """Whether each future that stays, of what is neither person nor bicycle, leaves enough of the ego's lane beside it.

    It leaves enough when it is not on the line, and off the lane or with a free strip beside it that the ego fits in.
    """
    futures, still = scene.futures, slice(scene.moving, None)
    offsets, half_widths = futures.offsets[still, 0], futures.half_widths[still, 0]
    rows = scene.rows[:, still, 0]
    lane_left, lane_right = window.lane_left[rows].min(axis=0), window.lane_right[rows].max(axis=0)
    left, right = offsets + half_widths, offsets - half_widths
    is_on_line = (left > 0.0) & (right < 0.0)
    is_on_lane = (left > lane_right) & (right < lane_left)
    is_narrow = np.maximum(lane_left - left, right - lane_right) < shape.width + _LANE_ROOM
    classes = scene.classes[scene.owners[still]]
    has_room: Flags = ~(is_on_line | (is_on_lane & is_narrow)) & (classes != _PERSON) & (classes != _BICYCLE)
    return has_room


def _margins(
    scene: Scene, gaps: Floats, window: Window, crossings: tuple[Crossing, ...], speed: float, config: PlanningConfig
) -> Floats:
    """(h,) sideways distance within which a future counts as in the way [m].

    It is wider for people who walk across, unless they stay clear of the ego's way or walk away from it. Past people
    who stand an ego creeps that is slow already; they may be waiting for it. Who walks, and sways, is left more room by
    an ego that stands: it can wait.
    """
    classes = scene.classes[scene.owners]
    margins = np.where(classes == _BICYCLE, config.bicycle_margin, config.object_margin)
    people = scene.is_person
    if not np.count_nonzero(people):
        return margins
    offsets, stations = scene.futures.offsets, scene.futures.stations[:, 0] + window.station
    walked = np.abs(offsets[:, 1] - offsets[:, 0])
    across = people & (walked > _WALKS_ACROSS * PREDICTION_STEP)
    across &= gaps.min(axis=1) < config.person_margin
    margins[people] = config.person_margin
    if speed < config.creeping_speed:
        margins[scene.moving :][people[scene.moving :]] = config.object_margin
    if speed < config.standing_speed:
        margins[: scene.moving][people[: scene.moving]] = config.setting_off_margin
    margins[across] = config.crossing_person_margin
    for crossing in crossings:
        begin, end = crossing.start_station - AT_CROSSING, crossing.end_station + AT_CROSSING
        margins[across & (stations > begin) & (stations < end)] = config.crossing_margin
    return margins


def _let_leave(occupied: Flags, scene: Scene, gaps: Floats, config: PlanningConfig) -> None:
    """Free the path of people who walk away from it, their nearest moment past."""
    people = scene.is_person.nonzero()[0]
    if people.size:
        gaps = gaps[people]
        leaves = np.arange(gaps.shape[1]) > gaps.argmin(axis=1)[:, None]
        occupied[people] &= ~(leaves & (gaps >= config.person_margin))


def _let_return(occupied: Flags, stations: Floats) -> frozenset[int]:
    """Free the path of those who leave it for a place nearer to the ego, up to then; which they are.

    Round a roundabout the path comes by again where somebody drives who will soon pass the entry. It is there that the
    ego meets that one, who has left the other place when it may be there.
    """
    jumps = stations[:, 1:] < stations[:, :-1] - _BACK
    if not np.count_nonzero(jumps):
        return frozenset()
    returning = []
    for row in np.count_nonzero(jumps, axis=1).nonzero()[0].tolist():
        for back in reversed((jumps[row].nonzero()[0] + 1).tolist()):
            if occupied[row, :back].any() and occupied[row, back:].any():
                occupied[row, :back] = False
                returning.append(row)
                break
    return frozenset(returning)


def leading(
    graph: Graph, lanes: frozenset[str], shape: VehicleShape, config: PlanningConfig
) -> tuple[list[int], list[int]]:
    """Moving futures on the path, as rows of the graph: those that lead (or come towards) the ego, and the rest.

    `lanes` are those of the ego's route. Left out are unlikely futures that are not about to happen, unless those of
    one object are a likely one together (ways that fork again soon share one probability), and who drives behind the
    ego, unless it passes where the path swings out, and crosses the path then: first, or on a lane of its own. People
    beside it do not lead it, nor who comes by its front already.
    """
    scene = graph.scene
    leaders: list[int] = []
    others: list[int] = []
    unlikely: dict[int, list[int]] = {}
    for row, first in enumerate(graph.first[: scene.moving]):
        if not graph.occupied[row, first]:
            continue
        leads = _leads(row, graph, lanes, shape, config)
        if leads is None:
            continue
        is_soon = scene.times[first] < config.soon
        if scene.probabilities[row] < (config.possible if is_soon else config.likely):
            unlikely.setdefault(int(scene.owners[row]), []).append(row)
        else:
            (leaders if leads else others).append(row)
    for rows in unlikely.values():
        if scene.probabilities[rows].sum() >= config.likely:
            others += rows
    return leaders, sorted(others)


def _leads(row: int, graph: Graph, lanes: frozenset[str], shape: VehicleShape, config: PlanningConfig) -> bool | None:
    """Whether future `row`, on the path, leads the ego (or comes towards it), or crosses or joins its way.

    None of who drives behind it, and does neither.
    """
    scene, futures, first = graph.scene, graph.scene.futures, graph.first[row]
    is_beside = graph.low[row, 0] < shape.front and (scene.is_person[row] or futures.directions[row, 0] < -ALONG)
    if is_beside or abs(futures.directions[row, first]) < ALONG:
        return False
    if futures.stations[row, 0] > shape.centre and row not in graph.returning:
        return bool(scene.times[first] <= PRESENT) and not _leaves_oncoming(row, graph, shape)
    aslant = futures.half_widths[row, : first + 1] - 0.5 * scene.boxes[scene.owners[row], 4]  # wider than it is
    is_along = futures.directions[row, 0] > ALONG
    gaps = np.where(futures.stations[row, : first + 1] > -BEHIND, graph.gaps[row, : first + 1], -math.inf)
    is_in_lane = is_along and (gaps + aslant).max() < config.object_margin
    is_crossing = not is_in_lane or (not lanes.issuperset(scene.lanes[row]) and graph.is_off_lane(row, shape.width))
    return False if is_crossing else None


def _leaves_oncoming(row: int, graph: Graph, shape: VehicleShape) -> bool:
    """Whether future `row`, on the path, comes towards the ego and is off it again before it is there."""
    last = graph.last[row]
    is_oncoming = graph.scene.futures.directions[row, graph.first[row]] < 0.0
    return bool(is_oncoming and last + 1 < graph.occupied.shape[1] and graph.low[row, last + 1] > shape.front)


def leader_of(rows: list[int], graph: Graph, shape: VehicleShape) -> Leader | None:
    """The nearest of the futures `rows` at each moment, while they occupy the path; carried on at constant speed.

    Who comes towards the ego, and is about to occupy it, is there already: an ego that stands does not set off for a
    moment.
    """
    if not rows:
        return None
    scene, those = graph.scene, np.array(rows)
    low, is_there = graph.low.take(those, axis=0), graph.occupied.take(those, axis=0)
    comes = scene.futures.directions[those, 0] < 0.0
    if np.count_nonzero(comes):
        first = np.array([graph.first[row] for row in rows])
        comes &= scene.times[first] <= PRESENT
        is_there |= comes[:, None] & (first[:, None] > _COLUMNS)
    places, paces = np.where(is_there, low - shape.front, _NEVER), (low[:, 1:] - low[:, :-1]) / PREDICTION_STEP
    nearest = places.argmin(axis=0)
    rears, speeds, times = np.empty((3, len(nearest) + 1))
    np.minimum.reduce(places, out=rears[:-1])
    speeds[:-2] = paces[nearest[:-1], _COLUMNS[:-1]]
    speeds[-2:] = paces[nearest[-1], -1]
    times[:-1], times[-1] = scene.times, STEP_TIMES[-1]
    rears[-1] = rears[-2] + (times[-1] - times[-2]) * speeds[-1]
    track = graph.track(rows[nearest[(rears < _NEVER).argmax()]])
    return Leader(
        np.interp(STEP_TIMES, times, rears).tolist(), np.interp(STEP_TIMES, times, speeds).tolist(), f"follow {track}"
    )
