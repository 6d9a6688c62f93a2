"""How a vehicle of a scenario becomes an ego: its route, its stack, its oracles."""

import difflib
import math
from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from dvca_sumo.oracles import Places, judges
from dvca_sumo.roadmap import RoadMap, RoadMapError, Route, RouteError
from dvca_sumo.run.drive import ARRIVED_WITHIN, Drive, Judging
from dvca_sumo.run.task import Task
from dvca_sumo.scenario import MARK, Definitions, Parameter, Scenario, ScenarioError
from dvca_sumo.stack.reference import StackContext, StackFactory
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.world import Entry, VehicleLimits, World, shape_of

_SHORTEST_AUTO_TRIP = 500.0  # [m]
# Longest allowed duration of a trip.
_PATIENCE = 3.0  # times the free-flow travel time ...
_PATIENCE_BASE = 90.0  # [s] ... plus this
_FIRST_BRAKING = 0.3  # [s] after its departure no ego has its full braking
_OFF_ROAD = ("tram", "rail_urban", "rail", "rail_electric", "rail_fast", "cable_car", "subway", "ship", "aircraft")

RoadMapOf = Callable[[str], RoadMap]  # the scenario's map as drivers of a vehicle class see it


class Departing:
    """Makes egos of vehicles of one scenario, all with stacks of one factory."""

    def __init__(self, scenario: Scenario, roadmap_of: RoadMapOf, factory: StackFactory) -> None:
        self._scenario = scenario
        self._roadmap_of = roadmap_of
        self._factory = factory

    @cached_property
    def definitions(self) -> Definitions:
        """Of the scenario's vehicles.

        Raises:
            ScenarioError: A vehicle has a "dvca." parameter that there is not, or with a value that is none.
        """
        definitions = Definitions(self._scenario.configuration)
        _refuse_wrong(definitions.parameters, self._scenario.ego)
        return definitions

    def awaited(self, world: World) -> Entry:
        """The scenario's ego at its departure.

        Raises:
            ScenarioError: It never departs, or a vehicle's parameter is wrong; see `definitions`.
        """
        _ = self.definitions  # what is wrong there makes no vehicle unfit, but the scenario
        return world.await_ego(Thresholds.__struct_fields__, self._is_fit)

    def entry(self, vehicle: str, world: World) -> Entry:
        """Another vehicle that has just departed."""
        return world.entry(vehicle, Thresholds.__struct_fields__)

    def edges(self, entry: Entry) -> tuple[str, ...]:
        """The edges of a trip, from the one that a vehicle stands on to the one where it shall arrive.

        Raises:
            ScenarioError: Its definition does not tell the latter.
        """
        arrival = self.definitions.arrival_row(entry.ego, entry.skipped + len(entry.edges))
        return entry.edges[: max(arrival - entry.skipped, 0) + 1]

    def route(self, entry: Entry) -> Route:
        """The way from where a vehicle stands to its arrival position.

        Raises:
            RouteError: There is none that can be driven.
            ScenarioError: Its definition holds an arrival that is none.
        """
        roadmap, edges = self._roadmap_of(entry.vehicle_class), self.edges(entry)
        last = roadmap.lanes.get(f"{edges[-1]}_0")
        if last is None:
            raise RouteError(f"edge {edges[-1]!r}, its last one, is not on the road map")
        arrival = self.definitions.arrival_position(entry.ego, last.length)
        return roadmap.route(edges, entry.lane, entry.position, None, arrival)

    def judging(self, entry: Entry, route: Route) -> Judging:
        """Fresh oracles for a trip, with the vehicle's own thresholds.

        Raises:
            ScenarioError: A threshold is none.
        """
        thresholds = _thresholds(entry)
        places = Places(route, self._roadmap_of(entry.vehicle_class), self.definitions.signed_lanes)
        return Judging(judges(places, thresholds), thresholds, places)

    def latest(self, entry: Entry, route: Route) -> float:
        """When a trip has to be over [s]: when patience is, or at the scenario's end, where that comes first.

        Not at an end that comes sooner than anybody arrives at the speed limits: that only cuts the trip off.
        """
        freely, end = free_flow(route), self._scenario.end
        patient = entry.time + patience(freely)
        return patient if end is None or entry.time + freely > end else min(patient, end)

    def drive(self, entry: Entry, task: Task, world: World, *, is_whole: bool = True) -> Drive:
        """Adopt a vehicle that has just departed; see `Drive` for `is_whole`.

        Raises:
            ScenarioError: It cannot be the ego.
            StackError: The stack cannot be built.
        """
        if entry.vehicle_class in _OFF_ROAD:
            raise ScenarioError(f"the ego {entry.ego!r} is of class {entry.vehicle_class}: allowed are road vehicles")
        try:
            route = self.route(entry)
        except RouteError as error:
            raise ScenarioError(f"the ego {entry.ego!r} has no drivable route: {error}") from None
        limits = VehicleLimits()
        distance = route.destination - route.start
        stopping = _FIRST_BRAKING * entry.speed + entry.speed**2 / (2.0 * limits.max_braking)
        if distance <= max(ARRIVED_WITHIN, stopping - ARRIVED_WITHIN):
            where = f"departs {distance:.1f} m before its destination at {entry.speed:.1f} m/s"
            raise ScenarioError(f"the ego {entry.ego!r} {where}: too near to drive there and stop")
        judging = self.judging(entry, route)
        stack = self._factory(StackContext(self._roadmap_of(entry.vehicle_class), route, shape_of(entry), task.seed))
        ego = world.adopt(entry, route, limits)
        return Drive(ego, stack, judging, task, self.latest(entry, route), is_whole=is_whole)

    def _is_fit(self, entry: Entry) -> bool:
        try:
            route = self.route(entry)
        except (RouteError, RoadMapError, ScenarioError):
            return False
        return route.destination - route.start >= _SHORTEST_AUTO_TRIP


def free_flow(route: Route) -> float:
    """How long a trip takes at the speed limits [s]."""
    stations = route.line.stations
    driven = (stations[1:] > route.start) & (stations[1:] <= route.destination)
    return float(np.sum(np.diff(stations)[driven] / route.speed_limits[1:][driven]))


def patience(freely: float) -> float:
    """How long a trip may take [s] that takes so long at the speed limits [s]."""
    return _PATIENCE_BASE + _PATIENCE * freely


def _thresholds(entry: Entry) -> Thresholds:
    values = {name: _threshold(f"the ego {entry.ego!r}", name, text) for name, text in entry.parameters.items()}
    return Thresholds(**values)


def _threshold(whose: str, name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not value >= 0.0:  # NaN is not
        raise ScenarioError(f"parameter dvca.{name} of {whose} is {text!r} (allowed: 0 or more)")
    return value


def _refuse_wrong(parameters: Sequence[Parameter], ego: str) -> None:
    """Of all vehicles: SUMO tells only those parameters of an ego that it is asked for by name."""
    for vehicle, name, text in parameters:
        whose = f"the ego {vehicle!r}" if vehicle == ego else f"the vehicle {vehicle!r}"
        if name in Thresholds.__struct_fields__:
            _threshold(whose, name, text)
        elif name != MARK:
            known = [f"dvca.{one}" for one in (*Thresholds.__struct_fields__, MARK)]
            close = difflib.get_close_matches(f"dvca.{name}", known, n=1)
            hint = f"did you mean {close[0]}?" if close else f"allowed: {', '.join(known)}"
            raise ScenarioError(f"no parameter dvca.{name} of {whose} ({hint})")
