"""The baselines: each answers where its idea reaches, and fails where it does not."""

import json
from collections.abc import Callable, Iterable
from itertools import pairwise
from pathlib import Path

import pytest
from analysis.scenes import (
    CRASHED,
    FATAL,
    HIT,
    SAFE,
    SCENARIO,
    START,
    VIOLATING,
    WALKER,
    Answers,
    FakeEngine,
    answering,
    drive,
    faulty_drive,
    ideals,
    saying,
)
from click.testing import CliRunner
from interventions.scenes import Thing, predicted, tracked
from msgspec.structs import replace

from bench.scores import score
from dvca_sumo import api
from dvca_sumo.analysis.attribution import Request
from dvca_sumo.bench import benchmark, runs
from dvca_sumo.bench.baselines import BASELINES, available_baselines, delta_debugging
from dvca_sumo.bench.baselines.delta_debugging import BUDGET, ddmin, substitutes
from dvca_sumo.bench.baselines.observation import most_deviating
from dvca_sumo.bench.baselines.paper_procedure import algorithm_1
from dvca_sumo.bench.baselines.procedure import Baseline, Reply, Situation
from dvca_sumo.bench.baselines.scoring import baseline_scores
from dvca_sumo.bench.baselines.whole_runs import whole_runs
from dvca_sumo.bench.cases import Case, injected_cases
from dvca_sumo.bench.runs import Setting, analysis_of
from dvca_sumo.bench.score import BaselineScore, Score
from dvca_sumo.bench.tables import json_of, terminal_text
from dvca_sumo.cli import benching
from dvca_sumo.interventions import Ideal
from dvca_sumo.messages import COMPONENTS, Component, ControlCommand, MessageId
from dvca_sumo.record import Record
from dvca_sumo.run import Task
from dvca_sumo.store import Store

LOCALIZATION, PERCEPTION, PREDICTION, PLANNING, CONTROL = COMPONENTS
BEFORE = 45  # 10 Hz messages up to the hit, 4.4 s after the departure


def situation(
    record: Record,
    answers: Answers = lambda _task: VIOLATING,
    *,
    healthy: Record | None = None,
    defective: Component = PERCEPTION,
    repeats: int | None = None,
) -> tuple[Situation, FakeEngine]:
    engine = FakeEngine(answers)
    driven = api.FactualDrive(Request(SCENARIO, (), repeats), engine, record)
    return Situation(driven, HIT, healthy or drive([WALKER]), defective), engine


def replied(explain: Callable[[Situation], Reply], record: Record, answers: Answers, **more: object) -> Reply:
    return explain(situation(record, answers, **more)[0])  # type: ignore[arg-type]


# Observation only


def test_observation_names_the_component_that_alone_deviates() -> None:
    found = most_deviating(situation(faulty_drive())[0])
    assert found.component is PERCEPTION
    assert found.message is not None
    assert found.message.index in faulty_drive().altered[PERCEPTION]
    assert (found.probes, found.simulated) == (0, 0.0)


def test_observation_blames_whoever_deviates_most_though_it_only_reacts() -> None:
    late = MessageId(CONTROL, 400)
    braking = saying(faulty_drive(), late, ControlCommand(START + 4.0, -8.0, 0.0))
    assert most_deviating(situation(braking)[0]).component is CONTROL


def test_observation_takes_no_heed_of_what_follows_the_violation() -> None:
    after = saying(drive([WALKER], violations=[HIT]), MessageId(CONTROL, 500), ControlCommand(START + 5.0, -8.0, 0.0))
    assert most_deviating(situation(after)[0]).component is PLANNING


def test_observation_names_planning_when_all_others_are_as_ever() -> None:
    found = most_deviating(situation(drive([WALKER], violations=[HIT]))[0])
    assert found.component is PLANNING
    assert found.message is None


def test_what_is_usual_in_the_healthy_drive_is_no_deviation() -> None:
    blind = faulty_drive()
    assert most_deviating(situation(blind, healthy=blind)[0]).component is PLANNING


def test_observation_sees_wrong_futures() -> None:
    mover = Thing("lead", 60.0, 0.0, (8.0, 0.0))
    stopped = replace(mover, x=76.0, speed=(0.0, 0.0))
    right = drive([mover], violations=[HIT])
    wrong = saying(right, MessageId(PREDICTION, 20), predicted([stopped], START + 2.0))
    found = most_deviating(situation(wrong, healthy=right)[0])
    assert found.component is PREDICTION
    assert found.message is not None
    assert found.message.index == 20


