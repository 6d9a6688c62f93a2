"""The decision table of the component level, over all 3^5 vectors of answers and by example."""

from itertools import product

import pytest

from analysis.scenes import CRASHED, SAFE, VIOLATING, FakeEngine, asking, ideals
from dvca_sumo.analysis.bisection import Outcome
from dvca_sumo.analysis.components import SUBSTITUTABLE, ComponentAnswer, Verdict, responsible_component
from dvca_sumo.engine.processes import Failure
from dvca_sumo.engine.protocol import Glimpse
from dvca_sumo.messages import Component
from dvca_sumo.run import Task

S, V, U = Outcome.SAFE, Outcome.VIOLATES, Outcome.UNRESOLVED
GLIMPSES: dict[Outcome, Glimpse | Failure] = {S: SAFE, V: VIOLATING, U: CRASHED}
Vector = tuple[Outcome, Outcome, Outcome, Outcome]


def answer(all_ideal: Outcome, singles: Vector) -> ComponentAnswer:
    def answers(task: Task) -> Glimpse | Failure:
        substituted = tuple(ideals(task))
        if len(substituted) == len(SUBSTITUTABLE):
            return GLIMPSES[all_ideal]
        (component,) = substituted
        return GLIMPSES[singles[SUBSTITUTABLE.index(component)]]

    engine = FakeEngine(answers)
    found = responsible_component(asking(engine))
    assert len(engine.tasks) == 5
    return found


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
