"""Interrupted and broken benchmarks: what is known stays known, what failed is tried again."""

import json
import os
import sys
from pathlib import Path

import pytest
from small_scenarios import scenario_file

from bench.scores import score
from dvca_sumo.api import REPEATS
from dvca_sumo.bench import benchmark
from dvca_sumo.bench.benchmark import run_benchmark
from dvca_sumo.bench.cases import Case, injected_cases, real_bug_cases
from dvca_sumo.bench.runs import Setting, analysed
from dvca_sumo.bench.score import FAILED, Score
from dvca_sumo.cli import ExitCode, benching, main
from dvca_sumo.messages import Component
from dvca_sumo.store import Store

CASES = [
    Case("injected", name, "nets/cs1.sumocfg", Component.PERCEPTION, fault="perception.miss")
    for name in ("a", "b", "c")
]


def ignore(*_words: object) -> None:
    """Nobody watches."""


def test_it_goes_on_where_it_was_interrupted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def dying_after_two(cases, setting, jobs):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202, ARG001
        for row, case in enumerate(cases):
            if len(asked) == 2:
                raise KeyboardInterrupt
            asked.append(case.name)
            yield row, score(case.name)

    monkeypatch.setattr(benchmark, "analysed", dying_after_two)
    with pytest.raises(KeyboardInterrupt):
        run_benchmark(CASES, [Setting()], 1, Store(tmp_path / "s", Score), ignore)
    asked.clear()
    found = run_benchmark(CASES, [Setting()], 1, Store(tmp_path / "s", Score), ignore)
    assert asked == ["c"]
    assert [one.name for one in found] == ["a", "b", "c"]


def test_a_case_that_failed_is_tried_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    verdicts = iter([FAILED, "component"])

    def failing_once(cases, setting, jobs):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202, ARG001
        yield 0, score("a", verdict=next(verdicts))

    monkeypatch.setattr(benchmark, "analysed", failing_once)
    for expected in (FAILED, "component"):
        (found,) = run_benchmark(CASES[:1], [Setting()], 1, Store(tmp_path / "s", Score), ignore)
        assert found.verdict == expected


def test_other_seeds_and_modes_are_other_questions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Setting] = []

    def noting(cases, setting, jobs):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202, ARG001
        asked.extend(setting for _ in cases)
        yield from ((row, score(case.name)) for row, case in enumerate(cases))

    monkeypatch.setattr(benchmark, "analysed", noting)
    settings = [Setting(), Setting(seed=2), Setting(repeats=3)]
    for _ in range(2):
        assert len(run_benchmark(CASES[:1], settings, 1, Store(tmp_path / "s", Score), ignore)) == 3
    assert asked == settings


def test_a_scenario_that_was_edited_is_another_question_and_a_touched_one_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def noting(cases, setting, jobs):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202, ARG001
        asked.extend(case.name for case in cases)
        yield from ((row, score(case.name)) for row, case in enumerate(cases))

    monkeypatch.setattr(benchmark, "analysed", noting)
    (tmp_path / "some.net.xml").write_text("<net/>")
    config = scenario_file(tmp_path, tmp_path / "some.net.xml")
    case = Case("injected", "own", str(config), Component.PERCEPTION, fault="perception.miss")
    for edit in (
        lambda: None,
        lambda: os.utime(config, (0.0, 0.0)),
        lambda: scenario_file(tmp_path, config, "<!-- -->"),
    ):
        edit()
        run_benchmark([case], [Setting()], 1, Store(tmp_path / "s", Score), ignore)
    assert asked == ["own", "own"]


def test_a_case_that_cannot_be_run_is_no_success_and_says_why() -> None:
    broken = Case("injected", "x", "nets/none.sumocfg", Component.CONTROL, fault="control.lateral")
    ((_, found),) = analysed([broken], Setting(), 1)
    assert found.verdict == FAILED
    assert not found.component_success
    assert "none.sumocfg" in found.reason
    assert found.command == "dvca-sumo run nets/none.sumocfg --fault control.lateral"


