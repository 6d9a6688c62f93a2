"""Algorithm 1 from end to end, on an engine that answers from a formula."""

import pytest
from interventions.scenes import trajectory
from msgspec.structs import replace

from analysis.scenes import (
    CRASHED,
    FATAL,
    FAULTY,
    HIT,
    SAFE,
    SCENARIO,
    START,
    WALKER,
    FakeEngine,
    answering,
    attributed,
    breach,
    collision,
    drive,
    faulty_drive,
    glimpse,
    ideals,
    saying,
    unknown,
)
from dvca_sumo.analysis.attribution import (
    LEAST_SETTLE,
    PAST,
    SETTLE,
    AttributionStoppedError,
    Progress,
    Request,
    attribute,
)
from dvca_sumo.analysis.bisection import Outcome
from dvca_sumo.analysis.components import Verdict
from dvca_sumo.analysis.dtest import Probe, Question
from dvca_sumo.engine.processes import Failure
from dvca_sumo.engine.protocol import Glimpse, RunFailedError
from dvca_sumo.interventions import planted_fault
from dvca_sumo.messages import PREDICTION_TIMES, Component, MessageId, Trajectory
from dvca_sumo.record import Record
from dvca_sumo.run import StopRule, Task
from dvca_sumo.stack.reference import StackError
from dvca_sumo.truth import EgoTruth
from dvca_sumo.violations import Category, Ending

PERCEPTION, PREDICTION, CONTROL = Component.PERCEPTION, Component.PREDICTION, Component.CONTROL
UNTOLD = "the repeated run could not be told"


def test_a_clean_run_needs_no_probe() -> None:
    found = attributed(drive(), lambda _: pytest.fail("nothing is to be asked"))
    assert found.verdict is Verdict.NONE
    assert found.violation is None
    assert found.probes == ()
    assert found.planted is None


def test_a_run_without_a_violation_that_an_oracle_could_not_judge_is_not_called_clean() -> None:
    record = replace(drive(), judgements=(unknown("red_light"),))
    found = attributed(record, lambda _: SAFE)
    assert found.verdict is Verdict.UNRESOLVED
    assert "red_light" in found.reason
    assert "it was dark" in found.reason


@pytest.mark.parametrize(("kind", "verdict"), [("speed_limit", Verdict.COMPONENT), ("red_light", Verdict.UNRESOLVED)])
def test_what_could_not_be_told_of_the_factual_run_is_not_asked_of_others(kind: str, verdict: Verdict) -> None:
    """As of a limit that a variable sign sets on the road of both."""
    record = replace(faulty_drive(), judgements=(unknown("speed_limit"),))
    enough = answering(record, {PERCEPTION: FATAL})

    def answers(task: Task) -> Glimpse | Failure:
        answer = enough(task)
        assert isinstance(answer, Glimpse)
        return replace(answer, judgements=(*answer.judgements, unknown(kind)))

    assert attributed(record, answers).verdict is verdict


def test_the_responsible_component_and_its_message_are_found_and_proven() -> None:
    record = faulty_drive()
    found = attributed(record, answering(record, {PERCEPTION: FATAL}), faults=(FAULTY,))
    assert found.verdict is Verdict.COMPONENT
    assert found.components is not None
    assert found.components.component is PERCEPTION
    assert found.message is not None
    assert (found.message.component, found.message.index) == (PERCEPTION, FATAL)
    assert found.message.time == pytest.approx(START + 0.1 * FATAL)
    assert found.is_reproducible
    assert [probe.outcome for probe in found.evidence] == [Outcome.SAFE, Outcome.VIOLATES]
    indices = [probe.question.since.index for probe in found.evidence if probe.question.since is not None]
    assert indices == [FATAL, FATAL + 1]
    assert found.differences[0].text == "object ped missing; truth: 17.4 m ahead, 1.7 m right, standing"


def test_every_run_is_kept_in_order_and_the_first_repeats_the_factual_one() -> None:
    record = faulty_drive()
    heard: list[Probe] = []

    class Listening(Progress):
        def factual(self, record: Record) -> None:
            assert record.violations
            assert not heard

        def probe(self, probe: Probe) -> None:
            heard.append(probe)

    engine = FakeEngine(answering(record, {PERCEPTION: FATAL}), [record])
    found = attribute(engine, Request(SCENARIO, (FAULTY,)), Listening())
    assert [probe.id for probe in found.probes] == list(range(len(engine.tasks)))
    assert found.probes[0].question.ideal == ()
    assert sorted(heard, key=lambda probe: probe.id) == list(found.probes)
    assert all(task.interventions[0] == FAULTY for task in engine.tasks)


