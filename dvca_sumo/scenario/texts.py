"""The text of a user's XML files, as SUMO reads them: gzipped or not, in any encoding, with what they include."""

import gzip
import re
import zlib
from collections.abc import Iterator
from pathlib import Path

from dvca_sumo.scenario.errors import ScenarioError

_ENCODING = re.compile(rb"<\?xml[^>]*\bencoding\s*=\s*[\"']([A-Za-z0-9._-]+)")
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_INCLUDE = re.compile(r"<\s*include\b[^>]*?\bhref\s*=\s*[\"']([^\"']*)")
# Element -> attribute with the path of a file that SUMO reads.
READ = {
    "variableSpeedSign": "file",
    "rerouter": "file",
    "calibrator": "file",
    "include": "href",
    "poly": "imgFile",
    "poi": "imgFile",
}
_NAMED = re.compile(
    r"<\s*(?:" + "|".join(rf"{tag}\b[^>]*?\b{name}" for tag, name in READ.items()) + r")\s*=\s*[\"']([^\"']+)"
)


def is_file(path: Path) -> bool:
    """Whether a file is there, as far as can be told; of words that can be no path (too long, say) there is none."""
    try:
        return path.is_file()
    except OSError:
        return False


def opened_text(path: Path) -> str:
    """The text of a plain or gzipped file.

    Raises:
        ScenarioError: The file cannot be read.
    """
    try:
        raw = path.read_bytes()
        plain = gzip.decompress(raw) if raw[:2] == b"\x1f\x8b" else raw
    except (OSError, EOFError, zlib.error) as error:
        raise ScenarioError(f"{path} cannot be read: {error}") from None
    declared = _ENCODING.match(plain)
    try:
        return plain.decode(declared.group(1).decode() if declared else "utf-8", errors="replace").lstrip("\ufeff")
    except LookupError as error:
        raise ScenarioError(f"{path} cannot be read: {error}") from None


def read_by(path: Path) -> tuple[Path, ...]:
    """The files that a file has SUMO read besides it, as `READ` says: what it includes for one.

    Raises:
        ScenarioError: The file cannot be read.
    """
    return _found(path.parent, _NAMED.findall(opened_text(path)))


def texts_within(paths: tuple[Path, ...]) -> Iterator[tuple[Path, str]]:
    """Files and all that they include, each once, in order; comments are blanked out line by line.

    Raises:
        ScenarioError: A file cannot be read.
    """
    waiting, seen = list(paths)[::-1], set(paths)
    while waiting:
        path = waiting.pop()
        text = opened_text(path)
        if "<!--" in text:
            text = _COMMENT.sub(lambda comment: "\n" * comment.group().count("\n"), text)
        yield path, text
        fresh = [one for one in _found(path.parent, _INCLUDE.findall(text)) if one not in seen]
        waiting.extend(fresh[::-1])
        seen.update(fresh)


def _found(folder: Path, names: list[str]) -> tuple[Path, ...]:
    """Those of the files named that are there, each once."""
    named = (folder / name for name in names)
    return tuple(dict.fromkeys(one.resolve() for one in named if is_file(one)))
