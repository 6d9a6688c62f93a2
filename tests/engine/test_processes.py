"""Jobs in processes of their own: whatever one of them does costs that one alone."""

import faulthandler
import itertools
import os
import resource
import select
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from dvca_sumo.engine import processes
from dvca_sumo.engine.processes import Failure, isolated

LONG = 60.0  # [s] only ever reached by a defect


def say(words: str) -> None:
    print(words, file=sys.stderr, flush=True)  # noqa: T201


def crash() -> None:
    faulthandler.disable()  # pytest's
    say("about to fall")
    os.kill(os.getpid(), signal.SIGSEGV)


def die_in_the_middle_of_the_answer() -> str:
    def half(self: Connection, message: Any, write: Any = None) -> None:  # noqa: ARG001
        os.write(self.fileno(), bytes(message)[: len(message) // 2])
        os.kill(os.getpid(), signal.SIGKILL)

    Connection._send = half  # type: ignore[attr-defined]
    return "x" * 100


def answers(jobs: list[Callable[[], Any]], parallel: int = 2, timeout: float = LONG) -> list[Any]:
    return [answer for _, answer in sorted(isolated(jobs, parallel, timeout), key=lambda pair: pair[0])]


def is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def test_every_job_gives_its_answer_under_its_own_row() -> None:
    jobs = [lambda number=number: number * number for number in range(7)]
    assert dict(isolated(jobs, 3, LONG)) == {number: number * number for number in range(7)}


def test_jobs_may_depend_on_what_was_found_before() -> None:
    found: list[int] = []

    def jobs() -> Iterator[Callable[[], int]]:
        while len(found) < 3:
            yield lambda: 10 * len(found)

    for _, answer in isolated(jobs(), 1, LONG):
        assert isinstance(answer, int)
        found.append(answer)
    assert found == [0, 10, 20]


def test_no_jobs_are_no_answers() -> None:
    assert answers([]) == []


def test_a_job_changes_nothing_in_this_process() -> None:
    here = Path.cwd()
    assert answers([lambda: os.chdir("/"), lambda: os.environ.update(DVCA_TEST="1")]) == [None, None]
    assert Path.cwd() == here
    assert "DVCA_TEST" not in os.environ


def test_a_crash_names_the_signal_and_the_last_words_and_leaves_the_others_alone() -> None:
    first, crashed, last = answers([lambda: 1, crash, lambda: 3])
    assert (first, last) == (1, 3)
    assert isinstance(crashed, Failure)
    assert "SIGSEGV" in crashed.reason
    assert "about to fall" in crashed.said
    assert crashed.error is None


def test_a_hanging_job_is_ended_and_the_others_give_their_answer() -> None:
    def hang() -> None:
        say("waiting for ever")
        signal.pause()

    hung, other = answers([hang, lambda: 2], timeout=0.5)
    assert other == 2
    assert isinstance(hung, Failure)
    assert hung.reason == "no answer within 0.5 s"
    assert hung.said == "waiting for ever"


def test_an_answer_that_is_there_counts_though_nobody_looked_in_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The machine was suspended, or whoever takes the answers had other things to do."""
    clock = [0.0]
    monkeypatch.setattr(processes, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader, writer = os.pipe()

    def hang() -> None:
        os.close(writer)
        signal.pause()

    results = isolated([lambda: "in time", pipe.read_text, hang], 3, LONG)
    assert next(results) == (0, "in time")
    os.close(writer)
    pipe.write_text("late")
    assert os.read(reader, 1) == b""  # the second one has ended
    os.close(reader)
    clock[0] = 2.0 * LONG
    assert next(results) == (1, "late")
    (hung,) = results
    assert hung == (2, Failure("no answer within 60 s", ""))


def test_an_exception_is_the_answer_with_its_words() -> None:
    def fail() -> None:
        raise FileNotFoundError(2, "no such thing", "map.xml")

    (failed,) = answers([fail])
    assert isinstance(failed, Failure)
    assert isinstance(failed.error, FileNotFoundError)
    assert failed.error.filename == "map.xml"
    assert failed.reason.startswith("FileNotFoundError: ")
    assert "no such thing" in failed.reason
    assert "in fail" in failed.said


def test_an_exception_that_cannot_travel_is_told_in_words() -> None:
    class LocalError(Exception):
        pass

    def fail() -> None:
        raise LocalError("homebound")

    (failed,) = answers([fail])
    assert (failed.reason, failed.error) == ("LocalError: homebound", None)


def test_an_answer_that_cannot_travel_is_a_failure() -> None:
    failed, other = answers([lambda: lambda: 0, lambda: 1])
    assert other == 1
    assert isinstance(failed, Failure)
    assert "pickle" in failed.said


@pytest.mark.parametrize("leave", [lambda: os._exit(3), lambda: sys.exit(3)])
def test_a_job_that_leaves_without_an_answer_is_a_failure(leave: Callable[[], None]) -> None:
    failed, other = answers([leave, lambda: 1])
    assert other == 1
    assert failed.reason == "the process ended with code 3 without an answer"


def test_a_job_that_dies_in_the_middle_of_its_answer_is_a_failure() -> None:
    failed, other = answers([die_in_the_middle_of_the_answer, lambda: 1])
    assert other == 1
    assert "SIGKILL" in failed.reason


def test_a_long_answer_arrives_whole() -> None:
    (answer,) = answers([lambda: bytes(5_000_000)])
    assert len(answer) == 5_000_000


@pytest.mark.parametrize("parallel", [1, 2, 3])
@pytest.mark.parametrize("refused", [{0}, {1}, {2}, {0, 1}, {0, 1, 2}])
def test_a_job_that_the_system_has_no_process_for_is_a_failure_and_the_others_give_their_answer(
    parallel: int, refused: set[int]
) -> None:
    fork, asked = os.fork, itertools.count()

    def scarce_fork() -> int:
        if next(asked) in refused:
            raise BlockingIOError(11, "Resource temporarily unavailable")
        return fork()

    def starve() -> list[Any]:  # in a process of its own: Python leaves pipes open there
        os.fork = scarce_fork
        return answers([partial(int, number) for number in range(3)], parallel)

    (starved,) = answers([starve])
    for row, answer in enumerate(starved):
        if row in refused:
            assert isinstance(answer, Failure)
            assert answer.reason.startswith("the system gives no process or pipe: ")
            assert "Resource temporarily unavailable" in answer.reason
        else:
            assert answer == row


def test_jobs_that_the_system_has_no_pipe_for_are_failures() -> None:
    def starve() -> list[Any]:
        lowest = os.dup(2)
        resource.setrlimit(resource.RLIMIT_NOFILE, (lowest + 1, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
        os.close(lowest)  # the only one that is left
        return answers([int, int, int])

    (starved,) = answers([starve])
    assert [type(one) for one in starved] == [Failure] * 3
    assert all("Too many open files" in one.reason for one in starved)


def test_jobs_run_at_once_but_never_more_than_allowed(tmp_path: Path) -> None:
    pipe, journal = tmp_path / "pipe", tmp_path / "journal"
    os.mkfifo(pipe)

    def noted(job: Any) -> Callable[[], None]:
        def run() -> None:
            descriptor = os.open(journal, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
            os.write(descriptor, b"+")
            job()
            os.write(descriptor, b"-")

        return run

    meeting = [lambda: os.open(pipe, os.O_RDONLY), lambda: os.open(pipe, os.O_WRONLY)]  # each waits for the other
    assert answers([noted(job) for job in [*meeting, int, int, int, *meeting]]) == [None] * 7
    running = [journal.read_text()[:end].count("+") - journal.read_text()[:end].count("-") for end in range(15)]
    assert max(running) == 2


def test_leaving_early_ends_what_still_runs(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)

    def hang() -> None:
        pipe.write_text(str(os.getpid()))
        signal.pause()

    results = isolated([hang, lambda: int(pipe.read_text())], 2, LONG)
    _, process = next(results)
    assert isinstance(process, int)
    assert is_alive(process)
    del results
    assert not is_alive(process)


def test_an_interrupt_ends_the_children_and_goes_on_up(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)

    def interrupt() -> None:
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGUSR1})
        pipe.write_text(str(os.getpid()))
        signal.sigwait({signal.SIGUSR1})
        os.kill(os.getppid(), signal.SIGINT)
        signal.pause()

    results = isolated([interrupt, lambda: int(pipe.read_text())], 2, LONG)
    _, process = next(results)
    assert isinstance(process, int)
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012 it may come anywhere in here
        os.kill(process, signal.SIGUSR1)
        next(results)
    del results
    assert not is_alive(process)


@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM])
def test_children_leave_an_interrupt_to_their_parent(by: signal.Signals) -> None:
    (answer,) = answers([lambda: [signal.raise_signal(by), "still here"]])  # type: ignore[func-returns-value]
    assert answer == [None, "still here"]


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells a process of its parent's death")
def test_a_killed_parent_leaves_no_child(tmp_path: Path) -> None:
    script = (
        "import os, signal, sys\n"
        "from dvca_sumo.engine.processes import isolated\n"
        "def hang():\n"
        "    os.write(int(sys.argv[1]), b'here')\n"
        "    signal.pause()\n"
        "list(isolated([hang, hang], 2, 60.0))\n"
    )
    reader, writer = os.pipe()
    root = Path(__file__).parents[2]
    with subprocess.Popen(  # noqa: S603 our own script
        [sys.executable, "-c", script, str(writer)],
        pass_fds=[writer],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(root)},
    ) as parent:
        os.close(writer)
        heard = b""
        while len(heard) < 8:  # both are there
            heard += os.read(reader, 8)
        parent.kill()
    ready, _, _ = select.select([reader], [], [], LONG)
    assert ready
    assert os.read(reader, 1) == b""  # nobody holds the other end any more
    os.close(reader)


def test_an_interrupt_while_a_child_starts_is_the_parents_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal interrupts the child, too, before it ignores that."""
    fork = os.fork

    def interrupted_fork() -> int:
        child = fork()
        os.kill(os.getpid(), signal.SIGINT)
        return child

    monkeypatch.setattr(os, "fork", interrupted_fork)
    with pytest.raises(KeyboardInterrupt):
        answers([lambda: "here"])
    monkeypatch.undo()
    assert answers([lambda: "still here"]) == ["still here"]
