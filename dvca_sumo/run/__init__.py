"""The closed loop of a run: the world steps, stacks drive, oracles judge."""

import contextlib
import tempfile
from collections.abc import Iterator
from pathlib import Path

from dvca_sumo.record import Record
from dvca_sumo.run.departing import Departing, RoadMapOf, free_flow, patience
from dvca_sumo.run.drive import Drive, DriveResult, Judging
from dvca_sumo.run.simulation import Over, Simulation
from dvca_sumo.run.task import StopRule, Task
from dvca_sumo.scenario import Scenario
from dvca_sumo.stack.reference import Stack, StackContext, StackFactory
from dvca_sumo.world import World

__all__ = [
    "Departing",
    "Drive",
    "DriveResult",
    "Judging",
    "Over",
    "RoadMapOf",
    "Simulation",
    "StopRule",
    "Task",
    "built_here",
    "departed",
    "free_flow",
    "opened",
    "patience",
    "rtest",
]


@contextlib.contextmanager
def opened(scenario: Scenario) -> Iterator[World]:
    """SUMO started, in a scratch folder that is the working folder until the context ends.

    Raises:
        ScenarioError: SUMO refuses the scenario.
    """
    # SUMO's devices write into the working folder what a vehicle's own parameters ask for.
    with tempfile.TemporaryDirectory(prefix="dvca-sumo-") as folder, contextlib.chdir(folder):
        world = World(scenario, Path(folder))
        try:
            yield world
        finally:
            world.close()


def built_here(factory: StackFactory) -> StackFactory:
    """`factory`, called in what is the working folder now: where the command was typed, and its files are."""
    origin = Path.cwd()

    def built(context: StackContext) -> Stack:
        with contextlib.chdir(origin):
            return factory(context)

    return built


@contextlib.contextmanager
def departed(task: Task, roadmap_of: RoadMapOf, factory: StackFactory) -> Iterator[Simulation]:
    """SUMO started and stepped until the ego has departed; ended with the context.

    Raises:
        ScenarioError: The scenario cannot be run (SUMO refuses it, the ego never departs).
        StackError: The stack cannot be built.
    """
    departing = Departing(task.scenario, roadmap_of, built_here(factory))
    with opened(task.scenario) as world:
        drive = departing.drive(departing.awaited(world), task, world)
        yield Simulation(world, task.scenario.begin, [drive])


def rtest(task: Task, roadmap_of: RoadMapOf, factory: StackFactory) -> Record:
    """Run a scenario once, in this process.

    Raises:
        ScenarioError: The scenario cannot be run (SUMO refuses it, the ego never departs or is removed).
        StackError: The stack cannot be built, or one of its components failed.
    """
    with departed(task, roadmap_of, factory) as simulation:
        return simulation.proceed()
