"""Planning: path decision and speed decision along the route, ten times a second."""

import math

import numpy as np

from dvca_sumo.messages import (
    TRAJECTORY_TIMES,
    Floats,
    LocalizationEstimate,
    PredictedObjects,
    SignalColour,
    Trajectory,
    VehicleShape,
)
from dvca_sumo.roadmap.route import Route
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.destination import stop_station
from dvca_sumo.stack.planning.junctions import Junctions, LineView
from dvca_sumo.stack.planning.lane_changing import LaneChanger, LaneChoice
from dvca_sumo.stack.planning.lane_gaps import Gaps
from dvca_sumo.stack.planning.limits import speed_caps
from dvca_sumo.stack.planning.meeting import Demand, Meetings
from dvca_sumo.stack.planning.nudging import Nudge, NudgeDecider
from dvca_sumo.stack.planning.oncoming import waits
from dvca_sumo.stack.planning.passing import Passing
from dvca_sumo.stack.planning.path import Path, lateral_start, path_along
from dvca_sumo.stack.planning.reference import BEHIND, Reference
from dvca_sumo.stack.planning.scene import scene_in
from dvca_sumo.stack.planning.settling import Settling
from dvca_sumo.stack.planning.sight import Sights
from dvca_sumo.stack.planning.situation import Situation
from dvca_sumo.stack.planning.speed import Driver, Profile, Stop
from dvca_sumo.stack.planning.st_graph import Graph, graph_of, leader_of, leading
from dvca_sumo.stack.planning.standing import Standing
from dvca_sumo.stack.planning.start import StartState, start_state
from dvca_sumo.stack.planning.stops import nearest_stop

_HORIZON = float(TRAJECTORY_TIMES[-1])  # [s]
_SPARE = 30.0  # [m] of window beyond what can be driven within the horizon
_LARGEST_ANGLE = 2.0  # [rad] to the reference line
_AROUND = 30.0  # [m] of the route's beginning the first start state lies
_ASTRAY = 0.3  # [rad] between ego and path
_ROUNDS = 3  # of deciding about meetings: yielding to one may put the ego in the way of the next


class Planner:
    """Plans the way along `route`; the whole state is the previous trajectory and what was decided in it."""

    def __init__(self, config: PlanningConfig, route: Route, shape: VehicleShape) -> None:
        self._config = config
        self._route = route
        self._shape = shape
        self._reference = Reference(route, shape, config)
        self._destination = stop_station(route, config)
        self._junctions = Junctions(route, shape, config)
        self._sights = Sights(shape, config)
        gaps = Gaps(route.line, self._destination, shape, config)
        self._lane_changer = LaneChanger(route.lane_changes, gaps, shape, config)
        self._passing = Passing(route.passing_lanes, gaps, shape, config)
        self._nudging = NudgeDecider(shape, config)
        self._settling = Settling(shape, config)
        self._standing = Standing()
        self._driver = Driver(config)
        self._lanes = frozenset(route.lane_ids)
        self._meetings = Meetings(self._lanes, shape, config)
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
        """Station and offset on the route, looked for where the ego was before, then anywhere; None off the route.

        Before it was anywhere it is where the route begins, which may come by the same place again.
        """
        begin = self._route.start - self._shape.front
        stretches: list[tuple[float, float] | None] = [(begin - _AROUND, begin + _AROUND), None]
        if self._station is not None:
            stretches = [None]
            located = self._reference.locate(start.x, start.y, self._station)
            if located is not None and self._is_on_route(start, *located[1:]):
                self._station = located[0]
                return located[:2]
        line = self._route.line
        for between in stretches:
            stations, offsets = line.project([[start.x, start.y]], between=between)
            station, offset = float(stations[0]), float(offsets[0])
            if self._is_on_route(start, offset, float(line.headings[int(station)])):
                self._station = station
                return station, offset
        return None

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
        predicted, stood = self._standing.settled(predicted, self._nudging.stood)
        config, shape = self._config, self._shape
        window = self._reference.window(station, self._reach(station, start.speed))
        choice = self._passing.step(window, offset, start.speed, predicted)
        if choice is None:
            choice = self._lane_changer.step(window, offset, start, predicted.objects)
        if choice.keeping is not None:
            window = window.moved(choice.keeping.offsets, choice.keeping.begin, choice.keeping.width)
            offset -= float(choice.keeping.offsets[BEHIND])
        scene = scene_in(window, predicted, time, stood, self._route.overpasses, config)
        nose = station if config.lines_at_rear_axle else station + shape.front
        views = self._junctions.step(time, nose, station - shape.rear_overhang, start.speed, signals, predicted.objects)
        lateral = lateral_start(start, window, offset)
        nudges, plateaus = self._nudging.step(Situation(time, start.speed, lateral, window, scene, views))
        plateaus = self._settling.step(lateral, window, start.speed, plateaus)
        path = path_along(window, start, lateral, plateaus, shape, config)
        graph = graph_of(scene, window, path, self._route, start.speed, shape, config)
        blind = self._sights.blind(views, path, start.speed, predicted)
        caps = speed_caps(start.speed, graph, views, self._route.crossings, blind, shape, config)
        profile = self._profile(start, graph, views, choice, caps)
        return _points(path, profile), profile.label or _described(nudges, path)

    def _reach(self, station: float, speed: float) -> float:
        """How far the ego can get within the horizon, and some more [m]."""
        fastest = self._reference.fastest(station)
        gained = 0.5 * self._config.acceleration * _HORIZON
        return _HORIZON * max(speed, min(speed + gained, fastest)) + self._shape.front + _SPARE

    def _profile(
        self, start: StartState, graph: Graph, views: list[LineView], choice: LaneChoice, caps: list[float]
    ) -> Profile:
        """The fastest motion that all demands allow, found by adding demands until nobody else is in the way."""
        config, shape = self._config, self._shape
        if abs(math.remainder(start.heading - float(graph.path.headings[0]), 2.0 * math.pi)) > _ASTRAY:
            caps = [min(cap, config.astray_speed) for cap in caps]
        leaders, others = leading(graph, self._lanes, shape, config)
        if choice.behind:
            others = [row for row in others if graph.track(row) not in choice.behind]
        leader = leader_of(leaders, graph, shape)
        to_destination = self._destination - graph.window.station - shape.front
        stops = [nearest_stop(to_destination, start.speed, graph, views, shape, config)]
        if choice.keeping is not None and choice.keeping.stop is not None:
            stops.append(choice.keeping.stop)
        if choice.pace < math.inf:
            caps = [min(cap, choice.pace) for cap in caps]
        profile = self._driver.roll_out(start.speed, start.acceleration, caps, stops, leader)
        waiting = waits(graph, views, profile, shape, config)
        if waiting:
            stops += waiting
            profile = self._driver.roll_out(start.speed, start.acceleration, caps, stops, leader)
        demands: dict[int, Demand] = {}
        for _ in range(_ROUNDS):
            undecided = [row for row in others if row not in demands]
            new = self._meetings.demands(undecided, graph, views, profile)
            if not new:
                break
            demands.update((demand.row, demand) for demand in new)
            joining = [demand.row for demand in demands.values() if demand.follows]
            leader = leader_of(leaders + joining, graph, shape)
            stops_now = [*stops, *_merged(demands, graph)]
            profile = self._driver.roll_out(start.speed, start.acceleration, caps, stops_now, leader)
        yielding = {graph.track(row) for row in demands}
        self._meetings.settle(others, yielding, graph, profile)
        return profile


