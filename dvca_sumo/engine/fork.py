"""The fork engine: a counterfactual costs the part of the drive that differs.

The factual run is driven once, by a process that leaves parked copies of itself on the way (see
`branching`). A counterfactual is branched off the last copy before the first message that it
substitutes. What cannot be branched (jitter mode draws every run anew; another scenario or fault; a
stack with threads) goes to the replay engine.
"""

import math
import multiprocessing
import os
import shutil
import socket
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from multiprocessing.connection import Connection, wait
from pathlib import Path

import msgspec

from dvca_sumo.engine.branching import Delivered, Holder, Order, Parked, Started
from dvca_sumo.engine.processes import Failure, said_in
from dvca_sumo.engine.protocol import Glimpse
from dvca_sumo.engine.replay import DEFAULT_TIMEOUT, ReplayEngine, raised, roadmap
from dvca_sumo.interventions import Fault, Ideal
from dvca_sumo.record import TICK, Record
from dvca_sumo.run import Task
from dvca_sumo.stack.reference import stack_factory

IS_AVAILABLE = sys.platform != "win32"

_TICKS_PER_STEP = 10
_WORTH_A_CHECKPOINT = 5  # world steps from the nearest one
_BEFORE_VIOLATION = (1, 2, 4)  # [s] where the premise's branch leaves checkpoints
_BACKLOG = 64


class _Checkpoint(msgspec.Struct, frozen=True):
    """A parked process."""

    step: int
    process: int
    connection: Connection


class ForkEngine:
    """Branches off parked copies of the factual run."""

    name = "fork"

    def __init__(self, net: Path, stack: str | None, jobs: int, timeout: float = DEFAULT_TIMEOUT) -> None:
        """As `ReplayEngine`, which it falls back to.

        Raises:
            RoadMapError: The net cannot be read.
            StackError: The stack cannot be read or imported.
        """
        self.jobs = jobs
        self._witness = ReplayEngine(net, stack, jobs, timeout)
        self.roadmap = self._witness.roadmap
        self._net = net
        self._stack = stack
        self._timeout = timeout
        self._factual: Task | None = None
        self._record: Record | None = None
        self._checkpoints: list[_Checkpoint] = []
        self._grove: _Grove | None = None

    @property
    def witness(self) -> ReplayEngine:
        """See `Engine`."""
        return self._witness

    @property
    def checkpoint_processes(self) -> tuple[int, ...]:
        """The parked processes, by their step."""
        return tuple(one.process for one in sorted(self._checkpoints, key=lambda one: one.step))

    def record(self, task: Task) -> Record:
        """See `Engine`. The run's checkpoints stay until `close` or the next factual run."""
        if task.jitter is not None or self._factual is not None:
            return self._witness.record(task)
        self._grove = _Grove()
        stem = self._grove.plant(partial(_hold, self._grove.address, self._grove.folder, self._net, self._stack, task))
        deadline = time.monotonic() + self._timeout
        while True:
            for connection, message in self._grove.heard(deadline):
                if isinstance(message, Parked):
                    self._checkpoints.append(_Checkpoint(message.step, message.process, connection))
                elif isinstance(message, Delivered):
                    return self._taken(task, message)
                elif message is None:
                    self._forget(connection)
            if not stem.is_alive() or time.monotonic() > deadline:
                how = "died without an answer" if not stem.is_alive() else f"gave no answer within {self._timeout:g} s"
                failure = Failure(f"the process {how}", said_in(self._grove.folder / str(stem.pid)))
                self.close()
                raise raised(failure)

    def glimpses(
        self, tasks: Sequence[Task], on_result: Callable[[int, Glimpse | Failure], None]
    ) -> list[Glimpse | Failure]:
        """See `Engine`."""
        if self._grove is None or not all(self._can_branch(task) for task in tasks):
            return self._witness.glimpses(tasks, on_result)
        answers: dict[int, Glimpse | Failure] = {}
        for row, answer in self._branched(tasks):
            answers[row] = answer
            on_result(row, answer)
        return [answers[row] for row in range(len(tasks))]

    def close(self) -> None:
        """End every process that is left."""
        if self._grove is not None:
            self._grove.close()
        self._grove, self._checkpoints = None, []

    def _taken(self, task: Task, message: Delivered) -> Record:
        if isinstance(message.answer, Record):
            self._factual, self._record = task, message.answer
            return message.answer
        assert isinstance(message.answer, Failure)  # the stem has nothing else to deliver
        failure = msgspec.structs.replace(message.answer, said=said_in(Path(message.log)))
        self.close()
        raise raised(failure)

    def _can_branch(self, task: Task) -> bool:
        factual = self._factual
        if factual is None or task.jitter is not None or task.scenario != factual.scenario or not self._checkpoints:
            return False
        faults = tuple(one for one in task.interventions if isinstance(one, Fault))
        return faults == factual.interventions

    def _branched(self, tasks: Sequence[Task]) -> Iterator[tuple[int, Glimpse | Failure]]:
        """Rows of `tasks` with their answers, as they come; at most `jobs` run at once."""
        assert self._grove is not None  # asked only while there is one
        waiting = list(range(len(tasks)))[::-1]
        running: dict[int, float] = {}  # row -> deadline
        branches: dict[Connection, tuple[int, int]] = {}  # -> row, process
        while waiting or running:
            while waiting and len(running) < self.jobs:
                row = waiting.pop()
                self._order(row, tasks[row])
                running[row] = time.monotonic() + self._timeout
            for connection, message in self._grove.heard(min(running.values())):
                if isinstance(message, Parked):
                    self._checkpoints.append(_Checkpoint(message.step, message.process, connection))
                elif isinstance(message, Started):
                    branches[connection] = (message.order, message.process)
                elif isinstance(message, Delivered):
                    row, _ = branches.pop(connection)
                    yield from self._finished(running, row, message.answer, message.log)
                elif connection in branches:
                    row, process = branches.pop(connection)
                    died = Failure("the branch died without an answer", "")
                    yield from self._finished(running, row, died, str(self._grove.folder / str(process)))
                else:
                    self._forget(connection)
            now = time.monotonic()
            for connection, (row, process) in [(c, b) for c, b in branches.items() if now > running.get(b[0], now)]:
                del branches[connection]
                self._grove.kill(process)
                late = Failure(f"no answer within {self._timeout:g} s", "")
                yield from self._finished(running, row, late, str(self._grove.folder / str(process)))

    @staticmethod
    def _finished(
        running: dict[int, float], row: int, answer: object, log: str
    ) -> Iterator[tuple[int, Glimpse | Failure]]:
        if running.pop(row, None) is None:
            return
        if isinstance(answer, Failure):
            yield row, msgspec.structs.replace(answer, said=said_in(Path(log)))
        else:
            assert isinstance(answer, Glimpse)
            yield row, answer

    def _order(self, row: int, task: Task) -> None:
        """Branch `task` off the last checkpoint before its first substituted message."""
        step = self._first_step(task)
        checkpoint = max((one for one in self._checkpoints if one.step <= step), key=lambda one: one.step)
        steps = (step,) if any(isinstance(one, Ideal) for one in task.interventions) else self._before_violation()
        known = {one.step for one in self._checkpoints}
        wanted = tuple(
            one
            for one in steps
            if one - checkpoint.step >= _WORTH_A_CHECKPOINT and not known & set(range(one, one + _WORTH_A_CHECKPOINT))
        )
        checkpoint.connection.send(Order(row, task, wanted))

    def _first_step(self, task: Task) -> int:
        """World step of the first message that `task` may substitute; without any, some time before the violation."""
        starts = [one.selection.start for one in task.interventions if isinstance(one, Ideal)]
        if starts:
            return math.floor((min(starts) + TICK) / TICK) // _TICKS_PER_STEP
        return min(self._before_violation(), default=0)

    def _before_violation(self) -> tuple[int, ...]:
        record = self._record
        assert record is not None
        if not record.violations:
            return ()
        breach = round((record.violations[0].time - record.start) * _TICKS_PER_STEP)
        return tuple(breach - 10 * seconds for seconds in _BEFORE_VIOLATION if breach > 10 * seconds)

    def _forget(self, connection: Connection) -> None:
        self._checkpoints = [one for one in self._checkpoints if one.connection is not connection]


