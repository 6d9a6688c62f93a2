"""Copies of net, additional and route files whose outputs go nowhere.

Detectors, and devices of single vehicles, name their own output file, relative to the file they stand
in. A run must not write into the user's folder, so files with such elements are copied with the output
pointed to the null device and every relative input path made absolute. A file that only tells which edges
such an output is about is not read.
"""

import os
import re
import xml.etree.ElementTree as ET
from pathlib import Path

from dvca_sumo.scenario.configuration import Configuration
from dvca_sumo.scenario.errors import ScenarioError
from dvca_sumo.scenario.texts import READ, is_file, opened_text

# Element -> attribute with the path of a file that SUMO writes.
WRITTEN = {
    "inductionLoop": "file",
    "e1Detector": "file",
    "instantInductionLoop": "file",
    "laneAreaDetector": "file",
    "e2Detector": "file",
    "entryExitDetector": "file",
    "e3Detector": "file",
    "edgeData": "file",
    "laneData": "file",
    "routeProbe": "file",
    "vTypeProbe": "file",
    "calibrator": "output",
    "timedEvent": "dest",
}
_EDGES = "edgesFile"  # the one path of theirs that SUMO takes relative to its working folder, not to the file
# Keys of parameters with the path of a file that SUMO writes.
_LIGHT_FILE = "file"  # of an actuated traffic light: where its own detectors write
_DEVICE_FILES = ("device.ssm.file", "device.toc.file")  # of vehicles and their types
_SUSPICIOUS = re.compile(
    r"<\s*(?:" + "|".join([*WRITTEN, "include"]) + r")\b"
    r"|\bkey\s*=\s*[\"'](?:" + "|".join(map(re.escape, [_LIGHT_FILE, *_DEVICE_FILES])) + r")[\"']"
)


def silenced(files: tuple[Path, ...], folder: Path) -> tuple[Path, ...]:
    """The same files, in order, those that write output replaced by silent copies in `folder`.

    Raises:
        ScenarioError: A file to be copied is not well-formed XML.
    """
    return tuple(_silenced(path, folder / str(number)) for number, path in enumerate(files))


def input_words(configuration: Configuration, folder: Path, *additionals: Path) -> list[str]:
    """SUMO's words for a configuration's net, additional and route files, silenced, and for more additional ones.

    Raises:
        ScenarioError: As `silenced`.
    """
    read = configuration
    net, *others = silenced((read.net, *read.additionals, *read.routes), folder)
    count = len(read.additionals)
    kinds = {"-n": [net], "-a": [*others[:count], *additionals], "-r": others[count:]}
    return [word for kind, files in kinds.items() if files for word in (kind, ",".join(map(str, files)))]


def _silenced(path: Path, folder: Path) -> Path:
    text = opened_text(path)
    if not _SUSPICIOUS.search(text):
        return path
    try:
        root = ET.fromstring(text)  # noqa: S314 - the user's own file, read as SUMO itself reads it
    except ET.ParseError as error:
        raise ScenarioError(f"{path} is not well-formed XML: {error}") from None
    for number, element in enumerate(root.iter()):
        _silence(element)
        read = READ.get(element.tag)
        source = element.get(read) if read is not None else None
        if read is not None and source:
            target = (path.parent / source).absolute()
            if element.tag == "include" and is_file(target):
                target = _silenced(target, folder / str(number))
            element.set(read, str(target))
    folder.mkdir(parents=True, exist_ok=True)
    copy = folder / path.name.removesuffix(".gz")
    ET.ElementTree(root).write(copy, encoding="utf-8", xml_declaration=True)
    return copy


def _silence(element: ET.Element) -> None:
    written = WRITTEN.get(element.tag)
    if written is not None and element.get(written):
        element.set(written, os.devnull)
        element.attrib.pop(_EDGES, None)
    if element.tag == "param" and element.get("key") in _DEVICE_FILES:
        element.set("value", os.devnull)
    if element.tag == "tlLogic":
        for parameter in element.iter("param"):
            if parameter.get("key") == _LIGHT_FILE:
                parameter.set("value", os.devnull)
