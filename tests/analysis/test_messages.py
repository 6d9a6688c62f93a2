import math
from collections.abc import Callable

import pytest
from msgspec.structs import replace

from analysis.scenes import (
    CRASHED,
    SAFE,
    START,
    VIOLATING,
    Answers,
    FakeEngine,
    asking,
    collision,
    drive,
    first_substituted,
    ideals,
    needing,
)
from dvca_sumo.analysis.bisection import Outcome
from dvca_sumo.analysis.dtest import Dtest, Question
from dvca_sumo.analysis.messages import MessageAnswer, violation_inducing_message
from dvca_sumo.engine.processes import Failure
from dvca_sumo.engine.protocol import Glimpse
from dvca_sumo.interventions import State
from dvca_sumo.messages import Component, MessageId
from dvca_sumo.record import Record

PERCEPTION, CONTROL = Component.PERCEPTION, Component.CONTROL
DRIVE = drive()  # 60 perception messages, two or three in each state
CRASH = collision(START + 4.95)
LONG_DRIVE = drive(duration=40.0)
BEFORE_CRASH = 50  # perception messages 0 ... 49 were made before it


def found(
    record: Record, component: Component, answers: Answers, *, is_exact: bool = True
) -> tuple[MessageAnswer, Dtest]:
    engine = FakeEngine(answers)
    dtest = asking(engine, jitters=(None,) if is_exact else (0, 1, 2))
    assert dtest.ask(Question((component,))) is Outcome.SAFE
    return violation_inducing_message(dtest, record, component, CRASH.time, math.inf, is_exact=is_exact), dtest


def by_index(record: Record, answer: Callable[[int], Glimpse | Failure]) -> Answers:
    return lambda task: answer(first_substituted(record, ideals(task)[PERCEPTION]))


def ends(dtest: Dtest, answer: MessageAnswer) -> list[Outcome]:
    """The recorded outcomes that prove an answer."""
    evidence = [dtest.evidence(question) for question in answer.proof]
    assert all(probe is not None for probe in evidence)
    return [probe.outcome for probe in evidence if probe is not None]


@pytest.mark.parametrize("last", range(BEFORE_CRASH - 1))
def test_the_last_message_that_could_still_prevent_it_is_found_between_adjacent_proven_messages(last: int) -> None:
    answer, dtest = found(DRIVE, PERCEPTION, needing(DRIVE, PERCEPTION, last, CRASH))
    assert answer.last_safe.index == last
    assert answer.first_violating is not None
    assert answer.first_violating.index == last + 1
    assert answer.is_adjacent
    assert answer.is_monotone
    assert answer.note == ""
    assert ends(dtest, answer) == [Outcome.SAFE, Outcome.VIOLATES]


def test_when_even_the_last_message_before_the_violation_prevents_it_the_other_end_is_the_run_as_driven() -> None:
    answer, dtest = found(DRIVE, PERCEPTION, needing(DRIVE, PERCEPTION, BEFORE_CRASH - 1, CRASH))
    assert answer.last_safe.index == BEFORE_CRASH - 1
    assert answer.first_violating is None
    assert answer.is_adjacent
    assert ends(dtest, answer) == [Outcome.SAFE]


def test_messages_after_the_violation_are_no_candidates() -> None:
    answer, _ = found(DRIVE, PERCEPTION, needing(DRIVE, PERCEPTION, 999, CRASH))
    assert answer.last_safe.time <= CRASH.time


def test_marks_say_when_and_in_which_state_a_message_was_made() -> None:
    answer, _ = found(DRIVE, PERCEPTION, needing(DRIVE, PERCEPTION, 31, CRASH))
    assert answer.last_safe.time == pytest.approx(START + 3.1)
    assert answer.last_safe.state == State(25, 10, 0)  # 20 m + 31 m, at 10 m/s


@pytest.mark.parametrize("last", [0, 1, 777, 2000, 3998, 3999])
def test_four_thousand_messages_cost_at_most_sixteen_probes(last: int) -> None:
    crash = collision(START + 40.0)
    engine = FakeEngine(needing(LONG_DRIVE, CONTROL, last, crash))
    dtest = asking(engine)
    dtest.ask(Question((CONTROL,)))
    answer = violation_inducing_message(dtest, LONG_DRIVE, CONTROL, crash.time, math.inf, is_exact=True)
    assert len(LONG_DRIVE.executions[CONTROL]) == 4000
    assert answer.last_safe.index == last
    assert len(engine.tasks) <= 1 + 16


def test_what_is_known_already_is_where_the_search_begins() -> None:
    engine = FakeEngine(needing(DRIVE, PERCEPTION, 33, CRASH))
    dtest = asking(engine)
    dtest.ask_all([Question((PERCEPTION,), DRIVE.mark(MessageId(PERCEPTION, index))) for index in (20, 30, 35, 40)])
    answer = violation_inducing_message(dtest, DRIVE, PERCEPTION, CRASH.time, math.inf, is_exact=True)
    assert answer.last_safe.index == 33
    assert len(engine.tasks) <= 4 + math.ceil(math.log2(5)) + 2


