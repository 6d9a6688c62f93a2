"""The vehicles that are judged: egos, moved by their own stacks, and natives, moved by SUMO's own drivers."""

import math

import numpy as np

from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.messages import VehicleShape
from dvca_sumo.roadmap import Route, is_inner
from dvca_sumo.truth import EgoTruth
from dvca_sumo.world.entry import Entry, departure
from dvca_sumo.world.session import Motion
from dvca_sumo.world.straddling import SLOW
from dvca_sumo.world.vehicle import Vehicle, VehicleLimits
from dvca_sumo.world.ways import End

_SEARCHED = 10.0  # [m] along the route: nobody gets farther in a world step, and a route may come by again soon
_SIDEWAYS = 0.3  # [m/s] is changing lanes
_INDICATED = 50.0  # [m] before a junction an ego that turns at it begins to indicate
# By a movement's direction; T: about, in left-hand traffic.
_SIDES = {"l": 1, "L": 1, "t": 1, "r": -1, "R": -1, "T": -1}


def shape_of(entry: Entry) -> VehicleShape:
    """The body of an ego of which SUMO knows length and width only: axles at 18 % and 78 % of its length."""
    return VehicleShape(entry.length, entry.width, 0.6 * entry.length, 0.18 * entry.length)


class Ego:
    """One ego's body in the world; between two world steps its `vehicle` is advanced by its own stack."""

    def __init__(self, entry: Entry, route: Route, limits: VehicleLimits) -> None:
        self.name = entry.ego
        self.stops = entry.stops
        self.route = route
        self.shape = shape_of(entry)
        self.vehicle = Vehicle(self.shape, limits, departure(entry, route, self.shape))
        self.signals = _signals(route)  # ids of the signal heads on its route
        self._turns = _turns(route)
        self._origins = _origins(route)
        self._way = _Way(route, self.shape)

    @property
    def truth(self) -> EgoTruth:
        """Its true motion now."""
        return self.vehicle.truth

    def station(self) -> float:
        """Where its rear axle is along the route [m]; asked for once a world step at least."""
        return self._way.station(self.vehicle.truth)

    def lane(self) -> str:
        """The route's lane under its front bumper, for SUMO's map matching."""
        line = self.route.line
        front = min(self.station() + self.shape.front, line.length)
        if self.route.lane_change_at(front) is None and self.route.passing_lane_at(front) is None:
            return self.route.lane_ids[self.route.row_at(front)]
        truth, reach = self.vehicle.truth, self.shape.front
        nose = (truth.x + reach * math.cos(truth.heading), truth.y + reach * math.sin(truth.heading))
        _, offset = line.place(*nose, between=(front - reach, front + reach))
        return self.route.lane_at(front, offset)

    def straddled(self, lane: str) -> tuple[End, ...]:
        """Where it may be across more lanes than one: its front, which is on `lane`, and its rear axle.

        Nowhere while it is fast.
        """
        if self.truth.speed > SLOW:
            return ()
        rear = self.route.lane_ids[self.route.row_at(self.station())]
        return tuple(End(end, self._origins.get(end, "")) for end in (lane, rear))

    def occupied(self) -> float:
        """How much lane it takes up [m]: more than its length where it cuts the corner that the lanes drive out."""
        station, shape = self.station(), self.shape
        return max(shape.length, self.route.lane_between(station - shape.rear_overhang, station + shape.front))

    def indicated(self, lane: str) -> int:
        """Which way it indicates, on `lane`: 1 left, -1 right, 0 neither.

        To the lane that the route needs, while that is another; else as it turns at the junction it is on or comes to;
        where it may pass others, as it moves sideways.
        """
        front = self.station() + self.shape.front
        change = self.route.lane_change_at(front)
        if change is not None and lane != change.lane(front, -1):
            return 1 if change.offsets[-1, 0] > change.offsets[0, 0] else -1
        if self.route.passing_lane_at(front) is not None:
            truth = self.vehicle.truth
            along = float(self.route.line.headings_at(np.array([self.station()]))[0])
            sideways = truth.speed * math.sin(truth.heading - along)
            if abs(sideways) > _SIDEWAYS:
                return 1 if sideways > 0.0 else -1
        return next((side for begin, end, side in self._turns if begin <= front <= end), 0)


class Native:
    """A vehicle that SUMO's own driver drives, as oracles see an ego: the pose is that of the rear axle."""

    def __init__(self, entry: Entry, route: Route) -> None:
        self.name = entry.ego
        self.route = route
        self.shape = shape_of(entry)
        self.signals = _signals(route)
        self.is_rerouted = False  # by SUMO, since its departure
        self._edges = entry.edges
        self._way = _Way(route, self.shape)
        self.truth = self._seen(
            entry.time,
            Motion(entry.front_x, entry.front_y, entry.heading, entry.speed, 0.0, is_on_road=True, edges=entry.edges),
            entry.heading,
            1.0,
        )

    def station(self) -> float:
        """Where its rear axle is along the route [m]; asked for once a world step at least."""
        return self._way.station(self.truth)

    def follow(self, time: float, motion: Motion) -> None:
        """Take over how it moves at `time` [s], and on what route."""
        self.is_rerouted |= motion.edges[-len(self._edges) :] != self._edges
        if time > self.truth.time:
            self.truth = self._seen(time, motion, self.truth.heading, time - self.truth.time)

    def _seen(self, time: float, motion: Motion, before: float, passed: float) -> EgoTruth:
        front, heading = self.shape.front, motion.heading
        return EgoTruth(
            time=time,
            x=motion.front_x - front * math.cos(heading),
            y=motion.front_y - front * math.sin(heading),
            heading=wrapped(heading),
            speed=motion.speed,
            acceleration=motion.acceleration,
            yaw_rate=wrapped(heading - before) / passed,
            steering=0.0,
        )


class _Way:
    """How far a body has come along its route."""

    def __init__(self, route: Route, shape: VehicleShape) -> None:
        self._line = route.line
        self._station, self._time = route.start - shape.front, -1.0

    def station(self, truth: EgoTruth) -> float:
        """Of the rear axle [m]; asked for once a world step at least."""
        if truth.time != self._time:
            window = (self._station - _SEARCHED, self._station + _SEARCHED)
            self._station, _ = self._line.place(truth.x, truth.y, between=window)
            self._time = truth.time
        return self._station


def _turns(route: Route) -> tuple[tuple[float, float, int], ...]:
    """Where along the route a turn is indicated, from and to [m], and its side as in `Ego.indicated`."""
    return tuple(
        (line.station - _INDICATED, line.exit_station, _SIDES[line.direction])
        for line in route.stop_lines
        if line.direction in _SIDES and line.station < route.destination
    )


def _origins(route: Route) -> dict[str, str]:
    """The lane of a road that leads to each lane of a junction, on the route or beside it, where the ego may be.

    On the route also one that is too short for a row of its own.
    """
    changed = [lanes for change in route.lane_changes for lanes in change.lanes]
    origins = dict[str, str]()
    for followed in (*changed, *(passing.lane_ids for passing in route.passing_lanes)):
        road = ""
        for lane in followed:
            if not is_inner(lane):
                road = lane
            elif road:
                origins[lane] = road
    for line in route.stop_lines:
        crossed = route.lane_ids[route.row_at(line.station) + 1 : route.row_at(line.exit_station) + 1]
        origins |= {lane: line.lane for lane in crossed if is_inner(lane)}
    return origins


def _signals(route: Route) -> tuple[str, ...]:
    return tuple(line.signal_id for line in route.stop_lines if line.signal_id is not None)
