"""Random faults: the same for everyone, sound by construction, and remembered."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import msgspec
import pytest
from command_line import assert_one_error, typed
from small_scenarios import scenario_file

from dvca_sumo import api
from dvca_sumo.analysis.attribution import Attribution
from dvca_sumo.bench import random_faults
from dvca_sumo.bench.cases import Case
from dvca_sumo.bench.places import BUILT_IN, HealthyDrive, healthy_drives, places_of
from dvca_sumo.bench.random_faults import Drawing, drawn_case, is_violating, random_scores
from dvca_sumo.bench.runs import Setting
from dvca_sumo.bench.score import Score, failed
from dvca_sumo.cli import ExitCode
from dvca_sumo.interventions import fault_library, planted_fault
from dvca_sumo.messages import Component
from dvca_sumo.scenario import ScenarioError
from dvca_sumo.store import Store

SETTING = Setting(has_controls=False)
DRIVES = [HealthyDrive(place, "", 40.0, ("lead", "person:walker")) for place in BUILT_IN]


def _ignored(*_words: object) -> None:
    """Hear of nothing."""


# Drawing.


def test_a_draw_depends_on_seed_and_number_alone() -> None:
    forwards = [drawn_case(7, number, DRIVES) for number in range(50)]
    backwards = [drawn_case(7, number, DRIVES) for number in reversed(range(50))]
    assert forwards == backwards[::-1]
    assert len({case.fault for case in forwards}) == 50
    assert [drawn_case(8, number, DRIVES).fault for number in range(50)] != [case.fault for case in forwards]


def test_draws_are_what_they_were_on_every_other_machine() -> None:
    assert drawn_case(1, 2, DRIVES).fault == "control.lateral:start=12.4,end=22.2,error=-0.875"


def test_every_drawn_fault_can_be_planted_in_its_component() -> None:
    for number in range(1000):
        case = drawn_case(1, number, DRIVES)
        fault = planted_fault(case.fault)
        assert fault.component is case.component
        assert 0.0 <= fault.selection.start < fault.selection.end <= 40.4


def test_draws_reach_the_whole_library_and_both_signs() -> None:
    faults = [planted_fault(drawn_case(1, number, DRIVES).fault) for number in range(1000)]
    assert {fault.name for fault in faults} == set(fault_library())
    errors = [float(fault.parameters["error"]) for fault in faults if fault.name == "control.longitudinal"]
    assert min(errors) < -1.0 < 1.0 < max(errors)
    assert min(map(abs, errors)) < 1.0
    assert {fault.parameters.get("object") for fault in faults} == {None, "in_way", "all", "lead", "person:walker"}


def test_a_drive_that_met_nobody_names_no_object() -> None:
    alone = [HealthyDrive(BUILT_IN[0], "", 10.0, ())]
    faults = [planted_fault(drawn_case(1, number, alone).fault) for number in range(200)]
    assert {fault.parameters.get("object") for fault in faults} == {None, "in_way", "all"}


# Which draws count, when the answers are known beforehand.


def _canned(monkeypatch: pytest.MonkeyPatch, violating: Callable[[int], bool], at_once: int) -> list[int]:
    """Let the draws for which `violating` holds violate, the last begun of `at_once` being told first."""
    asked: list[int] = []

    def analysed(cases: Iterable[Case], setting: Setting, jobs: int) -> Iterator[tuple[int, Score]]:  # noqa: ARG001
        waiting = iter(enumerate(cases))
        while True:
            group = [pair for pair in (next(waiting, None) for _ in range(at_once)) if pair is not None]
            for row, case in reversed(group):
                number = int(case.name.rpartition("#")[2])
                asked.append(number)
                score = msgspec.structs.replace(failed(case, None, 0, ""), verdict="component", altered_share=0.5)
                yield row, msgspec.structs.replace(score, violation="collision" if violating(number) else None)
            if len(group) < at_once:
                return

    monkeypatch.setattr(random_faults, "analysed", analysed)
    return asked


def _numbers(scores: list[Score]) -> list[int]:
    return [int(score.name.rpartition("#")[2]) for score in scores]


@pytest.mark.parametrize("at_once", [1, 2, 5])
def test_the_first_violating_draws_are_kept_however_many_run_at_once(
    monkeypatch: pytest.MonkeyPatch, at_once: int
) -> None:
    asked = _canned(monkeypatch, lambda number: number % 3 == 1, at_once)
    scores, drawn = random_scores(Drawing(1, 3), DRIVES, SETTING, at_once, None, _ignored)
    assert _numbers(scores) == [1, 4, 7]
    assert drawn == 8
    assert len(asked) < 8 + at_once


def test_drawing_stops_when_nothing_violates_any_more(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = _canned(monkeypatch, lambda number: number == 4, 1)
    scores, drawn = random_scores(Drawing(1, 2), DRIVES, SETTING, 1, None, _ignored)
    assert _numbers(scores) == [4]
    assert drawn == len(asked) == 5 + random_faults.PATIENCE


@pytest.mark.parametrize("at_once", [1, 5])
def test_what_is_told_is_all_of_it_only_when_drawing_is_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at_once: int
) -> None:
    """Who is interrupted before has heard of fewer than asked for; what is known already is told again."""
    asked = _canned(monkeypatch, lambda number: number != 0, at_once)
    heard: list[bool] = []

    def hear(_score: Score, left: int, is_new: bool) -> None:  # noqa: FBT001
        heard.append(is_new)
        assert left == max(wanted - len(heard), 0)
        assert left > 0 or set(asked) >= set(range(wanted + 1))

    for wanted in (2, 9):
        heard.clear()
        store = Store(tmp_path / "scores", Score)
        scores, _ = random_scores(Drawing(1, wanted), DRIVES, SETTING, at_once, store, hear)
        assert _numbers(scores) == list(range(1, wanted + 1))
        assert wanted - 1 <= len(heard) <= wanted
    assert (heard[0], heard[-1]) == (False, True)


def test_a_draw_that_could_not_be_run_is_a_case_and_wrong() -> None:
    score = failed(drawn_case(1, 0, DRIVES), None, 0, "the process died of SIGSEGV")
    assert is_violating(score)
    assert not score.component_success


# On a real, small drive.


def _never(drive: api.FactualDrive) -> Attribution:
    raise AssertionError(f"{drive.request} was analysed again")


def test_kept_faults_violate_and_nothing_is_run_twice(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path / "scenario", street)
    drives = Store(tmp_path / "drives", HealthyDrive)
    healthy = healthy_drives(places_of(config, None, None), SETTING, 2, drives)
    assert [drive.complaint for drive in healthy] == [""]
    scores, drawn = random_scores(Drawing(6, 2), healthy, SETTING, 2, Store(tmp_path / "scores", Score), _ignored)
    assert len(scores) == 2
    for score in scores:
        words = score.command.split()
        again = api.drive(api.load_scenario(config), [words[words.index("--fault") + 1]])
        again.engine.close()
        assert again.record.violations
        assert again.record.altered[Component(score.expected_component)]

    store, seen = Store(tmp_path / "scores", Score), Store(tmp_path / "drives", HealthyDrive)
    broken = msgspec.structs.replace(SETTING, attribute=_never)
    assert healthy_drives(places_of(config, None, None), broken, 1, seen) == healthy
    assert random_scores(Drawing(6, 2), healthy, broken, 1, store, _ignored) == (scores, drawn)


def test_a_scenario_that_is_not_clean_by_itself_takes_no_faults(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path / "scenario", street, end="2")  # of a drive of 4 s
    with pytest.raises(ScenarioError, match="no drive is clean without a fault"):
        healthy_drives(places_of(config, None, None), SETTING, 1, None)


# Where.


def test_a_scenario_with_an_ego_is_one_place(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path, street)
    assert [(place.ego, place.begin) for place in places_of(config, None, None)] == [(None, None)]


def test_a_scenario_with_several_egos_is_no_place(tmp_path: Path, street: Path) -> None:
    mark = '<param key="dvca.ego" value="true"/>'
    two = "".join(f'<vehicle id="{name}" depart="0"><route edges="bc"/>{mark}</vehicle>' for name in "ab")
    with pytest.raises(ScenarioError, match=r"several vehicles are marked .*: a, b;"):
        places_of(scenario_file(tmp_path, street, two), None, None)


def test_without_an_ego_several_times_of_the_traffic_are_tried(tmp_path: Path, street: Path) -> None:
    flow = '<flow id="cars" from="bc" to="bc" begin="0" end="1200" period="10"/>'
    config = scenario_file(tmp_path, street, flow)
    places = places_of(config, None, None)
    assert {place.ego for place in places} == {"auto"}
    assert [place.begin for place in places] == [50.0 + 100.0 * row for row in range(12)]
    assert [place.begin for place in places_of(config, None, 300.0)] == [300.0]
    assert [(place.ego, place.begin) for place in places_of(config, "cars.3", None)] == [("cars.3", None)]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("nets/cs1.sumocfg",), "--random"),
        (("--seed", "3"), "--random"),
        (("--random", "3", "--suite", "injected"), "--suite"),
        (("--random", "3", "--ego", "auto"), "SUMOCFG"),
    ],
)
def test_words_that_do_not_go_together(words: tuple[str, ...], said: str) -> None:
    assert_one_error(typed("bench", *words), ExitCode.USAGE, said)
