"""The processes that hold a simulation: stem, checkpoints, branches, passes.

The stem drives the factual run. Before a world step it may fork a *checkpoint*, which parks and waits
for orders; an order makes it fork a *branch*, which drives on under another task, delivers what came
of it, and ends. With ideal predictions the branch stays where it is and forks a *pass* as often as it
takes. A fork copies everything, SUMO, stack, oracles and record, so a branch is bit for bit what a run
from time 0 would have become.

Rules of this file: no thread; every process ends by `os._exit`, so that it never cleans up what others
still use; a parked process ends when the analysis closes its connection, a driving one when the process
that forked it ends.
"""

import contextlib
import gc
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Client, Connection, Pipe, wait
from pathlib import Path
from typing import NoReturn

from dvca_sumo.engine.descriptors import make_own
from dvca_sumo.engine.forking import Child, Lineage, NotForkedError
from dvca_sumo.engine.orders import Delivered, Died, Driven, Order, Parked, Recall
from dvca_sumo.engine.passes import Pass, predicts_ideally, settled, summary
from dvca_sumo.engine.processes import (
    Failure,
    adopt_orphans,
    death,
    ignore_interrupts,
    print_to_descriptors,
    raised_here,
)
from dvca_sumo.engine.protocol import Glimpse
from dvca_sumo.engine.thinning import Kept
from dvca_sumo.record import Record
from dvca_sumo.run import RoadMapOf, Simulation, Task, departed
from dvca_sumo.stack.reference import StackFactory

if sys.platform != "win32":
    import resource

SPACING = 75  # world steps between the stem's checkpoints: what forking costs stays below a tenth of the run
STEM_LOG = "stem"
_PARKED_LOG = "parked"


