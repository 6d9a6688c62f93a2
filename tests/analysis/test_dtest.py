from collections.abc import Sequence

import pytest

from analysis.scenes import (
    CRASHED,
    SAFE,
    SCENARIO,
    START,
    STOP,
    VIOLATING,
    Answers,
    FakeEngine,
    asking,
    breach,
    collision,
    drive,
    first_substituted,
    glimpse,
    ideals,
    unknown,
)
from dvca_sumo.analysis.bisection import Outcome
from dvca_sumo.analysis.dtest import Dtest, Probe, Question, Setting, majority
from dvca_sumo.engine.processes import Failure
from dvca_sumo.engine.protocol import Glimpse
from dvca_sumo.interventions import Futures, Selection, planted_fault
from dvca_sumo.messages import Component, MessageId
from dvca_sumo.violations import Category

LOCALIZATION, PERCEPTION, CONTROL = Component.LOCALIZATION, Component.PERCEPTION, Component.CONTROL
DRIVE = drive(duration=2.0)
MARK = DRIVE.mark(MessageId(PERCEPTION, 12))


def only(component: Component) -> Answers:
    """Safe with this component ideal."""
    return lambda task: SAFE if component in ideals(task) else VIOLATING


def in_turn(answers: Sequence[Glimpse | Failure]) -> Answers:
    """Of the runs of one question."""
    left = list(answers)
    return lambda _: left.pop(0)


def test_a_question_that_was_asked_costs_nothing_more() -> None:
    engine = FakeEngine(only(PERCEPTION))
    dtest = asking(engine)
    assert [dtest.ask(Question((PERCEPTION,))) for _ in range(3)] == [Outcome.SAFE] * 3
    assert dtest.ask_all([Question((CONTROL,)), Question((PERCEPTION,)), Question((CONTROL,))]) == [
        Outcome.VIOLATES,
        Outcome.SAFE,
        Outcome.VIOLATES,
    ]
    assert len(engine.tasks) == len(dtest.probes) == 2


def test_the_same_component_from_another_message_on_is_another_question() -> None:
    engine = FakeEngine(only(PERCEPTION))
    dtest = asking(engine)
    dtest.ask_all([Question((PERCEPTION,)), Question((PERCEPTION,), MARK)])
    assert len(engine.tasks) == 2


def test_with_jitter_two_messages_of_one_state_are_the_same_question() -> None:
    first, second = (DRIVE.mark(MessageId(PERCEPTION, index)) for index in (12, 13))
    assert first.state == second.state
    exact, jittered = FakeEngine(only(PERCEPTION)), FakeEngine(only(PERCEPTION))
    for engine, jitters in ((exact, (None,)), (jittered, (0,))):
        dtest = asking(engine, jitters=jitters)
        dtest.ask_all([Question((PERCEPTION,), first), Question((PERCEPTION,), second)])
        dtest.ask(Question((PERCEPTION,), second))
        assert dtest.evidence(Question((PERCEPTION,), second)) is dtest.probes[-1]
    assert (len(exact.tasks), len(jittered.tasks)) == (2, 1)


def test_what_is_known_of_a_component_alone_is_known_by_message() -> None:
    dtest = asking(FakeEngine(only(PERCEPTION)))
    dtest.ask_all([Question((PERCEPTION,)), Question((PERCEPTION,), MARK), Question((LOCALIZATION,), MARK)])
    dtest.ask(Question((LOCALIZATION, CONTROL)))
    assert dtest.known(PERCEPTION) == {0: Outcome.SAFE, 12: Outcome.SAFE}
    assert dtest.known(LOCALIZATION) == {12: Outcome.VIOLATES}
    assert dtest.known(CONTROL) == {}


def test_probe_ids_follow_the_order_of_the_questions_not_of_their_finishing() -> None:
    heard: list[Probe] = []
    engine = FakeEngine(only(PERCEPTION))
    dtest = Dtest(engine, Setting(SCENARIO, (), Futures(), STOP, START, False, (None,)), heard.append)
    questions = [Question((component,)) for component in (LOCALIZATION, PERCEPTION, CONTROL)]
    dtest.ask(questions[0])
    dtest.ask_all(questions)
    assert [probe.id for probe in dtest.probes] == [0, 1, 2]
    assert [probe.question for probe in dtest.probes] == questions
    assert [probe.id for probe in heard] == [0, 2, 1]  # as they finished
    assert sorted(heard, key=lambda probe: probe.id) == dtest.probes


def test_a_run_is_the_faults_then_the_substitutes_stopped_at_the_first_violation_or_when_settled() -> None:
    engine, fault = FakeEngine(only(PERCEPTION)), planted_fault("perception.miss")
    dtest = Dtest(engine, Setting(SCENARIO, (fault,), Futures(), STOP, START, False, (None,)), lambda _: None)
    dtest.ask(Question((LOCALIZATION, PERCEPTION), MARK))
    (task,) = engine.tasks
    assert task.interventions[0] == fault
    assert [one.component for one in task.interventions[1:]] == [LOCALIZATION, PERCEPTION]
    assert task.stop == STOP
    assert task.jitter is None


def test_exact_runs_substitute_from_the_very_message_jittered_ones_from_its_state() -> None:
    exact, jittered = FakeEngine(only(PERCEPTION)), FakeEngine(only(PERCEPTION))
    asking(exact).ask(Question((LOCALIZATION, PERCEPTION), MARK))
    asking(jittered, jitters=(0, 1, 2)).ask(Question((PERCEPTION,), MARK))
    substituted = ideals(exact.tasks[0])
    assert first_substituted(DRIVE, substituted[PERCEPTION]) == 12
    assert first_substituted(DRIVE, substituted[LOCALIZATION]) == 120
    assert [ideals(task)[PERCEPTION].selection for task in jittered.tasks] == [Selection(from_state=MARK.state)] * 3


