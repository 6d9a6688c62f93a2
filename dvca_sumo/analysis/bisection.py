"""Bisection over a row of answers. Knows nothing of vehicles.

`test(i)` answers SAFE, VIOLATES or UNRESOLVED. The search keeps one invariant, low SAFE and high
VIOLATES, and both ends of what it returns have been asked: the interval is proven, whatever the row
looks like elsewhere. Only if the row is monotone (SAFE up to a point, VIOLATES after it) is it the
one such place.
"""

import enum
from collections.abc import Callable, Sequence

import msgspec


class Outcome(enum.StrEnum):
    """The three answers of a dtest."""

    SAFE = "SAFE"
    VIOLATES = "VIOLATES"
    UNRESOLVED = "UNRESOLVED"


class Bracket(msgspec.Struct, frozen=True):
    """`low` answered SAFE, `high` VIOLATES; everything strictly between them is UNRESOLVED or not wanted."""

    low: int
    high: int


def bisect(test: Callable[[int], Outcome], bracket: Bracket, points: Sequence[int] | None = None) -> Bracket:
    """Narrow a bracket to adjacent points.

    Args:
        test: Asked at most once for a point, never for the ends.
        bracket: Proven ends.
        points: Ascending places to ask at; None: every whole number.

    Returns:
        A bracket whose ends are adjacent points, unless all points between them are UNRESOLVED. Costs at
        most ceil(log2(number of points between + 1)) questions plus the unresolved ones.
    """
    if points is None:
        points = range(bracket.low + 1, bracket.high)
    low, high = bracket.low, bracket.high
    candidates = [point for point in points if low < point < high]
    while candidates:
        point = candidates[len(candidates) // 2]
        outcome = test(point)
        if outcome is Outcome.SAFE:
            low = point
        elif outcome is Outcome.VIOLATES:
            high = point
        candidates = [one for one in candidates if low < one < high and one != point]
    return Bracket(low, high)
