"""Where a command's words go: stdout, stderr, the output folder, and nowhere else."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import COMMAND, Result, contents, environment, loaded, typed, without_costs

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


def test_what_cannot_be_written_is_printed_all_the_same(tmp_path: Path, scenario: Callable[..., Path]) -> None:
    (tmp_path / "out" / "result.json").mkdir(parents=True)
    said = typed("run", scenario(), "--json", "-o", tmp_path / "out")
    assert said.result["verdict"] == "none"
    assert said.err.splitlines()[-1] == f"error: cannot write {tmp_path}/out/result.json: Is a directory"
    assert said.code == ExitCode.BAD_INPUT


def test_characters_that_a_terminal_lacks_lose_nothing(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    words = "caf\xe9 \u2192"
    code = f"from dvca_sumo.cli.output import *; tell({words!a}); deliver({words!a}, {{Path('{page}'): {words!a}}})"
    poor = {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0", "PYTHONIOENCODING": "latin-1:strict"}
    said = subprocess.run(  # noqa: S603 our own code
        [sys.executable, "-c", code], capture_output=True, env=environment() | poor, check=True
    )
    assert said.stdout == said.stderr == b"caf\xe9 \\u2192\n"
    assert page.read_text(encoding="utf-8") == words


@pytest.mark.parametrize("is_all_unread", [False, True], ids=["| true", "2>&1 | true"])
def test_whoever_stops_reading_changes_neither_the_verdict_nor_what_is_kept(
    tmp_path: Path, scenario: Callable[..., Path], *, is_all_unread: bool
) -> None:
    code, told = _unread("run", str(scenario()), "-o", str(tmp_path / "out"), is_all_unread=is_all_unread)
    assert code == ExitCode.NO_VIOLATION, told
    assert len(told.splitlines()) == (0 if is_all_unread else 1)  # of the factual run
    assert loaded((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))["verdict"] == "none"


def test_a_list_that_nobody_reads_to_its_end_is_no_error() -> None:
    assert _unread("faults") == (ExitCode.NO_VIOLATION, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_result_that_there_is_no_room_for_is_told(tmp_path: Path, scenario: Callable[..., Path]) -> None:
    words = [*COMMAND, "run", str(scenario()), "--json", "-o", str(tmp_path / "out")]
    with Path("/dev/full").open("w") as full:
        said = subprocess.run(  # noqa: S603 our own command
            words, stdout=full, stderr=subprocess.PIPE, text=True, env=environment(), check=False
        )
    assert said.stderr.splitlines()[-1] == "error: cannot write standard output: No space left on device"
    assert said.returncode == ExitCode.BAD_INPUT
    assert (tmp_path / "out" / "result.json").exists()


def _unread(*words: str, is_all_unread: bool = False) -> tuple[int, str]:
    """Exit code of a command whose output nobody reads, and what it says on standard error if that is read."""
    read, write = os.pipe()
    os.close(read)
    said = subprocess.run(  # noqa: S603 our own command
        [*COMMAND, *words],
        stdout=write,
        stderr=write if is_all_unread else subprocess.PIPE,
        text=True,
        env=environment(),
        check=False,
    )
    os.close(write)
    return said.returncode, said.stderr or ""
