"""Jobs in processes of their own, so that a crash or a hang costs one job and never the tool.

Rules of this file: no thread is ever started; a child leaves only through its pipe or a signal; no
child outlives its parent.
"""

import contextlib
import ctypes
import multiprocessing
import os
import pickle
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterable, Iterator
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Generic, TypeVar

import msgspec

if sys.platform == "win32":
    _CONTEXT = multiprocessing.get_context("spawn")
else:
    _CONTEXT = multiprocessing.get_context("fork")

Result = TypeVar("Result")

# Of the terminal, of what schedules batches, and of a terminal that is closed, which not every system has.
INTERRUPTS = (signal.SIGINT, signal.SIGTERM, *(one for one in signal.Signals if one.name == "SIGHUP"))
_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36  # linux/prctl.h
_SAID_LINES = 60  # of standard error that a failure keeps: SUMO's words stand before a traceback


class Failure(msgspec.Struct, frozen=True):
    """A job without a result: it crashed, hung, or raised."""

    reason: str  # one line
    said: str  # last lines of its standard error
    error: Exception | None = None  # what it raised, if it did


class _Child(Generic[Result]):
    """One running job."""

    def __init__(self, index: int, job: Callable[[], Result], log: Path, timeout: float) -> None:
        self.index = index
        self.deadline = time.monotonic() + timeout
        self._log = log
        self._timeout = timeout
        self.receiver, sender = _CONTEXT.Pipe(duplex=False)
        self._process: BaseProcess = _CONTEXT.Process(target=_work, args=(job, sender, log, os.getpid()))
        try:
            self._process.start()
        finally:
            sender.close()

    def collect(self) -> Result | Failure:
        """Its result; called when the pipe has something to say or is closed, or when it is late, which ends it."""
        if not self.receiver.poll():
            self.kill()
            return Failure(f"no answer within {self._timeout:g} s", said_in(self._log))
        try:
            answer: Result | Failure = self.receiver.recv()
        except (EOFError, OSError):  # the latter when it died in the middle of its answer
            self._process.join()
            return Failure(death(self._process.exitcode), said_in(self._log))
        self._process.join()
        if isinstance(answer, Failure):
            return Failure(answer.reason, said_in(self._log), answer.error)
        return answer

    def kill(self) -> None:
        """End it now."""
        self._process.kill()
        self._process.join()


def isolated(
    jobs: Iterable[Callable[[], Result]], parallel: int, timeout: float
) -> Iterator[tuple[int, Result | Failure]]:
    """Run every job in a process of its own, at most `parallel` at once.

    Yields (row of the job, its result or `Failure`) as they finish. The next job is taken from `jobs` when
    there is room for it, so that what was found so far may decide whether there is one. A job that takes longer than
    `timeout` [s] is killed, unless its answer is there when that is noticed. Leaving the iterator early, by any
    exception, kills what still runs.
    """
    waiting = enumerate(jobs)
    running: list[_Child[Result]] = []
    # No answer is worth less for a folder that the system does not let go of.
    with tempfile.TemporaryDirectory(prefix="dvca-sumo-log-", ignore_cleanup_errors=True) as folder:
        try:
            while True:
                while len(running) < parallel and (work := next(waiting, None)) is not None:
                    refusal = _start(running, *work, Path(folder), timeout)
                    if refusal is not None:
                        yield work[0], refusal
                if not running:
                    return
                remaining = min(child.deadline for child in running) - time.monotonic()
                ready = wait([child.receiver for child in running], max(remaining, 0.0))
                for child in [one for one in running if one.receiver in ready or time.monotonic() > one.deadline]:
                    running.remove(child)
                    yield child.index, child.collect()
        finally:
            for child in running:
                child.kill()


def _start(
    running: list[_Child[Result]], index: int, job: Callable[[], Result], folder: Path, timeout: float
) -> Failure | None:
    """Add a job to those that run; why it cannot, where the system has no room for it."""
    try:
        with _no_interrupts():  # or a child that has just been forked is not among those that one ends
            running.append(_Child(index, job, folder / str(index), timeout))
    except OSError as error:
        return Failure(f"the system gives no process or pipe: {error}", "")
    return None


@contextlib.contextmanager
def _no_interrupts() -> Iterator[None]:
    """Hold an interrupt back: a child that was just forked does not ignore it yet (POSIX only)."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, INTERRUPTS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _work(job: Callable[[], object], sender: Connection, log: Path, parent: int) -> None:
    ignore_interrupts()
    if sys.platform != "win32":
        signal.pthread_sigmask(signal.SIG_UNBLOCK, INTERRUPTS)  # see `_no_interrupts`: a held one is dropped
    die_with(parent)
    tempfile.tempdir = str(log.parent)  # so that nothing outlives a killed child
    descriptor = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)
    print_to_descriptors()
    try:
        answer = job()
    except Exception as error:  # noqa: BLE001 - whatever a job raises is its answer
        answer = raised_here(error)
    sender.send(answer)
    sender.close()
    os._exit(0)  # SUMO's and the test runner's exit handlers are not this process's business


def stop_once() -> None:
    """Take a request to terminate, as batch systems send it, for an interrupt, and heed the first of either alone.

    Nothing computed is lost then, though some send two: what the first one has printed and kept, another cuts short.
    """
    for one in INTERRUPTS:
        if signal.getsignal(one) is not signal.SIG_IGN:
            signal.signal(one, _stop)


def _stop(_number: int, _frame: object) -> None:
    ignore_interrupts()
    raise KeyboardInterrupt


def ignore_interrupts() -> None:
    """Leave it to the parent what an interrupt ends."""
    for one in INTERRUPTS:
        signal.signal(one, signal.SIG_IGN)


def print_to_descriptors() -> None:
    """Let Python print where SUMO does: its own streams may be others (a notebook's, a test runner's)."""
    sys.stdout = sys.stderr = os.fdopen(2, "w", buffering=1, closefd=False)  # by the line: a crash flushes nothing


def raised_here(error: BaseException) -> Failure:
    """What to answer when `error` is being handled; its traceback goes to standard error."""
    os.write(2, traceback.format_exc().encode())
    return Failure(f"{type(error).__name__}: {error}", "", _sendable(error) if isinstance(error, Exception) else None)


def _sendable(error: Exception) -> Exception | None:
    """The bare error, or None where it does not survive the way to another process."""
    error.__traceback__ = error.__cause__ = error.__context__ = None
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301 - made in the line itself
    except Exception:  # noqa: BLE001 - a foreign exception may fail in any way
        return None
    return error


def die_with(parent: int) -> None:
    """End this process when the one that forked it ends (Linux only)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it died before the line above
            os._exit(1)


def adopt_orphans() -> None:
    """Become the parent of what this process's descendants leave behind, which is init's business else (Linux only)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1)


def death(code: int | None) -> str:
    """How a process with this exit code ended, in words."""
    if code is not None and code < 0:
        return f"the process died of {signal.Signals(-code).name}"
    return f"the process ended with code {code} without an answer"


def said_in(log: Path) -> str:
    """The last lines of a process's standard error."""
    lines = log.read_text(errors="replace").splitlines() if log.exists() else []
    return "\n".join(lines[-_SAID_LINES:])
