"""What bounds the speed whoever has the right of way: limits, curves, narrow gaps, and who may set off."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from dvca_sumo.messages import PREDICTION_STEP, Floats, ObjectClass, VehicleShape
from dvca_sumo.roadmap.route import Control, Crossing
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.junctions import LineView
from dvca_sumo.stack.planning.reference import BEHIND
from dvca_sumo.stack.planning.scene import ALONG
from dvca_sumo.stack.planning.speed import HARD_GAP, slowed_before
from dvca_sumo.stack.planning.st_graph import AT_CROSSING, Graph

_VEHICLE = int(ObjectClass.VEHICLE)
_PRIORITY = Control.PRIORITY
_SLOW_FOR_PERSON = (3.0, 6.0)  # [m/s], [m/s per m of gap]
_SLOW_FOR_OBJECT = (4.0, 10.0)  # [m/s], [m/s per m of gap]
_CREEPING = 1.0  # [m/s] past people who stand very close: below `creeping_speed`, so that they stay out of the way ...
_ROOM_TO_CREEP = 6.0  # ... and from so far before them [m]: from where the ego stopped for them
_STOPPABLE = 3.5  # [m/s^2] of braking that would do before who walks in the ego's way: they may stay there
_STEERED = 4  # [m] of path over which changes of curvature are looked at
_BESIDE = 3.0  # [m] sideways
_AT_LINE = 4.0  # [m] before or past it
_SLOWED = 4.0  # [m/s]
_SLOW_MOVER = 3.0  # [m/s] faster ones are not passed slowly
_BEFORE_WAITING = 3.0  # [m/s] in front of who has priority and stands ...
_NOSE = 6.0  # ... so near to the ego's way [m] ...
_ROOM_TO_STOP = 3.0  # ... and as far before it, should it set off [m]
_AT_KERB = 1.5  # [m/s] before people who stand at the kerb of a crossing and may set off with the ego ...
_UNHURRIED = 4.0  # ... that is slower than that [m/s]; ...
_BEFORE_PRIOR = 4.5  # ... [m/s] who is faster they let pass, but may set off all the same where they have priority ...
_OUTLOOK = 6.0  # ... so far before them [m]


def speed_caps(
    speed: float,
    graph: Graph,
    views: list[LineView],
    crossings: Sequence[Crossing],
    blind: Sequence[tuple[float, float]],
    shape: VehicleShape,
    config: PlanningConfig,
) -> list[float]:
    """Highest speed by metre of path [m/s]: limit, curves, how fast the wheels turn, and whom the ego comes close to.

    On the stretches `blind` [m] the ego feels its way. Each is braked for in comfort beforehand. Who walks in its way,
    to be gone before it comes, may stop there: the ego still could, too. `speed` is the ego's [m/s].
    """
    path = graph.path
    caps = np.minimum(
        cruise_speeds(graph.window.speed_limits[BEHIND:], config),
        np.sqrt(config.lateral_acceleration / np.maximum(np.abs(path.curvatures), 1e-4)),
    )
    changes = np.abs(path.curvatures[_STEERED:] - path.curvatures[:-_STEERED])  # of as many metres each
    turning = config.steering_rate * _STEERED / (shape.wheelbase * np.maximum(changes, 1e-4))
    middle = slice(_STEERED // 2, _STEERED // 2 + len(turning))
    np.minimum(caps[middle], turning, out=caps[middle])
    slow = [(begin, end, config.peering_speed) for begin, end in blind]
    slow += _slow_stretches(speed, graph, views, crossings, shape, config)
    for begin, end, cap in slow:
        if end > 0.0:
            part = slice(max(int(begin), 0), int(end) + 1)
            caps[part] = np.minimum(caps[part], cap)
    slowed = slowed_before(caps, path.arcs, config.slowing)
    nearest = _person_in_way(graph, shape, config)
    if nearest < math.inf:
        slowed = np.minimum(slowed, np.sqrt(2.0 * _STOPPABLE * np.maximum(nearest - path.arcs, 0.0)))
    bounds: list[float] = slowed.tolist()
    return bounds


def _person_in_way(graph: Graph, shape: VehicleShape, config: PlanningConfig) -> float:
    """How far it is to the nearest one ahead who walks in the ego's way [m]; infinite where nobody does."""
    moving = slice(graph.scene.moving)
    people, low = graph.scene.is_person[moving], graph.low[moving, 0]
    if not np.count_nonzero(people):
        return math.inf
    in_way = people & (graph.gaps[moving, 0] < config.person_margin) & (low > shape.front)
    return float(low[in_way].min(initial=math.inf)) - shape.front - HARD_GAP


def _slow_stretches(
    speed: float,
    graph: Graph,
    views: list[LineView],
    crossings: Sequence[Crossing],
    shape: VehicleShape,
    config: PlanningConfig,
) -> Iterator[tuple[float, float, float]]:
    """From where to where along the path somebody is near or may come [m], and the highest speed there [m/s].

    Near is also the nose of who may set off. Past a line of others the ego feels its way until it sees by who waits
    beside: it looks from the middle of its body.
    """
    low, high = graph.low[:, 0], graph.high[:, 0]
    for row, cap, room in _passing_speeds(graph, config):
        yield low[row] - shape.front - room, high[row] + shape.rear_overhang, cap
    for row in _waiting(graph, views):
        yield low[row] - shape.front - _ROOM_TO_STOP, high[row] + shape.rear_overhang, _BEFORE_WAITING
    for row in _at_kerbs(speed, graph, views, crossings, config):
        cap = _AT_KERB if speed < _UNHURRIED else _BEFORE_PRIOR
        yield low[row] - shape.front - _OUTLOOK, high[row] - shape.front, cap
    for view in views:
        distance = view.distance
        if not view.goes_first or view.line.control is _PRIORITY:
            continue
        if distance > 0.0:
            yield distance, distance + 1.0, config.give_way_speed
        abreast = _hiding(graph, shape.front + distance) - shape.centre
        yield min(distance, abreast), abreast, config.peering_speed


