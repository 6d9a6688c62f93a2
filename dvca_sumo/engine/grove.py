"""All processes of one factual run, as the analysis sees them: how they start, what they say, how they end."""

import contextlib
import itertools
import os
import shutil
import signal
import socket
import tempfile
import time
from collections.abc import Callable
from multiprocessing.connection import Connection, Pipe, wait
from pathlib import Path
from typing import NoReturn

import msgspec

from dvca_sumo.engine.branching import STEM_LOG
from dvca_sumo.engine.orders import Driven, Message, Parked
from dvca_sumo.engine.processes import death, die_with, said_in
from dvca_sumo.engine.thinning import Memory

_BACKLOG = 64
_LONGEST_FOLDER = 70  # [bytes] a socket's whole path may have 103
_GRACE = 5.0  # [s] of wall time for parked processes to end


class Checkpoint(msgspec.Struct, frozen=True):
    """A parked process, and the way to it."""

    parked: Parked
    connection: Connection


class Grove:
    """A stem and what was forked from it; `close` ends them all."""

    def __init__(self, hold: Callable[[str, Path, Connection], NoReturn]) -> None:
        """Start the stem: a child that does `hold(address to call, folder for logs, connection)`.

        Raises:
            OSError: The system gives no socket or no process.
        """
        is_short = len(os.fsencode(tempfile.gettempdir())) <= _LONGEST_FOLDER
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._folder = Path(tempfile.mkdtemp(prefix="dvca-sumo-fork-", dir=None if is_short else "/tmp"))  # noqa: S108
        except OSError:
            self._listener.close()
            raise
        self._owner = os.getpid()
        self._connections: list[Connection] = []
        self.checkpoints: list[Checkpoint] = []  # as far as was heard of them
        self.memory = Memory()  # of the checkpoints
        self.numbers = itertools.count()  # of orders
        self._process: int | None = None
        self._is_stem_idle = False
        try:
            address = str(self._folder / "socket")
            self._listener.bind(address)
            self._listener.listen(_BACKLOG)
            self.stem, theirs = Pipe()
            self._connections.append(self.stem)
            self._process = os.fork()
        except OSError:
            self.close()
            raise
        if self._process == 0:
            try:
                die_with(self._owner)
                self.stem.close()
                self._listener.close()  # held open here, it would let a child call an analysis that is gone
                hold(address, self._folder, theirs)
            finally:
                os._exit(1)
        theirs.close()

    def heard(self, deadline: float) -> list[tuple[Connection, Message | None]]:
        """What the processes say, waiting for it until `deadline`; None: one has ended, or has no more to say."""
        said: list[tuple[Connection, Message | None]] = []
        while not said:
            ready = wait([self._listener, *self._connections], max(deadline - time.monotonic(), 0.0))
            if not ready:
                break
            for one in ready:
                if isinstance(one, Connection):
                    said += self._received(one)
                else:
                    accepted, _ = self._listener.accept()
                    self._connections.append(Connection(accepted.detach()))
        return said

    def catch_up(self) -> None:
        """Hear what was said up to now, when nothing is wanted of any branch."""
        while self.heard(0.0):
            pass

    def said_by(self, order: int | None) -> str:
        """Last lines of the standard error of an order's branch; None: of the stem."""
        return said_in(self._folder / (STEM_LOG if order is None else str(order)))

    def stem_death(self) -> str:
        """How the stem ended, which it has."""
        assert self._process is not None  # it was started, and is asked for once
        process, self._process = self._process, None
        return death(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]))

    def close(self) -> None:
        """End all processes. On Linux none is left then, unless one takes longer than a few seconds to end."""
        if os.getpid() != self._owner:
            return  # a forked copy of the analysis
        for connection in self._connections:
            with contextlib.suppress(OSError):
                connection.send(None)  # not only closed: another child of this process may hold a copy
        self._listener.close()
        if self._process is not None:
            if not (self._is_stem_idle and wait([self.stem], _GRACE)):
                os.kill(self._process, signal.SIGKILL)
            os.waitpid(self._process, 0)
            self._process = None
        for connection in self._connections:
            connection.close()
        self._connections = []
        shutil.rmtree(self._folder, ignore_errors=True)

    def _received(self, connection: Connection) -> list[tuple[Connection, Message | None]]:
        try:
            message: Message | Parked = connection.recv()
        except BaseException as error:
            # Interrupted in the middle of a message, nothing on it can be understood any more.
            self._connections.remove(connection)
            self.checkpoints = [one for one in self.checkpoints if one.connection is not connection]
            self._is_stem_idle &= connection is not self.stem
            connection.close()
            if isinstance(error, (EOFError, OSError)):
                return [(connection, None)]
            raise
        if isinstance(message, Parked):
            self.checkpoints.append(Checkpoint(message, connection))
            self.memory.add(message.copied)
            return []
        self._is_stem_idle |= isinstance(message, Driven)
        return [(connection, message)]
