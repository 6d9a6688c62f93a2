"""Several components are enough: the last that could have prevented it is responsible, upstream among equals."""

import math
from collections.abc import Callable

import pytest

from analysis.scenes import (
    CRASHED,
    SAFE,
    START,
    VIOLATING,
    FakeEngine,
    answering,
    asking,
    attributed,
    breach,
    collision,
    drive,
    ideals,
)
from dvca_sumo.analysis.bisection import Outcome
from dvca_sumo.analysis.components import ComponentAnswer, Verdict, responsible_component
from dvca_sumo.analysis.dtest import Dtest
from dvca_sumo.analysis.last_chance import FURTHER, LATENCY, PROMPT, decisive, is_by_luck
from dvca_sumo.analysis.messages import MessageAnswer
from dvca_sumo.engine.processes import Failure
from dvca_sumo.engine.protocol import Glimpse
from dvca_sumo.interventions import Ideal
from dvca_sumo.messages import Component
from dvca_sumo.run import Task
from dvca_sumo.violations import Category

LOCALIZATION, PERCEPTION, PREDICTION, CONTROL = (
    Component.LOCALIZATION,
    Component.PERCEPTION,
    Component.PREDICTION,
    Component.CONTROL,
)
TIME = START + 12.0  # [s]
DRIVE = drive(duration=20.0, violations=(collision(TIME),))
CYCLE = 0.1  # [s]


def last(component: Component, before: float) -> int:
    """The component's message so long before the violation [s]."""
    return DRIVE.first_at(component, TIME - before)


def asked(**befores: float) -> tuple[Component, MessageAnswer, ComponentAnswer, Dtest]:
    enough = {Component(name): last(Component(name), before) for name, before in befores.items()}
    dtest = asking(FakeEngine(answering(DRIVE, enough)))
    answer = responsible_component(dtest, DRIVE, TIME)
    return *decisive(dtest, DRIVE, answer, TIME, TIME + 4.0, is_exact=True), answer, dtest


def test_of_two_with_the_same_last_chance_the_upstream_one_is_responsible() -> None:
    component, messages, _, _ = asked(perception=0.8, prediction=0.8)
    assert component is PERCEPTION
    assert messages.last_safe.index == last(PERCEPTION, 0.8)


def test_one_cycle_earlier_upstream_is_the_same_chance() -> None:
    assert asked(perception=0.8 + CYCLE, prediction=0.8)[0] is PERCEPTION


def test_one_that_could_prevent_it_only_earlier_did_so_by_luck() -> None:
    component, messages, answer, _ = asked(localization=0.95, perception=0.4)
    assert answer.component is LOCALIZATION
    assert component is PERCEPTION
    assert messages.last_safe.index == last(PERCEPTION, 0.4)


@pytest.mark.parametrize("downstream", [PREDICTION, CONTROL])
@pytest.mark.parametrize(("goes_wrong", "responsible"), [((0.0,), None), ((4.0,), None), ((), PERCEPTION)])
def test_foresight_and_a_perfect_hand_alone_make_nobody_responsible(
    downstream: Component, goes_wrong: tuple[float, ...], responsible: Component | None
) -> None:
    """Only who, given the truth from the last chance or some time before, still fails."""
    befores = {PERCEPTION: 0.9, downstream: 0.3}
    enough = answering(DRIVE, {component: last(component, before) for component, before in befores.items()})
    nothing = answering(DRIVE, {})

    def answers(task: Task) -> Glimpse | Failure:
        asked_of = ideals(task)
        is_sensing = set(asked_of) == {LOCALIZATION, PERCEPTION}
        back = TIME - START - 0.9 - max(ideal.selection.start for ideal in asked_of.values())
        fails = is_sensing and any(abs(back - one) < CYCLE for one in goes_wrong)
        return (nothing if fails else enough)(task)

    dtest = asking(FakeEngine(answers))
    answer = responsible_component(dtest, DRIVE, TIME)
    component, messages = decisive(dtest, DRIVE, answer, TIME, TIME + 4.0, is_exact=True)
    assert component is (responsible or downstream)
    assert messages.last_safe.index == last(component, befores[component])


def test_one_upstream_that_was_just_out_of_reach_of_the_common_question_is_found() -> None:
    component, _, answer, _ = asked(perception=1.0 + CYCLE, prediction=1.0)
    assert answer.component is PREDICTION  # perception was not enough from 1 s before on
    assert component is PERCEPTION


def test_one_far_upstream_in_time_is_not_asked_again() -> None:
    component, _, _, dtest = asked(localization=5.0, perception=0.5)
    assert component is PERCEPTION
    assert sum(probe.question.ideal == (LOCALIZATION,) for probe in dtest.probes) == 1


def test_a_single_one_costs_no_further_question_about_others() -> None:
    _, _, _, dtest = asked(control=0.5)
    others = [probe.question.ideal for probe in dtest.probes if probe.question.ideal != (CONTROL,)]
    assert len(others) == len(set(others))


