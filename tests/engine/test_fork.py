"""The fork engine: branches are bit for bit what the replay engine gives, and what cannot be branched is replayed."""

import math
import os
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from forked_drives import SUBSTITUTABLE, assert_as_replayed, factual, fork_engine, glimpses, ideal, outcomes
from msgspec.structs import replace
from small_scenarios import EGO, TIMEOUT, scenario_file

from dvca_sumo.engine import grove, thinning
from dvca_sumo.engine.fork import ForkEngine
from dvca_sumo.engine.protocol import Glimpse
from dvca_sumo.engine.thinning import Memory, is_kept
from dvca_sumo.installation import scenario_path
from dvca_sumo.interventions import Futures, planted_fault, recorded_futures
from dvca_sumo.messages import Component
from dvca_sumo.run import StopRule, Task
from dvca_sumo.scenario import Scenario, load_scenario

PERCEPTION, PREDICTION, CONTROL = Component.PERCEPTION, Component.PREDICTION, Component.CONTROL
BUILT_IN = (
    ("cs1", "perception.miss"),
    ("cs2", "prediction.wrong"),
    ("cs4", "planning.path:start=8"),
    ("cs5", "control.lateral:start=10"),
)
FULL_THROTTLE = "small_stacks:full_throttle"


@pytest.fixture
def task(tmp_path: Path, street: Path) -> Task:
    return factual(tmp_path, street)


