"""A user's sumocfg: which files it reads, which options it sets, which outputs it asks for."""

import contextlib
import difflib
import hashlib
import math
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from urllib.parse import unquote

import msgspec

from dvca_sumo.scenario.errors import ScenarioError
from dvca_sumo.scenario.texts import is_file, read_by

# SUMO accepts options under several names; values here are the names SUMO prints in --help.
SYNONYMS = {
    "net": "net-file",
    "n": "net-file",
    "routes": "route-files",
    "r": "route-files",
    "additional": "additional-files",
    "a": "additional-files",
    "b": "begin",
    "e": "end",
    "v": "verbose",
    "X": "xml-validation",
    "g": "gui-settings-file",
    "srand": "seed",
    "abs-rand": "random",
    "no-duration-log": "duration-log.disable",
    "routing-threads": "device.rerouting.threads",
    "ndump": "netstate-dump",
    "netstate": "netstate-dump",
    "netstate-output": "netstate-dump",
    "tripinfo": "tripinfo-output",
    "personinfo": "personinfo-output",
    "summary": "summary-output",
    "vehroutes": "vehroute-output",
    "personroutes": "personroute-output",
    "person-fcd": "person-fcd-output",
    "statistics-output": "statistic-output",
    "log-file": "log",
    "l": "log",
    "C": "save-configuration",
    "save-config": "save-configuration",
}

# Options that make SUMO write a file, beside all that end in "-output".
OUTPUTS = frozenset(
    [
        "netstate-dump",
        "log",
        "message-log",
        "error-log",
        "device.rerouting.output",
        "device.ssm.file",
        "device.toc.file",
        "device.taxi.dispatch-algorithm.output",
        "device.taxi.idle-algorithm.output",
        "pedestrian.jupedsim.wkt",
        "pedestrian.jupedsim.py",
    ]
)

# With these SUMO writes a file about its options and leaves.
_LEAVES = ("save-configuration", "save-template", "save-schema")
_VARIABLE = re.compile(r"\$\{([^}]+)\}")


