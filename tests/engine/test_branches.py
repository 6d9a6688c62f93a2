"""Branches that fail, and ends of all kinds: what one process does costs its own answer alone, and nobody stays."""

import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import forking_stacks
import pytest
from forked_drives import Alive, factual, fork_engine, glimpses, ideal, outcomes
from small_scenarios import TIMEOUT

from dvca_sumo.engine.fork import ForkEngine
from dvca_sumo.engine.processes import Failure
from dvca_sumo.engine.protocol import Glimpse, RunFailedError
from dvca_sumo.engine.replay import ReplayEngine
from dvca_sumo.messages import Component
from dvca_sumo.run import Task
from dvca_sumo.stack.reference import StackError
from dvca_sumo.stack.sources import StackSource

LOCALIZATION, PERCEPTION, PREDICTION = Component.LOCALIZATION, Component.PERCEPTION, Component.PREDICTION
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells a process of its parent's death")


@pytest.fixture
def task(tmp_path: Path, street: Path) -> Task:
    return factual(tmp_path, street)


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> int:
    """Where stacks write, to be read."""
    reader, writer = os.pipe()
    monkeypatch.setattr(forking_stacks, "told", writer)
    monkeypatch.setattr(forking_stacks, "analysis", os.getpid())
    return reader


def failing(engine: ForkEngine, task: Task, component: Component = PERCEPTION) -> Failure:
    """What comes of a branch that fails, which must be no business of its neighbours."""
    engine.record(task)
    good = [ideal(task, 1.0, LOCALIZATION), ideal(task, 2.5, LOCALIZATION)]
    first, failed, last = glimpses(engine, good[0], ideal(task, 2.0, component), good[1])
    assert isinstance(failed, Failure)
    assert outcomes([first, last]) == outcomes(glimpses(engine, *good))
    assert engine.fallback is None
    return failed


def wait_for(process: int) -> None:
    """Until a process, not necessarily a child, has ended."""
    try:
        end = os.pidfd_open(process)
    except ProcessLookupError:
        return
    assert select.select([end], [], [], 20.0)[0]
    os.close(end)


@pytest.mark.parametrize("component", [PERCEPTION, PREDICTION])
def test_a_branch_that_crashes_names_the_signal_and_its_last_words(
    task: Task, street: Path, component: Component
) -> None:
    with fork_engine(street, "forking_stacks:crashing") as engine:
        failed = failing(engine, task, component)
    assert failed.reason == "the process died of SIGSEGV"
    assert failed.said == "last words"


@pytest.mark.parametrize("component", [PERCEPTION, PREDICTION])
def test_a_component_that_raises_in_a_branch_is_named(task: Task, street: Path, component: Component) -> None:
    with fork_engine(street, "forking_stacks:raising") as engine:
        failed = failing(engine, task, component)
    assert "planning raised ZeroDivisionError: no way out in cycle 20 (" in failed.reason
    assert isinstance(failed.error, StackError)
    assert "in _raise" in failed.said


@pytest.mark.parametrize("component", [PERCEPTION, PREDICTION])
def test_a_component_that_leaves_python_in_a_branch_ends_that_alone(
    task: Task, street: Path, component: Component
) -> None:
    with fork_engine(street, "forking_stacks:leaving") as engine:
        assert "planning raised SystemExit: 3 in cycle" in failing(engine, task, component).reason


@pytest.mark.parametrize("component", [PERCEPTION, PREDICTION])
def test_a_branch_that_hangs_is_ended(task: Task, street: Path, told: int, component: Component) -> None:
    with fork_engine(street, "forking_stacks:hanging") as engine:
        engine.record(task)
        engine._timeout = 2.0
        (hung,) = glimpses(engine, ideal(task, 2.0, component))
        assert isinstance(hung, Failure)
        assert hung.reason == "no answer within 2 s"
        engine._timeout = TIMEOUT
        good = ideal(task, 1.0, LOCALIZATION)
        assert outcomes(glimpses(engine, good)) == outcomes(glimpses(engine.witness, good))
        wait_for(int(os.read(told, 20)))


