"""Which checkpoints of a factual run are kept: few, however long it is, and within a memory budget."""

import os
import signal
from collections.abc import Iterable
from pathlib import Path

MEMORY_BUDGET = 1 << 30  # [bytes] that parked processes may hold for themselves


class Memory:
    """What parked processes hold for themselves. Measuring takes milliseconds each: only when it may be too much."""

    def __init__(self) -> None:
        self._most = 0  # [bytes]

    def add(self, copied: int) -> None:
        """One more process is parked, which holds at most `copied` [bytes] that no earlier one holds."""
        self._most += copied

    def is_over_budget(self, processes: Iterable[int]) -> bool:
        """Whether `processes`, all that are left, hold more than the budget."""
        if self._most > MEMORY_BUDGET:
            self._most = sum(map(private_memory, processes))
        return self._most > MEMORY_BUDGET


class Kept:
    """The stem's checkpoints, numbered as they were made."""

    def __init__(self) -> None:
        self._processes: dict[int, int] = {}  # by number
        self._memory = Memory()
        self._dropped: list[int] = []  # until they are gone: their end takes a while

    def add(self, number: int, process: int, copied: int) -> None:
        """Keep one more, a child of this process (`copied`: see `Memory`), and drop what is kept no longer.

        Over the budget the oldest are dropped, but for the first of all and the latest.
        """
        self._processes[number] = process
        self._memory.add(copied)
        for old in [one for one in self._processes if not is_kept(one, number)]:
            self._drop(old)
        while len(self._processes) > 2 and self._memory.is_over_budget(self._processes.values()):
            self._drop(sorted(self._processes)[1])

    def bury(self) -> None:
        """Wait until all that were dropped are gone, so that nobody calls them any more."""
        while self._dropped:
            os.waitpid(self._dropped.pop(), 0)

    def _drop(self, number: int) -> None:
        process = self._processes.pop(number)
        os.kill(process, signal.SIGKILL)
        self._dropped.append(process)
        self._dropped = [one for one in self._dropped if os.waitpid(one, os.WNOHANG)[0] == 0]


def is_kept(number: int, latest: int) -> bool:
    """Whether a checkpoint is kept when the latest one has the number `latest`.

    Number 0 is, and every other one until it is four times as old as the largest power of two that
    divides it. So there is always one between any age and 5/3 of it, and there are never more than two
    for each doubling of the age.
    """
    return number == 0 or latest - number < 4 * (number & -number)


def private_memory(process: int) -> int:
    """Pages that belong to a process alone [bytes]; 0 where the system does not tell."""
    try:
        lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0
    return sum(1024 * int(line.split()[1]) for line in lines if line.startswith("Private_"))
