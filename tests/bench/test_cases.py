from pathlib import Path

import msgspec
import pytest

from dvca_sumo.bench.cases import INJECTED, Case, CasesError, cases_in, injected_cases
from dvca_sumo.bench.places import Place
from dvca_sumo.installation import scenario_path
from dvca_sumo.interventions import planted_fault

FAULT = """
[[case]]
name = "{name}"
scenario = "nets/cs1.sumocfg"
component = "perception"
fault = "perception.miss:start=9,end=11"
harmless = "perception.miss:start=2,end=4"
"""
# The paper's table of injected errors: in which collision scenarios there is an instance of each.
TABLE = {
    "perception.miss": "1234",
    "perception.box": "4",
    "perception.longitudinal": "1234",
    "perception.lateral": "1234",
    "perception.velocity": "1234",
    "prediction.none": "1",
    "prediction.wrong": "1234",
    "planning.path": "345",
    "planning.speed": "123",
    "planning.none": "12345",
    "control.longitudinal": "1234",
    "control.lateral": "5",
    "localization.lateral": "5",
}


def _file(folder: Path, text: str) -> Path:
    path = folder / "some.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_injected_faults_are_the_39_of_the_papers_table() -> None:
    expected = {f"{fault}/cs{number}" for fault, numbers in TABLE.items() for number in numbers}
    assert len(expected) == 39
    assert {case.name for case in injected_cases()} == expected


@pytest.mark.parametrize("case", injected_cases(), ids=lambda case: case.name)
def test_an_injected_fault_is_what_its_name_says_for_a_part_of_the_drive(case: Case) -> None:
    harmful = planted_fault(case.fault)
    assert case.name == f"{harmful.name}/{Path(case.scenario).stem}"
    assert case.component is harmful.component
    assert scenario_path(Path(case.scenario)).is_file()
    assert harmful.selection.end - harmful.selection.start < 11.0  # [s] of 38 and more


@pytest.mark.parametrize("case", injected_cases(), ids=lambda case: case.name)
def test_the_harmless_fault_is_the_same_in_another_moment_no_longer(case: Case) -> None:
    harmful, harmless = planted_fault(case.fault), planted_fault(case.harmless)
    assert (harmless.name, harmless.parameters) == (harmful.name, harmful.parameters)
    assert harmless.selection.start != harmful.selection.start
    long, brief = (one.selection.end - one.selection.start for one in (harmful, harmless))
    assert brief <= long + 1e-9


def test_the_committed_file_is_sorted_and_says_how_it_was_found() -> None:
    names = [line for line in INJECTED.read_text(encoding="utf-8").splitlines() if line.startswith("name")]
    assert names == sorted(names)
    assert "benchmarks/smallest_faults.py" in INJECTED.read_text(encoding="utf-8")


def test_cases_come_sorted_by_name(tmp_path: Path) -> None:
    path = _file(tmp_path, FAULT.format(name="b") + FAULT.format(name="a"))
    assert [case.name for case in cases_in(path, "injected")] == ["a", "b"]


def test_a_bug_is_a_case_of_its_own_kind(tmp_path: Path) -> None:
    text = '[[case]]\nname = "a"\nscenario = "x"\ncomponent = "planning"\nbug = "b"\nharmless_scenario = "y"\n'
    (case,) = cases_in(_file(tmp_path, text), "real-bugs")
    assert (case.suite, case.bug, case.fault) == ("real-bugs", "b", "")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (FAULT.format(name="a") * 2, "2 cases 'a'"),
        (FAULT.format(name="a") + 'magnitude = "2"\n', "magnitude"),
        (FAULT.format(name="a").replace('component = "perception"\n', ""), "component"),
        (FAULT.format(name="a").replace('"perception"', '"sensors"'), "sensors"),
        (FAULT.format(name="a").replace("harmless =", "# harmless ="), "lacks 'harmless'"),
        (FAULT.format(name="a") + 'bug = "b"\n', "has 'bug'"),
        ("case = 1\n", "'case'"),
        ("suite = 1\n", "'suite'"),
        ("[[case]\n", "cannot be read"),
    ],
)
def test_a_case_that_is_not_whole_is_refused_in_one_line(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(CasesError, match=reason) as refused:
        cases_in(_file(tmp_path, text), "injected")
    assert "\n" not in str(refused.value)
    assert "some.toml" in str(refused.value)


def test_a_file_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(CasesError, match=r"other\.toml"):
        cases_in(tmp_path / "other.toml", "injected")


def test_the_command_of_a_case_has_its_begin_to_the_last_digit() -> None:
    case = msgspec.structs.replace(injected_cases()[0], begin=28800.25)
    assert case.command(None, None).endswith("--begin 28800.25")
    assert str(Place("city.sumocfg", begin=1234567.5)) == "city.sumocfg --begin 1234567.5"
