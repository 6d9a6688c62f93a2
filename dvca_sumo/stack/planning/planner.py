"""Planning: path decision and speed decision along the route, ten times a second."""

import math

import numpy as np

from dvca_sumo.messages import (
    TRAJECTORY_TIMES,
    Floats,
    LocalizationEstimate,
    ObjectClass,
    PredictedObjects,
    SignalColour,
    Trajectory,
    VehicleShape,
)
from dvca_sumo.roadmap.route import Control, Route
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.junctions import Junctions, LineView
from dvca_sumo.stack.planning.meeting import Demand, Meetings
from dvca_sumo.stack.planning.nudging import Nudge, NudgeDecider
from dvca_sumo.stack.planning.path import Path, lateral_start, path_along
from dvca_sumo.stack.planning.reference import BEHIND, Reference, Window
from dvca_sumo.stack.planning.scene import Scene, scene_in
from dvca_sumo.stack.planning.speed import Leader, Profile, Stop, roll_out, slowed_before
from dvca_sumo.stack.planning.st_graph import Graph, graph_of, leader_of, leading
from dvca_sumo.stack.planning.start import StartState, start_state

_PERSON, _VEHICLE = int(ObjectClass.PEDESTRIAN), int(ObjectClass.VEHICLE)
_PRIORITY = Control.PRIORITY
_HORIZON = float(TRAJECTORY_TIMES[-1])  # [s]
_SPARE = 30.0  # [m] of window beyond what can be driven within the horizon
_LARGEST_ANGLE = 1.2  # [rad] to the reference line
_ROUNDS = 3  # of deciding about meetings: yielding to one may put the ego in the way of the next
_GIVE_AT_DESTINATION = 1.0  # [m]
_SLOW_FOR_PERSON = (3.0, 6.0)  # [m/s], [m/s per m of gap]
_SLOW_FOR_OBJECT = (4.0, 10.0)  # [m/s], [m/s per m of gap]
_SLOW_MOVER = 3.0  # [m/s] faster ones are not passed slowly
_TIMID = 1.0  # [m/s] a leader slower than this may stop on the junction's exit


