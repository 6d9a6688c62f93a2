"""The processes that hold a simulation: stem, checkpoints, branches, passes.

The stem drives the factual run. Before a world step it may fork a *checkpoint*, which parks and waits
for orders; an order makes it fork a *branch*, which drives on under another task and delivers what came
of it. With ideal predictions the branch stays where it is and forks a *pass* as often as it takes.
A fork copies everything, SUMO, stack, oracles and record, so a branch is bit for bit what a run from
time 0 would have become.

Rules of this file: no thread; a child makes its descriptors its own before its parent goes on; every
process but the stem ends by `os._exit`; a parked process ends when the analysis closes its connection,
a driving one when the process that forked it ends.
"""

import gc
import os
import resource
import signal
import threading
import time
from collections.abc import Callable
from multiprocessing.connection import Client, Connection, Pipe
from pathlib import Path
from typing import NoReturn

import msgspec

from dvca_sumo.engine.descriptors import make_own
from dvca_sumo.engine.passes import Pass, predicts_ideally, settled, summary
from dvca_sumo.engine.processes import Failure, die_with, said_in, sendable
from dvca_sumo.engine.protocol import Glimpse
from dvca_sumo.record import Record
from dvca_sumo.run import RoadMapOf, Task, departed
from dvca_sumo.stack.reference import StackFactory

SPACING = 100  # world steps between the stem's checkpoints: what forking costs stays below a tenth of the run
MEMORY_BUDGET = 1 << 30  # [bytes] of the stem's checkpoints together
_KEPT_OF_AN_AGE = 2  # checkpoints for each doubling of the age


class Parked(msgspec.Struct, frozen=True):
    """A checkpoint says that it is there."""

    step: int  # world steps driven
    process: int


class Started(msgspec.Struct, frozen=True):
    """A branch says that it is under way."""

    order: int
    process: int


class Delivered(msgspec.Struct, frozen=True):
    """What came of the stem (order None) or of a branch."""

    order: int | None
    answer: Record | Glimpse | Failure
    log: str


class Order(msgspec.Struct, frozen=True):
    """Branch off, under `task`; leave checkpoints at `steps` on the way."""

    number: int
    task: Task
    steps: tuple[int, ...]


class _DriveOn(BaseException):
    """Unwinds a freshly forked pass to the loop that drives."""


