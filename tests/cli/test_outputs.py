"""Where a command's words go: stdout, stderr, the output folder, and nowhere else."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import Result, contents, loaded, typed, without_costs

from dvca_sumo.cli import ExitCode

# Asks for output in every way that SUMO knows: of the simulation, of a detector, of a device.
DETECTOR = (
    '<inductionLoop id="d" lane="bc_0" pos="30" period="1" file="loop.xml"/><edgeData id="e" period="1" file="e.xml"/>'
)
OUTPUTS = {
    "tripinfo_output": "trips.xml",
    "fcd_output": "fcd.xml",
    "netstate_dump": "dump.xml",
    "log": "sumo.log",
    "output_prefix": "TIME_",
    "device__ssm__probability": "1",
    "device__ssm__file": "ssm.xml",
}


def _in_both(folder: Path, *words: str) -> tuple[int, Result, str]:
    """Exit code, result and progress of a command with both --json and -o, which must say the same."""
    said = typed("run", *words, "--json", "-o", folder / "out")
    assert [path.name for path in (folder / "out").iterdir()] == ["result.json"]
    written = (folder / "out" / "result.json").read_text(encoding="utf-8")
    assert loaded(written) == said.result
    assert written.endswith("}\n")
    return said.code, said.result, said.err


def test_a_clean_drive_as_json(tmp_path: Path, scenario: Callable[..., Path]) -> None:
    code, result, progress = _in_both(tmp_path, str(scenario()))
    assert code == ExitCode.NO_VIOLATION
    assert result["schema"] == 1
    assert result["verdict"] == "none"
    assert result["violations"] == []
    assert result["component"] is result["message"] is result["interval"] is result["planted"] is None
    assert result["probes"] == []
    assert result["scenario"]["ego"] == "ego"
    assert result["scenario"]["step_length"] == 0.1
    assert len(progress.splitlines()) == 1


def test_an_attributed_violation_as_json(tmp_path: Path) -> None:
    code, result, progress = _in_both(tmp_path, "nets/cs5.sumocfg", "--fault", "planning.path")
    assert code == ExitCode.ATTRIBUTED
    assert result["verdict"] == result["component"] == "planning"
    assert [fault["name"] for fault in result["faults"]] == ["planning.path"]
    told = [re.fullmatch(r"probe (\d+): .*: ([A-Z]+), .*", line) for line in progress.splitlines()]
    outcomes = {int(line[1]): line[2] for line in told if line is not None}
    assert outcomes == {probe["id"]: probe["outcome"] for probe in result["probes"]}
    assert [probe["id"] for probe in result["probes"]] == list(range(len(result["probes"])))
    assert sum(count for name, count in result["messages"].items() if name != "total") == result["messages"]["total"]
    text = typed("run", "nets/cs5.sumocfg", "--fault", "planning.path")
    assert text.code == code
    assert f"MESSAGE    planning #{result['message']['index']} " in text.out
    assert "{" not in text.out


def test_seed_begin_and_end_reach_the_result(scenario: Callable[..., Path]) -> None:
    from_car = '<trip id="car" from="bc" to="bc" depart="40" departPos="20" departSpeed="10" arrivalPos="90"/>'
    words = ("--ego", "car", "--seed", "77", "--begin", "30", "--end", "200", "--json")
    said = typed("run", scenario(from_car), *words)
    assert said.code == ExitCode.NO_VIOLATION, said
    chosen = said.result["scenario"]
    assert (chosen["ego"], chosen["seed"], chosen["begin"], chosen["end"]) == ("car", 77, 30.0, 200.0)
    overridden = {one["option"] for one in chosen["overrides"]}
    assert {"seed", "begin", "step-length", "collision.action"} <= overridden


def test_outputs_that_a_scenario_asks_for_go_nowhere(scenario: Callable[..., Path]) -> None:
    config = scenario(additional=DETECTOR, **OUTPUTS)
    before = contents(config.parent)
    said = typed("run", config, "--json")
    assert said.code == ExitCode.NO_VIOLATION, said
    assert contents(config.parent) == before
    overridden = {one["option"] for one in said.result["scenario"]["overrides"]}
    assert {"tripinfo-output", "fcd-output", "netstate-dump", "log", "device.ssm.file"} <= overridden


def test_a_relative_path_counts_from_where_the_command_is_typed(tmp_path: Path, scenario: Callable[..., Path]) -> None:
    config = scenario()
    there = typed("run", config.relative_to(tmp_path), "--json", folder=tmp_path)
    assert there.code == ExitCode.NO_VIOLATION, there
    assert there.result["scenario"]["config"] == str(config)


def test_another_folder_does_not_change_the_answer(tmp_path: Path, scenario: Callable[..., Path]) -> None:
    config = scenario()
    results = [typed("run", config, "--json", folder=folder).result for folder in (tmp_path, config.parent)]
    first, second = (json.dumps(without_costs(result)) for result in results)
    assert first == second


@pytest.mark.parametrize("engine", ["fork", "replay"])
def test_no_scratch_file_outlives_a_command(engine: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    words = ("--fault", "planning.path", "--engine", engine)
    assert typed("run", "nets/cs5.sumocfg", *words, folder=Path(__file__).parent).code == ExitCode.ATTRIBUTED
    assert list(tmp_path.iterdir()) == []