def test_observation_sees_an_object_that_is_not_there() -> None:
    right = drive([WALKER], violations=[HIT])
    ghost = saying(right, MessageId(PERCEPTION, 20), tracked([WALKER, Thing("ghost", 60.0, 0.0)], START + 2.0))
    found = most_deviating(situation(ghost, healthy=right)[0])
    assert found.component is PERCEPTION


def test_messages_that_were_not_published_shift_no_other() -> None:
    silent = saying(drive([WALKER], violations=[HIT]), MessageId(PERCEPTION, 0), None)
    blind = saying(silent, MessageId(PERCEPTION, 20), tracked([], START + 2.0))
    found = most_deviating(situation(blind)[0])
    assert found.message is not None
    assert found.message.index == 20


def test_observation_misses_an_object_far_from_where_it_is_said_to_be() -> None:
    right = drive([WALKER], violations=[HIT])
    far = saying(right, MessageId(PERCEPTION, 20), tracked([replace(WALKER, x=WALKER.x + 16.0)], START + 2.0))
    assert most_deviating(situation(far, healthy=right)[0]).component is PERCEPTION


# Whole-run substitution


def test_whole_runs_name_the_component_and_no_message() -> None:
    record = faulty_drive()
    asked, engine = situation(record, answering(record, {PERCEPTION: FATAL}))
    found = whole_runs(asked)
    assert found.component is PERCEPTION
    assert found.message is None
    assert found.probes == len(engine.tasks) == 5
    assert found.simulated == pytest.approx(5 * SAFE.simulated)
    assert all(ideal.selection.start == 0.0 for task in engine.tasks for ideal in ideals(task).values())


def test_whole_runs_name_planning_where_nothing_helps() -> None:
    assert replied(whole_runs, faulty_drive(), lambda _task: VIOLATING).component is PLANNING


def test_whole_runs_cannot_tell_of_two_that_act_together() -> None:
    def both(task: Task) -> object:
        return SAFE if {PERCEPTION, CONTROL} <= set(ideals(task)) else VIOLATING

    assert replied(whole_runs, faulty_drive(), both).component is None  # type: ignore[arg-type]


# The paper's procedure


def test_the_paper_names_the_first_message_of_the_last_safe_state() -> None:
    record = faulty_drive()
    found = replied(algorithm_1, record, answering(record, {PERCEPTION: FATAL, PREDICTION: FATAL}))
    assert found.component is PERCEPTION
    assert found.message is not None
    assert found.message.state == record.mark(MessageId(PERCEPTION, FATAL)).state
    assert found.message.index == FATAL - 1  # two messages lie in one state: the exact one is not singled out


def test_the_paper_replays_whole_drives_in_its_own_order() -> None:
    record = faulty_drive()
    asked, engine = situation(record, answering(record, {CONTROL: 0, LOCALIZATION: 0}))
    found = algorithm_1(asked)
    first, *others = engine.tasks
    assert set(ideals(first)) == {LOCALIZATION, PREDICTION, CONTROL}
    assert [set(ideals(task)) for task in others[:3]] == [{PERCEPTION}, {PREDICTION}, {CONTROL}]
    assert found.component is CONTROL  # localization, which would do as well, lies upstream: it is never asked
    assert all(task.stop.at == task.stop.settled == float("inf") for task in engine.tasks)
    assert found.probes == len(engine.tasks)


def test_the_paper_blames_planning_when_only_perception_would_have_helped_beside_the_others() -> None:
    def all_four(task: Task) -> object:
        return SAFE if len(ideals(task)) == 4 else VIOLATING

    assert replied(algorithm_1, faulty_drive(), all_four).component is PLANNING  # type: ignore[arg-type]


def test_the_paper_names_the_first_planning_message_that_breaks_the_specification() -> None:
    record = saying(drive([WALKER], violations=[HIT]), MessageId(PLANNING, 12), None)
    found = replied(algorithm_1, record, lambda _task: VIOLATING, defective=PLANNING)
    assert found.message is not None
    assert found.message.index == 12
    assert found.probes == 1


def test_the_paper_names_nobody_where_no_single_substitution_is_enough() -> None:
    def together(task: Task) -> object:
        return SAFE if len(ideals(task)) > 1 else VIOLATING

    found = replied(algorithm_1, faulty_drive(), together)  # type: ignore[arg-type]
    assert (found.component, found.message, found.probes) == (None, None, 5)


# Delta debugging


