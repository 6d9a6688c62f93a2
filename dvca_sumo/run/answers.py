"""What a component answers: checked, and no longer to be changed."""

import itertools
from collections.abc import Callable, Iterable, Iterator
from operator import attrgetter
from types import NoneType
from typing import Any, NamedTuple, TypeVar, get_args, get_origin

import msgspec
import numpy as np

from dvca_sumo.messages import (
    PREDICTION_TIMES,
    TRAJECTORY_TIMES,
    ControlCommand,
    Message,
    PoseStep,
    PredictedObjects,
    SignalColour,
    T,
    TrackedObjects,
    Trajectory,
)
from dvca_sumo.record import Digest

Answer = TypeVar("Answer", bound=msgspec.Struct)

_SAME_TIME = 1e-9  # [s]
# What numbers may stand for those of an array, in numpy's letters. Longer ones have bytes that mean nothing.
_CODES: dict[type[np.generic], str] = {
    np.int64: np.typecodes["AllInteger"],
    np.float64: np.typecodes["AllInteger"] + "efd",
}
# Classes that may stand for the type of a field, the first one for all of them in words; arrays are checked apart.
_CLASSES = {float: (float, int, np.floating, np.integer), np.ndarray: (object,), NoneType: (PoseStep,)}


def checked(answer: object, kind: type[Answer]) -> Answer:
    """A component's answer, as `messages` tells it: of its types and shapes, and finite. A user's own may be anything.

    Nobody can write to its arrays any more; see `freeze`.
    """
    if not isinstance(answer, kind):
        raise TypeError(f"its step returned {type(answer).__name__}, not {kind.__name__}")
    is_plain = _is_plain(answer, kind)
    if is_plain and not _ARRAYS[kind]:
        return answer  # numbers alone, 100 times a second
    for array in _ARRAYS[kind]:
        _freeze(array.of(answer), array)
    for name, found, wanted in _shapes(answer):
        if found != wanted:
            raise ValueError(f"the shape of its {name} is {found}, and must be {wanted}")
    _check_numbers(answer, kind)
    for name, items, item in _items(answer):
        is_plain &= _are_plain(name, items, item)
    if not is_plain:
        Digest().step(answer)  # raises where a class of somebody's own has no bytes for a record
    return answer


def _check_numbers(message: object, kind: type) -> None:
    """Raise a ValueError where numbers in the arrays of a message of this kind are none that may stand there."""
    for array in _ARRAYS[kind]:
        if array.number is np.float64 and not np.isfinite(array.of(message)).all():
            raise ValueError(f"one of its {array.name} is not finite")
    if isinstance(message, PredictedObjects) and message.owners.size:
        count = len(message.objects.ids)
        if message.owners.min() < 0 or message.owners.max() >= count:
            raise ValueError(f"one of its owners is no row of its {count} objects")
    if isinstance(message, Trajectory):
        gap = float(np.abs(message.points[:, T] - TRAJECTORY_TIMES).max())
        if gap > _SAME_TIME:
            raise ValueError(f"the times of its points are up to {gap:g} s off, and must be TRAJECTORY_TIMES")


def freeze(message: Message) -> None:
    """Let nobody write to a message's arrays any more, be it through what they are views of: it was made."""
    for kind, arrays in _ARRAYS.items():
        if isinstance(message, kind):
            for array in arrays:
                _freeze(array.of(message), array)


def told(error: BaseException) -> str:
    """What a component raised, in a line."""
    said = " ".join(f"{type(error).__name__}: {error}".split())
    return f"{said} (messages given or returned are not to be written to)" if "read-only" in said else said


def _shapes(message: object) -> Iterator[tuple[str, object, tuple[int, ...]]]:
    """What a message holds by name: the shape that it has, and the one that it must have."""
    if isinstance(message, TrackedObjects):
        count = np.size(message.ids)
        yield "ids", _shape(message.ids), (count,)
        yield "classes", _shape(message.classes), (count,)
        yield "boxes", _shape(message.boxes), (count, 5)
        yield "velocities", _shape(message.velocities), (count, 2)
    elif isinstance(message, PredictedObjects):
        yield from _shapes(message.objects)
        count = np.size(message.owners)
        yield "owners", _shape(message.owners), (count,)
        yield "probabilities", _shape(message.probabilities), (count,)
        yield "poses", _shape(message.poses), (count, len(PREDICTION_TIMES), 3)
        yield "lanes", (len(message.lanes),), (count,)
    elif isinstance(message, Trajectory):
        yield "points", _shape(message.points), (len(TRAJECTORY_TIMES), 7)