class _Grove:
    """All processes of one factual run, and the socket that they report to."""

    def __init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="dvca-sumo-fork-"))
        self.address = str(self.folder / "socket")
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._listener.bind(self.address)
        self._listener.listen(_BACKLOG)
        self._connections: list[Connection] = []
        self._stem: multiprocessing.process.BaseProcess | None = None

    def plant(self, hold: Callable[[int], None]) -> multiprocessing.process.BaseProcess:
        """Start the stem."""
        self._stem = multiprocessing.get_context("fork").Process(target=hold, args=(os.getpid(),))
        self._stem.start()
        return self._stem

    def heard(self, deadline: float) -> list[tuple[Connection, object]]:
        """What the processes say until something is said or `deadline` has passed; None: one has ended."""
        said: list[tuple[Connection, object]] = []
        stem = [] if self._stem is None else [self._stem.sentinel]
        ready = wait([self._listener, *self._connections, *stem], max(deadline - time.monotonic(), 0.0))
        for one in ready:
            if one is self._listener:
                accepted, _ = self._listener.accept()
                self._connections.append(Connection(accepted.detach()))
            elif isinstance(one, Connection):
                try:
                    said.append((one, one.recv()))
                except (EOFError, OSError):
                    self._connections.remove(one)
                    one.close()
                    said.append((one, None))
        return said

    def kill(self, process: int) -> None:
        """End a branch that takes too long."""
        os.kill(process, 9)

    def close(self) -> None:
        """Close all connections, which ends every parked process, and the stem."""
        for connection in self._connections:
            connection.close()
        self._listener.close()
        if self._stem is not None:
            self._stem.kill()
            self._stem.join()
        shutil.rmtree(self.folder, ignore_errors=True)


def _hold(address: str, folder: Path, net: Path, stack: str | None, task: Task, parent: int) -> None:
    Holder(address, folder).hold(parent, task, partial(roadmap, net), stack_factory(stack))
