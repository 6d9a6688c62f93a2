"""Exhaustive over rows of answers, and a contract on what they cost."""

import math
from collections.abc import Sequence
from itertools import product

import pytest

from dvca_sumo.analysis.bisection import Bracket, Outcome, best_share, bisect

SAFE, VIOLATES, UNRESOLVED = Outcome.SAFE, Outcome.VIOLATES, Outcome.UNRESOLVED


class Row:
    """Answers at 0 ... n-1, both ends known beforehand; every question is counted and asked once only."""

    def __init__(self, answers: Sequence[Outcome]) -> None:
        self.answers = answers
        self.asked: list[int] = []

    def __call__(self, point: int) -> Outcome:
        assert 0 < point < len(self.answers) - 1, "an end was asked again"
        assert point not in self.asked, "a point was asked twice"
        self.asked.append(point)
        return self.answers[point]

    @property
    def whole(self) -> Bracket:
        return Bracket(0, len(self.answers) - 1)


def promised(points: int, share: float = 0.5) -> int:
    return math.floor(math.log(points) / -math.log(max(share, 1.0 - share)) + 1e-9) + 1 if points else 0


def monotone(length: int, last_safe: int) -> list[Outcome]:
    return [SAFE] * (last_safe + 1) + [VIOLATES] * (length - last_safe - 1)


@pytest.mark.parametrize("share", [0.3, 0.5, 0.78])
@pytest.mark.parametrize("length", range(2, 42))
def test_every_monotone_row_ends_where_it_turns_at_the_promised_cost(length: int, share: float) -> None:
    for last_safe in range(length - 1):
        row = Row(monotone(length, last_safe))
        assert bisect(row, row.whole, share=share) == Bracket(last_safe, last_safe + 1)
        assert len(row.asked) <= promised(length - 2, share)


@pytest.mark.parametrize(("safe", "violates"), [(1.0, 1.0), (2.0, 1.0), (6.5, 1.5), (1.0, 3.0)])
def test_where_one_answer_costs_more_the_best_share_makes_a_search_cheaper_than_halving(
    safe: float, violates: float
) -> None:
    def cost(share: float) -> float:
        total = 0.0
        for last_safe in range(1001):
            row = Row(monotone(1002, last_safe))
            bisect(row, row.whole, share=share)
            total += sum(safe if point <= last_safe else violates for point in row.asked)
        return total

    best = best_share(safe, violates)
    assert cost(best) <= min(cost(share) for share in (0.2, 0.35, 0.5, 0.65, 0.8)) * 1.02


@pytest.mark.parametrize("cost", [3.0, 3600.0])
def test_equal_costs_are_searched_by_halves(cost: float) -> None:
    assert best_share(cost, cost) == pytest.approx(0.5, abs=1e-5)


@pytest.mark.parametrize("length", [2, 3, 10, 25, 40])
def test_one_or_two_unresolved_points_are_stepped_around(length: int) -> None:
    for last_safe in range(length - 1):
        for unresolved in product(range(1, length - 1), repeat=2):
            answers = monotone(length, last_safe)
            for point in unresolved:
                answers[point] = UNRESOLVED
            row = Row(answers)
            found = bisect(row, row.whole)
            assert answers[found.low] is SAFE
            assert answers[found.high] is VIOLATES
            assert set(answers[found.low + 1 : found.high]) <= {UNRESOLVED}
            assert len(row.asked) <= promised(length - 2) + 2


@pytest.mark.parametrize("length", range(2, 9))
def test_any_row_at_all_ends_between_a_safe_and_a_violating_neighbour(length: int) -> None:
    for inner in product(Outcome, repeat=length - 2):
        answers = [SAFE, *inner, VIOLATES]
        row = Row(answers)
        found = bisect(row, row.whole)
        assert answers[found.low] is SAFE
        assert answers[found.high] is VIOLATES
        assert set(answers[found.low + 1 : found.high]) <= {UNRESOLVED}


def test_a_row_that_cannot_be_told_at_all_keeps_its_ends_and_asks_every_point_once() -> None:
    row = Row([SAFE, *[UNRESOLVED] * 9, VIOLATES])
    assert bisect(row, row.whole) == row.whole
    assert sorted(row.asked) == list(range(1, 10))


def test_adjacent_ends_cost_nothing() -> None:
    row = Row([SAFE, VIOLATES])
    assert bisect(row, row.whole) == Bracket(0, 1)
    assert row.asked == []


@pytest.mark.parametrize("last_safe", range(40))
def test_only_the_given_points_are_asked_and_the_ends_are_neighbours_among_them(last_safe: int) -> None:
    points = [0, 3, 7, 8, 15, 22, 23, 24, 31, 39]
    row = Row(monotone(41, last_safe))
    found = bisect(row, row.whole, points)
    assert set(row.asked) <= set(points)
    assert found.low <= last_safe < found.high
    assert [point for point in points if found.low < point < found.high] == []
    assert len(row.asked) <= promised(len(points))


def test_no_points_between_the_ends_cost_nothing() -> None:
    row = Row(monotone(10, 4))
    assert bisect(row, row.whole, [0, 9, 12]) == row.whole
    assert row.asked == []
