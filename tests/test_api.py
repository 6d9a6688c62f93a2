"""The same as the command, in three calls from Python."""

import json
from pathlib import Path

import pytest
from command_line import loaded, typed
from small_scenarios import scenario_file

import dvca_sumo
from dvca_sumo.analysis.attribution import Attribution, Progress
from dvca_sumo.analysis.components import Verdict
from dvca_sumo.analysis.dtest import Probe
from dvca_sumo.api import FactualDrive
from dvca_sumo.interventions import FaultError, fault_library, library
from dvca_sumo.messages import Component
from dvca_sumo.report.result import Timing, result_of
from dvca_sumo.report.terminal import verdict_text
from dvca_sumo.scenario import ScenarioError
from dvca_sumo.stack.reference import StackError

FAULT = "planning.path"
CS5 = "nets/cs5.sumocfg"


class Heard(Progress):
    def __init__(self) -> None:
        self.probes: list[Probe] = []

    def probe(self, probe: Probe) -> None:
        self.probes.append(probe)


@pytest.fixture(scope="module")
def drive() -> FactualDrive:
    return dvca_sumo.drive(dvca_sumo.load_scenario(CS5), faults=[FAULT])


@pytest.fixture(scope="module")
def heard() -> Heard:
    return Heard()


@pytest.fixture(scope="module")
def answer(drive: FactualDrive, heard: Heard) -> Attribution:
    return dvca_sumo.attribute(drive, heard)


def test_three_calls_explain_a_violation(drive: FactualDrive, answer: Attribution) -> None:
    assert [one.kind for one in drive.record.violations][:1] == ["lane_departure"]
    assert answer.violation == drive.record.violations[0]
    assert answer.verdict is Verdict.PLANNING
    assert answer.message is not None
    assert answer.message.component is Component.PLANNING
    assert answer.is_reproducible
    assert answer.planted is not None
    assert answer.planted.message_success


def test_progress_hears_of_every_probe(answer: Attribution, heard: Heard) -> None:
    assert sorted(probe.id for probe in heard.probes) == [probe.id for probe in answer.probes]


def test_the_command_says_the_same(answer: Attribution) -> None:
    result = typed("run", CS5, "--fault", FAULT, "--json").result
    assert result["digest"] == answer.digest
    assert result["verdict"] == answer.verdict.value
    assert answer.message is not None
    assert result["message"]["index"] == answer.message.index


def test_a_clean_drive_has_nothing_to_explain(tmp_path: Path, street: Path) -> None:
    scenario = dvca_sumo.load_scenario(str(scenario_file(tmp_path / "free", street)), seed=3)
    assert scenario.seed == 3
    answer = dvca_sumo.attribute(dvca_sumo.drive(scenario))
    assert (answer.verdict, answer.violation, answer.probes, answer.planted) == (Verdict.NONE, None, (), None)


@pytest.mark.parametrize("silent", [("localization",), ("control",), ("localization", "control")], ids="+".join)
def test_components_that_put_out_nothing_from_the_start_are_explained_as_any_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, silent: tuple[str, ...]
) -> None:
    for component in silent:
        text = f'component = "{component}"\neffect = "publish_nothing"\nsummary = "Nothing is published."\n'
        (tmp_path / f"{component}.none.toml").write_text(text, encoding="utf-8")
    monkeypatch.setattr(library, "folder", lambda _: tmp_path)
    fault_library.cache_clear()
    try:
        drive = dvca_sumo.drive(dvca_sumo.load_scenario("nets/cs1.sumocfg"), [f"{name}.none" for name in silent])
    finally:
        fault_library.cache_clear()
    answer = dvca_sumo.attribute(drive)
    timing = Timing(factual_wall_s=0.5, attribution_wall_s=2.0, engine="fork", jobs=2)
    result = loaded(json.dumps(result_of(drive.request, drive.source, answer, timing)))
    assert "VIOLATION" in verdict_text(answer, timing)
    assert answer.is_reproducible
    assert answer.record.executions[Component.PLANNING] == [] or "localization" not in silent
    assert result["component"] == (silent[0] if len(silent) == 1 else None)


def test_a_built_in_scenario_is_found_from_any_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert dvca_sumo.load_scenario(Path(CS5)).configuration.path.name == "cs5.sumocfg"


def test_a_built_in_scenario_misspelt_is_told_its_nearest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ScenarioError, match=r"no such SUMO configuration: .*cs5\.sumo \(did you mean cs5\.sumocfg\?\)"):
        dvca_sumo.load_scenario("nets/cs5.sumo")
    (tmp_path / "nets").mkdir()
    (tmp_path / "nets" / "my5.sumocfg").touch()
    with pytest.raises(ScenarioError, match=r"did you mean my5\.sumocfg\?"):
        dvca_sumo.load_scenario("nets/my5.sumo")


def test_errors_are_named_for_what_was_wrong(tmp_path: Path) -> None:
    scenario = dvca_sumo.load_scenario(CS5)
    with pytest.raises(ScenarioError, match="no such SUMO configuration"):
        dvca_sumo.load_scenario(tmp_path / "none.sumocfg")
    with pytest.raises(FaultError, match=r"did you mean 'planning\.path'"):
        dvca_sumo.drive(scenario, faults=["planning.pat"])
    with pytest.raises(StackError, match="nowhere:stack"):
        dvca_sumo.drive(scenario, stack="nowhere:stack")
    with pytest.raises(ValueError, match=r"repeats is 0 \(allowed: 1 or more"):
        dvca_sumo.drive(scenario, repeats=0)
    with pytest.raises(ValueError, match=r"jobs is 0 \(allowed: 1 or more"):
        dvca_sumo.drive(scenario, jobs=0)
    with pytest.raises(ValueError, match=r"engine is 'x' \(allowed: 'fork', 'replay', or None"):
        dvca_sumo.drive(scenario, engine="x")


def test_the_package_offers_the_three_calls_and_nothing_unknown() -> None:
    assert set(dvca_sumo.__all__) == {"load_scenario", "drive", "attribute"}
    with pytest.raises(AttributeError, match="no attribute 'explain'"):
        dvca_sumo.explain  # noqa: B018