def cruise_speeds(limits: Floats, config: PlanningConfig) -> Floats:
    """The speeds to drive at under speed `limits` of any shape [m/s]."""
    return np.maximum(config.cruise_fraction * limits, limits - config.cruise_room)


def _waiting(graph: Graph, views: list[LineView]) -> list[int]:
    """Vehicles that stand before the ego's way, pointing at it, and have priority: they may set off at any time.

    As rows of the graph. Not at signals: nearly all who stand there have red.
    """
    scene = graph.scene
    prior = frozenset().union(*(view.goes_first for view in views if view.line.control is not Control.SIGNAL))
    if not prior:
        return []
    rows = [row for row in range(scene.moving, len(scene.lanes)) if not prior.isdisjoint(scene.lanes[row])]
    if not rows:
        return []
    boxes, gaps, futures = scene.boxes[scene.owners[rows]], graph.gaps[rows, 0], scene.futures
    ahead = 0.5 * boxes[:, 3:4] * np.column_stack((np.cos(boxes[:, 2]), np.sin(boxes[:, 2])))
    _, noses, _ = graph.window.project(boxes[:, :2] + ahead)
    points_at = np.abs(noses) < np.abs(futures.offsets[rows, 0])
    waits = (gaps > 0.0) & (gaps < _NOSE) & points_at & (np.abs(futures.directions[rows, 0]) < ALONG)
    return [row for row, is_one in zip(rows, waits.tolist(), strict=True) if is_one]


def _at_kerbs(
    speed: float, graph: Graph, views: list[LineView], crossings: Sequence[Crossing], config: PlanningConfig
) -> list[int]:
    """Rows of people who stand beside a crossing ahead, and may use it before an ego of such a `speed` [m/s]."""
    scene, still = graph.scene, slice(graph.scene.moving, None)
    people, gaps = scene.is_person[still], graph.gaps[still, 0]
    if not np.count_nonzero(people):
        return []
    stands = people & (gaps > 0.0) & (gaps < config.crossing_margin)
    places = scene.futures.stations[still, 0] + graph.window.station
    waits = np.zeros_like(stands)
    for crossing in _in_use(speed, views, crossings):
        waits |= (places > crossing.start_station - AT_CROSSING) & (places < crossing.end_station + AT_CROSSING)
    rows: list[int] = (scene.moving + (stands & waits).nonzero()[0]).tolist()
    return rows


def _in_use(speed: float, views: list[LineView], crossings: Sequence[Crossing]) -> list[Crossing]:
    """Where people have priority; with a slow ego before it any crossing, unless a signal has them wait."""
    if speed < _UNHURRIED:
        closed = frozenset().union(*(view.line.crosses for view in views if _is_green(view)))
        return [crossing for crossing in crossings if crossing.lane not in closed]
    prior = frozenset().union(*(view.goes_first for view in views))
    return [crossing for crossing in crossings if crossing.lane in prior]


def _is_green(view: LineView) -> bool:
    """Whether nobody goes before the ego at a signal."""
    return view.line.control is Control.SIGNAL and not view.stop and not view.goes_first


def _hiding(graph: Graph, line: float) -> float:
    """The foremost nose, when they have slowed down, of those who then wait beside the ego's way at a `line`.

    They hide what comes, and may have seen it. Both are arcs of the path [m]; minus infinity where nobody does.
    """
    scene, stations = graph.scene, graph.scene.futures.stations
    speeds = np.empty(stations.shape)
    speeds[:, 0] = scene.speeds[scene.owners]
    speeds[:, 1:] = (stations[:, 1:] - stations[:, :-1]) / PREDICTION_STEP
    is_slow = speeds < _SLOWED
    rows, first = np.arange(len(stations)), is_slow.argmax(axis=1)
    gaps, noses = graph.gaps[rows, first], graph.high[rows, first]
    waits = is_slow[rows, first] & (gaps > 0.0) & (gaps < _BESIDE) & (np.abs(noses - line) < _AT_LINE)
    waits &= (scene.futures.directions[:, 0] > ALONG) & (scene.classes[scene.owners] == _VEHICLE)
    return float(noses[waits].max(initial=-math.inf))


def _passing_speeds(graph: Graph, config: PlanningConfig) -> list[tuple[int, float, float]]:
    """Futures that are passed close by now, as rows, at which speed [m/s], and from how far before them on [m]."""
    scene, speeds = graph.scene, []
    for row, (gap, is_person) in enumerate(zip(graph.gaps[:, 0].tolist(), scene.is_person.tolist(), strict=True)):
        if not 0.0 <= gap < (config.person_slow_gap if is_person else config.object_slow_gap):
            continue
        owner = scene.owners[row]
        is_slow = scene.speeds[owner] < _SLOW_MOVER and scene.classes[owner] != _VEHICLE
        if is_slow or scene.is_standing[owner]:
            slowest, more = _SLOW_FOR_PERSON if is_person else _SLOW_FOR_OBJECT
            creeps = is_person and scene.is_standing[owner] and gap < config.person_margin
            speeds.append((row, _CREEPING, _ROOM_TO_CREEP) if creeps else (row, slowest + more * gap, 0.0))
    return speeds
