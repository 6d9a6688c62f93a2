"""What a scenario's files say to this program: the "dvca." parameters of its vehicles."""

import io
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path
from typing import NamedTuple

from dvca_sumo.scenario.errors import ScenarioError

MARK = "ego"  # name of the parameter that marks the ego
_PREFIX = "dvca."
_VEHICLES, _ALLOWED = ("vehicle", "trip", "flow"), "of a vehicle, a trip or a flow"
_TRUE, _FALSE = ("true", "1", "yes", "on", "t", "x"), ("false", "0", "no", "off", "f", "-")  # as SUMO reads them


class Parameter(NamedTuple):
    """One of them."""

    vehicle: str  # of a flow, its first
    name: str  # without "dvca."
    text: str

    @property
    def is_true(self) -> bool:
        """What it says when it is a mark.

        Raises:
            ScenarioError: It says neither true nor false.
        """
        said = self.text.lower()
        if said not in (*_TRUE, *_FALSE):
            allowed = "allowed: true, 1, yes, on; false, 0, no, off"
            raise ScenarioError(f"parameter {_PREFIX}{self.name} of {self.vehicle!r} is {self.text!r} ({allowed})")
        return said in _TRUE


def parameters_within(text: str, path: Path) -> tuple[Parameter, ...]:
    """Those in the text of one file, in their order.

    Raises:
        ScenarioError: There are some, and the text is not well-formed, or they are not a vehicle's.
    """
    return _parsed(text, path) if _PREFIX in text else ()


@cache  # a run's process finds here what its parent has parsed
def _parsed(text: str, path: Path) -> tuple[Parameter, ...]:
    found: list[Parameter] = []
    around: list[ET.Element] = []  # the elements that are open
    try:
        for event, element in ET.iterparse(io.StringIO(text), ("start", "end")):  # noqa: S314 - the user's own file
            if event == "start":
                around.append(element)
                continue
            around.pop()
            key = element.get("key", "") if element.tag == "param" else ""
            if key.startswith(_PREFIX):
                if not around:
                    raise ScenarioError(f"parameter {key} of nothing in {path} (allowed: {_ALLOWED})")
                owner, name = around[-1].tag, around[-1].get("id", "")
                if owner not in _VEHICLES:
                    raise ScenarioError(f"parameter {key} of {owner} {name!r} in {path} (allowed: {_ALLOWED})")
                vehicle = f"{name}.0" if owner == "flow" else name
                found.append(Parameter(vehicle, key.removeprefix(_PREFIX), element.get("value", "")))
    except ET.ParseError as error:
        raise ScenarioError(f"{path} is not well-formed XML: {error}") from None
    return tuple(found)