class Holder:
    """The process that holds a simulation, in whichever role it is."""

    _simulation: Simulation
    _task: Task

    def __init__(self, address: str, folder: Path, connection: Connection) -> None:
        """A stem that answers through `connection`; those forked from it call the socket `address`.

        All write what they have to say into files in `folder`: the stem into `STEM_LOG`, a branch into
        one named after the number of its order.
        """
        self._address = address
        self._folder = folder
        self._connection = connection
        self._log = folder / STEM_LOG
        self._lineage = Lineage()
        self._is_stem = True
        self._wanted: frozenset[int] = frozenset()  # world steps at which a branch leaves checkpoints
        self._kept = Kept()
        self._copied = 0  # [bytes] up to the last checkpoint that this process left
        self._obstacle = ""
        self._deliver: Callable[[Record | Failure], NoReturn] = self._deliver_factual
        self._begin, self._since = 0.0, 0.0

    def hold(self, task: Task, roadmap_of: RoadMapOf, factory: StackFactory) -> NoReturn:
        """Drive the factual run in this process, and stay until the analysis has enough."""
        ignore_interrupts()
        adopt_orphans()
        make_own(self._log)
        print_to_descriptors()
        tempfile.tempdir = str(self._folder)  # the run's own folder goes with it, however this process ends
        try:
            with departed(task, roadmap_of, factory) as self._simulation:
                self._copied = _copied_here()
                self._drive_on()
        except BaseException as error:  # noqa: BLE001 - whatever a run raises is its answer, SystemExit included
            self._deliver(raised_here(error))

    def _drive_on(self) -> NoReturn:
        try:
            try:
                answer: Record | Failure = self._simulation.proceed(self._at_step)
            except BaseException as error:  # noqa: BLE001 - as above
                answer = raised_here(error)
            self._deliver(answer)
        except BaseException as error:  # noqa: BLE001 - nobody listens any more
            raised_here(error)
        finally:
            os._exit(1)

    def _deliver_factual(self, answer: Record | Failure) -> NoReturn:
        self._kept.bury()
        self._connection.send(Driven(answer, self._obstacle))
        with contextlib.suppress(EOFError, OSError):
            self._connection.recv()  # whatever it is: the end
        with contextlib.suppress(ChildProcessError):
            while True:  # they end as this process does; it is the last, and leaves none unburied
                os.wait()
        os._exit(0)

    def _at_step(self) -> None:
        drive = self._simulation.drive
        # Nobody asks what would have come of a substitution after the violation.
        is_due = drive.steps % SPACING == 0 and not drive.has_violated
        if is_due if self._is_stem else drive.steps in self._wanted:
            self._leave_checkpoint(drive.steps)

    def _leave_checkpoint(self, step: int) -> None:
        gc.freeze()  # the collector would touch, and so copy, every page of what is here already
        copied, self._copied = _copied_here() - self._copied, _copied_here()
        try:
            if self._is_stem:
                self._lineage.assert_alone()
            child = self._lineage.forked(self._folder / _PARKED_LOG, partial(self._park, step, copied))
        except NotForkedError as error:
            self._obstacle = str(error)
            return
        if child is None:
            self._obey(self._awaited())
            return
        os.close(child.sign)
        if self._is_stem:
            self._kept.add(step // SPACING, child.process, copied)

    def _park(self, step: int, copied: int) -> None:
        self._is_stem = False
        self._connection.close()  # the other end must see when its owner dies
        self._connection = Client(self._address, "AF_UNIX")
        self._connection.send(Parked(step, os.getpid(), copied))

    def _awaited(self) -> Order:
        """Fork a branch for every order, and tell of those that die. Returns in a branch only: its order."""
        branches: dict[int, Child] = {}  # by order
        try:
            while True:
                signs = {child.sign: order for order, child in branches.items()}
                for ready in wait([self._connection, *signs]):
                    if isinstance(ready, int):
                        self._bury(signs[ready], branches.pop(signs[ready]))
                    elif (order := self._called(branches)) is not None:
                        return order
        except BaseException:  # noqa: BLE001 - the analysis is gone
            os._exit(1)

    def _called(self, branches: dict[int, Child]) -> Order | None:
        """Do as the analysis says. Returns the order in the branch that is forked for it, None in this process."""
        said: Order | Recall | None = self._connection.recv()
        if said is None:
            os._exit(0)
        if isinstance(said, Recall):
            if said.order in branches:
                os.kill(branches[said.order].process, signal.SIGKILL)
            return None
        try:
            child = self._lineage.forked(self._folder / str(said.number), self._connection.close, mortal=True)
        except NotForkedError as error:
            self._connection.send(Died(said.number, str(error)))
            return None
        if child is not None:
            branches[said.number] = child
            return None
        return said

    def _bury(self, order: int, child: Child) -> None:
        os.close(child.sign)
        code = os.waitstatus_to_exitcode(os.waitpid(child.process, 0)[1])
        if code != 0:
            self._connection.send(Died(order, death(code)))

    def _obey(self, order: Order) -> None:
        """Become the branch that `order` asks for. Returns to drive on."""
        self._log = self._folder / str(order.number)
        self._copied = 0  # the system counts anew for a new process
        self._deliver = lambda answer: self._report(order.number, self._glimpse(answer))
        if not predicts_ideally(order.task):
            self._wanted = frozenset(order.steps)
            self._start(order.task)
            return
        self._wanted = frozenset()
        try:
            answer: Glimpse | Failure = settled(order.task, self._passed)
        except _DriveOn:
            return
        except _PassFailedError as failed:
            answer = failed.failure
        self._report(order.number, answer)

    def _passed(self, task: Task) -> Pass:
        """One pass, driven by a child. Raises `_DriveOn` there."""
        receiver, sender = Pipe(duplex=False)
        try:
            child = self._lineage.forked(self._log, receiver.close, mortal=True)
        except NotForkedError as error:
            raise _PassFailedError(Failure(str(error), "")) from None
        if child is None:
            self._start(task)
            self._deliver = lambda answer: self._deliver_pass(sender, answer)
            raise _DriveOn
        sender.close()
        os.close(child.sign)
        answer: Pass | Failure | None = None
        with contextlib.suppress(EOFError, OSError):  # the latter when it died in the middle of its answer
            answer = receiver.recv()
        code = os.waitstatus_to_exitcode(os.waitpid(child.process, 0)[1])
        if answer is None or isinstance(answer, Failure):
            raise _PassFailedError(answer or Failure(death(code), ""))
        return answer

    def _start(self, task: Task) -> None:
        self._task = task
        self._begin, self._since = time.perf_counter(), self._simulation.simulated
        self._simulation.drive.branch(task)

    def _summary(self, record: Record) -> Pass:
        return summary(self._task, record, record.simulated - self._since, time.perf_counter() - self._begin)

    def _glimpse(self, answer: Record | Failure) -> Glimpse | Failure:
        return answer if isinstance(answer, Failure) else self._summary(answer).glimpse

    def _report(self, order: int, answer: Glimpse | Failure) -> NoReturn:
        with Client(self._address, "AF_UNIX") as connection:
            connection.send(Delivered(order, answer))
        os._exit(0)

    def _deliver_pass(self, sender: Connection, answer: Record | Failure) -> NoReturn:
        sender.send(answer if isinstance(answer, Failure) else self._summary(answer))
        os._exit(0)


class _DriveOn(BaseException):
    """Unwinds a freshly forked pass to the loop that drives."""


class _PassFailedError(Exception):
    """A pass did not come to an end."""

    def __init__(self, failure: Failure) -> None:
        super().__init__(failure.reason)
        self.failure = failure


def _copied_here() -> int:
    """Memory [bytes] that this process has made its own since it was forked."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt * resource.getpagesize()
