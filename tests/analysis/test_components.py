"""The decision table of the component level, over all 3^5 vectors of answers and by example."""

from itertools import product

import pytest

from analysis.scenes import CRASHED, SAFE, START, VIOLATING, Answers, FakeEngine, asking, drive, ideals
from dvca_sumo.analysis.bisection import Outcome
from dvca_sumo.analysis.components import (
    SUBSTITUTABLE,
    ComponentAnswer,
    Verdict,
    lookbacks,
    responsible_component,
)
from dvca_sumo.analysis.dtest import Question
from dvca_sumo.engine.processes import Failure
from dvca_sumo.engine.protocol import Glimpse
from dvca_sumo.messages import Component
from dvca_sumo.run import Task

S, V, U = Outcome.SAFE, Outcome.VIOLATES, Outcome.UNRESOLVED
GLIMPSES: dict[Outcome, Glimpse | Failure] = {S: SAFE, V: VIOLATING, U: CRASHED}
Vector = tuple[Outcome, Outcome, Outcome, Outcome]

DRIVE = drive(duration=40.0)
VIOLATED = START + 39.0


def asked_of(answers: Answers) -> tuple[ComponentAnswer, list[Question]]:
    dtest = asking(FakeEngine(answers))
    found = responsible_component(dtest, DRIVE, VIOLATED)
    return found, [probe.question for probe in dtest.probes]


def answer(all_ideal: Outcome, singles: Vector) -> ComponentAnswer:
    """In a world where it does not matter from when on a component is ideal."""

    def answers(task: Task) -> Glimpse | Failure:
        substituted = tuple(ideals(task))
        if len(substituted) == len(SUBSTITUTABLE):
            return GLIMPSES[all_ideal]
        (component,) = substituted
        return GLIMPSES[singles[SUBSTITUTABLE.index(component)]]

    return asked_of(answers)[0]


def enough_before(**backs: float) -> Answers:
    """A world where a component (or `together`) must be ideal so many seconds before the violation, or earlier."""

    def answers(task: Task) -> Glimpse:
        substituted = ideals(task)
        name = "together" if len(substituted) > 1 else next(iter(substituted)).value
        since = next(iter(substituted.values())).selection.start
        return SAFE if name in backs and VIOLATED - START - since > backs[name] else VIOLATING

    return answers


def test_a_violation_that_stays_with_all_components_ideal_is_plannings() -> None:
    found = answer(V, (V, V, V, V))
    assert (found.verdict, found.component, found.alternatives) == (Verdict.PLANNING, Component.PLANNING, ())


@pytest.mark.parametrize("component", SUBSTITUTABLE)
def test_the_one_component_that_suffices_is_responsible(component: Component) -> None:
    singles = tuple(S if one is component else V for one in SUBSTITUTABLE)
    assert len(singles) == 4
    found = answer(S, singles)
    assert (found.verdict, found.component, found.alternatives) == (Verdict.COMPONENT, component, ())
    assert component.value in found.reason


def test_of_several_that_suffice_the_most_upstream_is_named_and_the_others_are_alternatives() -> None:
    found = answer(S, (V, S, S, S))
    assert found.component is Component.PERCEPTION
    assert found.alternatives == (Component.PREDICTION, Component.CONTROL)


def test_more_than_one_cause_is_said_to_be_so() -> None:
    found = answer(S, (V, V, V, V))
    assert (found.verdict, found.component) == (Verdict.UNRESOLVED, None)
    assert "more than one component" in found.reason


def test_where_a_single_substitution_could_not_be_told_nothing_is_said_about_it() -> None:
    found = answer(S, (V, U, V, V))
    assert (found.verdict, found.component) == (Verdict.UNRESOLVED, None)
    assert "perception" in found.reason
    assert "more than one component" not in found.reason


def test_an_unresolved_component_upstream_of_a_sufficient_one_leaves_it_open() -> None:
    found = answer(S, (U, S, V, V))
    assert (found.verdict, found.component) == (Verdict.UNRESOLVED, None)
    assert found.alternatives == (Component.PERCEPTION,)
    assert "localization" in found.reason


def test_an_unresolved_component_downstream_changes_nothing() -> None:
    assert answer(S, (V, S, U, U)).component is Component.PERCEPTION


def test_without_an_answer_to_the_all_ideal_question_a_sufficient_one_still_stands() -> None:
    assert answer(U, (V, S, V, V)).component is Component.PERCEPTION
    found = answer(U, (V, V, V, V))
    assert found.verdict is Verdict.UNRESOLVED
    assert "all components ideal" in found.reason


