"""Open files of a forked process.

A fork shares file offsets: SUMO reads routes piecemeal, and two processes that read through one
descriptor steal each other's vehicles. What is written by one appears in the other's file.
"""

import contextlib
import os
import stat
import sys
from pathlib import Path

if sys.platform != "win32":
    import fcntl

_PROC = Path("/proc/self/fd")  # Linux
_FOLDER = _PROC if _PROC.is_dir() else Path("/dev/fd")
_F_GETPATH = 50  # sys/fcntl.h of macOS


def make_own(log: Path) -> None:
    """Give this process offsets of its own.

    Regular files open for reading are opened anew at the same offset, for reading alone: a file that is
    open for both cannot be written any more, which whoever tries is told. Those open for writing alone are
    pointed to the null device, and standard output and error to `log`.

    Raises:
        OSError: A file open for reading alone cannot be opened again.
    """
    said = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    null = os.open(os.devnull, os.O_WRONLY)
    for number, mode in open_descriptors().items():
        if number > 2 and number != said and stat.S_ISREG(mode):
            _own(number, null)
    os.dup2(said, 1)
    os.dup2(said, 2)
    os.close(said)
    os.close(null)


def open_descriptors() -> dict[int, int]:
    """Mode (`stat.S_ISREG` and its kind tell of what) of every descriptor that is open."""
    modes: dict[int, int] = {}
    for number in map(int, os.listdir(_FOLDER)):  # noqa: PTH208 - numbers, not paths
        with contextlib.suppress(OSError):  # the listing's own, closed by now
            modes[number] = os.fstat(number).st_mode
    return modes


def _own(number: int, null: int) -> None:
    access = fcntl.fcntl(number, fcntl.F_GETFL) & os.O_ACCMODE
    if access == os.O_WRONLY:
        os.dup2(null, number)
        return
    offset = os.lseek(number, 0, os.SEEK_CUR)
    try:
        again = os.open(_path_of(number), os.O_RDONLY)
    except OSError:
        if access == os.O_RDONLY:
            raise
        os.dup2(null, number)  # nobody may need it; who reads it is told
        return
    os.lseek(again, offset, os.SEEK_SET)
    os.dup2(again, number)
    os.close(again)


def _path_of(number: int) -> str:
    if _FOLDER is _PROC:
        return str(_PROC / str(number))  # opens the file itself, even one that was unlinked
    return fcntl.fcntl(number, _F_GETPATH, bytes(1024)).rstrip(b"\0").decode()