def test_a_long_standstill_is_one_state_and_costs_its_own_logarithm_only() -> None:
    record = replace(LONG_DRIVE, stations=[min(station, 60.0) for station in LONG_DRIVE.stations])
    engine = FakeEngine(needing(record, CONTROL, 3000, CRASH))
    dtest = asking(engine)
    dtest.ask(Question((CONTROL,)))
    violation_inducing_message(dtest, record, CONTROL, START + 40.0, math.inf, is_exact=True)
    states, longest = 21, 3600
    rounds = math.ceil(math.log(states + 1, 3)) + math.ceil(math.log(longest + 1, 3))
    assert len(engine.tasks) <= 1 + 2 * rounds + 2


def test_messages_that_cannot_be_told_leave_a_gap_that_is_noted() -> None:
    answers = by_index(DRIVE, lambda index: SAFE if index < 30 else CRASHED if index < 33 else VIOLATING)
    answer, dtest = found(DRIVE, PERCEPTION, answers)
    assert answer.last_safe.index == 29
    assert answer.first_violating is not None
    assert answer.first_violating.index == 33
    assert not answer.is_adjacent
    assert "could not be told" in answer.note
    assert ends(dtest, answer) == [Outcome.SAFE, Outcome.VIOLATES]


@pytest.mark.parametrize("odd", [range(26, 28), range(32, 34)])
def test_an_outcome_that_is_not_monotone_where_it_was_asked_is_noticed_and_the_ends_stay_proven(odd: range) -> None:
    answers = by_index(DRIVE, lambda index: VIOLATING if (index >= 30) != (index in odd) else SAFE)
    dtest = asking(FakeEngine(answers))
    dtest.ask_all([Question((PERCEPTION,), DRIVE.mark(MessageId(PERCEPTION, index))) for index in (0, 26, 28, 31, 33)])
    answer = violation_inducing_message(dtest, DRIVE, PERCEPTION, CRASH.time, math.inf, is_exact=True)
    assert not answer.is_monotone
    assert "not monotone" in answer.note
    assert ends(dtest, answer) == [Outcome.SAFE, Outcome.VIOLATES]
    assert answer.is_adjacent


@pytest.mark.parametrize("last", range(BEFORE_CRASH - 1))
def test_with_jitter_the_search_ends_on_adjacent_states_and_names_the_first_message_of_the_safe_one(last: int) -> None:
    answer, dtest = found(DRIVE, PERCEPTION, needing(DRIVE, PERCEPTION, last, CRASH), is_exact=False)
    states = [DRIVE.stations[10 * index] // 2.0 for index in range(BEFORE_CRASH)]
    starts = [index for index in range(BEFORE_CRASH) if index == 0 or states[index] != states[index - 1]]
    low = max(start for start in starts if start <= last)
    high = min((start for start in starts if start > last), default=BEFORE_CRASH)
    assert answer.last_safe.index == low
    assert answer.latest == DRIVE.mark(MessageId(PERCEPTION, high - 1)).time
    assert (BEFORE_CRASH if answer.first_violating is None else answer.first_violating.index) == high
    assert answer.is_adjacent
    assert dtest.evidence(answer.proof[0]) is not None
    assert answer.proof[0] == Question((PERCEPTION,), answer.last_safe if low > 0 else None)
    assert ends(dtest, answer)[0] is Outcome.SAFE


def test_with_jitter_a_wait_is_named_where_it_begins_as_only_that_is_proven() -> None:
    waiting = replace(DRIVE, stations=[min(station, 40.0) for station in DRIVE.stations])
    answer, dtest = found(waiting, PERCEPTION, needing(waiting, PERCEPTION, 33, CRASH), is_exact=False)
    assert answer.last_safe.time == pytest.approx(START + 2.0)
    assert answer.latest == pytest.approx(START + 4.9)
    assert answer.first_violating is None
    assert [probe.outcome for probe in dtest.probes if probe.question == answer.proof[0]] == 3 * [Outcome.SAFE]


def test_with_jitter_each_question_is_repeated() -> None:
    _, dtest = found(DRIVE, PERCEPTION, needing(DRIVE, PERCEPTION, 20, CRASH), is_exact=False)
    questions = {probe.question for probe in dtest.probes}
    assert len(dtest.probes) == 3 * len(questions)


@pytest.mark.parametrize("last", range(BEFORE_CRASH - 1))
def test_with_jitter_a_state_that_is_met_again_does_not_turn_the_ends_around(last: int) -> None:
    trembling = drive(accelerations=lambda tick: 0.01 * (-1.0) ** (tick // 10))
    trembling.stations = [4.0 * (station // 4.0) for station in trembling.stations]
    answer, dtest = found(trembling, PERCEPTION, needing(trembling, PERCEPTION, last, CRASH), is_exact=False)
    high = BEFORE_CRASH if answer.first_violating is None else answer.first_violating.index
    first: dict[State, int] = {}
    for index in range(BEFORE_CRASH):
        first.setdefault(trembling.mark(MessageId(PERCEPTION, index)).state, index)
    assert high == min((index for index in first.values() if index > last), default=BEFORE_CRASH)
    assert answer.last_safe.index < high
    assert answer.is_monotone
    assert ends(dtest, answer) == [Outcome.SAFE, Outcome.VIOLATES][: len(answer.proof)]