class Planner:
    """Plans the way along `route`; the whole state is the previous trajectory and what was decided in it."""

    def __init__(self, config: PlanningConfig, route: Route, shape: VehicleShape) -> None:
        self._config = config
        self._route = route
        self._shape = shape
        self._reference = Reference(route, shape)
        self._junctions = Junctions(route, config)
        self._nudging = NudgeDecider(shape, config)
        self._meetings = Meetings(shape, config)
        self._previous: Trajectory | None = None
        self._station: float | None = None  # of the start state of the last cycle

    def step(
        self, localization: LocalizationEstimate, predicted: PredictedObjects, signals: dict[str, SignalColour]
    ) -> Trajectory:
        """The trajectory from `localization.time` on."""
        start = start_state(self._previous, localization, self._config)
        located = self._locate(start)
        if located is None:
            points, decision = _braking(start, self._config.comfort_braking), "stop off route"
        else:
            points, decision = self._along_route(start, located, localization.time, predicted, signals)
        self._previous = Trajectory(localization.time, points, decision)
        return self._previous

    def _locate(self, start: StartState) -> tuple[float, float] | None:
        """Station and offset on the route, looked for where the ego was before, then anywhere; None off the route."""
        if self._station is not None:
            located = self._reference.locate(start.x, start.y, self._station)
            if located is not None and self._is_on_route(start, *located[1:]):
                self._station = located[0]
                return located[:2]
        line = self._route.line
        stations, offsets = line.project([[start.x, start.y]])
        station, offset = float(stations[0]), float(offsets[0])
        if not self._is_on_route(start, offset, float(line.headings[int(station)])):
            return None
        self._station = station
        return station, offset

    def _is_on_route(self, start: StartState, offset: float, heading: float) -> bool:
        angle = abs(math.remainder(start.heading - heading, 2.0 * math.pi))
        return abs(offset) <= self._config.off_route and angle <= _LARGEST_ANGLE

    def _along_route(
        self,
        start: StartState,
        located: tuple[float, float],
        time: float,
        predicted: PredictedObjects,
        signals: dict[str, SignalColour],
    ) -> tuple[Floats, str]:
        station, offset = located
        config, shape = self._config, self._shape
        window = self._reference.window(station, self._reach(station, start.speed))
        scene = scene_in(window, predicted, time, config)
        views = self._junctions.step(time, station + shape.front, station - shape.rear_overhang, start.speed, signals)
        lateral = lateral_start(start, window, offset)
        nudges = self._nudging.step(time, start.speed, lateral, window, scene, views)
        path = path_along(window, start, lateral, [nudge.plateau for nudge in nudges], shape, config)
        graph = graph_of(scene, window, path, self._route.crossings, shape, config)
        profile = self._profile(start, window, path, scene, graph, views)
        return _points(path, profile), profile.label or _described(nudges, path)

    def _reach(self, station: float, speed: float) -> float:
        """How far the ego can get within the horizon, and some more [m]."""
        fastest = self._reference.fastest(station)
        gained = 0.5 * self._config.acceleration * _HORIZON
        return _HORIZON * max(speed, min(speed + gained, fastest)) + self._shape.front + _SPARE

    def _profile(
        self, start: StartState, window: Window, path: Path, scene: Scene, graph: Graph, views: list[LineView]
    ) -> Profile:
        """The fastest motion that all demands allow, found by adding demands until nobody else is in the way."""
        caps = self._caps(window, path, scene, graph, views).tolist()
        leaders, others = leading(graph, scene, self._shape, self._config)
        leader = leader_of(leaders, graph, scene, self._shape)
        stops = self._stops(window, scene, graph, views, leader)
        profile = roll_out(start.speed, start.acceleration, caps, stops, leader, self._config)
        demands: dict[int, Demand] = {}
        for _ in range(_ROUNDS):
            undecided = [row for row in others if row not in demands]
            new = self._meetings.demands(undecided, graph, scene, views, window.station, profile)
            if not new:
                break
            demands.update((demand.row, demand) for demand in new)
            joining = [demand.row for demand in demands.values() if demand.follows]
            leader = leader_of(leaders + joining, graph, scene, self._shape)
            stops_now = [*stops, *_merged(demands, scene)]
            profile = roll_out(start.speed, start.acceleration, caps, stops_now, leader, self._config)
        yielding = {int(scene.owners[row]) for row in demands}
        self._meetings.settle(scene.ids[scene.owners[row]] for row in others if scene.owners[row] not in yielding)
        return profile

    def _caps(self, window: Window, path: Path, scene: Scene, graph: Graph, views: list[LineView]) -> Floats:
        """Highest speed by metre of path [m/s]: limit, curves, passing close by, lines with duty to give way."""
        config, shape = self._config, self._shape
        caps = np.minimum(
            config.cruise_fraction * window.speed_limits[BEHIND:],
            np.sqrt(config.lateral_acceleration / np.maximum(np.abs(path.curvatures), 1e-4)),
        )
        for row, cap in _passing_speeds(scene, graph, config):
            low, high = graph.low[row, 0] - shape.front, graph.high[row, 0] + shape.rear_overhang
            if high > 0.0:
                part = slice(max(int(low), 0), int(high) + 1)
                caps[part] = np.minimum(caps[part], cap)
        for line, distance, _, gives_way in views:
            if gives_way and line.yields_to and distance > 0.0 and line.control is not _PRIORITY:
                part = slice(int(distance), int(distance) + 2)
                caps[part] = np.minimum(caps[part], config.give_way_speed)
        return slowed_before(caps, path.arcs, config.slowing)

    def _stops(
        self, window: Window, scene: Scene, graph: Graph, views: list[LineView], leader: Leader | None
    ) -> list[Stop]:
        """Where the ego has to stop whatever anybody does; only the nearest matters."""
        config, front = self._config, self._shape.front
        to_destination = self._route.destination - window.station - front
        stops = [Stop(to_destination, _GIVE_AT_DESTINATION, "stop destination")]
        stops += [
            Stop(view.distance - config.stop_line_gap, config.stop_line_gap, view.stop) for view in views if view.stop
        ]
        obstacle = _obstacle(scene, graph, front)
        occupied_from = math.inf
        if obstacle is not None:
            occupied_from = float(graph.low[obstacle, 0]) - front
            label = f"stop behind {scene.ids[scene.owners[obstacle]]}"
            stops.append(Stop(occupied_from - config.object_gap, config.object_gap - 1.0, label))
        if leader is not None and max(leader.speeds[0], leader.speeds[15]) < _TIMID:
            occupied_from = min(occupied_from, leader.rears[0])
        needed = self._shape.length + config.follow_gap
        for line, distance, _, _ in views:
            to_exit = distance + line.exit_station - line.station
            if line.crosses and distance > 0.0 and to_exit < occupied_from < to_exit + needed:
                stops.append(Stop(distance - config.stop_line_gap, config.stop_line_gap, "stop exit occupied"))
        return [min(stops, key=lambda stop: stop.at)]


