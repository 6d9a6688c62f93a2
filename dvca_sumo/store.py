"""Answers kept on disk as they are found, so that what was interrupted goes on where it stopped."""

import hashlib
from collections.abc import Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Generic, TypeVar

import msgspec

from dvca_sumo.installation import folder

Kept = TypeVar("Kept")


class StoreError(ValueError):
    """The folder of results cannot be used."""


class _Line(msgspec.Struct, frozen=True):
    key: str
    value: msgspec.Raw


class Store(Generic[Kept]):
    """A file of answers of one kind, one a line, each under the key of what was asked."""

    def __init__(self, path: Path, kind: type[Kept]) -> None:
        """Read what is there. What the answers of other questions say is not looked at: other code may have given them.

        Raises:
            StoreError: The file cannot be read, made or written, or holds something else.
        """
        self._path = path
        self._kind = kind
        self._known: dict[str, msgspec.Raw] = {}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("a+b") as file:  # whether it can be added to is known before anything is asked
                file.seek(0)
                lines = file.read().splitlines(keepends=True)
                if lines and not lines[-1].endswith(b"\n"):  # killed while it was written
                    file.truncate(sum(map(len, lines := lines[:-1])))
        except OSError as error:
            raise self._unkept(error) from None
        for number, text in enumerate(lines, 1):
            try:
                line = msgspec.json.decode(text, type=_Line)
            except msgspec.DecodeError as error:
                raise StoreError(f"line {number} of {path} is no {kind.__name__}: {error}") from None
            self._known[line.key] = line.value

    def find(self, key: str) -> Kept | None:
        """What was found for that question before.

        Raises:
            StoreError: Something else is kept there.
        """
        if key not in self._known:
            return None
        try:
            return msgspec.json.decode(self._known[key], type=self._kind)
        except msgspec.DecodeError as error:
            raise StoreError(f"what {self._path} keeps under {key} is no {self._kind.__name__}: {error}") from None

    def add(self, key: str, value: Kept) -> None:
        """Keep an answer: it is on disk when this returns.

        Raises:
            StoreError: It cannot be written.
        """
        self._known[key] = msgspec.Raw(msgspec.json.encode(value))
        try:
            with self._path.open("ab") as file:
                file.write(msgspec.json.encode(_Line(key, self._known[key])) + b"\n")
        except OSError as error:
            raise self._unkept(error) from None

    def _unkept(self, error: OSError) -> StoreError:
        return StoreError(f"results cannot be kept in {self._path}: {error.strerror}")


def key_of(parts: Sequence[object]) -> str:
    """One key for equal questions to the same code and faults, on every machine: what others found is not taken."""
    return _digest(msgspec.json.encode([parts, _sources(), _libraries()]))


@cache
def _sources() -> str:
    """Of this package's code, and of the fault library; the version does not change with each edit."""
    code = Path(__file__).parent
    files = {path.relative_to(code).as_posix(): path for path in code.rglob("*.py")}
    files |= {f"faults/{path.name}": path for path in folder("faults").glob("*.toml")}
    return _digest(b"".join(b"%s\0%s\0" % (name.encode(), files[name].read_bytes()) for name in sorted(files)))


def _libraries() -> list[str]:
    """The versions of those that answers come from, beside SUMO's own, which who asks tells."""
    return [version(name) for name in ("numpy", "shapely", "sumolib")]


def _digest(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=12).hexdigest()
