"""The main job on the built-in scenarios: the planted fault's component and one of its messages are found."""

import math
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest
from command_line import Result, loaded, typed, without_costs

from dvca_sumo.cli import ExitCode
from dvca_sumo.interventions import fault_library

SCENARIOS = ("cs1", "cs2", "cs3", "cs4", "cs5")


class Case(NamedTuple):
    scenario: str
    fault: str

    @property
    def component(self) -> str:
        return fault_library()[self.fault.partition(":")[0]].component.value


# Where a window is given, most messages are innocent. cs1 with perception.miss is the README's example.
EXACT = (
    Case("cs5", "localization.lateral"),
    Case("cs3", "localization.lateral:left=2.5,start=10,end=13"),
    Case("cs2", "perception.longitudinal"),
    Case("cs4", "perception.miss:start=14,end=17"),
    Case("cs1", "prediction.wrong:object=pedestrian,start=8.5,end=13"),
    Case("cs4", "prediction.wrong:start=14,end=17"),
    Case("cs1", "planning.speed:start=5,end=8"),
    Case("cs1", "planning.none:start=8"),
    Case("cs5", "planning.path"),
    Case("cs2", "control.longitudinal:start=5,end=7"),
    Case("cs5", "control.lateral"),
)
JITTERED = (
    Case("cs5", "localization.lateral"),
    Case("cs1", "perception.miss"),
    Case("cs2", "prediction.wrong"),
    Case("cs5", "planning.path"),
    Case("cs5", "control.lateral"),
)


@cache
def _analysed(case: Case) -> tuple[int, Result]:
    said = typed("run", f"nets/{case.scenario}.sumocfg", "--fault", case.fault, "--json")
    return said.code, said.result


def _altered(result: Result) -> set[int]:
    """Indices of the messages that the fault changed."""
    parts = [part if isinstance(part, list) else [part, part] for part in result["planted"]["altered"]]
    return {index for first, last in parts for index in range(first, last + 1)}


def _window(case: Case) -> tuple[float, float]:
    words = dict(word.split("=") for word in case.fault.partition(":")[2].split(",") if word)
    return float(words.get("start", 0.0)), float(words.get("end", math.inf))


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_healthy_stack_completes_a_built_in_scenario(scenario: str) -> None:
    said = typed("run", f"nets/{scenario}.sumocfg", "--json")
    assert said.code == ExitCode.NO_VIOLATION, said
    assert said.result["verdict"] == "none"
    assert {one["answer"] for one in said.result["judgements"]} == {"kept"}


@pytest.mark.parametrize("case", EXACT, ids=":".join)
def test_a_planted_fault_is_found(case: Case) -> None:
    code, result = _analysed(case)
    assert code == ExitCode.ATTRIBUTED
    assert result["component"] == case.component
    assert result["verdict"] == ("planning" if case.component == "planning" else "component")
    assert result["reproducible"] is True
    assert result["differences"]
    assert result["message"]["time"] < result["violation"]["time"]
    _assert_planted_as_asked(case, result)
    if case.component != "planning":
        _assert_proven(result)


def _assert_planted_as_asked(case: Case, result: Result) -> None:
    """Messages in the window were altered, no others, and the reported message is one of them."""
    planted, message = result["planted"], result["message"]
    assert planted["component"] == message["component"] == case.component
    assert planted["component_success"] is True
    assert planted["message_success"] is True
    assert planted["message_distance_s"] == 0.0
    assert result["reduction_rate"] == 1.0 - 1.0 / result["messages"]["total"]
    altered, (start, end) = _altered(result), _window(case)
    assert message["index"] in altered
    assert len(altered) <= result["messages"][case.component]
    if not math.isinf(end):
        rate = 100.0 if case.component in ("localization", "control") else 10.0  # [1/s]
        assert len(altered) <= rate * (end - start) + 0.5


def _assert_proven(result: Result) -> None:
    """Ideal from the reported message on is safe, and violates from the next message on."""
    interval, reported = result["interval"], result["message"]["index"]
    assert interval["adjacent"] is True
    assert interval["last_safe"]["index"] == reported
    outcomes = {
        probe["from"]["index"]: (probe["id"], probe["outcome"])
        for probe in result["probes"]
        if probe["ideal"] == [result["component"]] and probe["from"] is not None
    }
    proof = {reported: "SAFE"}
    if interval["first_violating"] is not None:
        assert interval["first_violating"]["index"] == reported + 1
        proof[reported + 1] = "VIOLATES"
    assert {index: outcomes[index][1] for index in proof} == proof
    assert {outcomes[index][0] for index in proof} == set(interval["probes"])


@pytest.mark.parametrize("case", JITTERED, ids=":".join)
def test_the_component_is_found_although_no_two_runs_are_alike(case: Case, tmp_path: Path) -> None:
    words = ("--fault", case.fault, "--jitter", "--repeats", "2", "-o", tmp_path)
    said = typed("run", f"nets/{case.scenario}.sumocfg", *words)
    assert said.code == ExitCode.ATTRIBUTED, said
    result = loaded((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert result["component"] == case.component
    assert result["planted"]["component_success"] is True
    assert len({probe["jitter"] for probe in result["probes"]}) == len(result["probes"])
    assert f"\nCOMPONENT  {case.component}\n" in said.out


def test_twice_the_same_command_gives_the_same_answer() -> None:
    case = EXACT[0]
    first, second = _analysed(case), _analysed.__wrapped__(case)
    assert first[1]["digest"] == second[1]["digest"]
    assert without_costs(first[1]) == without_costs(second[1])


def test_both_engines_give_the_same_answer() -> None:
    case = EXACT[0]
    words = ("--fault", case.fault, "--engine", "replay", "--json")
    replayed = typed("run", f"nets/{case.scenario}.sumocfg", *words).result
    forked = _analysed(case)[1]
    for key in ("digest", "violation", "verdict", "component", "message", "substitutions", "planted"):
        assert replayed[key] == forked[key]