def chosen(task: Task, record: Record) -> set[int]:
    """Indices of the perception messages that a task replaces."""
    windows = [one.selection for one in task.interventions if isinstance(one, Ideal)]
    return {
        index
        for index, made in enumerate(record.executions[PERCEPTION])
        if any(window.start <= 0.01 * made.tick < window.end for window in windows)
    }


def needing(record: Record, needed: Iterable[int]) -> Answers:
    wanted = set(needed)
    return lambda task: SAFE if wanted <= chosen(task, record) else VIOLATING


def test_ddmin_finds_the_smallest_set_wherever_its_messages_lie() -> None:
    pytest.importorskip("picire")
    record = faulty_drive()
    asked, engine = situation(record, needing(record, {20, 33}))
    found = ddmin(asked)
    assert found.message is not None
    assert found.message.index == 33
    assert found.reason.startswith("2 messages")
    assert found.probes == len(engine.tasks) <= BUDGET
    assert all(one.selection.start > 0.0 for one in engine.tasks[-1].interventions if isinstance(one, Ideal))


def test_ddmin_gives_up_when_its_probes_are_spent() -> None:
    pytest.importorskip("picire")
    record = faulty_drive()
    found = replied(ddmin, record, needing(record, range(0, BEFORE, 2)))
    assert found.message is None
    assert "could not tell" in found.reason
    assert found.probes <= BUDGET


def test_ddmin_says_so_where_the_component_does_not_help_or_cannot_be_replaced() -> None:
    nothing = replied(ddmin, faulty_drive(), lambda _task: CRASHED)
    assert (nothing.message, nothing.probes) == (None, 1)
    planning = replied(ddmin, faulty_drive(), lambda _task: SAFE, defective=PLANNING)
    assert (planning.message, planning.probes) == (None, 0)


def test_ddmin_does_not_mix_up_messages_of_runs_that_differ() -> None:
    found = replied(ddmin, faulty_drive(), lambda _task: SAFE, repeats=3)
    assert (found.message, found.probes) == (None, 0)
    assert "jitter" in found.reason


@pytest.mark.parametrize("rows", [[], [0], [3, 4, 5], [0, 2, 4], [4, 5], list(range(BEFORE)), [BEFORE - 1]])
def test_exactly_the_chosen_messages_are_replaced_and_all_after_the_violation(rows: list[int]) -> None:
    record = faulty_drive()
    times = [0.1 * index for index in range(BEFORE)]
    made = tuple(substitutes(PERCEPTION, times, rows))
    assert chosen(Task(SCENARIO, made), record) == {*rows, *range(BEFORE, 60)}
    assert all(before.selection.end < after.selection.start for before, after in pairwise(made))


# Scores, tables, command


def scored(reply: Reply, altered: tuple[int, ...], *, component: bool = True, message: bool = True) -> BaselineScore:
    baseline = Baseline("some", "some idea", component, message, lambda _situation: reply)
    return baseline_scores([baseline], situation(faulty_drive())[0], altered)["some"]


def test_an_answer_is_held_against_the_altered_messages() -> None:
    mark = faulty_drive().mark(MessageId(PERCEPTION, 20))
    right = scored(Reply(PERCEPTION, mark, probes=3, simulated=7.0), (20, 21))
    assert (right.component_success, right.message_success, right.message_distance_s) == (True, True, 0.0)
    assert (right.probes, right.simulated_s) == (3, 7.0)
    beside = scored(Reply(PERCEPTION, mark), (25,))
    assert (beside.component_success, beside.message_success) == (True, False)
    assert beside.message_distance_s == pytest.approx(0.5)
    other = scored(Reply(CONTROL, faulty_drive().mark(MessageId(CONTROL, 20))), (20,))
    assert (other.component_success, other.message_success, other.message_distance_s) == (False, False, None)


def test_what_a_baseline_does_not_answer_is_neither_right_nor_wrong() -> None:
    mark = faulty_drive().mark(MessageId(PERCEPTION, 20))
    assert scored(Reply(PERCEPTION, mark), (20,), component=False).component_success is None
    assert scored(Reply(PERCEPTION), (20,), message=False).message_success is None


def beside(*, is_right: bool = True) -> dict[str, BaselineScore]:
    one = BaselineScore("perception", is_right, is_right, None, 4, 50.0, 9.0, "why")
    return {
        "observation": one,
        "whole-run": replace(one, message_success=None),
        "ddmin": replace(one, component_success=None),
    }


