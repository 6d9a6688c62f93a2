"""A share of cases, and how sure it is."""

import math

import msgspec

_Z = 1.959964  # of the standard normal distribution, for 95 %


class Share(msgspec.Struct, frozen=True):
    """`count` of `total`, with Wilson's 95 % interval (E. B. Wilson, 1927)."""

    count: int
    total: int
    low: float
    high: float

    @property
    def value(self) -> float:
        """From 0 to 1; 0 of nothing is 0."""
        return self.count / self.total if self.total else 0.0


def share_of(count: int, total: int) -> Share:
    """A share with its interval; of nothing it is unknown: from 0 to 1."""
    if total == 0:
        return Share(count, total, 0.0, 1.0)
    rate, square = count / total, _Z * _Z
    middle = (rate + square / (2 * total)) / (1 + square / total)
    reach = _Z * math.sqrt(rate * (1 - rate) / total + square / (4 * total * total)) / (1 + square / total)
    return Share(count, total, max(middle - reach, 0.0), min(middle + reach, 1.0))
