"""What an engine does: run a scenario, whole or branched, and say how it came out."""

from collections.abc import Callable, Sequence
from typing import Protocol

import msgspec

from dvca_sumo.engine.processes import Failure
from dvca_sumo.record import Record
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.run import Task
from dvca_sumo.violations import Ending, Judgement, Violation


class Glimpse(msgspec.Struct, frozen=True):
    """What is kept of a counterfactual run."""

    violations: tuple[Violation, ...]
    judgements: tuple[Judgement, ...]
    ending: Ending
    digest: str
    last_step: bytes  # digest of the run up to its last world step, to be held against another run's
    steps: int  # world steps driven
    simulated: float  # [s]
    wall: float  # [s]
    passes: int  # runs made until ideal predictions came true; 1 when there were none
    residual: float | None  # [m] between predicted and real futures at the last pass


class Engine(Protocol):
    """Runs tasks in processes of their own."""

    name: str  # of the engine that does the work
    fallback: str | None  # why that is not the one that was asked for; None: it is
    roadmap: RoadMap

    @property
    def witness(self) -> "Engine":
        """An engine that shares nothing with this one but the task: the replay engine."""
        ...

    def record(self, task: Task) -> Record:
        """One run with everything it leaves.

        Raises:
            ScenarioError, StackError: As `rtest`.
            RunFailedError: The process crashed or hung.
        """
        ...

    def glimpses(
        self, tasks: Sequence[Task], on_result: Callable[[int, Glimpse | Failure], None]
    ) -> list[Glimpse | Failure]:
        """Outcomes of several runs, in the order of `tasks`; `on_result` hears of each as it finishes."""
        ...

    def close(self) -> None:
        """Let go of everything that was kept for branching; the engine goes on to work, from time 0."""
        ...


class RunFailedError(RuntimeError):
    """A run's process crashed or hung: how, and its last words."""