def test_the_table_has_ours_first_and_a_row_for_each_baseline() -> None:
    scores = [replace(score(), baselines=beside()), replace(score("b"), baselines=beside(is_right=False))]
    text = terminal_text(scores)
    rows = text[text.index("What each idea buys") :].splitlines()[2:6]
    assert [row.split("  ")[1] for row in rows] == ["this analysis", *(BASELINES[name].title for name in beside())]
    assert rows[0].count("2/2") == 2
    assert rows[1].count("1/2") == 2
    assert "names none" in rows[2]
    assert "is told" in rows[3]


def test_without_baselines_there_is_no_table_of_them() -> None:
    assert "What each idea buys" not in terminal_text([score()])


def test_baselines_are_part_of_the_result_and_of_what_is_kept(tmp_path: Path) -> None:
    whole = replace(score(), baselines=beside())
    Store(tmp_path / "s", Score).add("key", whole)
    assert Store(tmp_path / "s", Score).find("key") == whole
    result = json.loads(json.dumps(json_of([whole])))
    assert result["cases"][0]["baselines"]["ddmin"]["component_success"] is None
    assert [one["name"] for one in result["summary"][0]["procedures"]] == ["ours", *beside()]


def test_what_is_kept_without_baselines_does_not_answer_for_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Setting] = []

    def noting(cases, setting, jobs):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202, ARG001
        asked.extend(setting for _ in cases)
        yield from ((row, score(case.name)) for row, case in enumerate(cases))

    monkeypatch.setattr(benchmark, "analysed", noting)
    case = Case("injected", "a", "nets/cs1.sumocfg", PERCEPTION, fault="perception.miss")
    for setting in (Setting(), Setting(baselines=("paper",)), Setting(baselines=("paper",))):
        benchmark.run_benchmark([case], [setting], 1, Store(tmp_path / "s", Score), lambda *_: None)
    assert [setting.baselines for setting in asked if setting.baselines] == [("paper",)]


@pytest.fixture
def commanded(monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[list[Setting], str]]:
    """The settings that `dvca-sumo bench WORDS` asks for, and what it says on standard error."""

    def command(*words: str) -> tuple[list[Setting], str]:
        asked: list[Setting] = []

        def noting(_cases: object, settings: list[Setting], *_rest: object) -> list[Score]:
            asked.extend(settings)
            return [score()]

        monkeypatch.setattr(benching, "run_benchmark", noting)
        return asked, CliRunner().invoke(benching.bench, words).stderr

    return command


def test_without_picire_delta_debugging_is_left_out_and_its_extra_named(
    monkeypatch: pytest.MonkeyPatch, commanded: Callable[..., tuple[list[Setting], str]]
) -> None:
    monkeypatch.setattr(delta_debugging, "IS_AVAILABLE", False)
    (setting,), said = commanded("--baselines")
    assert setting.baselines == ("observation", "whole-run", "paper")
    (line,) = said.splitlines()
    assert "dvca-sumo[test]" in line
    (setting,), said = commanded()
    assert (setting.baselines, said) == ((), "")


def test_both_modes_have_them(commanded: Callable[..., tuple[list[Setting], str]]) -> None:
    settings, _ = commanded("--baselines", "--jitter")
    assert {one.baselines for one in settings} == {tuple(one.name for one in available_baselines())}
    assert [one.mode for one in settings] == ["exact", "jitter"]


def test_a_drive_without_violation_leaves_them_nothing_to_explain() -> None:
    clean = situation(drive([WALKER]))[0].drive
    case = Case("injected", "x", "nets/cs1.sumocfg", PERCEPTION, fault="perception.miss")
    setting = Setting(has_controls=False, baselines=tuple(BASELINES))
    found = runs.judged(case, setting, clean, api.attribute(clean), (1.0, 1.0)).baselines
    assert {one.component_success for one in found.values()} == {False, None}
    assert {one.message_success for one in found.values()} == {False, None}


# For real


def test_a_missed_pedestrian_as_each_one_explains_it() -> None:
    case = next(case for case in injected_cases() if case.name == "perception.miss/cs1")
    names = tuple(one.name for one in available_baselines())
    found = analysis_of(case, Setting(has_controls=False, baselines=names)).baselines
    assert set(found) == set(names)
    assert found["observation"].component is not None
    assert found["observation"].probes == 0
    assert (found["whole-run"].component, found["whole-run"].probes) == ("perception", 5)
    assert (found["paper"].component, found["paper"].message_success) == ("perception", True)
    assert found["paper"].simulated_s > found["whole-run"].simulated_s
    if "ddmin" in found:
        assert found["ddmin"].message_success
        assert 0 < found["ddmin"].probes <= BUDGET
