"""The fault library: one TOML file an entry, and the command-line words that plant one."""

import difflib
import math
import tomllib
from collections.abc import Collection
from functools import cache

import msgspec

from dvca_sumo.installation import folder
from dvca_sumo.interventions.effects import EFFECTS
from dvca_sumo.interventions.selection import Selection
from dvca_sumo.interventions.states import State
from dvca_sumo.messages import Component


class FaultError(ValueError):
    """A fault was asked for that the library does not hold, or with a parameter that it does not take."""


class Parameter(msgspec.Struct, frozen=True):
    """One parameter of a fault; `low` and `high` are the allowed range of a number."""

    summary: str
    default: float | str
    kind: str = "number"  # number, object
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf


class FaultType(msgspec.Struct, frozen=True):
    """One entry of the library."""

    component: Component
    effect: str  # name in EFFECTS
    summary: str
    parameters: dict[str, Parameter] = {}


class Fault(msgspec.Struct, frozen=True):
    """A planted defect: an effect on the selected messages of one component."""

    name: str
    component: Component
    effect: str
    parameters: dict[str, float | str]
    selection: Selection


# What every fault takes, beside its own parameters.
COMMON: dict[str, Parameter] = {
    "start": Parameter("active from so long after the ego's departure", 0.0, unit="s", low=0.0),
    "end": Parameter("active until then (exclusive)", math.inf, unit="s", low=0.0),
    "first": Parameter("first message index touched", 0.0, kind="index", unit="message", low=0.0),
    "last": Parameter("last message index touched", math.inf, kind="index", unit="message", low=0.0),
    "state": Parameter("only messages made in this vehicle dynamic state, p:v:a", "", kind="state"),
}


@cache
def fault_library() -> dict[str, FaultType]:
    """All entries by name, in alphabetical order.

    Raises:
        FaultError: An entry's file is malformed; file and reason are named.
    """
    entries: dict[str, FaultType] = {}
    for path in sorted(folder("faults").glob("*.toml")):
        try:
            entry = msgspec.convert(tomllib.loads(path.read_text()), FaultType)
        except (tomllib.TOMLDecodeError, msgspec.ValidationError) as error:
            raise FaultError(f"fault file {path} is malformed: {error}") from None
        if entry.effect not in EFFECTS:
            raise FaultError(f"fault file {path} names the effect {entry.effect!r}{_nearest(entry.effect, EFFECTS)}")
        entries[path.stem] = entry
    return entries


def planted_fault(text: str) -> Fault:
    """The fault that `NAME[:key=value,...]` asks for.

    Raises:
        FaultError: Unknown name or parameter (the nearest is suggested), or a value of the wrong type
            or outside the allowed range (both are named).
    """
    name, _, rest = text.partition(":")
    entry = fault_library().get(name)
    if entry is None:
        raise FaultError(f"unknown fault {name!r}{_nearest(name, fault_library())}")
    known = {**entry.parameters, **COMMON}
    values: dict[str, float | str] = {key: parameter.default for key, parameter in known.items()}
    for word in filter(None, rest.split(",")):
        key, separator, value = word.partition("=")
        if key not in known:
            raise FaultError(f"fault {name} takes no parameter {key!r}{_nearest(key, known)}")
        if not separator:
            raise FaultError(f"fault {name}: parameter {key} has no value (write {key}=...)")
        values[key] = _value(name, key, known[key], value)
    for low, high in (("start", "end"), ("first", "last")):
        if float(values[high]) < float(values[low]):
            raise FaultError(f"fault {name}: {high}={values[high]:g} lies before {low}={values[low]:g}")
    return Fault(
        name=name,
        component=entry.component,
        effect=entry.effect,
        parameters={key: values[key] for key in entry.parameters},
        selection=_selection(values),
    )


def _selection(values: dict[str, float | str]) -> Selection:
    last, state = float(values["last"]), str(values["state"])
    return Selection(
        start=float(values["start"]),
        end=float(values["end"]),
        first=int(values["first"]),
        last=None if math.isinf(last) else int(last),
        state=State(*map(int, state.split(":"))) if state else None,
    )


def _value(fault: str, key: str, parameter: Parameter, text: str) -> float | str:
    where = f"fault {fault}: parameter {key}"
    if parameter.kind == "object":
        if not text:
            raise FaultError(f"{where} is empty (allowed: an object id, in_way, all)")
        return text
    if parameter.kind == "state":
        parts = text.split(":")
        if len(parts) != 3 or not all(part.removeprefix("-").isdecimal() for part in parts):
            raise FaultError(f"{where} is no state: {text!r} (allowed: three whole numbers p:v:a)")
        return text
    allowed = f"allowed: {parameter.low:g} to {parameter.high:g} {parameter.unit}".rstrip()
    try:
        number = float(text)
    except ValueError:
        raise FaultError(f"{where} is no number: {text!r} ({allowed})") from None
    if not parameter.low <= number <= parameter.high:
        raise FaultError(f"{where} is out of range: {text} ({allowed})")
    if parameter.kind == "index" and not number.is_integer():
        raise FaultError(f"{where} is no whole number: {text} ({allowed})")
    return number


def _nearest(name: str, known: Collection[str]) -> str:
    close = difflib.get_close_matches(name, list(known), n=1, cutoff=0.4)
    if close:
        return f"; did you mean {close[0]!r}?"
    return f"; known: {', '.join(known)}"