@pytest.mark.parametrize(
    ("answers", "outcome"),
    [
        ((SAFE, SAFE, VIOLATING), Outcome.SAFE),
        ((VIOLATING, SAFE, VIOLATING), Outcome.VIOLATES),
        ((SAFE, CRASHED, CRASHED), Outcome.UNRESOLVED),
        ((SAFE, VIOLATING, CRASHED), Outcome.UNRESOLVED),
        ((SAFE, SAFE, VIOLATING, VIOLATING), Outcome.UNRESOLVED),
        ((SAFE, SAFE, VIOLATING, CRASHED), Outcome.UNRESOLVED),
        ((SAFE,), Outcome.SAFE),
    ],
)
def test_more_than_half_of_the_repeats_decide(answers: Sequence[Glimpse | Failure], outcome: Outcome) -> None:
    dtest = asking(FakeEngine(in_turn(answers)), jitters=tuple(range(len(answers))))
    assert dtest.ask(Question((PERCEPTION,))) is outcome
    assert len(dtest.probes) == len(answers)


def test_the_majority_of_one_is_that_one() -> None:
    assert [majority([outcome]) for outcome in Outcome] == list(Outcome)


def test_a_crash_is_unresolved_with_its_reason_and_last_words() -> None:
    dtest = asking(FakeEngine(lambda _: CRASHED))
    assert dtest.ask(Question((PERCEPTION,))) is Outcome.UNRESOLVED
    (probe,) = dtest.probes
    assert "SIGSEGV" in probe.reason
    assert "boom" in probe.reason
    assert probe.digest is None


def test_a_run_that_an_oracle_could_not_judge_is_unresolved_and_says_which() -> None:
    dtest = asking(FakeEngine(lambda _: glimpse(judgements=[unknown("red_light")])))
    assert dtest.ask(Question((PERCEPTION,))) is Outcome.UNRESOLVED
    assert "red_light" in dtest.probes[0].reason
    assert "it was dark" in dtest.probes[0].reason


def test_a_violation_counts_even_if_another_oracle_could_not_judge() -> None:
    answer = glimpse(collision(START + 4.0), judgements=[unknown("red_light")])
    assert asking(FakeEngine(lambda _: answer)).ask(Question((PERCEPTION,))) is Outcome.VIOLATES


def test_a_violation_of_another_kind_violates_and_is_recorded_as_such() -> None:
    other = breach("speed_limit", Category.TRAFFIC_RULE, START + 3.0)
    dtest = asking(FakeEngine(lambda _: glimpse(other, collision(START + 4.0))))
    assert dtest.ask(Question((PERCEPTION,))) is Outcome.VIOLATES
    assert dtest.probes[0].violation == other


@pytest.mark.parametrize("kind", ["destination", "a users own"])
def test_an_unfinished_drive_leaves_only_mission_questions_open(kind: str) -> None:
    engine = FakeEngine(lambda _: glimpse(judgements=[unknown(kind, needs_end=True)]))
    assert asking(engine).ask(Question((PERCEPTION,))) is Outcome.SAFE
    assert asking(engine, is_mission=True).ask(Question((PERCEPTION,))) is Outcome.UNRESOLVED


def test_the_evidence_of_a_question_is_a_probe_that_agrees_with_its_answer() -> None:
    dtest = asking(FakeEngine(in_turn((VIOLATING, SAFE, SAFE))), jitters=(0, 1, 2))
    question = Question((PERCEPTION,))
    assert dtest.evidence(question) is None
    dtest.ask(question)
    evidence = dtest.evidence(question)
    assert evidence is dtest.probes[1]


def test_without_an_agreeing_probe_the_first_one_is_the_evidence() -> None:
    dtest = asking(FakeEngine(in_turn((VIOLATING, SAFE))), jitters=(0, 1))
    assert dtest.ask(Question((PERCEPTION,))) is Outcome.UNRESOLVED
    assert dtest.evidence(Question((PERCEPTION,))) is dtest.probes[0]


def test_the_premise_is_a_question_without_substitutes_and_counts_as_a_probe() -> None:
    engine = FakeEngine(lambda _: VIOLATING)
    dtest = asking(engine)
    assert dtest.ask(Question(())) is Outcome.VIOLATES
    assert engine.tasks[0].interventions == ()
    assert [probe.id for probe in dtest.probes] == [0]


def test_with_jitter_schedule_and_noise_are_drawn_anew_for_each_run_and_the_same_whatever_was_asked_before() -> None:
    questions = [Question(()), Question((PERCEPTION,)), Question((PERCEPTION,), MARK), Question((LOCALIZATION,))]
    first, second = (FakeEngine(only(PERCEPTION)) for _ in range(2))
    asking(first, jitters=(0, 1, 2)).ask_all(questions)
    asking(second, jitters=(0, 1, 2)).ask_all(questions[::-1])
    drawn = [task.jitter for task in first.tasks]
    assert len({0, *drawn}) == 1 + 3 * len(questions)  # 0 is the factual run's
    assert sorted(map(str, drawn)) == sorted(str(task.jitter) for task in second.tasks)
    assert {task.seed for task in first.tasks} == {task.seed for task in second.tasks}
