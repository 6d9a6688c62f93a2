"""A user's sumocfg: which files it reads, which options it sets, which outputs it asks for."""

import difflib
import gzip
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import msgspec

from dvca_sumo.scenario.errors import ScenarioError

# SUMO accepts each option under several names; values here are the names SUMO prints in --help.
SYNONYMS = {
    "net": "net-file",
    "n": "net-file",
    "routes": "route-files",
    "r": "route-files",
    "additional": "additional-files",
    "a": "additional-files",
    "b": "begin",
    "e": "end",
    "tripinfo": "tripinfo-output",
    "netstate": "netstate-dump",
    "emissions": "emission-output",
    "summary": "summary-output",
    "vehroutes": "vehroute-output",
    "vehroute": "vehroute-output",
    "fcd": "fcd-output",
    "collision": "collision-output",
    "log-file": "log",
    "l": "log",
    "M": "mesosim",
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
        "save-configuration",
        "save-template",
        "save-schema",
    ]
)


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


def read_configuration(path: Path) -> Configuration:
    """Read a sumocfg.

    Raises:
        ScenarioError: The file, or one that it names, is missing or is not XML, or it cannot be run
            by this tool (mesoscopic model).
    """
    path = path.resolve()
    if path.is_dir():
        raise ScenarioError(f"{path} is a folder, not a SUMO configuration")
    if not path.is_file():
        raise ScenarioError(f"no such SUMO configuration: {path}{_nearest(path)}")
    try:
        root = ET.parse(path).getroot()  # noqa: S314 - the user's own file, read as SUMO itself reads it
    except ET.ParseError as error:
        raise ScenarioError(f"{path} is not well-formed XML: {error}") from None
    options: dict[str, str] = {}
    for element in root.iter():
        value = element.get("value", element.get("v"))
        if element is not root and value is not None:
            options[SYNONYMS.get(element.tag, element.tag)] = value
    if options.get("mesosim", "false").lower() in ("true", "1", "yes", "on"):
        raise ScenarioError(f"{path} asks for the mesoscopic model (mesosim), in which no ego can be moved")
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


def seconds(text: str, option: str) -> float:
    """SUMO's time formats (`3600`, `1:00:00`, `0:1:0:0`) as seconds.

    Raises:
        ScenarioError: The text is none of them; `option` is named.
    """
    try:
        parts = [float(part) for part in text.strip().split(":")]
    except ValueError:
        raise ScenarioError(f"option {option} is no time: {text!r} (allowed: seconds, H:M:S or D:H:M:S)") from None
    factors = (86400.0, 3600.0, 60.0, 1.0)
    return sum(part * factor for part, factor in zip(parts, factors[-len(parts) :], strict=True))


def opened_text(path: Path) -> str:
    """The text of a plain or gzipped file, as SUMO reads both."""
    raw = path.read_bytes()
    return (gzip.decompress(raw) if raw[:2] == b"\x1f\x8b" else raw).decode(errors="replace")


def _files(config: Path, options: dict[str, str], name: str) -> tuple[Path, ...]:
    paths = tuple(
        (config.parent / part.strip()).resolve() for part in re.split(r"[,;]", options.get(name, "")) if part.strip()
    )
    for path in paths:
        if not path.is_file():
            raise ScenarioError(f"{config} names a file that does not exist ({name}): {path}{_nearest(path)}")
    return paths


def _nearest(path: Path) -> str:
    if not path.parent.is_dir():
        return f" (no such folder: {path.parent})"
    close = difflib.get_close_matches(path.name, [entry.name for entry in path.parent.iterdir()], n=1)
    return f" (did you mean {close[0]}?)" if close else ""
