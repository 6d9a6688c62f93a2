"""What a component answers: checked, and no longer to be changed."""

from collections.abc import Callable, Iterator
from operator import attrgetter
from typing import TypeVar, get_args, get_origin

import msgspec
import numpy as np

from dvca_sumo.messages import Message

Answer = TypeVar("Answer")


def checked(answer: object, kind: type[Answer]) -> Answer:
    """A component's answer: a user's own stack may give anything.

    Nobody can write to its arrays any more, be it through what they are views of: it is a message that was made.
    """
    if not isinstance(answer, kind):
        raise TypeError(f"its step returned {type(answer).__name__}, not {kind.__name__}")
    for array_of in _ARRAYS[kind]:
        array = array_of(answer)
        while isinstance(array, np.ndarray):
            array.setflags(write=False)
            array = array.base
    return answer


def told(error: BaseException) -> str:
    """What a component raised, in a line."""
    said = " ".join(f"{type(error).__name__}: {error}".split())
    return f"{said} (messages given or returned are not to be written to)" if "read-only" in said else said


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