def test_the_factual_run_goes_on_for_a_minute_past_a_violation_and_one_prediction_horizon_past_a_contact() -> None:
    asked: list[Task] = []

    class Remembering(FakeEngine):
        def record(self, task: Task) -> Record:
            asked.append(task)
            return super().record(task)

    attribute(Remembering(lambda _: SAFE, [drive()]), Request(SCENARIO, (FAULTY,)), Progress())
    assert asked == [
        Task(SCENARIO, (FAULTY,), StopRule(after_violation=60.0, after_contact=float(PREDICTION_TIMES[-1])))
    ]


def test_a_witness_that_agrees_certifies_the_two_ends_and_the_whole_component() -> None:
    record = faulty_drive()
    answers = answering(record, {PERCEPTION: FATAL})
    found = attributed(record, answers, witness=answers)
    assert found.verdict is Verdict.COMPONENT
    assert [check.outcome for check in found.certificate] == [Outcome.SAFE, Outcome.VIOLATES, Outcome.SAFE]
    assert all(check.agrees for check in found.certificate)
    assert found.certificate[-1].question == Question((PERCEPTION,))


def test_where_the_witness_disagrees_nothing_is_concluded() -> None:
    record = faulty_drive()
    found = attributed(record, answering(record, {PERCEPTION: FATAL}), witness=answering(record, {}), faults=(FAULTY,))
    assert found.verdict is Verdict.UNRESOLVED
    assert "witness" in found.reason
    assert found.components is not None
    assert found.components.component is None
    assert found.message is None
    assert found.planted is not None
    assert not found.planted.component_success


def test_a_witness_of_plannings_fault_drives_with_all_components_ideal() -> None:
    record = drive([replace(WALKER, y=0.0)], violations=[HIT])
    found = attributed(record, answering(record, {}), witness=answering(record, {}))
    assert found.verdict is Verdict.PLANNING
    assert [check.outcome for check in found.certificate] == [Outcome.VIOLATES]


def test_without_a_conclusion_there_is_nothing_to_certify() -> None:
    record = faulty_drive()
    found = attributed(record, lambda _: CRASHED, witness=lambda _: pytest.fail("asked for nothing"))
    assert found.certificate == ()


def test_a_probe_is_safe_after_the_settle_time_and_for_missions_at_the_end_of_the_scenario() -> None:
    record = faulty_drive()
    engine = FakeEngine(answering(record, {PERCEPTION: FATAL}), [record])
    found = attribute(engine, Request(SCENARIO), Progress())
    (stop,) = {task.stop for task in engine.tasks}
    assert found.stop == stop
    assert (stop.after_violation, stop.at, stop.settled) == (0.0, HIT.time + SETTLE, HIT.time + LEAST_SETTLE)
    assert stop.place == pytest.approx(20.0 + 10.0 * (HIT.time - START) + PAST)
    late = faulty_drive(breach("destination_not_reached", Category.MISSION, START + 6.0))
    assert attributed(late, answering(late, {PERCEPTION: FATAL})).stop == StopRule(after_violation=0.0)


def test_several_sufficient_components_are_alternatives_to_the_most_upstream() -> None:
    record = faulty_drive()
    found = attributed(record, answering(record, {PERCEPTION: FATAL, PREDICTION: FATAL}))
    assert found.components is not None
    assert found.components.component is PERCEPTION
    assert found.components.alternatives == (PREDICTION,)


def test_planning_is_named_with_its_first_violating_message() -> None:
    record = drive([replace(WALKER, y=0.0)], violations=[HIT])
    found = attributed(record, answering(record, {}))
    assert found.verdict is Verdict.PLANNING
    assert found.message is not None
    assert found.message.component is Component.PLANNING
    assert found.message.time < HIT.time
    assert "driven as planned" in found.differences[0].text
    assert found.evidence == ()


def test_planning_without_a_violating_message_says_so() -> None:
    def stopping(who: EgoTruth) -> Trajectory:
        points = trajectory(who).points.copy()
        points[1:, 1], points[1:, 4] = points[0, 1] + 0.5, 0.0
        return Trajectory(who.time, points, "stop")

    record = drive(plan=stopping, violations=[HIT])
    found = attributed(record, answering(record, {}))
    assert found.verdict is Verdict.PLANNING
    assert found.message is None
    assert "no planning message" in found.reason


def test_what_no_single_component_prevents_is_unresolved() -> None:
    record = faulty_drive()

    def answers(task: Task) -> Glimpse:
        return SAFE if len(ideals(task)) == 4 else glimpse(HIT, steps=44)

    found = attributed(record, answers)
    assert found.verdict is Verdict.UNRESOLVED
    assert found.message is None
    assert found.is_reproducible


