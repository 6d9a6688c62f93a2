"""The closed loop of one run: the world steps, the stack drives, the oracles judge."""

import math
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np

from dvca_sumo.oracles import judges
from dvca_sumo.record import Record
from dvca_sumo.roadmap import RoadMap, Route, RouteError
from dvca_sumo.run.drive import Drive, Judging
from dvca_sumo.run.task import StopRule, Task
from dvca_sumo.scenario import Scenario, ScenarioError, arrival_position
from dvca_sumo.stack.reference import StackContext, StackFactory
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.world import Entry, VehicleLimits, World, shape_of

__all__ = ["Drive", "RoadMapOf", "StopRule", "Task", "rtest"]

_SHORTEST_AUTO_TRIP = 500.0  # [m]
# Longest allowed duration of a trip, unless the scenario ends before.
_PATIENCE = 3.0  # times the free-flow travel time ...
_PATIENCE_BASE = 90.0  # [s] ... plus this


RoadMapOf = Callable[[str], RoadMap]  # the scenario's map as drivers of a vehicle class see it


def rtest(task: Task, roadmap_of: RoadMapOf, factory: StackFactory) -> Record:
    """Run a scenario once, in this process.

    Raises:
        ScenarioError: The scenario cannot be run (SUMO refuses it, the ego never departs or is removed).
        StackError: The stack cannot be built, or one of its components failed.
    """
    origin = Path.cwd()
    with tempfile.TemporaryDirectory(prefix="dvca-sumo-") as folder:
        world = World(task.scenario, Path(folder))
        try:
            drive = _departure(task, world, roadmap_of, factory)
            while drive.cycle(world.observe(drive.ego)):
                world.advance()
            return drive.record(world.time - task.scenario.begin)
        finally:
            world.close()
            os.chdir(origin)


def _departure(task: Task, world: World, roadmap_of: RoadMapOf, factory: StackFactory) -> Drive:
    scenario = task.scenario

    def is_fit(entry: Entry) -> bool:
        try:
            route = _route(entry, scenario, roadmap_of(entry.vehicle_class))
        except RouteError:
            return False
        return route.destination - route.start >= _SHORTEST_AUTO_TRIP

    entry = world.await_ego(Thresholds.__struct_fields__, is_fit)
    try:
        route = _route(entry, scenario, roadmap_of(entry.vehicle_class))
    except RouteError as error:
        raise ScenarioError(f"the ego {entry.ego!r} has no drivable route: {error}") from None
    thresholds, roadmap = _thresholds(entry), roadmap_of(entry.vehicle_class)
    stack = factory(StackContext(roadmap, route, shape_of(entry), task.seed))
    ego = world.adopt(entry, route, VehicleLimits())
    latest = min(entry.time + _patience(route), math.inf if scenario.end is None else scenario.end)
    return Drive(ego, stack, Judging(judges(route, thresholds, roadmap), thresholds), task, latest)


def _route(entry: Entry, scenario: Scenario, roadmap: RoadMap) -> Route:
    arrival = arrival_position(scenario.configuration, entry.ego)
    length = roadmap.lanes[f"{entry.edges[-1]}_0"].line.length
    if arrival is None:
        arrival = length
    elif arrival < 0.0:
        arrival += length
    return roadmap.route(entry.edges, entry.lane, entry.position, None, min(max(arrival, 0.0), length))


def _patience(route: Route) -> float:
    stations = route.line.stations
    driven = (stations[1:] > route.start) & (stations[1:] <= route.destination)
    return _PATIENCE_BASE + _PATIENCE * float(np.sum(np.diff(stations)[driven] / route.speed_limits[1:][driven]))


def _thresholds(entry: Entry) -> Thresholds:
    try:
        return msgspec.convert(entry.parameters, Thresholds, strict=False)
    except msgspec.ValidationError as error:
        raise ScenarioError(f"a dvca. parameter of the ego {entry.ego!r} is wrong: {error}") from None
