"""Checks: what must not pass."""

import pytest
from msgspec.structs import replace

from bench.scores import HOLDING, score
from dvca_sumo.bench.score import FAILED, Controls, Score
from dvca_sumo.bench.summary import summary_of
from dvca_sumo.intervals import share_of


def test_cases_that_are_all_right_pass_every_check() -> None:
    assert all(check.holds for check in summary_of([score(), score()]).checks)


@pytest.mark.parametrize(
    "wrong",
    [
        score(component="prediction"),
        score(component=None),
        score(has_message=False),
        score(is_proven=False),
        score(controls=Controls(without=False, defective=True, harmless=True)),
        score(controls=Controls(without=True, defective=False, harmless=True)),
        score(controls=Controls(without=True, defective=True, harmless=False)),
        score(controls=Controls(without=True, defective=True, harmless=None)),
        score(component=None, has_message=False, is_proven=None, verdict=FAILED, controls=None),
    ],
)
def test_one_wrong_case_among_forty_fails_a_check(wrong: Score) -> None:
    assert not all(check.holds for check in summary_of([*[score()] * 39, wrong]).checks)


def test_with_jitter_one_message_in_fifty_may_be_wrong_and_two_may_not() -> None:
    right, wrong = score(mode="jitter", is_proven=None), score(mode="jitter", has_message=False, is_proven=None)
    checks = {count: summary_of([*[right] * (50 - count), *[wrong] * count]).checks for count in (1, 2)}
    assert [check.holds for check in checks[1] if "messages" in check.text] == [True]
    assert [check.holds for check in checks[2] if "messages" in check.text] == [False]


def test_a_case_that_could_not_be_analysed_is_counted_as_wrong_and_as_failed() -> None:
    summary = summary_of([score(), score(component=None, has_message=False, verdict=FAILED)])
    assert (summary.failures, summary.components.count, summary.components.total) == (1, 1, 2)
    assert summary.confusion == {"perception": {"perception": 1, "none": 1}}


def test_controls_that_were_not_run_are_not_counted() -> None:
    assert summary_of([score(controls=None)]).controls is None
    assert summary_of([score(controls=None), score()]).controls == share_of(1, 1)


def test_every_single_control_can_break_the_three() -> None:
    assert HOLDING.hold
    for name in ("without", "defective", "harmless"):
        for said in (False, None):
            assert not replace(HOLDING, **{name: said}).hold
