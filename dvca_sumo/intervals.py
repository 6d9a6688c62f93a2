"""Shares and rates with their 95 % intervals."""

import math
from collections.abc import Callable

import msgspec

_Z = 1.959964  # of the standard normal distribution, for 95 %
_TAIL = 0.025  # of probability beyond either end


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


class Rate(msgspec.Struct, frozen=True):
    """`count` events in so many units of exposure, with the exact Poisson interval (F. Garwood, 1936)."""

    count: int
    exposure: float
    value: float | None  # events a unit; None of no exposure
    low: float | None
    high: float | None


def share_of(count: int, total: int) -> Share:
    """A share with its interval; of nothing it is unknown: from 0 to 1."""
    if total == 0:
        return Share(count, total, 0.0, 1.0)
    return Share(count, total, _least_share(count, total), 1.0 - _least_share(total - count, total))


def _least_share(count: int, total: int) -> float:
    """The low end of Wilson's interval: exactly 0 of none."""
    square = _Z * _Z
    reach = math.sqrt(square * (count * (total - count) / total + square / 4))
    return (count + square / 2 - reach) / (total + square)


def rate_of(count: int, exposure: float) -> Rate:
    """A rate with its interval: the means under which so many events, or so few, have a probability of 2.5 %."""
    if exposure <= 0.0:
        return Rate(count, exposure, None, None, None)
    low, high = poisson_interval(count)
    return Rate(count, exposure, count / exposure, low / exposure, high / exposure)


def poisson_interval(count: int) -> tuple[float, float]:
    """The exact 95 % interval of a Poisson mean of which `count` was drawn."""
    # P(X < count | low) = 1 - 2.5 %, P(X <= count | high) = 2.5 %; both fall with the mean.
    low = _root(lambda mean: _at_most(count - 1, mean) - (1.0 - _TAIL), count) if count else 0.0
    return low, _root(lambda mean: _at_most(count, mean) - _TAIL, count)


def _at_most(count: int, mean: float) -> float:
    """The probability of at most so many events."""
    return math.fsum(math.exp(k * math.log(mean) - mean - math.lgamma(k + 1)) for k in range(count + 1))


def _root(falling: Callable[[float], float], count: int) -> float:
    low, high = 0.0, count + 10.0 * math.sqrt(count + 1.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if falling(middle) > 0.0 else (low, middle)
    return 0.5 * (low + high)