def test_a_failure_is_told_as_the_replay_engine_tells_it(task: Task, street: Path) -> None:
    for stack in ("crashing", "raising"):
        asked = ideal(task, 2.0, PERCEPTION)
        (replayed,) = glimpses(ReplayEngine(street, StackSource(f"forking_stacks:{stack}"), 1, TIMEOUT), asked)
        with fork_engine(street, f"forking_stacks:{stack}") as engine:
            branched = failing(engine, task)
        assert isinstance(replayed, Failure)
        assert branched.reason == replayed.reason


@LINUX
def test_a_checkpoint_that_dies_under_its_branch_costs_that_branch(task: Task, street: Path) -> None:
    with fork_engine(street, "forking_stacks:killing_its_parent") as engine:
        assert failing(engine, task).reason == "the process it was branched off died"


def kill_checkpoints(processes: tuple[int, ...]) -> None:
    for process in processes:
        os.kill(process, signal.SIGKILL)
        wait_for(process)


def test_checkpoints_that_died_before_are_done_without(task: Task, street: Path) -> None:
    asked = [ideal(task, since, PERCEPTION) for since in (0.5, 2.0, 3.5)]
    with fork_engine(street) as engine:
        engine.record(task)
        expected = outcomes(glimpses(engine, *asked))
        kill_checkpoints(engine.checkpoint_processes[1:])
        assert outcomes(glimpses(engine, *asked)) == expected
        kill_checkpoints(engine.checkpoint_processes)
        assert outcomes(glimpses(engine, *asked)) == expected


