"""Bisection over a row of answers. Knows nothing of vehicles.

A test answers SAFE, VIOLATES or UNRESOLVED. The search keeps one invariant, low SAFE and high
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


def bisect(
    test_all: Callable[[Sequence[int]], Sequence[Outcome]], bracket: Bracket, points: Sequence[int] | None = None
) -> Bracket:
    """Narrow a bracket to adjacent points, two questions at a time: run side by side, they cost hardly more than one.

    Args:
        test_all: Asked for one or two points at once, at most once for a point, never for the ends.
        bracket: Proven ends.
        points: Ascending places to ask at; None: every whole number.

    Returns:
        A bracket whose ends are adjacent points, unless all points between them are UNRESOLVED. Costs at
        most ceil(log3(number of points between + 1)) rounds, plus those of unresolved points.
    """
    if points is None:
        points = range(bracket.low + 1, bracket.high)
    low, high = bracket.low, bracket.high
    candidates = [point for point in points if low < point < high]
    while candidates:
        count = len(candidates)
        asked = sorted({candidates[count // 3], candidates[2 * count // 3]})
        answers = dict(zip(asked, test_all(asked), strict=True))
        low = max([low, *(point for point, outcome in answers.items() if outcome is Outcome.SAFE)])
        violating = [point for point, outcome in answers.items() if outcome is Outcome.VIOLATES and point > low]
        high = min([high, *violating])
        candidates = [one for one in candidates if low < one < high and one not in answers]
    return Bracket(low, high)
