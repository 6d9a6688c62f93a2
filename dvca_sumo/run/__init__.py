"""The closed loop of one run: the world steps, the stack drives, the oracles judge."""

import contextlib
import math
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from dvca_sumo.oracles import judges
from dvca_sumo.record import Record
from dvca_sumo.roadmap import RoadMap, Route, RouteError
from dvca_sumo.run.drive import Drive, Judging
from dvca_sumo.run.task import StopRule, Task
from dvca_sumo.scenario import Scenario, ScenarioError, arrival_position
from dvca_sumo.stack.reference import Stack, StackContext, StackFactory
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.world import Entry, VehicleLimits, World, shape_of

__all__ = ["Drive", "RoadMapOf", "Simulation", "StopRule", "Task", "departed", "rtest"]

_SHORTEST_AUTO_TRIP = 500.0  # [m]
# Longest allowed duration of a trip, unless the scenario ends before.
_PATIENCE = 3.0  # times the free-flow travel time ...
_PATIENCE_BASE = 90.0  # [s] ... plus this


RoadMapOf = Callable[[str], RoadMap]  # the scenario's map as drivers of a vehicle class see it


class Simulation:
    """A drive in its world, from the ego's departure on."""

    def __init__(self, world: World, drive: Drive, begin: float) -> None:
        self.drive = drive
        self._world = world
        self._begin = begin

    @property
    def simulated(self) -> float:
        """SUMO time passed since the scenario's begin [s]."""
        return self._world.time - self._begin

    def proceed(self, at_step: Callable[[], None] = lambda: None) -> Record:
        """Drive to the end; `at_step` is called before every world step's cycle.

        Raises:
            ScenarioError: SUMO removed the ego or gave up.
            StackError: A component failed.
        """
        at_step()
        while self.drive.cycle(self._world.observe(self.drive.ego)):
            self._world.advance()
            at_step()
        return self.drive.record(self.simulated)


@contextlib.contextmanager
def departed(task: Task, roadmap_of: RoadMapOf, factory: StackFactory) -> Iterator[Simulation]:
    """SUMO started and stepped until the ego has departed; ended with the context.

    Raises:
        ScenarioError: The scenario cannot be run (SUMO refuses it, the ego never departs).
        StackError: The stack cannot be built.
    """
    origin = Path.cwd()

    def built(context: StackContext) -> Stack:
        with contextlib.chdir(origin):  # a user's factory finds its files where the command was typed
            return factory(context)

    # SUMO's devices write into the working folder what a vehicle's own parameters ask for.
    with tempfile.TemporaryDirectory(prefix="dvca-sumo-") as folder, contextlib.chdir(folder):
        world = World(task.scenario, Path(folder))
        try:
            yield Simulation(world, _departure(task, world, roadmap_of, built), task.scenario.begin)
        finally:
            world.close()


def rtest(task: Task, roadmap_of: RoadMapOf, factory: StackFactory) -> Record:
    """Run a scenario once, in this process.

    Raises:
        ScenarioError: The scenario cannot be run (SUMO refuses it, the ego never departs or is removed).
        StackError: The stack cannot be built, or one of its components failed.
    """
    with departed(task, roadmap_of, factory) as simulation:
        return simulation.proceed()


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
    length = roadmap.lanes[f"{entry.edges[-1]}_0"].length
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
    for name, text in entry.parameters.items():
        try:
            is_allowed = float(text) >= 0.0  # NaN is not
        except ValueError:
            is_allowed = False
        if not is_allowed:
            raise ScenarioError(f"parameter dvca.{name} of the ego {entry.ego!r} is {text!r} (allowed: 0 or more)")
    return Thresholds(**{name: float(text) for name, text in entry.parameters.items()})
