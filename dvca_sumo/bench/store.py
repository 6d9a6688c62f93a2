"""Scores kept on disk as they are found, so that an interrupted benchmark goes on where it stopped."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

import msgspec

from dvca_sumo.bench.score import Score


class StoreError(ValueError):
    """The folder of results cannot be used."""


class _Line(msgspec.Struct, frozen=True):
    key: str
    score: Score


class Store:
    """A file of scores, one a line, each under the key of what was asked."""

    def __init__(self, path: Path) -> None:
        """Read what is there.

        Raises:
            StoreError: The file cannot be read or made, or holds something else.
        """
        self._path = path
        self._known: dict[str, Score] = {}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            lines = path.read_bytes().splitlines(keepends=True) if path.exists() else []
        except OSError as error:
            raise StoreError(f"results cannot be kept in {path}: {error.strerror}") from None
        if lines and not lines[-1].endswith(b"\n"):  # killed while it was written
            path.write_bytes(b"".join(lines := lines[:-1]))
        for number, text in enumerate(lines, 1):
            try:
                line = msgspec.json.decode(text, type=_Line)
            except (msgspec.DecodeError, msgspec.ValidationError) as error:
                raise StoreError(f"line {number} of {path} is no score: {error}") from None
            self._known[line.key] = line.score

    def find(self, key: str) -> Score | None:
        """What was found for that question before."""
        return self._known.get(key)

    def add(self, key: str, score: Score) -> None:
        """Keep a score: it is on disk when this returns."""
        self._known[key] = score
        with self._path.open("ab") as file:
            file.write(msgspec.json.encode(_Line(key, score)) + b"\n")


def key_of(parts: Sequence[object]) -> str:
    """One key for equal questions, on every machine."""
    return hashlib.blake2b(msgspec.json.encode(parts), digest_size=12).hexdigest()