def test_every_vector_of_answers_obeys_the_table() -> None:
    for all_ideal, *singles in product(Outcome, repeat=5):
        vector = (singles[0], singles[1], singles[2], singles[3])
        found = answer(all_ideal, vector)
        enough = [component for component, one in zip(SUBSTITUTABLE, vector, strict=True) if one is S]
        upstream = vector[: SUBSTITUTABLE.index(enough[0])] if enough else vector
        if all_ideal is V:
            expected = (Verdict.PLANNING, Component.PLANNING)
        elif enough and U not in upstream:
            expected = (Verdict.COMPONENT, enough[0])
        else:
            assert (found.verdict, found.component) == (Verdict.UNRESOLVED, None)
            assert found.alternatives == tuple(enough)
            continue
        assert (found.verdict, found.component) == expected
        assert found.alternatives == tuple(one for one in enough if one is not expected[1])
        assert found.all_ideal is all_ideal
        assert tuple(found.singles.values()) == vector
        assert found.reason


@pytest.mark.parametrize(
    ("duration", "expected"),
    [(1.0, [None]), (1.5, [None]), (2.0, [1.0, None]), (39.0, [1.0, 2.0, 4.0, 8.0, 16.0, None])],
)
def test_looking_back_doubles_while_a_good_part_of_the_drive_is_left_and_ends_with_the_whole_of_it(
    duration: float, expected: list[float | None]
) -> None:
    assert lookbacks(START, START + duration) == expected


def backs(questions: list[Question], *ideal: Component) -> list[float | None]:
    """How long before the violation a substitution was asked for."""
    marks = [question.since for question in questions if question.ideal == ideal]
    return [None if mark is None else round(VIOLATED - mark.time, 2) for mark in marks]


def test_the_search_begins_just_before_the_violation_and_stops_where_it_is_prevented() -> None:
    found, questions = asked_of(enough_before(together=2.5, control=2.5))
    assert found.component is Component.CONTROL
    assert backs(questions, *SUBSTITUTABLE) == [1.0, 2.0, 4.0]
    assert backs(questions, Component.CONTROL) == [4.0]


def test_a_component_is_asked_no_later_than_where_all_together_are_enough() -> None:
    found, questions = asked_of(enough_before(together=1.5, perception=7.0))
    assert found.component is Component.PERCEPTION
    assert backs(questions, Component.PERCEPTION) == [2.0, 4.0, 8.0]


def test_once_one_is_enough_none_is_asked_further_back() -> None:
    found, questions = asked_of(enough_before(together=1.5, localization=3.5, prediction=1.5))
    assert (found.component, found.alternatives) == (Component.PREDICTION, ())
    assert backs(questions, Component.LOCALIZATION) == [2.0]
    assert found.since == pytest.approx(VIOLATED - 2.0)


def test_a_component_that_must_be_ideal_from_the_start_is_found() -> None:
    found, questions = asked_of(enough_before(together=38.0, localization=38.0))
    assert found.component is Component.LOCALIZATION
    assert backs(questions, Component.LOCALIZATION) == [None]


def test_planning_is_named_only_when_all_ideal_from_the_start_changes_nothing() -> None:
    found, questions = asked_of(enough_before())
    assert found.component is Component.PLANNING
    assert backs(questions, *SUBSTITUTABLE)[-1] is None
    assert set(found.singles) == set(SUBSTITUTABLE)


def test_what_only_a_perfect_hand_in_the_last_second_prevents_is_plannings() -> None:
    def answers(task: Task) -> Glimpse:
        substituted = ideals(task)
        since = max(ideal.selection.start for ideal in substituted.values())
        return SAFE if len(substituted) > 1 and VIOLATED - START - since < 3.0 else VIOLATING

    found, _ = asked_of(answers)
    assert found.verdict is Verdict.PLANNING
    assert found.all_ideal is V


def test_a_component_costs_a_few_questions_for_each_doubling_of_time() -> None:
    for back in (0.5, 1.5, 3.0, 6.0, 12.0, 24.0, 38.0):
        for component in SUBSTITUTABLE:
            found, questions = asked_of(enough_before(together=back, **{component.value: back}))
            assert found.component is component
            levels = len(backs(questions, *SUBSTITUTABLE))
            assert len(questions) <= levels + len(SUBSTITUTABLE)