def _obstacle(scene: Scene, graph: Graph, front: float) -> int | None:
    """The nearest future that stands in the way, as a row; not one that the front bumper has cleared already."""
    rows = np.arange(scene.moving, len(scene.owners))
    standing = graph.occupied[rows, 0] & ((graph.low[rows, 0] > front) | (graph.gaps[rows, 0] < 0.0))
    rows = rows[standing]
    return int(rows[graph.low[rows, 0].argmin()]) if len(rows) else None


def _passing_speeds(scene: Scene, graph: Graph, config: PlanningConfig) -> list[tuple[int, float]]:
    """Futures that are passed close by now, as rows, and at which speed [m/s]."""
    owners, gaps = scene.owners, graph.gaps[:, 0]
    is_person = scene.classes[owners] == _PERSON
    close = (gaps >= 0.0) & (gaps < np.where(is_person, config.person_slow_gap, config.object_slow_gap))
    close &= scene.is_standing[owners] | ((scene.speeds[owners] < _SLOW_MOVER) & (scene.classes[owners] != _VEHICLE))
    speeds = []
    for row in np.flatnonzero(close).tolist():
        slowest, more = _SLOW_FOR_PERSON if is_person[row] else _SLOW_FOR_OBJECT
        speeds.append((row, slowest + more * float(gaps[row])))
    return speeds


def _merged(demands: dict[int, Demand], scene: Scene) -> list[Stop]:
    """One stop for each object: the nearest place of all its futures, until the last of them has passed."""
    stops: dict[int, Stop] = {}
    for row, demand in demands.items():
        owner, stop = int(scene.owners[row]), demand.stop
        if owner in stops:
            known = stops[owner]
            nearer = min(known, stop, key=lambda each: each.at)
            stop = Stop(nearer.at, nearer.give, stop.label, max(known.until, stop.until))
        stops[owner] = stop
    return [stop for stop in stops.values() if stop.until > 0.0]


def _described(nudges: list[Nudge], path: Path) -> str:
    """What the path does, where no demand shapes the speed."""
    for nudge in nudges:
        if nudge.plateau.begin < path.arcs[-1]:
            return nudge.label
    return "cruise"


def _points(path: Path, profile: Profile) -> Floats:
    arcs, speeds, accelerations = profile.rows()
    points = np.empty((len(TRAJECTORY_TIMES), 7))
    points[:, 0] = TRAJECTORY_TIMES
    for column, values in ((1, path.x), (2, path.y), (3, path.headings), (6, path.curvatures)):
        points[:, column] = np.interp(arcs, path.arcs, values)
    points[:, 4] = speeds
    points[:, 5] = accelerations
    parts = np.interp(arcs, path.arcs, np.arange(len(path.arcs))) % 1.0
    bulge = 0.5 * points[:, 6] * parts * (1.0 - parts)  # of an arc over its chord; rows of the path are 1 m apart
    points[:, 1] += bulge * np.sin(points[:, 3])
    points[:, 2] -= bulge * np.cos(points[:, 3])
    return points


def _braking(start: StartState, braking: float) -> Floats:
    """Straight ahead to a stop."""
    stopped = start.speed / braking
    times = np.minimum(TRAJECTORY_TIMES, stopped)
    arcs = times * (start.speed - 0.5 * braking * times)
    points = np.zeros((len(TRAJECTORY_TIMES), 7))
    points[:, 0] = TRAJECTORY_TIMES
    points[:, 1] = start.x + arcs * math.cos(start.heading)
    points[:, 2] = start.y + arcs * math.sin(start.heading)
    points[:, 3] = start.heading
    points[:, 4] = start.speed - braking * times
    points[:, 5] = np.where(stopped > TRAJECTORY_TIMES, -braking, 0.0)
    return points
