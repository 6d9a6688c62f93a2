"""A small scenario with traffic, and a fork engine on it whose processes leave a trace as long as they live."""

import contextlib
import os
import select
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from small_scenarios import EGO, TIMEOUT, scenario_file

from dvca_sumo.engine import branching
from dvca_sumo.engine.fork import ForkEngine
from dvca_sumo.engine.processes import Failure
from dvca_sumo.engine.protocol import Engine, Glimpse
from dvca_sumo.engine.replay import ReplayEngine
from dvca_sumo.interventions import Ideal, Intervention, Selection
from dvca_sumo.messages import COMPONENTS, Component
from dvca_sumo.run import StopRule, Task
from dvca_sumo.scenario import load_scenario
from dvca_sumo.stack.sources import StackSource

SUBSTITUTABLE = tuple(component for component in COMPONENTS if component is not Component.PLANNING)
FOLLOWER = '<vehicle id="behind" depart="0" departPos="8" departSpeed="10"><route edges="bc"/></vehicle>'
SPACING = 10  # world steps between the stem's checkpoints, of about 50 that the ego drives


def factual(folder: Path, net: Path, *interventions: Intervention) -> Task:
    """A drive of about 5 s, with a vehicle behind."""
    return Task(load_scenario(scenario_file(folder, net, EGO + FOLLOWER)), interventions)


def ideal(task: Task, since: float, *components: Component, stop: StopRule = StopRule()) -> Task:  # noqa: B008 - frozen
    """`task` with `components` ideal from `since` [s] after departure on."""
    ideals = (Ideal(component, Selection(start=since)) for component in components)
    return Task(task.scenario, (*task.interventions, *ideals), stop, task.futures)


def glimpses(engine: Engine, *tasks: Task) -> list[Glimpse | Failure]:
    return engine.glimpses(tasks, lambda _row, _answer: None)


def outcomes(answers: Sequence[Glimpse | Failure]) -> list[tuple[object, ...]]:
    """All of the answers but what they cost."""
    found: list[tuple[object, ...]] = []
    for one in answers:
        assert isinstance(one, Glimpse), one
        found.append((one.violations, one.judgements, one.ending, one.digest, one.steps, one.passes, one.residual))
    return found


def assert_as_replayed(engine: ForkEngine, net: Path, stack: str | None, *tasks: Task) -> None:
    """Bit for bit, and really branched."""
    assert engine.fallback is None
    branched = glimpses(engine, *tasks)
    assert outcomes(branched) == outcomes(glimpses(ReplayEngine(net, StackSource(stack), 2, TIMEOUT), *tasks))


class Alive:
    """A pipe whose other end is open as long as one of the processes forked meanwhile lives."""

    def __init__(self) -> None:
        self._reader, self._writer = os.pipe()

    def is_nobody(self) -> bool:
        """Whether all have ended, or do so soon; asked once."""
        os.close(self._writer)
        ready, _, _ = select.select([self._reader], [], [], 20.0)
        os.close(self._reader)
        return bool(ready)


@contextlib.contextmanager
def fork_engine(
    net: Path, stack: str | None = None, jobs: int = 2, timeout: float = TIMEOUT, spacing: int = SPACING
) -> Iterator[ForkEngine]:
    """A fork engine that leaves nobody behind."""
    alive = Alive()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(branching, "SPACING", spacing)
        engine = ForkEngine(net, StackSource(stack), jobs, timeout)
        try:
            yield engine
        finally:
            engine.close()
            assert alive.is_nobody()