def test_a_late_chance_is_no_luck_and_is_not_asked_about() -> None:
    _, messages, _, dtest = asked(perception=PROMPT - 0.5)
    count = len(dtest.probes)
    assert not is_by_luck(dtest, DRIVE, PERCEPTION, messages, TIME)
    assert len(dtest.probes) == count


@pytest.mark.parametrize("is_enough_from_the_start", [True, False])
def test_an_early_chance_is_luck_when_all_ideal_from_the_start_fail(*, is_enough_from_the_start: bool) -> None:
    enough = answering(DRIVE, {CONTROL: last(CONTROL, PROMPT + 0.5)})
    nothing = answering(DRIVE, {})

    def answers(task):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        substituted = [one for one in task.interventions if hasattr(one, "selection")]
        is_whole = len(substituted) == 4 and all(one.selection.start == 0.0 for one in substituted)
        return (enough if not is_whole or is_enough_from_the_start else nothing)(task)

    dtest = asking(FakeEngine(answers))
    answer = responsible_component(dtest, DRIVE, TIME)
    assert answer.all_ideal is Outcome.SAFE
    component, messages = decisive(dtest, DRIVE, answer, TIME, TIME + 4.0, is_exact=True)
    assert is_by_luck(dtest, DRIVE, component, messages, TIME) is not is_enough_from_the_start


def test_an_ego_that_rests_in_one_state_up_to_its_chance_has_no_early_one() -> None:
    """With jitter the message that is named is the first of that state; the chance is there as long as the state."""
    record = drive(duration=20.0, violations=(collision(TIME),))
    record.stations = [min(station, 80.0) for station in record.stations]
    dtest = asking(
        FakeEngine(answering(record, {PERCEPTION: record.first_at(PERCEPTION, TIME - 0.3)})), jitters=(0, 1, 2)
    )
    answer = responsible_component(dtest, record, TIME)
    component, messages = decisive(dtest, record, answer, TIME, TIME + 4.0, is_exact=False)
    assert TIME - messages.last_safe.time > PROMPT > TIME - messages.latest
    asked = len(dtest.probes)
    assert not is_by_luck(dtest, record, component, messages, TIME)
    assert len(dtest.probes) == asked


@pytest.mark.parametrize("is_enough_further_back", [True, False])
def test_of_control_it_is_asked_however_late_its_chance_was(*, is_enough_further_back: bool) -> None:
    enough = answering(DRIVE, {CONTROL: last(CONTROL, 0.4)})
    nothing = answering(DRIVE, {})

    def answers(task):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        starts = [one.selection.start for one in task.interventions if hasattr(one, "selection")]
        is_further = len(starts) == 4 and min(starts) < TIME - START - FURTHER + 0.1
        return (enough if not is_further or is_enough_further_back else nothing)(task)

    dtest = asking(FakeEngine(answers))
    answer = responsible_component(dtest, DRIVE, TIME)
    component, messages = decisive(dtest, DRIVE, answer, TIME, TIME + 4.0, is_exact=True)
    assert component is CONTROL
    assert is_by_luck(dtest, DRIVE, component, messages, TIME) is not is_enough_further_back


def test_with_jitter_none_is_later_than_another_within_one_state_of_an_ego_at_rest() -> None:
    record = drive(duration=20.0, violations=(collision(TIME),))
    record.stations = [min(station, 100.0) for station in record.stations]
    enough = {one: record.first_at(one, TIME - 2.0) for one in (LOCALIZATION, PERCEPTION)}
    dtest = asking(FakeEngine(answering(record, enough)), jitters=(0, 1, 2))
    answer = responsible_component(dtest, record, TIME)
    component, messages = decisive(dtest, record, answer, TIME, TIME + 4.0, is_exact=False)
    assert component is LOCALIZATION
    assert messages.last_safe.time == pytest.approx(START + 8.0)


@pytest.mark.parametrize("is_exact", [True, False])
@pytest.mark.parametrize("before", [0.0, 0.1, 0.4, 1.0])
def test_of_a_drive_that_ends_with_its_violation_nothing_later_is_asked(before: float, *, is_exact: bool) -> None:
    """With jitter by as much as the states cannot tell: from standstill to the end they are one."""
    violation = breach("no_progress", Category.MISSION, TIME)
    record = drive(duration=TIME - START, violations=(violation,))
    record.stations = [min(station, 100.0) for station in record.stations]
    enough = {one: record.first_at(one, TIME - before - CYCLE) for one in (PERCEPTION, PREDICTION)}
    jitters = (None,) if is_exact else (0, 1, 2)
    dtest = asking(FakeEngine(answering(record, enough)), jitters=jitters, is_mission=True)
    answer = responsible_component(dtest, record, TIME)
    assert decisive(dtest, record, answer, TIME, math.inf, is_exact=is_exact)[0] is PERCEPTION


