"""The fault library: one TOML file an entry, and the command-line words that plant one."""

import math
from collections.abc import Iterable
from functools import cache

import msgspec

from dvca_sumo.installation import folder
from dvca_sumo.interventions.entries import FaultError, FaultType, Parameter, allowed_range, choice, nearest, read_entry
from dvca_sumo.interventions.selection import Selection
from dvca_sumo.interventions.states import State
from dvca_sumo.interventions.targets import ALL, IN_WAY, words_for
from dvca_sumo.messages import Component


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
        FaultError: An entry's file is malformed; see `read_entry`.
    """
    return {path.stem: read_entry(path) for path in sorted(folder("faults").glob("*.toml"))}


def planted_fault(text: str) -> Fault:
    """The fault that `NAME[:key=value,...]` asks for.

    Raises:
        FaultError: Unknown name or parameter (the nearest is suggested), one given twice, or a value of the
            wrong type or outside the allowed range (both are named).
    """
    name, separator, rest = text.partition(":")
    entry = fault_library().get(name)
    if entry is None:
        raise FaultError(f"unknown fault {name!r}{choice(name, fault_library())}")
    known = {**entry.parameters, **COMMON}
    values: dict[str, float | str] = {key: parameter.default for key, parameter in known.items()}
    given = set[str]()
    for word in rest.split(",") if separator else ():
        key, is_given, value = word.partition("=")
        if key not in known:
            raise FaultError(f"fault {name} takes no parameter {key!r}{choice(key, known)}")
        if key in given:
            raise FaultError(f"fault {name}: parameter {key} is given twice")
        given.add(key)
        if not is_given:
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


def assert_met(fault: Fault, ids: Iterable[str]) -> None:
    """Check that the object that a fault is about is one of those, whose `ids` these are, that the ego came across.

    Raises:
        FaultError: It is none of theirs; the nearest is suggested.
    """
    which = str(fault.parameters.get("object", ALL))
    known = {word for one in ids for word in words_for(one) if word}
    if which not in known | {ALL, IN_WAY}:
        allowed = f"(allowed: the id of one that does, {IN_WAY}, {ALL}){nearest(which, known)}"
        raise FaultError(f"fault {fault.name}: no object {which!r} comes near the ego {allowed}")


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
    allowed = f"allowed: {allowed_range(parameter)}"
    try:
        number = float(text)
    except ValueError:
        raise FaultError(f"{where} is no number: {text!r} ({allowed})") from None
    if not parameter.low <= number <= parameter.high:
        raise FaultError(f"{where} is out of range: {text} ({allowed})")
    if parameter.kind == "index" and not number.is_integer() and number != parameter.default:
        raise FaultError(f"{where} is no whole number: {text} ({allowed})")
    return number
