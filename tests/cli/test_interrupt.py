"""Ctrl-C, or a request to terminate, half-way: what was found is kept, and nobody is left behind."""

import json
import os
import select
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from command_line import COMMAND, Said, environment, loaded

import dvca_sumo
from dvca_sumo.__main__ import main
from dvca_sumo.bench.cases import real_bug_cases
from dvca_sumo.cli import ExitCode, screening


def interrupted(
    words: Sequence[str],
    folder: Path,
    is_time: Callable[[str], bool],
    by: signal.Signals = signal.SIGINT,
    times: int = 1,
) -> tuple[int, str, str]:
    """Exit code and output of a command that is interrupted once it has said such a line; nobody may be left behind."""
    alive, inherited = os.pipe()  # readable as soon as no process holds its other end any more
    running = subprocess.Popen(  # noqa: S603 our own command
        [*COMMAND, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
        env=environment(),
        pass_fds=(inherited,),
        start_new_session=True,
    )
    os.close(inherited)
    with running:
        assert running.stderr is not None
        while not is_time(line := running.stderr.readline()):
            assert line, "it ended before that"
        for _ in range(times):
            os.killpg(running.pid, by)  # as a terminal does: to parent and children alike
        out, err = running.communicate(timeout=60)
    left_behind = not select.select([alive], [], [], 20.0)[0]
    os.close(alive)
    assert not left_behind
    return running.returncode, out, err


@pytest.mark.skipif(os.name != "posix", reason="process groups")
@pytest.mark.parametrize(
    ("by", "times"),
    [(signal.SIGINT, 1), (signal.SIGTERM, 1), (signal.SIGINT, 3)] + [(signal.SIGHUP, 1)] * (os.name == "posix"),
)
@pytest.mark.parametrize("after", ["probe ", "factual run: "])
def test_an_interrupted_analysis_prints_and_keeps_what_it_has_found(
    tmp_path: Path, by: signal.Signals, times: int, after: str
) -> None:
    """Some send one interrupt after the other, to the command and to its group. An earlier answer is not lost by it."""
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "result.json").write_text("of before", encoding="utf-8")
    words = ("run", "nets/cs1.sumocfg", "--fault", "perception.miss", "--json", "-o", str(tmp_path / "out"))
    code, out, err = interrupted(words, tmp_path, lambda line: line.startswith(after), by, times)
    assert code == ExitCode.INTERRUPTED
    assert "Traceback" not in err
    assert err.splitlines()[-1] == "interrupted"
    partial = loaded(out)
    kept = {path.name: path.read_text(encoding="utf-8") for path in (tmp_path / "out").iterdir()}
    assert set(kept) == {"result.json", "result.partial.json"}
    assert kept["result.json"] == "of before"
    assert loaded(kept["result.partial.json"]) == partial
    assert partial["reason"].startswith("interrupted")
    assert partial["planted"]["component"] == "perception"
    assert partial["violations"]
    assert partial["message"] is None


@pytest.mark.skipif(os.name != "posix", reason="process groups")
def test_an_interrupted_benchmark_prints_and_keeps_the_cases_it_has(tmp_path: Path) -> None:
    words = ("bench", "--suite", "real-bugs", "--jobs", "1", "--json", "-o", str(tmp_path / "out"))
    code, out, err = interrupted(words, tmp_path, lambda line: " left, about " in line)
    assert code == ExitCode.INTERRUPTED
    assert "Traceback" not in err
    assert err.splitlines()[-1] == "interrupted"
    partial = json.loads(out)
    assert [case["suite"] for case in partial["cases"]] == ["real-bugs"]
    assert partial["missing"] == len(real_bug_cases()) - 1
    assert json.loads((tmp_path / "out" / "benchmark.json").read_text(encoding="utf-8")) == partial
    assert len((tmp_path / "out" / "scores.jsonl").read_text(encoding="utf-8").splitlines()) == 1


@pytest.mark.parametrize("is_kept", [True, False])
def test_an_interrupted_screening_prints_no_rates_but_says_what_is_kept(
    called: Callable[..., Said], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, is_kept: bool
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(screening, "screened", interrupt)
    said = called("screen", "nets/cs1.sumocfg", *(["-o", str(tmp_path)] if is_kept else []))
    assert (said.code, said.out) == (ExitCode.INTERRUPTED, "")
    told, last = (line for line in said.err.splitlines() if line)
    assert last == "interrupted"
    assert [word in told for word in (f"kept in {tmp_path}", "goes on from there")] == [is_kept] * 2
    assert [word in told for word in ("nothing is kept", "with -o")] == [not is_kept] * 2


class Interrupt:
    """Finds the command line's modules, and is interrupted by it."""

    def find_spec(self, name: str, *_: object) -> None:
        if name.startswith("dvca_sumo.cli"):
            raise KeyboardInterrupt


def test_an_interrupt_while_the_program_loads_is_one_as_any_other(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delitem(sys.modules, "dvca_sumo.cli")
    monkeypatch.delattr(dvca_sumo, "cli")
    monkeypatch.setattr(sys, "meta_path", [Interrupt(), *sys.meta_path])
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == ExitCode.INTERRUPTED
    assert capsys.readouterr().err == "interrupted\n"


def test_an_interrupt_that_nobody_is_there_to_be_told_of_is_one_all_the_same() -> None:
    """A reader that has gone: `dvca-sumo run ... 2>&1 | head -1`."""
    program = (
        "import os, dvca_sumo.cli as cli, dvca_sumo.cli.running as running\n"
        "def interrupted(*_): raise KeyboardInterrupt\n"
        "running.load_scenario = interrupted\n"
        "reader, writer = os.pipe(); os.dup2(writer, 2); os.close(writer); os.close(reader)\n"
        "cli.main()\n"
    )
    words = [sys.executable, "-c", program, "run", "nets/cs1.sumocfg"]
    done = subprocess.run(words, check=False, capture_output=True, env=environment())  # noqa: S603
    assert (done.returncode, done.stdout) == (ExitCode.INTERRUPTED, b"")
