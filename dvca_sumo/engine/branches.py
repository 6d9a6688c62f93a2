"""Branches under way: orders given to checkpoints, and what comes of them."""

import contextlib
import time
from collections.abc import Generator, Sequence
from multiprocessing.connection import Connection

import msgspec

from dvca_sumo.engine.grove import Checkpoint, Grove
from dvca_sumo.engine.orders import Delivered, Died, Order, Recall
from dvca_sumo.engine.processes import Failure
from dvca_sumo.engine.protocol import Glimpse
from dvca_sumo.run import Task

Answers = Generator[tuple[int, Glimpse | Failure], None, None]


class Plan(msgspec.Struct, frozen=True):
    """How a task is to be branched."""

    task: Task
    checkpoints: tuple[Checkpoint, ...]  # that it may be branched off, by their step: the last is the first choice
    steps: tuple[int, ...]  # where to leave new ones


class _Branch(msgspec.Struct, frozen=True):
    """An order under way."""

    row: int
    deadline: float  # of time.monotonic
    checkpoint: Connection


class Branches:
    """Carries out plans, at most `jobs` at once, each within `timeout` [s]."""

    def __init__(self, grove: Grove, jobs: int, timeout: float) -> None:
        self._grove = grove
        self._jobs = jobs
        self._timeout = timeout
        self._running: dict[int, _Branch] = {}  # by the number of its order

    def answers(self, plans: Sequence[Plan]) -> Answers:
        """Rows of `plans` with their answers, as they come. Leaving it early ends what still runs."""
        waiting = [*enumerate(plans)][::-1]
        try:
            while waiting or self._running:
                while waiting and len(self._running) < self._jobs:
                    row, plan = waiting.pop()
                    if not self._is_ordered(row, plan):
                        yield row, Failure("no copy of the run is left to branch it off", "")
                if self._running:
                    yield from self._finished()
        finally:
            for number, branch in self._running.items():
                _recall(number, branch)

    def _is_ordered(self, row: int, plan: Plan) -> bool:
        number = next(self._grove.numbers)
        for checkpoint in reversed(plan.checkpoints):
            with contextlib.suppress(OSError):  # it died
                checkpoint.connection.send(Order(number, plan.task, plan.steps))
                self._running[number] = _Branch(row, time.monotonic() + self._timeout, checkpoint.connection)
                return True
        return False

    def _finished(self) -> Answers:
        """Waits until there is news."""
        for number, answer in [*self._news(), *self._overdue()]:
            branch = self._running.pop(number, None)
            if branch is None:  # of an earlier batch, or told twice
                continue
            if isinstance(answer, Failure):
                _recall(number, branch)
                yield branch.row, msgspec.structs.replace(answer, said=self._grove.said_by(number))
            else:
                yield branch.row, answer

    def _news(self) -> Answers:
        for connection, message in self._grove.heard(min(branch.deadline for branch in self._running.values())):
            if isinstance(message, Died):
                yield message.order, Failure(message.reason, "")
            elif isinstance(message, Delivered):
                yield message.order, message.answer
            else:
                lost = [number for number, one in self._running.items() if one.checkpoint is connection]
                yield from ((number, Failure("the process it was branched off died", "")) for number in lost)

    def _overdue(self) -> Answers:
        late = [number for number, branch in self._running.items() if branch.deadline <= time.monotonic()]
        yield from ((number, Failure(f"no answer within {self._timeout:g} s", "")) for number in late)


def _recall(number: int, branch: _Branch) -> None:
    with contextlib.suppress(OSError):  # the checkpoint died, and with it the branch
        branch.checkpoint.send(Recall(number))
