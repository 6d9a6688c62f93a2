"""What every command says and writes, and how it ends."""

from enum import IntEnum
from pathlib import Path

import click


class ExitCode(IntEnum):
    """The contract's exit codes."""

    NO_VIOLATION = 0
    ATTRIBUTED = 1
    USAGE = 2
    BAD_INPUT = 3
    UNRESOLVED = 4
    INTERNAL = 70
    INTERRUPTED = 130


def tell(line: str) -> None:
    """One line on standard error."""
    click.echo(line, err=True)


def make_folder(folder: Path) -> None:
    """The folder that `-o` names, made where it is not there.

    Raises:
        click.BadParameter: It cannot be.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise click.BadParameter(f"cannot make the folder {folder}: {error.strerror}", param_hint="'-o'") from None


def write_whole(path: Path, text: str) -> None:
    """Whole or not at all: a reader never sees half a file."""
    draft = path.with_suffix(".part")
    draft.write_text(text)
    draft.replace(path)
