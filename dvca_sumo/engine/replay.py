"""The replay engine: every run starts at time 0, in a process of its own."""

import time
from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path

from dvca_sumo.engine.passes import Pass, settled, summary
from dvca_sumo.engine.processes import Failure, isolated
from dvca_sumo.engine.protocol import Glimpse, RunFailedError
from dvca_sumo.record import Record
from dvca_sumo.roadmap import RoadMap, RoadMapError
from dvca_sumo.run import Task, rtest
from dvca_sumo.scenario import ScenarioError
from dvca_sumo.stack.reference import StackError
from dvca_sumo.stack.sources import StackSource, stack_factory

DEFAULT_TIMEOUT = 600.0  # [s] of wall time for one run


class ReplayEngine:
    """Re-runs from time 0: slow, and the witness that every other engine is held against."""

    name = "replay"
    fallback: str | None = None

    def __init__(self, net: Path, source: StackSource, jobs: int, timeout: float = DEFAULT_TIMEOUT) -> None:
        """An engine for scenarios on one net, with one stack.

        Raises:
            RoadMapError: The net cannot be read.
            StackError, BugError: The stack cannot be read or imported.
        """
        self.jobs = jobs
        self._net = net
        self._source = source
        self._timeout = timeout
        # Loaded before any process starts: a forked child finds both in its cache.
        self.roadmap = roadmap(net, "passenger")
        stack_factory(source)

    @property
    def witness(self) -> "ReplayEngine":
        """See `Engine`: a replay is its own witness, every run being from time 0."""
        return self

    def record(self, task: Task) -> Record:
        """See `Engine`."""
        job = partial(_rtest, self._net, self._source, task)
        ((_, answer),) = isolated([job], 1, self._timeout)
        if isinstance(answer, Failure):
            raise raised(answer)
        return answer

    def glimpses(
        self, tasks: Sequence[Task], on_result: Callable[[int, Glimpse | Failure], None]
    ) -> list[Glimpse | Failure]:
        """See `Engine`."""
        jobs = [partial(_glimpse, self._net, self._source, task) for task in tasks]
        answers: dict[int, Glimpse | Failure] = {}
        for row, answer in isolated(jobs, self.jobs, self._timeout):
            answers[row] = answer
            on_result(row, answer)
        return [answers[row] for row in range(len(tasks))]

    def close(self) -> None:
        """See `Engine`; nothing is kept."""


@cache
def roadmap(net: Path, vehicle_class: str) -> RoadMap:
    """The map of a net, read once: a forked child finds it here."""
    return RoadMap.load(net, vehicle_class)


def _rtest(net: Path, source: StackSource, task: Task) -> Record:
    return rtest(task, partial(roadmap, net), stack_factory(source))


def _glimpse(net: Path, source: StackSource, task: Task) -> Glimpse:
    return settled(task, partial(_pass, net, source))


def _pass(net: Path, source: StackSource, task: Task) -> Pass:
    begin = time.perf_counter()
    record = _rtest(net, source, task)
    return summary(task, record, record.simulated, time.perf_counter() - begin)


def raised(failure: Failure) -> Exception:
    """The exception that tells a user of a failed factual run."""
    words = _sumo_words(failure.said)
    if isinstance(failure.error, ScenarioError):
        return ScenarioError(f"{failure.error}{words}")
    if isinstance(failure.error, (StackError, RoadMapError)):
        return failure.error
    return RunFailedError(f"the run failed: {failure.reason}{words}")


def _sumo_words(said: str) -> str:
    """SUMO's own explanation: an exception of libsumo's does not carry it."""
    words: list[str] = []
    is_error = False
    for line in said.splitlines():
        is_error = line.startswith(("Error:", "***", "Fatal")) or (is_error and line.startswith(" "))
        if is_error:
            words += line.split()
    return f" ({' '.join(words)})" if words else ""