class Configuration(msgspec.Struct, frozen=True):
    """What a sumocfg says. Paths are absolute; options are under SUMO's canonical names."""

    path: Path
    options: dict[str, str]
    net: Path
    routes: tuple[Path, ...]
    additionals: tuple[Path, ...]

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the set options that would make SUMO write a file."""
        return tuple(name for name in self.options if name in OUTPUTS or name.endswith("-output"))

    @property
    def contents(self) -> tuple[str, ...]:
        """Digests of the sumocfg, of its options, which variables of the environment may be in, and of the files read.

        Those of a copy are equal, however old it is.

        Raises:
            ScenarioError: A file cannot be read.
        """
        waiting = [self.net, *self.routes, *self.additionals]
        found = dict.fromkeys([self.path, *waiting, *self._others()])
        while waiting:
            fresh = [one for one in _read_by(waiting.pop()) if one not in found]
            found.update(dict.fromkeys(fresh))
            waiting += fresh
        options = hashlib.blake2b(msgspec.json.encode(sorted(self.options.items()))).hexdigest()
        return options, *(content_of(path) for path in found)

    def _others(self) -> list[Path]:
        """Files that other options name, a state to begin with for one; none that SUMO would write."""
        words = (
            value for name, value in self.options.items() if name not in self.outputs and not name.startswith("save-")
        )
        return [path.resolve() for value in words for path in _listed(self.path, value) if is_file(path)]


def read_configuration(path: Path) -> Configuration:
    """Read a sumocfg.

    Raises:
        ScenarioError: The file, or one that it names, is missing, cannot be read or is not XML, or it cannot be run
            by this tool (mesoscopic model, nothing but its options saved).
    """
    with _reading(path.absolute()):
        path = path.resolve()
        if path.is_dir():
            raise ScenarioError(f"{path} is a folder, not a SUMO configuration")
        if not path.is_file():
            raise ScenarioError(f"no such SUMO configuration: {path}{_nearest(path)}")
        try:
            root = ET.parse(path).getroot()  # noqa: S314 - the user's own file, read as SUMO itself reads it
        except (ET.ParseError, LookupError, ValueError) as error:  # the latter two of a foreign encoding
            raise ScenarioError(f"{path} is not well-formed XML: {error}") from None
    options: dict[str, str] = {}
    for element in root.iter():
        value = element.get("value") or element.get("v") or _text_of(element)
        if value:
            options[SYNONYMS.get(element.tag, element.tag)] = _VARIABLE.sub(_of_environment, value)
    if options.get("mesosim", "false").lower() in ("true", "1", "yes", "on"):
        raise ScenarioError(f"{path} asks for the mesoscopic model (mesosim), in which no ego can be moved")
    for name in _LEAVES:
        if name in options:
            raise ScenarioError(f"{path} makes SUMO write a file and leave without a simulation ({name})")
    nets = _files(path, options, "net-file")
    if not nets:
        raise ScenarioError(f"{path} is not a SUMO configuration with a net: option net-file is not set")
    return Configuration(
        path=path,
        options=options,
        net=nets[0],
        routes=_files(path, options, "route-files"),
        additionals=_files(path, options, "additional-files"),
    )


def _text_of(element: ET.Element) -> str:
    return "" if len(element) else (element.text or "").strip()  # SUMO forgets what stands before a child


def _of_environment(name: re.Match[str]) -> str:
    return os.environ.get(name.group(1), "")  # as SUMO has it


def content_of(path: Path) -> str:
    """Digest of a file's bytes.

    Raises:
        ScenarioError: The file cannot be read.
    """
    with _reading(path):
        status = path.stat()
        return _content(path, status.st_size, status.st_mtime_ns)


@contextlib.contextmanager
def _reading(path: Path, role: str = "") -> Iterator[None]:
    try:
        yield
    except ScenarioError:
        raise
    except OSError as error:
        raise ScenarioError(f"{path}{role} cannot be read: {error.strerror}") from None
    except (RuntimeError, ValueError) as error:  # of links in a circle, and of a name with a null character
        raise ScenarioError(f"{path}{role} cannot be read: {error}") from None


def _read_by(path: Path) -> tuple[Path, ...]:
    with _reading(path):
        status = path.stat()
    return _files_read(path, status.st_size, status.st_mtime_ns)


@cache
def _files_read(path: Path, _size: int, _modified: int) -> tuple[Path, ...]:
    return read_by(path)


@cache
def _content(path: Path, _size: int, _modified: int) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "blake2b").hexdigest()


def seconds(text: str, option: str) -> float:
    """SUMO's time formats (`3600`, `1:00:00`, `0:1:0:0`) as seconds.

    Raises:
        ScenarioError: The text is none of them; `option` is named.
    """
    try:
        parts = [float(part) for part in text.strip().split(":")]
    except ValueError:
        parts = []
    if len(parts) not in (1, 3, 4) or not all(map(math.isfinite, parts)):
        raise ScenarioError(f"option {option} is no time: {text!r} (allowed: seconds, H:M:S or D:H:M:S)")
    factors = (86400.0, 3600.0, 60.0, 1.0)
    return sum(part * factor for part, factor in zip(parts, factors[-len(parts) :], strict=True))


def _files(config: Path, options: dict[str, str], name: str) -> tuple[Path, ...]:
    found: list[Path] = []
    for path in _listed(config, options.get(name, "")):
        with _reading(path, f" ({name} of {config})"):
            file = path.resolve()
            if not file.is_file():
                raise ScenarioError(f"{config} names a file that does not exist ({name}): {file}{_nearest(file)}")
        found.append(file)
    return tuple(found)


def _listed(config: Path, value: str) -> list[Path]:
    """The paths that an option's value lists; SUMO encodes names, as those of URLs are, where it saves them."""
    names = (unquote(part).strip() for part in re.split(r"[,;]", value))
    return [config.parent / name for name in names if name]


def _nearest(path: Path) -> str:
    try:
        names = [entry.name for entry in path.parent.iterdir()]
    except (FileNotFoundError, NotADirectoryError):
        return f" (no such folder: {path.parent})"
    except OSError:  # of a folder that may be entered, but not listed
        return ""
    close = difflib.get_close_matches(path.name, names, n=1)
    return f" (did you mean {close[0]}?)" if close else ""
