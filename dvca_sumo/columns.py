"""Many values of one kind as a few arrays: that is how thousands of them go to another process.

Every value comes back as it was, except that arrays come back as parts of a larger one, and that what
was one object in several places need not be one any more.
"""

from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt


class Numbers(msgspec.Struct, frozen=True):
    """All of them float, or all int."""

    values: npt.NDArray[np.float64] | npt.NDArray[np.int64]

    def rows(self) -> Sequence[Any]:
        """The numbers."""
        numbers: list[object] = self.values.tolist()
        return numbers


class Arrays(msgspec.Struct, frozen=True):
    """Arrays that differ in length alone."""

    joined: npt.NDArray[np.generic]
    ends: tuple[int, ...]

    def rows(self) -> Sequence[Any]:
        """The arrays."""
        return [self.joined[start:end] for start, end in zip((0, *self.ends[:-1]), self.ends, strict=True)]


class Same(msgspec.Struct, frozen=True):
    """One object, again and again."""

    value: object
    count: int

    def rows(self) -> Sequence[Any]:
        """The object, as often as it was there."""
        return [self.value] * self.count


class Others(msgspec.Struct, frozen=True):
    """What nothing is known about."""

    values: tuple[object, ...]

    def rows(self) -> Sequence[Any]:
        """The values."""
        return self.values


class Structs(msgspec.Struct, frozen=True):
    """Structs of one type, a column a field."""

    kind: type[msgspec.Struct]
    fields: tuple["Columns", ...]

    def rows(self) -> Sequence[Any]:
        """The structs."""
        return list(map(self.kind, *(field.rows() for field in self.fields)))


Columns = Numbers | Arrays | Same | Others | Structs


def packed(values: Sequence[Any]) -> Columns:
    """Columns whose `rows` are `values`."""
    kinds = set(map(type, values))
    kind = kinds.pop() if len(kinds) == 1 else None
    if kind is None or kind is dict or kind is tuple:
        return Others(tuple(values))
    if kind is float or kind is int:
        return Numbers(np.array(values, dtype=np.float64) if kind is float else np.array(values, dtype=np.int64))
    if kind is np.ndarray:
        return _joined(values)
    if all(value is values[0] for value in values):
        return Same(values[0], len(values))
    if issubclass(kind, msgspec.Struct) and kind.__struct_fields__ == kind.__match_args__:  # made by position
        columns = zip(*map(msgspec.structs.astuple, values), strict=True)
        return Structs(kind, tuple(map(packed, columns)))
    return Others(tuple(values))


def _joined(arrays: Sequence[npt.NDArray[np.generic]]) -> Columns:
    shapes = {(array.dtype, array.shape[1:], array.ndim > 0) for array in arrays}
    if len(shapes) > 1 or not shapes.pop()[2]:
        return Others(tuple(arrays))
    return Arrays(np.concatenate(arrays), tuple(np.cumsum([len(array) for array in arrays]).tolist()))
