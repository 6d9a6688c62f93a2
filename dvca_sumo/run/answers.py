"""What a component answers: checked, and no longer to be changed."""

from collections.abc import Callable, Iterator
from operator import attrgetter
from typing import TypeVar, get_args, get_origin

import msgspec
import numpy as np

from dvca_sumo.messages import (
    PREDICTION_TIMES,
    TRAJECTORY_TIMES,
    Message,
    PredictedObjects,
    T,
    TrackedObjects,
    Trajectory,
)

Answer = TypeVar("Answer")

_SAME_TIME = 1e-9  # [s]


def checked(answer: object, kind: type[Answer]) -> Answer:
    """A component's answer, its arrays in the shapes that `messages` tells: a user's own stack may give anything.

    Nobody can write to its arrays any more, be it through what they are views of: it is a message that was made.
    """
    if not isinstance(answer, kind):
        raise TypeError(f"its step returned {type(answer).__name__}, not {kind.__name__}")
    for array_of in _ARRAYS[kind]:
        array = array_of(answer)
        while isinstance(array, np.ndarray):
            array.setflags(write=False)
            array = array.base
    for name, found, wanted in _shapes(answer):
        if found != wanted:
            raise ValueError(f"the shape of its {name} is {found}, and must be {wanted}")
    if isinstance(answer, Trajectory):
        gap = float(np.abs(answer.points[:, T] - TRAJECTORY_TIMES).max())
        if gap > _SAME_TIME:
            raise ValueError(f"the times of its points are up to {gap:g} s off, and must be TRAJECTORY_TIMES")
    return answer


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


def _arrays(kind: type, prefix: str = "") -> Iterator[str]:
    """Names of the arrays in a message of this kind, and in those that it holds."""
    for field in msgspec.structs.fields(kind):
        if get_origin(field.type) is np.ndarray:
            yield prefix + field.name
        elif isinstance(field.type, type) and issubclass(field.type, msgspec.Struct):
            yield from _arrays(field.type, f"{prefix}{field.name}.")


_ARRAYS: dict[type, tuple[Callable[[object], object], ...]] = {
    kind: tuple(attrgetter(name) for name in _arrays(kind)) for kind in get_args(Message)
}
