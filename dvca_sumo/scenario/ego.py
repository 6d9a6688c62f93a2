"""Which vehicle of a scenario is the ego."""

import difflib
import re

from dvca_sumo.scenario.configuration import Configuration
from dvca_sumo.scenario.errors import NoEgoError, ScenarioError
from dvca_sumo.scenario.parameters import MARK, Parameter, parameters_within
from dvca_sumo.scenario.texts import texts_within

AUTO = "auto"
_VEHICLE = re.compile(r"<\s*(vehicle|trip|flow)\b[^>]*?\bid\s*=\s*[\"']([^\"']*)[\"']")
_SIGN = re.compile(r"<\s*variableSpeedSign\b[^>]*?\blanes\s*=\s*[\"']([^\"']*)")
_LISTED = 5


def find_ego(configuration: Configuration, asked: str | None) -> str:
    """The id of the ego, or `AUTO` when the choice is left to the run.

    In this order: `asked` (`--ego`); the vehicle with `<param key="dvca.ego" value="true"/>`; the
    vehicle id `ego`.

    Raises:
        NoEgoError: Nothing says which one it is; candidates are listed.
        ScenarioError: There is no such vehicle, or several; or a mark is neither true nor false.
    """
    if asked == AUTO:
        return AUTO
    names: list[str] = []
    marked: list[str] = []
    for path, text in texts_within((*configuration.routes, *configuration.additionals)):
        marked.extend(one.vehicle for one in parameters_within(text, path) if one.name == MARK and one.is_true)
        for element, name in _VEHICLE.findall(text):
            names.append(f"{name}.0" if element == "flow" else name)
    flows = {name.rsplit(".", 1)[0] for name in names if name.endswith(".0")}
    if asked is not None:
        if asked in names or asked.rpartition(".")[0] in flows:
            return asked
        close = difflib.get_close_matches(asked, names, n=1)
        hint = f"did you mean {close[0]}?" if close else _candidates(names)
        raise ScenarioError(f"no vehicle {asked!r} in the scenario ({hint})")
    if len(marked) > 1:
        raise ScenarioError(f"several vehicles are marked dvca.ego: {', '.join(marked)}; choose one with --ego ID")
    if marked:
        return marked[0]
    if "ego" in names:
        return "ego"
    raise NoEgoError(
        f"{configuration.path} names no ego: use --ego ID, --ego auto, or mark a vehicle with "
        f'<param key="dvca.ego" value="true"/> ({_candidates(names)})'
    )


class Definitions:
    """How a scenario's files define its vehicles, and where signs change the limit: read once, asked about many."""

    def __init__(self, configuration: Configuration) -> None:
        """Read them.

        Raises:
            ScenarioError: A file cannot be read.
        """
        self._tags: dict[str, str] = {}  # first tag of each vehicle and trip, by name
        self._flows: dict[str, str] = {}
        self.parameters: list[Parameter] = []
        signed: set[str] = set()
        for path, text in texts_within((*configuration.routes, *configuration.additionals)):
            for match in _VEHICLE.finditer(text):
                tags = self._flows if match.group(1) == "flow" else self._tags
                end = text.find(">", match.start())
                tags.setdefault(match.group(2), text[match.start() : end if end >= 0 else None])
            self.parameters += parameters_within(text, path)
            signed.update(*map(str.split, _SIGN.findall(text)))
        self.signed_lanes = frozenset(signed)  # under variable speed signs

    def has(self, vehicle: str) -> bool:
        """Whether `--ego` accepts that name."""
        return self._tag(vehicle) is not None

    def arrival_position(self, vehicle: str, length: float) -> float:
        """Where on an edge of `length` [m] it shall arrive [m]; at the end, unless its definition says where.

        SUMO does not tell it of a running vehicle, so it is read from the vehicle's own definition.

        Raises:
            ScenarioError: The definition holds something that is no position.
        """
        text = self._attribute(vehicle, "arrivalPos")
        position = length if text is None else _position(text, vehicle, length)
        return min(max(position, 0.0), length)

    def arrival_row(self, vehicle: str, rows: int) -> int:
        """On which of the `rows` edges of the whole route that it departed with it shall arrive; usually the last.

        Raises:
            ScenarioError: The definition does not tell it.
        """
        text = self._attribute(vehicle, "arrivalEdge")
        if text is None:
            return rows - 1
        try:
            return min(max(int(text), 0), rows - 1)
        except ValueError:  # "random": SUMO draws it, and tells nobody
            raise ScenarioError(
                f"arrivalEdge of {vehicle} is no edge: {text!r} (allowed: its number along the route, from 0 on)"
            ) from None

    def _attribute(self, vehicle: str, name: str) -> str | None:
        found = re.search(rf"\b{name}\s*=\s*[\"']([^\"']*)", self._tag(vehicle) or "")
        return found.group(1) if found else None

    def _tag(self, vehicle: str) -> str | None:
        return self._tags.get(vehicle) or self._flows.get(vehicle.rpartition(".")[0])


def _position(text: str, ego: str, length: float) -> float:
    if text == "max":
        return length
    if text == "center":
        return 0.5 * length
    try:
        position = float(text)
    except ValueError:  # "random": SUMO draws it, and tells nobody
        allowed = "metres, center, max"
        raise ScenarioError(f"arrivalPos of {ego} is no position: {text!r} (allowed: {allowed})") from None
    return position + length if position < 0.0 else position


def _candidates(names: list[str]) -> str:
    if not names:
        return "the scenario has no vehicles"
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return "candidates: " + ", ".join(names[:_LISTED]) + more
