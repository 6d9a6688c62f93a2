"""One entry of the fault library: a TOML file, read and checked."""

import difflib
import math
import tomllib
from collections.abc import Collection
from pathlib import Path
from typing import Any

import msgspec

from dvca_sumo.interventions.effects import EFFECTS
from dvca_sumo.messages import COMPONENTS, Component


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


def read_entry(path: Path) -> FaultType:
    """The entry that a file holds: its effect is made for its component, and finds all that it reads.

    Raises:
        FaultError: The file is malformed, or holds what would be ignored or fail in a run; file, reason and
            what is allowed are named.
    """
    where = f"fault file {path}"
    try:
        written = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise FaultError(f"{where} is malformed: {error}") from None
    _refuse_unknown(where, written)
    try:
        entry = msgspec.convert(written, FaultType)
    except msgspec.ValidationError as error:
        raise FaultError(f"{where} is malformed: {error}") from None
    _check_effect(where, entry)
    for key, parameter in entry.parameters.items():
        _check_default(f"{where}: parameter {key!r}", parameter)
    return entry


def allowed_range(parameter: Parameter) -> str:
    """The numbers that it may be, with their unit."""
    return f"{parameter.low:g} to {parameter.high:g} {parameter.unit}".rstrip()


def choice(name: str, known: Collection[str]) -> str:
    """What may stand in the place of a word that is unknown, and which of it comes nearest."""
    return f" (allowed: {', '.join(known) or 'none'}){nearest(name, known)}"


def nearest(name: str, known: Collection[str]) -> str:
    """The word that comes nearest to an unknown one, as a question; empty where none does."""
    close = difflib.get_close_matches(name, sorted(known), n=1, cutoff=0.4)
    return f"; did you mean {close[0]!r}?" if close else ""


def _refuse_unknown(where: str, written: dict[str, Any]) -> None:
    """Before types are checked, so that a misspelt field is not told as a missing one."""
    words = [("field", name, FaultType.__struct_fields__) for name in written]
    parameters = written.get("parameters")
    for key, table in parameters.items() if isinstance(parameters, dict) else ():
        if isinstance(table, dict):
            words += [(f"field of parameter {key!r}", name, Parameter.__struct_fields__) for name in table]
    for what, known in (("component", COMPONENTS), ("effect", EFFECTS)):
        if isinstance(written.get(what), str):
            words.append((what, written[what], tuple(known)))
    for what, name, allowed in words:
        if name not in allowed:
            raise FaultError(f"{where}: unknown {what} {name!r}{choice(name, allowed)}")


def _check_effect(where: str, entry: FaultType) -> None:
    effect = EFFECTS[entry.effect]
    if entry.component not in effect.components:
        allowed = choice(entry.component, effect.components)
        raise FaultError(f"{where}: the effect {entry.effect} cannot be one of {entry.component}{allowed}")
    for key, parameter in entry.parameters.items():
        if key not in effect.reads:
            raise FaultError(f"{where}: the effect {entry.effect} reads no {key!r}{choice(key, effect.reads)}")
        if parameter.kind != effect.reads[key]:
            raise FaultError(f"{where}: parameter {key!r} is of kind {parameter.kind!r} (allowed: {effect.reads[key]})")
    missing = [key for key in effect.reads if key not in entry.parameters]
    if missing:
        raise FaultError(f"{where}: the effect {entry.effect} reads {missing[0]!r}, of which there is no parameter")


def _check_default(where: str, parameter: Parameter) -> None:
    default = parameter.default
    if parameter.kind == "object":
        if not isinstance(default, str) or not default:
            raise FaultError(f"{where} has the default {default!r} (allowed: an object id, in_way, all)")
    elif not isinstance(default, float) or not parameter.low <= default <= parameter.high:
        raise FaultError(f"{where} has the default {default!r} (allowed: {allowed_range(parameter)})")