def is_late_perception(substituted: dict[Component, Ideal]) -> bool:
    return set(substituted) == {PERCEPTION} and 0.7 < back_of(substituted) < 0.95


def is_sensing(substituted: dict[Component, Ideal]) -> bool:
    return set(substituted) == {LOCALIZATION, PERCEPTION}


def is_all_of_the_drive(substituted: dict[Component, Ideal]) -> bool:
    return len(substituted) == 4 and back_of(substituted) == TIME - START


def back_of(substituted: dict[Component, Ideal]) -> float:
    """How long before the violation a substitution begins [s]."""
    return TIME - START - min(ideal.selection.start for ideal in substituted.values())


@pytest.mark.parametrize(
    ("befores", "crashes", "said"),
    [
        ({LOCALIZATION: 0.95, PERCEPTION: 0.4}, is_late_perception, "ideal perception from"),
        ({PERCEPTION: 0.9, CONTROL: 0.3}, is_sensing, "ideal localization, perception from"),
        ({LOCALIZATION: PROMPT + 0.5}, is_all_of_the_drive, "prediction, control could not"),
    ],
)
def test_where_a_question_that_decides_could_not_be_told_nobody_is_named(
    befores: dict[Component, float], crashes: Callable[[dict[Component, Ideal]], bool], said: str
) -> None:
    enough = answering(DRIVE, {component: last(component, before) for component, before in befores.items()})

    def answers(task: Task) -> Glimpse | Failure:
        return CRASHED if ideals(task) and crashes(ideals(task)) else enough(task)

    found = attributed(DRIVE, answers)
    assert (found.verdict, found.message, found.messages) == (Verdict.UNRESOLVED, None, None)
    assert said in found.reason
    assert found.components is not None
    assert (found.components.verdict, found.components.component) == (Verdict.UNRESOLVED, None)
    assert set(found.components.alternatives) == set(befores)
    assert found.components.reason == found.reason
    assert Outcome.UNRESOLVED in [probe.outcome for probe in found.probes]
    assert attributed(DRIVE, enough).verdict is Verdict.COMPONENT


@pytest.mark.parametrize(("crashes_before", "named"), [(0.9, PERCEPTION), (0.1, None)])
def test_one_downstream_that_could_not_be_told_is_asked_by_the_last_chance(
    crashes_before: float, named: Component | None
) -> None:
    """It may have had a later one; where that cannot be told either, nobody is named."""
    enough = answering(DRIVE, {LOCALIZATION: last(LOCALIZATION, 0.95), PERCEPTION: last(PERCEPTION, 0.4)})

    def answers(task: Task) -> Glimpse | Failure:
        substituted = ideals(task)
        return CRASHED if set(substituted) == {PERCEPTION} and back_of(substituted) > crashes_before else enough(task)

    found = attributed(DRIVE, answers)
    assert found.components is not None
    assert found.components.singles[PERCEPTION] is Outcome.UNRESOLVED
    assert found.components.component is named
    assert (found.verdict is Verdict.UNRESOLVED) == (named is None)


@pytest.mark.parametrize(("late", "named"), [(SAFE, PERCEPTION), (VIOLATING, PREDICTION), (CRASHED, None)])
def test_one_upstream_that_could_not_be_told_is_asked_however_late(
    late: Glimpse | Failure, named: Component | None
) -> None:
    """Of perception, between localization that is named first and prediction that had a later chance."""
    enough = answering(DRIVE, {LOCALIZATION: last(LOCALIZATION, 0.95), PREDICTION: last(PREDICTION, 0.4)})

    def answers(task: Task) -> Glimpse | Failure:
        substituted = ideals(task)
        if set(substituted) == {PERCEPTION}:
            back = back_of(substituted)
            return CRASHED if back > 0.9 else VIOLATING if not 0.5 < back < 0.7 else late
        return VIOLATING if is_sensing(substituted) else enough(task)

    found = attributed(DRIVE, answers)
    assert found.components is not None
    assert found.components.singles[PERCEPTION] is Outcome.UNRESOLVED
    assert found.components.component is named


def test_a_question_on_which_nothing_depends_may_stay_open() -> None:
    """Of prediction, once perception upstream of it has turned out to be the same chance."""
    enough = answering(DRIVE, {PERCEPTION: last(PERCEPTION, 1.0 + CYCLE), PREDICTION: last(PREDICTION, 1.0)})

    def answers(task: Task) -> Glimpse | Failure:
        substituted = ideals(task)
        return CRASHED if set(substituted) == {PREDICTION} and 0.7 < back_of(substituted) < 0.95 else enough(task)

    found = attributed(DRIVE, answers)
    assert Outcome.UNRESOLVED in [probe.outcome for probe in found.probes]
    assert found.components is not None
    assert found.components.component is PERCEPTION


def test_the_latency_is_that_of_components_that_run_ten_times_a_second() -> None:
    assert CYCLE < LATENCY < 2.0 * CYCLE
