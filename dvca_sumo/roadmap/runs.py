"""Equal values that stand next to each other."""

from collections.abc import Iterable, Iterator
from itertools import groupby
from typing import TypeVar

T = TypeVar("T")


def runs(values: Iterable[T]) -> Iterator[tuple[T, slice]]:
    """Each run of equal values, with its rows."""
    begin = 0
    for value, run in groupby(values):
        end = begin + sum(1 for _ in run)
        yield value, slice(begin, end)
        begin = end
