"""The benchmark cannot be passed by luck: analyses that are broken on purpose fail its checks."""

from collections.abc import Callable

import pytest
from msgspec.structs import replace

from dvca_sumo import api
from dvca_sumo.analysis.attribution import Attribution
from dvca_sumo.analysis.components import SUBSTITUTABLE, Verdict
from dvca_sumo.bench.cases import Case
from dvca_sumo.bench.runs import Setting, judged
from dvca_sumo.bench.score import Score
from dvca_sumo.bench.summary import summary_of
from dvca_sumo.messages import Component, MessageId

CASES = (
    Case("injected", "perception.miss/cs1", "nets/cs1.sumocfg", Component.PERCEPTION, fault="perception.miss"),
    Case(
        "injected",
        "control.longitudinal/cs2",
        "nets/cs2.sumocfg",
        Component.CONTROL,
        fault="control.longitudinal:start=12",
    ),
    Case("injected", "planning.speed/cs1", "nets/cs1.sumocfg", Component.PLANNING, fault="planning.speed:start=8"),
)
SETTING = Setting(has_controls=False)  # no analysis has a part in them

Analysed = list[tuple[Case, api.FactualDrive, Attribution]]
Breaking = Callable[[Attribution], Attribution]


@pytest.fixture(scope="module")
def analysed() -> Analysed:
    drives = [api.drive(api.load_scenario(case.scenario), [case.fault]) for case in CASES]
    return [(case, drive, api.attribute(drive)) for case, drive in zip(CASES, drives, strict=True)]


def scores(analysed: Analysed, breaking: Breaking) -> list[Score]:
    return [judged(case, SETTING, drive, breaking(found), (1.0, 1.0)) for case, drive, found in analysed]


def failing(analysed: Analysed, breaking: Breaking) -> list[str]:
    return [check.text for check in summary_of(scores(analysed, breaking)).checks if not check.holds]


def test_the_analysis_as_it_is_passes(analysed: Analysed) -> None:
    assert failing(analysed, lambda found: found) == []


def always_perception(found: Attribution) -> Attribution:
    """Of every violation, blames what was perceived a second before."""
    record, violation = found.record, found.violation
    assert found.components is not None
    assert violation is not None
    index = record.first_at(Component.PERCEPTION, violation.time - 1.0)
    return replace(
        found,
        verdict=Verdict.COMPONENT,
        components=replace(found.components, component=Component.PERCEPTION),
        message=record.mark(MessageId(Component.PERCEPTION, index)),
    )


def test_one_that_always_blames_perception_fails(analysed: Analysed) -> None:
    assert any("components" in text for text in failing(analysed, always_perception))


@pytest.mark.parametrize("step", [-1, 1])
def test_one_that_is_off_by_one_message_fails(analysed: Analysed, step: int) -> None:
    def beside(found: Attribution) -> Attribution:
        assert found.message is not None
        mark = found.record.mark(MessageId(found.message.component, found.message.index + step))
        return replace(found, message=mark)

    assert [score.is_proven for score in scores(analysed, beside)] == [False] * len(CASES)
    assert any("proven" in text for text in failing(analysed, beside))


def without_the_all_ideal_test(found: Attribution) -> Attribution:
    """Looks at single substitutions alone: where none is enough, it knows no answer."""
    assert found.components is not None
    if found.verdict is not Verdict.PLANNING:
        return found
    components = replace(found.components, component=None, verdict=Verdict.UNRESOLVED)
    return replace(found, verdict=Verdict.UNRESOLVED, components=components, message=None)


def test_one_that_does_not_ask_for_all_ideal_fails(analysed: Analysed) -> None:
    assert any("components" in text for text in failing(analysed, without_the_all_ideal_test))


def test_one_that_names_the_first_component_where_it_should_say_planning_fails(analysed: Analysed) -> None:
    def named(found: Attribution) -> Attribution:
        assert found.components is not None
        if found.verdict is not Verdict.PLANNING:
            return found
        return replace(found, components=replace(found.components, component=SUBSTITUTABLE[0]))

    assert any("components" in text for text in failing(analysed, named))