def test_a_run_that_does_not_repeat_is_not_reproducible_with_the_first_difference() -> None:
    record = faulty_drive()
    digests = [*record.digests[:13], *[b"other"] * 47]
    found = attributed(record, lambda _: glimpse(HIT, steps=99), again=[replace(record, digests=digests)])
    assert found.verdict is Verdict.NOT_REPRODUCIBLE
    assert not found.is_reproducible
    assert f"{START + 1.3:.1f} s" in found.reason
    assert found.components is None


def test_a_violation_at_the_departure_is_reproduced_though_nothing_was_driven_before() -> None:
    at_once = collision(START)
    found = attributed(faulty_drive(at_once), lambda _: glimpse(at_once))
    assert found.is_reproducible
    assert found.verdict is Verdict.PLANNING


def test_where_one_more_run_is_the_same_no_difference_is_made_up() -> None:
    record = faulty_drive()
    found = attributed(record, lambda _: glimpse(HIT, steps=99), again=[record])
    assert found.verdict is Verdict.NOT_REPRODUCIBLE
    assert "first at" not in found.reason


def test_a_repeated_run_that_ends_earlier_differs_from_there_on() -> None:
    record = faulty_drive()
    shorter = replace(record, digests=record.digests[:20])
    found = attributed(record, lambda _: glimpse(HIT, steps=99), again=[shorter])
    assert f"{START + 2.0:.1f} s" in found.reason


def test_a_run_from_time_0_that_differs_does_not_reproduce_what_a_copy_repeats() -> None:
    record = faulty_drive()
    answers = answering(record, {PERCEPTION: FATAL})
    assert attributed(record, answers, again=[record], from_start=True).verdict is Verdict.COMPONENT
    other = replace(record, digests=[*record.digests[:7], b"other", *record.digests[8:]])
    found = attributed(record, answers, again=[other], from_start=True)
    assert found.verdict is Verdict.NOT_REPRODUCIBLE
    assert f"first at {START + 0.7:.1f} s" in found.reason
    failed = attributed(record, answers, again=[StackError("planning raised ValueError")], from_start=True)
    assert (failed.verdict, failed.is_reproducible) == (Verdict.UNRESOLVED, True)
    assert failed.reason == f"{UNTOLD}: one more run failed: planning raised ValueError"


def test_the_same_run_without_the_violation_does_not_reproduce_it() -> None:
    found = attributed(faulty_drive(), lambda _: glimpse(steps=44))
    assert found.verdict is Verdict.NOT_REPRODUCIBLE
    assert "no violation" in found.reason


@pytest.mark.parametrize("error", [RunFailedError("killed"), StackError("planning raised ValueError")])
def test_when_the_run_that_should_show_the_difference_fails_that_is_said(error: Exception) -> None:
    found = attributed(faulty_drive(), lambda _: glimpse(HIT, steps=99), again=[error])
    assert found.verdict is Verdict.NOT_REPRODUCIBLE
    assert str(error) in found.reason


@pytest.mark.parametrize("repeats", [None, 3])
def test_a_repetition_that_crashes_does_not_tell_whether_it_is_reproducible(repeats: int | None) -> None:
    found = attributed(faulty_drive(), lambda _: CRASHED, repeats=repeats)
    assert (found.verdict, found.is_reproducible, found.components) == (Verdict.UNRESOLVED, True, None)
    assert found.reason.startswith(f"{UNTOLD}: killed by SIGSEGV")


def test_repetitions_of_which_no_outcome_has_most_do_not_tell_it_either() -> None:
    answers = iter((glimpse(HIT), SAFE))
    found = attributed(faulty_drive(), lambda _: next(answers), repeats=2)
    assert (found.verdict, found.is_reproducible) == (Verdict.UNRESOLVED, True)
    assert found.reason == f"{UNTOLD}: no outcome is that of most runs"


def test_with_jitter_the_premise_holds_when_most_runs_violate() -> None:
    record = faulty_drive()
    answers = answering(record, {PERCEPTION: FATAL})
    found = attributed(record, answers, faults=(FAULTY,), repeats=3)
    assert found.verdict is Verdict.COMPONENT
    assert found.message is not None
    assert found.planted is not None
    assert found.planted.message_success
    assert len(found.probes) % 3 == 0
    assert len({probe.jitter for probe in found.probes}) == len(found.probes)
    mostly_safe = iter((glimpse(HIT), SAFE, SAFE))
    assert attributed(record, lambda _: next(mostly_safe), repeats=3).verdict is Verdict.NOT_REPRODUCIBLE