@pytest.fixture
def short_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One whose path is not too long for that of a socket in it."""
    return tmp_path_factory.mktemp("t")


def test_pythons_own_random_numbers_go_on_in_a_branch(task: Task, street: Path) -> None:
    stack = "forking_stacks:wobbling"
    with fork_engine(street, stack) as engine:
        engine.record(task)
        assert_as_replayed(engine, street, stack, *(ideal(task, since, PREDICTION) for since in (1.0, 2.5)))


def accelerating(folder: Path, net: Path) -> Task:
    """A drive that, with `FULL_THROTTLE`, breaks the speed limit midway."""
    slow = EGO.replace('departSpeed="10"', 'departSpeed="2"').replace('arrivalPos="60"', 'arrivalPos="200"')
    return Task(load_scenario(scenario_file(folder, net, slow)))


def built_in(name: str) -> Scenario:
    return load_scenario(scenario_path(Path(f"nets/{name}.sumocfg")))


@pytest.mark.parametrize(("name", "fault"), BUILT_IN)
def test_a_branch_is_the_replayed_run_bit_for_bit(name: str, fault: str) -> None:
    scenario = built_in(name)
    task = Task(scenario, (planted_fault(fault),), StopRule(after_contact=6.0))
    with fork_engine(scenario.configuration.net, spacing=40) as engine:
        record = engine.record(task)
        assert record.violations
        violated = record.violations[0].time - record.start
        stop = StopRule(after_violation=0.0, at=record.violations[0].time + 2.0)
        known = replace(task, futures=recorded_futures(record.moments), stop=stop)
        first = [ideal(known, violated - 2.0, *SUBSTITUTABLE, stop=stop), known]
        singles = [ideal(known, violated - 1.0, component, stop=stop) for component in (PERCEPTION, PREDICTION)]
        assert_as_replayed(engine, scenario.configuration.net, None, *first, *singles)


def test_a_branch_begins_before_the_first_message_that_it_substitutes(task: Task, street: Path) -> None:
    with fork_engine(street) as engine:
        engine.record(task)
        assert 20 in _steps(engine)
        starts = (0.0, 1.99, 1.991, 1.995, 2.0, 2.001, 2.09, 30.0)
        assert_as_replayed(engine, street, None, *(ideal(task, since, CONTROL) for since in starts))


def test_a_prediction_that_comes_true_only_in_a_later_pass_is_branched(tmp_path: Path, street: Path) -> None:
    ahead = '<vehicle id="ahead" depart="0" departPos="35" departSpeed="10"><route edges="bc"/></vehicle>'
    task = Task(load_scenario(scenario_file(tmp_path, street, EGO + ahead)))
    with fork_engine(street) as engine:
        (track,) = recorded_futures(engine.record(task).moments).tracks.values()
        elsewhere = Futures({"ahead": replace(track, poses=track.poses + np.array([3.0, 0.0, 0.0]))})
        asked = ideal(replace(task, futures=elsewhere), 0.5, PREDICTION)
        assert_as_replayed(engine, street, None, asked)
        (found,) = glimpses(engine, asked)
        assert isinstance(found, Glimpse)
        assert found.passes == 2


def test_a_run_that_ends_before_it_substitutes_anything_ends_when_it_would(tmp_path: Path, street: Path) -> None:
    task = accelerating(tmp_path, street)
    with fork_engine(street, FULL_THROTTLE) as engine:
        record = engine.record(task)
        violated = record.violations[0].time
        assert 2.0 < violated < record.moments[-1].time - 2.0
        stops = [
            StopRule(after_violation=0.0),
            StopRule(after_violation=1.0),
            StopRule(at=violated - 1.0),
            StopRule(settled=violated - 1.0, place=-1000.0),
            StopRule(settled=violated - 1.0, place=record.stations[-200]),
        ]
        late = record.moments[-1].time - record.start - 0.5
        asked = [ideal(task, late, PERCEPTION, stop=stop) for stop in stops]
        assert_as_replayed(engine, street, FULL_THROTTLE, *asked)


def test_answers_and_their_cost_do_not_depend_on_how_many_run_at_once(task: Task, street: Path) -> None:
    asked = [ideal(task, since, *which) for since in (1.7, 1.9, 3.3) for which in ((PERCEPTION,), SUBSTITUTABLE)]
    found = []
    for jobs in (1, 2, 4):
        with fork_engine(street, jobs=jobs) as engine:
            engine.record(task)
            batches = [*glimpses(engine, *asked[1:]), *glimpses(engine, *asked[:3])]
        found.append([replace(one, wall=0.0) if isinstance(one, Glimpse) else one for one in batches])
    assert found[0] == found[1] == found[2]


def test_a_question_costs_the_part_that_differs_from_what_was_asked_there_before(task: Task, street: Path) -> None:
    with fork_engine(street, spacing=1000) as engine:
        whole = engine.record(task).simulated
        asked = ideal(task, 2.0, PERCEPTION)
        (first,), (again,) = glimpses(engine, asked), glimpses(engine, asked)
    assert isinstance(first, Glimpse)
    assert isinstance(again, Glimpse)
    assert first.simulated == pytest.approx(whole, abs=0.5)
    assert again.simulated == pytest.approx(first.simulated - 2.0)


def test_the_repeated_run_leaves_checkpoints_shortly_before_the_violation(tmp_path: Path, street: Path) -> None:
    task = accelerating(tmp_path, street)
    with fork_engine(street, FULL_THROTTLE, spacing=1000) as engine:
        record = engine.record(task)
        violated = math.floor(10.0 * (record.violations[0].time - record.start) + 1e-6)
        glimpses(engine, replace(task, stop=StopRule(after_violation=0.0)))
        glimpses(engine)
        assert _steps(engine) == [0, violated - 40, violated - 20, violated - 10]


def test_another_scenario_or_fault_is_replayed(task: Task, street: Path) -> None:
    other = replace(task, scenario=load_scenario(task.scenario.configuration.path, seed=99))
    faulty = replace(task, interventions=(planted_fault("control.lateral"),))
    jittered = replace(task, jitter=1)
    with fork_engine(street) as engine:
        engine.record(task)
        assert_as_replayed(engine, street, None, other, faulty, jittered, task)
        assert engine.record(other).digest == engine.witness.record(other).digest


@pytest.mark.parametrize(
    ("stack", "words"),
    [
        ("threaded", "the run cannot be branched: it runs 2 threads"),
        ("conversing", "the run cannot be branched: it has a pipe or socket"),
        (None, "jitter"),
    ],
)
def test_what_cannot_be_branched_is_replayed_and_the_reason_told(
    task: Task, street: Path, stack: str | None, words: str
) -> None:
    stack = stack and f"forking_stacks:{stack}"
    asked = task if stack else replace(task, jitter=0)
    with fork_engine(street, stack) as engine:
        assert (engine.name, engine.fallback) == ("fork", None)
        record = engine.record(asked)
        assert engine.name == "replay"
        assert engine.fallback is not None
        assert words in engine.fallback
        assert engine.checkpoint_processes == ()
        assert record.digest == engine.witness.record(asked).digest
        (found,) = glimpses(engine, asked)
        assert isinstance(found, Glimpse)
        assert found.digest == record.digest


def test_a_thread_that_is_started_later_leaves_the_checkpoints_before_it(task: Task, street: Path) -> None:
    with fork_engine(street, "forking_stacks:threaded_late") as engine:
        engine.record(task)
        assert len(engine.checkpoint_processes) == 2
        assert_as_replayed(engine, street, "forking_stacks:threaded_late", ideal(task, 3.0, PERCEPTION))


@pytest.mark.parametrize(("where", "name"), [(os, "fork"), (grove, "Pipe"), (socket, "socket"), (tempfile, "mkdtemp")])
def test_a_system_without_processes_or_descriptors_to_give_is_no_error(
    task: Task, street: Path, short_folder: Path, monkeypatch: pytest.MonkeyPatch, where: object, name: str
) -> None:
    def refuse(*_words: object, **_settings: object) -> int:
        raise BlockingIOError(11, "Resource temporarily unavailable")

    with fork_engine(street) as engine, monkeypatch.context() as patch:
        replayed = engine.witness.record(task)
        patch.setattr(engine.witness, "record", lambda _task: replayed)
        patch.setattr(tempfile, "tempdir", str(short_folder))
        patch.setattr(where, name, refuse)
        assert engine.record(task) is replayed
        assert engine.fallback is not None
        assert "the system gives no process or socket" in engine.fallback
    assert list(short_folder.iterdir()) == []


def test_a_long_path_of_the_folder_for_temporary_files_does_not_matter(
    task: Task, street: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / ("x" * 150)
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    with fork_engine(street) as engine:
        engine.record(task)
        assert engine.fallback is None


def test_nothing_is_left_in_the_folder_for_temporary_files(
    task: Task, street: Path, short_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(short_folder))
    with fork_engine(street) as engine:
        engine.record(task)
        assert list(short_folder.iterdir()) != []
        glimpses(engine, ideal(task, 1.0, PREDICTION), ideal(task, 1.0, CONTROL))
    assert list(short_folder.iterdir()) == []


def test_thinned_checkpoints_are_near_to_every_age_and_few() -> None:
    for latest in range(300):
        kept = [number for number in range(latest + 1) if all(is_kept(number, now) for now in range(latest + 1))]
        assert kept[0] == 0
        for age in range(latest + 1):
            assert min(latest - number for number in kept if latest - number >= age) <= max(5 / 3 * age, age)
        assert len(kept) <= 3 + 2 * math.log2(latest + 1)


def test_what_is_not_kept_once_is_never_needed_again() -> None:
    for number in range(300):
        answers = [is_kept(number, latest) for latest in range(number, 600)]
        assert answers == sorted(answers, reverse=True)


def test_a_run_keeps_the_start_and_checkpoints_at_doubling_distances(task: Task, street: Path) -> None:
    with fork_engine(street, spacing=1) as engine:
        last = len(engine.record(task).digests)
        steps = _steps(engine)
    assert steps == [step for step in range(last + 1) if is_kept(step, last)]
    assert steps[0] == 0


def test_memory_is_measured_only_when_more_may_have_been_copied_than_the_budget(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    held = {1: 300, 2: 500}
    measured: list[int] = []

    def measure(process: int) -> int:
        measured.append(process)
        return held[process]

    monkeypatch.setattr(thinning, "MEMORY_BUDGET", 1000)
    monkeypatch.setattr(thinning, "private_memory", measure)
    memory = Memory()
    for copied, so_often in ((1000, 0), (1, 2), (199, 2), (2, 4)):
        memory.add(copied)
        assert not memory.is_over_budget(held)
        assert len(measured) == so_often
    held[2] = 900
    memory.add(201)
    assert memory.is_over_budget(held)


def test_a_memory_budget_that_is_used_up_leaves_the_start_and_the_latest(
    task: Task, street: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(thinning, "MEMORY_BUDGET", 0)
    with fork_engine(street) as engine:
        last = len(engine.record(task).digests)
        assert _steps(engine) == [0, last - last % 10]
        asked = [ideal(task, since, PERCEPTION) for since in (1.5, 2.5, 4.5)]
        assert_as_replayed(engine, street, None, *asked)
        assert _steps(engine) == [0, last - last % 10]


def test_an_engine_that_was_closed_goes_on_from_time_0(task: Task, street: Path) -> None:
    asked = ideal(task, 2.0, PERCEPTION)
    with fork_engine(street) as engine:
        digest = engine.record(task).digest
        engine.close()
        assert engine.record(task).digest == digest
        assert outcomes(glimpses(engine, asked)) == outcomes(glimpses(engine.witness, asked))


def python(script: str, folder: Path, *words: str, **environment: str) -> str:
    """What a script in a process of its own prints; it must not complain, nor leave a temporary file in `folder`."""
    said = subprocess.run(  # noqa: S603 our own script
        [sys.executable, "-c", script, *words],
        check=True,
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2]), "TMPDIR": str(folder), **environment},
    )
    assert said.stderr == ""
    assert list(folder.iterdir()) == []
    return said.stdout.strip()


def test_a_drive_that_is_never_explained_does_not_keep_python_from_ending(tmp_path: Path, street: Path) -> None:
    script = (
        "import sys, dvca_sumo\n"
        "drive = dvca_sumo.drive(dvca_sumo.load_scenario(sys.argv[1]), engine='fork')\n"
        "print(drive.engine.checkpoint_processes)\n"
    )
    folder = tmp_path / "temporary"
    folder.mkdir()
    assert python(script, folder, str(scenario_file(tmp_path, street))) not in ("", "()")


def test_a_run_stays_in_one_thread_where_numpy_was_imported_before(tmp_path: Path) -> None:
    script = (
        "import numpy as np\n"
        "from dvca_sumo.engine.forking import thread_count\n"
        "from dvca_sumo.engine.processes import isolated\n"
        "def threads():\n"
        "    long = np.ones((400, 400))\n"
        "    long @ long\n"
        "    return thread_count()\n"
        "print(list(isolated([threads], 1, 60.0)))\n"
    )
    assert python(script, tmp_path, OPENBLAS_NUM_THREADS="2") == "[(0, 1)]"


@pytest.mark.parametrize("imports", ["numpy, dvca_sumo", "dvca_sumo, numpy"])
def test_products_are_the_same_to_the_last_bit_however_many_threads_are_asked_for(tmp_path: Path, imports: str) -> None:
    script = (
        f"import hashlib, {imports}\n"
        "values = numpy.random.default_rng(1).normal(size=(600, 2503))\n"
        "print(hashlib.md5((values[:, :3] @ values[:3]).tobytes()).hexdigest())\n"
    )
    alone, several = (python(script, tmp_path, OPENBLAS_NUM_THREADS=threads) for threads in ("1", "2"))
    assert alone == several


def test_a_system_that_cannot_fork_has_the_replay_engine(tmp_path: Path) -> None:
    script = (
        "import sys, dvca_sumo.api\n"
        "for name in [name for name in sys.modules if name.startswith('dvca_sumo.')]:\n"
        "    del sys.modules[name]\n"
        "sys.modules |= dict.fromkeys(['fcntl', 'resource'])\n"
        "sys.platform = 'win32'\n"
        "import dvca_sumo.api\n"
        "print(dvca_sumo.api.DEFAULT_ENGINE)\n"
    )
    assert python(script, tmp_path) == "replay"


def _steps(engine: ForkEngine) -> list[int]:
    assert engine._grove is not None
    return sorted(one.parked.step for one in engine._grove.checkpoints)