class Holder:
    """The process that holds a simulation, in whichever role it is."""

    def __init__(self, address: str, folder: Path) -> None:
        """A stem that reports to the socket `address`; logs go to `folder`."""
        self._address = address
        self._folder = folder
        self._is_stem = True
        self._wanted: frozenset[int] = frozenset()
        self._children: dict[int, int] = {}  # step -> process of the stem's checkpoints
        self._killed: list[int] = []  # those it has dropped, until they are gone: their end takes a while
        self._deliver: Callable[[Record | Failure], None] = self._deliver_factual
        self._begin, self._since = 0.0, 0.0
        self._task: Task | None = None

    def hold(self, parent: int, task: Task, roadmap_of: RoadMapOf, factory: StackFactory) -> None:
        """Drive the factual run in this process, a child of `parent`, and stay until the analysis has enough."""
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what an interrupt ends
        die_with(parent)
        make_own(self._log)
        self._task = task
        self._connection = Client(self._address, "AF_UNIX")
        try:
            with departed(task, roadmap_of, factory) as simulation:
                self._simulation = simulation
                try:
                    answer: Record | Failure = simulation.proceed(self._at_step)
                except Exception as error:  # noqa: BLE001 - whatever a run raises is its answer
                    answer = Failure(f"{type(error).__name__}: {error}", "", sendable(error))
                self._deliver(answer)
        except Exception as error:  # noqa: BLE001
            self._deliver_factual(Failure(f"{type(error).__name__}: {error}", "", sendable(error)))

    def _deliver_factual(self, answer: Record | Failure) -> None:
        self._send(self._connection, None, answer)
        try:
            self._connection.recv()  # nothing is ever sent: this waits for the end
        except EOFError:
            for process in self._children.values():
                os.kill(process, signal.SIGKILL)

    def _at_step(self) -> None:
        step = self._simulation.drive.steps
        is_due = step % SPACING == 0 if self._is_stem else step in self._wanted
        if is_due and _is_forkable():
            self._leave_checkpoint(step)

    def _leave_checkpoint(self, step: int) -> None:
        gc.freeze()  # the collector would touch, and so copy, every page of what is here already
        child = self._forked(f"checkpoint-{step}")
        if child == 0:
            self._serve(step)
        elif self._is_stem:
            self._children[step] = child
            self._thin(step)

    def _thin(self, now: int) -> None:
        """Keep the start, and a few checkpoints for each doubling of the age; fewer if memory runs out."""
        counts: dict[int, int] = {}
        for step in sorted(self._children, reverse=True):
            age = ((now - step) // SPACING).bit_length()
            counts[age] = counts.get(age, 0) + 1
            if step > 0 and counts[age] > _KEPT_OF_AN_AGE:
                self._drop(step)
        # What checkpoints hold alone is at most what was copied since the first: only past that is it worth measuring.
        if resource.getrusage(resource.RUSAGE_SELF).ru_minflt * resource.getpagesize() < MEMORY_BUDGET:
            return
        while len(self._children) > 2 and sum(map(private_memory, self._children.values())) > MEMORY_BUDGET:
            self._drop(sorted(self._children)[1])

    def _drop(self, step: int) -> None:
        process = self._children.pop(step)
        os.kill(process, signal.SIGKILL)
        self._killed.append(process)
        self._killed = [one for one in self._killed if os.waitpid(one, os.WNOHANG)[0] == 0]

    def _serve(self, step: int) -> None:
        """Wait for orders. Returns in a branch or a pass only, which then drives on."""
        signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for branches
        self._is_stem = False
        self._connection.close()  # the other end must see when its owner dies
        self._connection = Client(self._address, "AF_UNIX")
        self._connection.send(Parked(step, os.getpid()))
        while True:
            try:
                order: Order = self._connection.recv()
            except (EOFError, OSError):
                os._exit(0)
            if self._forked(f"branch-{order.number}", mortal=True) == 0:
                self._connection.close()
                signal.signal(signal.SIGCHLD, signal.SIG_DFL)
                self._branch(order)
                return

    def _branch(self, order: Order) -> None:
        self._connection = connection = Client(self._address, "AF_UNIX")
        connection.send(Started(order.number, os.getpid()))
        if not predicts_ideally(order.task):
            self._wanted = frozenset(order.steps)
            self._start(order.task)
            self._deliver = lambda answer: self._end(connection, order.number, self._glimpse(answer))
            return
        self._wanted = frozenset()
        try:
            answer: Glimpse | Failure = settled(order.task, self._forked_pass)
        except _DriveOn:
            return
        except EOFError:
            answer = Failure("a pass died without an answer", said_in(Path(self._log)))
        except _PassFailedError as failed:
            answer = failed.failure
        self._end(connection, order.number, answer)

    def _forked_pass(self, task: Task) -> Pass:
        receiver, sender = Pipe(duplex=False)
        if self._forked("pass", mortal=True) == 0:
            receiver.close()
            self._start(task)
            self._deliver = lambda answer: self._end_pass(sender, answer)
            raise _DriveOn
        sender.close()
        answer: Pass | Failure = receiver.recv()
        if isinstance(answer, Failure):
            raise _PassFailedError(answer)
        return answer

    def _start(self, task: Task) -> None:
        self._task = task
        self._begin, self._since = time.perf_counter(), self._simulation.simulated
        self._simulation.drive.branch(task)

    def _summary(self, record: Record) -> Pass:
        assert self._task is not None  # set before anything is driven
        return summary(self._task, record, record.simulated - self._since, time.perf_counter() - self._begin)

    def _glimpse(self, answer: Record | Failure) -> Glimpse | Failure:
        return answer if isinstance(answer, Failure) else self._summary(answer).glimpse

    def _end(self, connection: Connection, order: int, answer: Glimpse | Failure) -> NoReturn:
        self._send(connection, order, answer)
        os._exit(0)

    def _end_pass(self, sender: Connection, answer: Record | Failure) -> NoReturn:
        sender.send(answer if isinstance(answer, Failure) else self._summary(answer))
        os._exit(0)

    def _send(self, connection: Connection, order: int | None, answer: Record | Glimpse | Failure) -> None:
        connection.send(Delivered(order, answer, self._log))

    @property
    def _log(self) -> str:
        return str(self._folder / str(os.getpid()))

    def _forked(self, role: str, *, mortal: bool = False) -> int:
        """Fork; returns 0 in the child, whose descriptors are its own, and its process id in the parent.

        A `mortal` child ends with its parent; a checkpoint outlives the branch that left it.
        """
        parent = os.getpid()
        receiver, sender = os.pipe()
        child = os.fork()
        if child:
            os.close(sender)
            os.read(receiver, 1)  # nothing may be read from a shared file before the child has its own
            os.close(receiver)
            return child
        os.close(receiver)
        if mortal:
            die_with(parent)
        make_own(self._log)
        os.write(2, f"{role} of {parent}\n".encode())
        os.write(sender, b".")
        os.close(sender)
        return 0


class _PassFailedError(Exception):
    """A pass did not come to an end."""

    def __init__(self, failure: Failure) -> None:
        super().__init__(failure.reason)
        self.failure = failure


def private_memory(process: int) -> int:
    """Pages that belong to a process alone [bytes]; 0 where the system does not tell."""
    try:
        lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0
    return sum(1024 * int(line.split()[1]) for line in lines if line.startswith("Private_"))


def _is_forkable() -> bool:
    return thread_count() == 1


def thread_count() -> int:
    """Threads of this process, a stack's own included."""
    tasks = Path("/proc/self/task")
    return len(list(tasks.iterdir())) if tasks.is_dir() else threading.active_count()
