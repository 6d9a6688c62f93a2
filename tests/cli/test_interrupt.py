"""Ctrl-C while probes run: what was found is kept, and nobody is left behind."""

import os
import select
import signal
import subprocess
from pathlib import Path

import pytest
from command_line import COMMAND, environment, loaded

from dvca_sumo.cli import ExitCode


@pytest.mark.skipif(os.name != "posix", reason="process groups")
def test_an_interrupted_analysis_prints_and_keeps_what_it_has_found(tmp_path: Path) -> None:
    words = ("run", "nets/cs1.sumocfg", "--fault", "perception.miss", "--json", "-o", str(tmp_path / "out"))
    alive, inherited = os.pipe()  # readable as soon as no process holds its other end any more
    running = subprocess.Popen(  # noqa: S603 our own command
        [*COMMAND, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        env=environment(),
        pass_fds=(inherited,),
        start_new_session=True,
    )
    os.close(inherited)
    with running:
        assert running.stderr is not None
        while not (line := running.stderr.readline()).startswith("probe "):
            assert line, "it ended before any probe did"
        os.killpg(running.pid, signal.SIGINT)  # as a terminal does: to parent and children alike
        out, err = running.communicate(timeout=60)
    left_behind = not select.select([alive], [], [], 20.0)[0]
    os.close(alive)
    assert running.returncode == ExitCode.INTERRUPTED
    assert "Traceback" not in err
    assert err.splitlines()[-1] == "interrupted"
    partial = loaded(out)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["result.json"]
    assert loaded((tmp_path / "out" / "result.json").read_text(encoding="utf-8")) == partial
    assert partial["reason"] == "interrupted"
    assert partial["violations"]
    assert partial["message"] is None
    assert not left_behind