@pytest.mark.parametrize(
    ("repeats", "words"), [(None, ""), (REPEATS, " --jitter"), (REPEATS + 2, f" --jitter --repeats {REPEATS + 2}")]
)
def test_the_command_that_shows_a_case_repeats_as_often(repeats: int | None, words: str) -> None:
    broken = Case("injected", "x", "nets/none.sumocfg", Component.CONTROL, fault="control.lateral")
    ((_, found),) = analysed([broken], Setting(repeats=repeats), 1)
    assert found.command == f"dvca-sumo run nets/none.sumocfg --fault control.lateral{words}"
    assert found.mode == ("exact" if repeats is None else "jitter")


@pytest.mark.parametrize("form", ["text", "json"])
def test_interrupted_it_tells_what_it_has_found(
    form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def dying(cases, settings, jobs, store, on_score):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202, ARG001
        on_score(score("perception.miss/cs1"), 38, True)
        raise KeyboardInterrupt

    words = ["dvca-sumo", "bench", "-o", str(tmp_path), *(["--json"] if form == "json" else [])]
    monkeypatch.setattr(sys, "argv", words)
    monkeypatch.setattr(benching, "run_benchmark", dying)
    with pytest.raises(SystemExit) as left:
        main()
    said = capfd.readouterr()
    assert left.value.code == ExitCode.INTERRUPTED
    missing = len(injected_cases()) + len(real_bug_cases()) - 1
    told = f"NOT WHOLE: 1 of {missing + 1} cases, {missing} missing: interrupted"
    if form == "json":
        assert [case["name"] for case in json.loads(said.out)["cases"]] == ["perception.miss/cs1"]
        assert json.loads(said.out)["missing"] == missing
    else:
        assert said.out.startswith(f"{told}\n\nInjected faults, exact mode: 1 cases")
    assert (tmp_path / "benchmark.md").read_text().startswith(f"# Benchmark\n\n{told}\n")
    assert [line for line in said.err.splitlines() if line][-2:] == [told, "interrupted"]


def test_interrupted_it_tells_what_was_kept_before_as_well(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Whether it finds anything new or not, the page never holds less than it did."""
    more = iter([2, 0, 1])

    def dying(cases, setting, jobs):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202, ARG001
        yield from ((row, score(case.name)) for row, case in zip(range(next(more)), cases, strict=False))
        raise KeyboardInterrupt

    monkeypatch.setattr(benchmark, "analysed", dying)
    monkeypatch.setattr(sys, "argv", ["dvca-sumo", "bench", "--suite", "real-bugs", "-o", str(tmp_path)])
    for known, new in ((0, 2), (2, 0), (2, 1)):
        with pytest.raises(SystemExit):
            main()
        said = capfd.readouterr()
        assert said.out.startswith(f"NOT WHOLE: {known + new} of {len(real_bug_cases())} cases")
        assert len(json.loads((tmp_path / "benchmark.json").read_text())["cases"]) == known + new
        assert said.err.count(" left, about ") == new


def test_too_few_random_faults_are_no_success_and_the_page_says_why(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["dvca-sumo", "bench", "--random", "3"])
    monkeypatch.setattr(benching, "healthy_drives", lambda *_: [])
    monkeypatch.setattr(benching, "random_scores", lambda *_: ([score(suite="random")], 101))
    with pytest.raises(SystemExit) as left:
        main()
    said = capfd.readouterr()
    told = "NOT WHOLE: 1 of 3 cases, 2 missing: drawing stopped where none of the last 100 faults violated"
    assert left.value.code == 1
    assert said.out.startswith(told)
    assert "FAILS" not in said.out
    assert said.err.splitlines()[-1] == told


def test_a_page_that_cannot_be_written_loses_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "benchmark.md").mkdir()
    monkeypatch.setattr(sys, "argv", ["dvca-sumo", "bench", "-o", str(tmp_path)])
    monkeypatch.setattr(benching, "run_benchmark", lambda *_: [score()])
    with pytest.raises(SystemExit) as left:
        main()
    said = capfd.readouterr()
    assert left.value.code == ExitCode.BAD_INPUT
    assert "Injected faults, exact mode: 1 cases" in said.out
    assert said.err == f"error: cannot write {tmp_path}/benchmark.md: Is a directory\n"
    assert json.loads((tmp_path / "benchmark.json").read_text())["cases"]
