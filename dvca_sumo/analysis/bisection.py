"""Bisection over a row of answers. Knows nothing of vehicles.

A test answers SAFE, VIOLATES or UNRESOLVED. The search keeps one invariant, low SAFE and high
VIOLATES, and both ends of what it returns have been asked: the interval is proven, whatever the row
looks like elsewhere. Only if the row is monotone (SAFE up to a point, VIOLATES after it) is it the
one such place.
"""

import enum
import math
from collections.abc import Callable, Sequence

import msgspec

_HALVINGS = 20  # of the interval that holds the best share


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
    test: Callable[[int], Outcome], bracket: Bracket, points: Sequence[int] | None = None, share: float = 0.5
) -> Bracket:
    """Narrow a bracket to adjacent points.

    Args:
        test: Asked at most once for a point, never for the ends.
        bracket: Proven ends.
        points: Ascending places to ask at; None: every whole number.
        share: Where to ask, as a share of the points between, from the low end; see `best_share`.

    Returns:
        A bracket whose ends are adjacent points, unless all points between them are UNRESOLVED. For n points
        between the ends it costs at most floor(log(n) / -log(larger of share and 1 - share)) + 1 questions,
        plus one for each unresolved point.
    """
    if points is None:
        points = range(bracket.low + 1, bracket.high)
    low, high = bracket.low, bracket.high
    candidates = [point for point in points if low < point < high]
    while candidates:
        asked = candidates[int(share * len(candidates))]
        outcome = test(asked)
        if outcome is Outcome.SAFE:
            low = asked
        elif outcome is Outcome.VIOLATES:
            high = asked
        candidates = [one for one in candidates if low < one < high and one != asked]
    return Bracket(low, high)


def best_share(safe: float, violates: float) -> float:
    """Share at which a long bisection costs least when a SAFE answer costs `safe` and a VIOLATES `violates`.

    Either answer then narrows the bracket in proportion to its cost: with x = share, (1 - x)^(1 / safe) =
    x^(1 / violates) (D. E. Knuth, The Art of Computer Programming 3, section 6.2.2: trees with unequal costs).
    """
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2.0
        is_low = safe * math.log(middle) < violates * math.log1p(-middle)  # the powers themselves may be too small
        low, high = (middle, high) if is_low else (low, middle)
    return low