def _merged(demands: dict[int, Demand], graph: Graph) -> list[Stop]:
    """One stop for each object: the nearest place of all its futures, until the last of them has passed.

    Futures that are followed from the first ask for none.
    """
    stops: dict[int, Stop] = {}
    for row, demand in demands.items():
        track, stop = graph.track(row), demand.stop
        if stop.until <= 0.0:
            continue
        if track in stops:
            known = stops[track]
            nearer = min(known, stop, key=lambda each: each.at)
            stop = Stop(nearer.at, nearer.give, stop.label, max(known.until, stop.until))
        stops[track] = stop
    return list(stops.values())


def _described(nudges: list[Nudge], path: Path) -> str:
    """What the path does, where no demand shapes the speed."""
    for nudge in nudges:
        if nudge.plateau.begin < path.arcs[-1]:
            return nudge.label
    return "cruise"


def _points(path: Path, profile: Profile) -> Floats:
    """The path at the places that the profile has reached at each time of a trajectory.

    Between rows of the path, headings are the cubic with the rows' curvatures as slopes, and curvatures are its slope:
    a plan that begins anew from any of its points, again and again, turns neither sooner nor later than it tells.
    """
    columns = np.empty((7, len(TRAJECTORY_TIMES)))
    times, x, y, headings, speeds, accelerations, curvatures = columns
    times[:] = TRAJECTORY_TIMES
    arcs, speeds[:], accelerations[:] = profile.rows()
    places = path.arcs[1:-1].searchsorted(arcs, side="right")
    before, after = path.rows.take(places, axis=1), path.rows.take(places + 1, axis=1)
    steps, east, north, turned, _ = after - before
    ahead = arcs - before[0]
    parts = ahead / steps
    first, last = before[4] * steps, after[4] * steps
    third = first + last - 2.0 * turned
    bent = parts * third
    bend = turned - first - third + bent
    np.add(parts * (first + parts * bend), before[3], out=headings)
    np.divide(first + parts * (bend + bend + bent), steps, out=curvatures)
    bulge = 0.5 * curvatures * ahead * (steps - ahead)  # of an arc over its chord
    np.add(parts * east + before[1], bulge * np.sin(headings), out=x)
    np.subtract(parts * north + before[2], bulge * np.cos(headings), out=y)
    return columns.T


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
