"""Intervals against published tables."""

import pytest

from dvca_sumo.intervals import poisson_interval, rate_of, share_of


@pytest.mark.parametrize(
    ("count", "total", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718), (0, 0, 0, 1)],
)
def test_the_interval_of_a_share_is_wilsons(count: int, total: int, low: float, high: float) -> None:
    """Against R. G. Newcombe (1998), table I, method 3."""
    share = share_of(count, total)
    assert share.low == pytest.approx(low, abs=1e-4)
    assert share.high == pytest.approx(high, abs=1e-4)


def test_the_interval_of_none_begins_at_0_and_that_of_all_ends_at_1() -> None:
    for total in range(1, 200):
        assert (share_of(0, total).low, share_of(total, total).high) == (0.0, 1.0)


@pytest.mark.parametrize(
    ("count", "low", "high"),
    [
        (0, 0.0, 3.6889),
        (1, 0.0253, 5.5716),
        (2, 0.2422, 7.2247),
        (5, 1.6235, 11.6683),
        (10, 4.7954, 18.3904),
        (50, 37.1110, 65.9188),
    ],
)
def test_the_interval_of_a_poisson_mean_is_garwoods(count: int, low: float, high: float) -> None:
    """Against K. Ulm (1990), and tables of exact Poisson limits."""
    assert poisson_interval(count) == pytest.approx((low, high), abs=1e-3)


def test_a_rate_is_of_its_exposure() -> None:
    rate = rate_of(2, 50.0)
    assert (rate.value, rate.low, rate.high) == pytest.approx((0.04, 0.004844, 0.144494), rel=1e-3)
    assert rate_of(0, 0.0).value is None


def test_the_interval_of_many_events_nears_the_normal_one() -> None:
    assert poisson_interval(2000) == pytest.approx((2000 - 1.96 * 44.72, 2000 + 1.96 * 44.72), rel=2e-3)