@pytest.mark.parametrize("after", [0, 1, 3, 9])
def test_an_interruption_hands_out_what_was_found_until_then(after: int) -> None:
    record = faulty_drive()
    answers = answering(record, {PERCEPTION: FATAL})
    made: list[Glimpse | Failure] = []

    def interrupted(task: Task) -> Glimpse | Failure:
        if len(made) == after:
            raise KeyboardInterrupt
        made.append(answers(task))
        return made[-1]

    with pytest.raises(AttributionStoppedError) as caught:
        attributed(record, interrupted, faults=(FAULTY,))
    partial = caught.value.partial
    assert partial.reason.startswith("interrupted")
    assert partial.violation == HIT
    assert len(partial.probes) == after
    assert partial.message is None
    assert partial.verdict is Verdict.UNRESOLVED
    assert partial.planted is not None
    assert partial.planted.component is PERCEPTION
    if after == 9:  # all five of Algorithm 1, but not those that decide
        assert partial.components is not None
        assert partial.components.component is None
        assert partial.components.alternatives == (PERCEPTION,)
        assert "up to then: ideal perception alone" in partial.reason


def test_an_interruption_of_the_witness_leaves_the_answer_that_it_was_asked_about() -> None:
    record = faulty_drive()
    answers = answering(record, {PERCEPTION: FATAL})

    def interrupted(_: Task) -> Glimpse | Failure:
        raise KeyboardInterrupt

    with pytest.raises(AttributionStoppedError) as caught:
        attributed(record, answers, faults=(FAULTY,), witness=interrupted)
    partial = caught.value.partial
    assert partial.verdict is Verdict.COMPONENT
    assert partial.message is not None
    assert partial.certificate == ()
    assert partial.reason.endswith("interrupted before that was certified")


def test_a_planted_fault_is_found_when_component_and_message_are_its_own() -> None:
    record = faulty_drive()
    planted = attributed(record, answering(record, {PERCEPTION: FATAL}), faults=(FAULTY,)).planted
    assert planted is not None
    assert (planted.component, planted.component_success, planted.message_success) == (PERCEPTION, True, True)
    assert planted.message_distance == 0.0
    assert planted.altered == tuple(range(10, 60))


def test_a_message_beside_those_that_the_fault_altered_misses_by_a_time() -> None:
    record = faulty_drive()
    planted = attributed(record, answering(record, {PERCEPTION: 7}), faults=(FAULTY,)).planted
    assert planted is not None
    assert (planted.component_success, planted.message_success) == (True, False)
    assert planted.message_distance == pytest.approx(0.3)


def test_another_component_than_the_planted_one_is_a_miss() -> None:
    record = faulty_drive()
    planted = attributed(record, answering(record, {CONTROL: 290}), faults=(FAULTY,)).planted
    assert planted is not None
    assert (planted.component_success, planted.message_success) == (False, False)
    assert planted.message_distance is None


def test_of_several_planted_faults_the_one_of_the_named_component_counts() -> None:
    record = faulty_drive()
    faults = (planted_fault("control.longitudinal"), FAULTY)
    planted = attributed(record, answering(record, {PERCEPTION: FATAL}), faults=faults).planted
    assert planted is not None
    assert planted.component is PERCEPTION
    assert planted.component_success


def test_a_planted_fault_that_does_no_harm_tells_what_it_altered() -> None:
    record = drive()
    record.altered[PERCEPTION] = [3, 4]
    planted = attributed(record, lambda _: SAFE, faults=(FAULTY,)).planted
    assert planted is not None
    assert planted.altered == (3, 4)
    assert not planted.component_success


def test_the_contact_and_not_the_close_call_before_it_is_explained() -> None:
    close = breach("ttc", Category.SAFETY, START + 4.0, "person:ped")
    record = faulty_drive(close, HIT)
    assert attributed(record, answering(record, {PERCEPTION: FATAL})).violation == HIT
    assert collision(START).kind == "collision"


@pytest.mark.parametrize("before", [1.0, 30.0])
def test_who_could_have_saved_the_ego_from_a_missing_plan_is_not_to_blame(before: float) -> None:
    """Unless the plan was missing long before anybody's last chance."""
    record = drive([WALKER], duration=44.0, violations=[collision(START + 40.0, "person:ped")], ending=Ending.CUT)
    missing = record.first_at(Component.PLANNING, START + 40.0 - before)
    record = saying(record, MessageId(Component.PLANNING, missing), None)
    enough = answering(record, {Component.PREDICTION: record.first_at(Component.PREDICTION, START + 39.0)})
    found = attributed(record, enough)
    assert found.components is not None
    assert found.components.alternatives == ((Component.PREDICTION,) if before == 1.0 else ())
    if before == 1.0:
        assert found.verdict is Verdict.PLANNING
        assert found.message == record.mark(MessageId(Component.PLANNING, missing))
        assert found.components.all_ideal is Outcome.SAFE
    else:
        assert found.components.component is Component.PREDICTION