def _shape(array: object) -> object:
    return array.shape if isinstance(array, np.ndarray) else f"that of a {type(array).__name__}"


def _freeze(array: object, wanted: "_Array") -> None:
    if isinstance(array, np.ndarray) and array.dtype.char not in wanted.codes:
        raise TypeError(f"its {wanted.name} are of type {array.dtype}, not {wanted.number.__name__}")
    while isinstance(array, np.ndarray):
        array.setflags(write=False)
        array = array.base


def _is_plain(message: msgspec.Struct, kind: type) -> bool:
    """Whether the fields of a message are exactly of the types that its kind tells; what they hold is not looked at.

    Raises:
        TypeError: One is not even of a class that may stand for its type, as a number of numpy's may.
    """
    types, values = _TYPES[kind], msgspec.structs.astuple(message)
    is_plain = type(message) is kind and tuple(map(type, values)) == types
    if not is_plain:
        for name, told_as, value in zip(message.__struct_fields__, types, values, strict=False):  # a subclass has more
            classes = _CLASSES.get(told_as, (told_as,))
            if not isinstance(value, (told_as, *classes)):
                raise TypeError(f"its {name} is of type {type(value).__name__}, not {classes[0].__name__}")
    if isinstance(message, PredictedObjects):
        return _is_plain(message.objects, TrackedObjects) and is_plain
    if isinstance(message, ControlCommand) and message.exact is not None:
        return _is_plain(message.exact, PoseStep) and is_plain
    return is_plain


def _are_plain(name: str, items: Iterable[object], told_as: type) -> bool:
    """As `_is_plain`, of the items of a collection."""
    types = set(map(type, items))
    for found in types:
        if not issubclass(found, told_as):
            raise TypeError(f"one of its {name} is of type {found.__name__}, not {told_as.__name__}")
    return types <= {told_as}


def _items(message: object) -> Iterator[tuple[str, Iterable[object], type]]:
    """What the collections in a message hold: what it is called, and of which type it must be."""
    if isinstance(message, TrackedObjects):
        yield "signals", message.signals, str
        yield "colours", message.signals.values(), SignalColour
    elif isinstance(message, PredictedObjects):
        yield from _items(message.objects)
        yield "lanes", message.lanes, tuple
        yield "lanes", itertools.chain.from_iterable(message.lanes), str


class _Array(NamedTuple):
    """In a message."""

    of: Callable[[object], Any]
    name: str
    number: type[np.generic]  # that it holds
    codes: str  # of the numbers that it may hold


def _arrays(kind: type, prefix: str = "") -> Iterator[_Array]:
    """In a message of this kind, and in those that it holds."""
    for field in msgspec.structs.fields(kind):
        name = prefix + field.name
        if get_origin(field.type) is np.ndarray:
            (number,) = get_args(get_args(field.type)[1])  # of ndarray[shape, dtype[number]]
            yield _Array(attrgetter(name), name, number, _CODES[number])
        elif isinstance(field.type, type) and issubclass(field.type, msgspec.Struct):
            yield from _arrays(field.type, f"{name}.")


def _types(kind: type) -> Iterator[type]:
    """Those of a kind's fields; that of nothing where one may hold that, as it mostly does."""
    for field in msgspec.structs.fields(kind):
        yield NoneType if NoneType in get_args(field.type) else get_origin(field.type) or field.type


_KINDS: tuple[type, ...] = get_args(Message)
_ARRAYS = {kind: tuple(_arrays(kind)) for kind in _KINDS}
_TYPES = {kind: tuple(_types(kind)) for kind in (*_KINDS, PoseStep)}
