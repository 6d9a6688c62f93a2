"""Copying a process that holds a simulation: whether it can be done, and how the copy becomes a process of its own.

A fork copies memory, and nothing else: open files, other threads, and what other processes know stay one.
"""

import contextlib
import os
import random
import stat
import threading
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from dvca_sumo.engine.descriptors import make_own, open_descriptors
from dvca_sumo.engine.processes import die_with, raised_here

_TASKS = Path("/proc/self/task")  # Linux
_READY = b"."
_LONGEST_REASON = 4096  # [bytes] a pipe takes so many at once


class NotForkedError(Exception):
    """This process cannot be copied, and why."""


class Child(NamedTuple):
    """A process that was forked here."""

    process: int
    sign: int  # descriptor that can be read once the process has ended


class Lineage:
    """A process among those that are forked from one another."""

    def __init__(self) -> None:
        """The first one, before it runs anything of the user's."""
        self._held: int | None = None  # open as long as this process lives: its parent sees its end by it
        self._channels = _channels()

    def assert_alone(self) -> None:
        """Check that this process has come to talk to no other one: that would see its copies as one.

        Raises:
            NotForkedError: It has.
        """
        if _channels() - self._channels:
            raise NotForkedError("it has a pipe or socket to another process, which a copy of it would share")

    def forked(self, log: Path, introduce: Callable[[], None], *, mortal: bool = False) -> Child | None:
        """Fork; returns the child, and in it None.

        By then the child has made its descriptors its own, standard error being `log`, and done what
        `introduce` asks. A `mortal` child ends with its parent; others may outlive it.

        Raises:
            NotForkedError: There is no child.
        """
        if (threads := thread_count()) > 1:
            raise NotForkedError(f"it runs {threads} threads, of which a copy of it would have one")
        drawn = random.getstate()
        sign, held = os.pipe()
        parent = os.getpid()
        try:
            process = os.fork()
        except OSError as error:
            os.close(sign)
            os.close(held)
            raise NotForkedError(f"the system forks no process: {error.strerror}") from None
        if process == 0:
            os.close(sign)
            random.setstate(drawn)  # Python has seeded it anew
            self._settle_in(held, log, introduce, parent if mortal else None)
            return None
        os.close(held)
        said = os.read(sign, _LONGEST_REASON)  # nothing may be read from a shared file before the child has its own
        if said == _READY:
            return Child(process, sign)
        os.close(sign)
        os.waitpid(process, 0)
        raise NotForkedError(f"a copy of it cannot be set up: {said.decode(errors='replace') or 'it died'}")

    def _settle_in(self, held: int, log: Path, introduce: Callable[[], None], parent: int | None) -> None:
        try:
            if self._held is not None:
                os.close(self._held)
            self._held = held
            if parent is not None:
                die_with(parent)
            make_own(log)
            introduce()
            os.write(held, _READY)
        except BaseException as error:  # noqa: BLE001 - the parent tells of it
            with contextlib.suppress(OSError):
                os.write(held, raised_here(error).reason.encode()[:_LONGEST_REASON])
            os._exit(1)


def thread_count() -> int:
    """Threads of this process, a stack's own included."""
    return len(list(_TASKS.iterdir())) if _TASKS.is_dir() else threading.active_count()


def _channels() -> frozenset[int]:
    """Open pipes and sockets."""
    modes = open_descriptors()
    return frozenset(number for number, mode in modes.items() if stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode))