def test_checkpoints_that_die_when_they_are_called_are_done_without(
    task: Task, street: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = [ideal(task, since, PERCEPTION) for since in (0.5, 2.0)]
    with fork_engine(street) as engine:
        engine.record(task)
        expected = outcomes(glimpses(engine, *asked))
        assert engine._grove is not None
        engine._grove.catch_up()
        monkeypatch.setattr(engine._grove, "catch_up", lambda: None)
        kill_checkpoints(engine.checkpoint_processes[1:])
        assert outcomes(glimpses(engine, *asked)) == expected
        kill_checkpoints(engine.checkpoint_processes[:1])
        reasons = [one.reason for one in glimpses(engine, *asked) if isinstance(one, Failure)]
        assert reasons == 2 * ["no copy of the run is left to branch it off"]


def test_a_stem_that_died_is_not_needed_any_more(task: Task, street: Path) -> None:
    asked = ideal(task, 2.0, PERCEPTION)
    with fork_engine(street) as engine:
        engine.record(task)
        expected = outcomes(glimpses(engine, asked))
        assert engine._grove is not None
        assert engine._grove._process is not None
        os.kill(engine._grove._process, signal.SIGKILL)
        assert outcomes(glimpses(engine, asked)) == expected


def test_an_interrupt_ends_the_branches_and_leaves_an_engine_that_answers(task: Task, street: Path, told: int) -> None:
    good = [ideal(task, since, LOCALIZATION) for since in (1.0, 3.0)]
    with fork_engine(street, "forking_stacks:interrupting") as engine:
        engine.record(task)
        expected = outcomes(glimpses(engine, *good))
        with pytest.raises(KeyboardInterrupt):
            glimpses(engine, ideal(task, 2.0, PERCEPTION), *good)
        wait_for(int(os.read(told, 20)))
        assert outcomes(glimpses(engine, *good)) == expected


@pytest.mark.usefixtures("told")
def test_a_listener_that_raises_ends_the_branches_and_leaves_an_engine_that_answers(task: Task, street: Path) -> None:
    def refuse(_row: int, _answer: Glimpse | Failure) -> None:
        raise LookupError

    good = ideal(task, 1.0, LOCALIZATION)
    with fork_engine(street, "forking_stacks:hanging") as engine:
        engine.record(task)
        expected = outcomes(glimpses(engine, good))
        with pytest.raises(LookupError):
            engine.glimpses([ideal(task, 2.0, PERCEPTION), good], refuse)
        assert outcomes(glimpses(engine, good)) == expected


def test_an_engine_that_is_forgotten_ends_its_processes(task: Task, street: Path) -> None:
    alive = Alive()
    engine = ForkEngine(street, StackSource(), 2, TIMEOUT)
    engine.record(task)
    (process, *_) = engine.checkpoint_processes
    del engine
    wait_for(process)
    assert alive.is_nobody()


@pytest.mark.parametrize(
    ("stack", "error", "words"),
    [
        ("small_stacks:raising_planning", StackError, "planning raised ZeroDivisionError"),
        ("small_stacks:refusing", StackError, "no weights here"),
        ("small_stacks:hanging", RunFailedError, "the run failed: no answer within 2 s"),
        ("forking_stacks:crashing_at_once", RunFailedError, "the run failed: the process died of SIGSEGV"),
    ],
)
def test_a_factual_run_that_fails_is_told_and_leaves_nobody(
    task: Task, street: Path, stack: str, error: type[Exception], words: str
) -> None:
    alive = Alive()
    with fork_engine(street, stack, timeout=2.0 if "hanging" in stack else TIMEOUT) as engine:
        with pytest.raises(error, match=words):
            engine.record(task)
        assert alive.is_nobody()


SCRIPT = """
import os, sys
from pathlib import Path
import forking_stacks
from forked_drives import factual, fork_engine, glimpses, ideal
from dvca_sumo.messages import Component

def main():
    forking_stacks.told, forking_stacks.analysis = int(sys.argv[3]), os.getpid()
    with fork_engine(Path(sys.argv[1]), "forking_stacks:" + sys.argv[2]) as engine:
        task = factual(Path("scenario"), Path(sys.argv[1]))
        engine.record(task)
        components = (Component.PERCEPTION, Component.PREDICTION)
        glimpses(engine, *(ideal(task, 2.5, component) for component in components))
        os.write(forking_stacks.told, b"done ")

main()
"""


def analysing(folder: Path, net: Path, stack: str) -> tuple[subprocess.Popen[bytes], int]:
    """An analysis in a process of its own; a pipe that its stack writes into, open as long as anybody lives."""
    reader, writer = os.pipe()
    tests = Path(__file__).parents[1]
    paths = os.pathsep.join(map(str, (tests.parent, tests, tests / "engine")))
    process = subprocess.Popen(  # noqa: S603 our own script
        [sys.executable, "-c", SCRIPT, str(net), stack, str(writer)],
        pass_fds=[writer],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": paths, "TMPDIR": str(folder)},
    )
    os.close(writer)
    return process, reader


def is_nobody(reader: int) -> bool:
    """Whether all who could write have ended, or do so soon."""
    while select.select([reader], [], [], 20.0)[0]:
        if os.read(reader, 1000) == b"":
            return True
    return False


@LINUX
@pytest.mark.parametrize(("stack", "count"), [("hanging_at_once", 1), ("hanging", 2)])
def test_an_analysis_that_is_killed_leaves_nobody(tmp_path: Path, street: Path, stack: str, count: int) -> None:
    """In the stem, with checkpoints parked; and in a branch and a pass, with more of them."""
    process, reader = analysing(tmp_path, street, stack)
    with process:
        heard = b""
        while heard.count(b" ") < count:
            heard += os.read(reader, 100)
            assert b"done" not in heard
        process.kill()
    assert is_nobody(reader)
    os.close(reader)


@LINUX
def test_a_branch_that_outlives_the_analysis_leaves_no_checkpoint(tmp_path: Path, street: Path) -> None:
    process, reader = analysing(tmp_path, street, "outliving_the_analysis")
    with process:
        pass
    assert process.returncode == -signal.SIGKILL
    assert is_nobody(reader)
    os.close(reader)
