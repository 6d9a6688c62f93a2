"""What every command says and writes, and how it ends."""

import contextlib
import io
import os
import sys
import tempfile
from collections.abc import Mapping
from enum import IntEnum
from pathlib import Path

import click


class OutputError(Exception):
    """What was found cannot be printed or written."""


class ExitCode(IntEnum):
    """The contract's exit codes."""

    NO_VIOLATION = 0
    ATTRIBUTED = 1
    USAGE = 2
    BAD_INPUT = 3
    UNRESOLVED = 4
    INTERNAL = 70
    INTERRUPTED = 130


class Folder(click.Path):
    """A folder that is to be written into, named in so many words: an empty name is a variable that is not set."""

    def __init__(self) -> None:
        super().__init__(file_okay=False, path_type=Path)

    def convert(self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """See `click.Path`."""
        if value == "":
            self.fail("the folder's name is empty", param, ctx)
        super().convert(value, param, ctx)
        return Path(value)


def tell(line: str) -> None:
    """One line on standard error, as long as anybody listens."""
    _printed(line, is_error=True)


def make_folder(folder: Path) -> None:
    """The folder that `-o` names, made where it is not there; files can be made in it.

    Raises:
        click.BadParameter: It cannot be, or they cannot.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        said = f"cannot write into the folder {folder}: {error.strerror}"
        raise click.BadParameter(said, param_hint="'-o'") from None


def deliver(text: str, files: Mapping[Path, str]) -> None:
    """Write each file whole or not at all, a reader never seeing half of one, then print the text.

    Who stops reading what is printed loses nothing else by it: the files, the exit code.

    Raises:
        OutputError: Something of it could not be printed or written; all the rest is.
    """
    lost = []
    for path, content in files.items():
        draft = path.with_suffix(".part")
        try:
            draft.write_text(content, encoding="utf-8")
            draft.replace(path)
        except OSError as error:
            lost.append(f"{path}: {error.strerror}")
            with contextlib.suppress(OSError):
                draft.unlink()
    unprinted = _printed(text)
    if unprinted is not None and not isinstance(unprinted, BrokenPipeError):
        lost.append(f"standard output: {unprinted.strerror}")
    if lost:
        raise OutputError(f"cannot write {', '.join(lost)}")


def _printed(text: str, *, is_error: bool = False) -> OSError | None:
    """Prints; returns why it could not. After that nothing more is printed there, and nothing fails for it."""
    stream = sys.stderr if is_error else sys.stdout
    try:
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # not every terminal has the characters of every id
        click.echo(text, err=is_error)
    except OSError as error:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 2 if is_error else 1)  # what is still in the stream's buffer goes there, too
        os.close(null)
        return error
    return None
