"""Files that are open when a process is forked: nobody reads another's bytes away, nobody writes but the first."""

import contextlib
import os
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import forking_stacks
import pytest
from forked_drives import assert_as_replayed, fork_engine, glimpses, ideal
from small_scenarios import EGO, in_child, scenario_file

from dvca_sumo.engine import descriptors
from dvca_sumo.engine.descriptors import make_own
from dvca_sumo.messages import Component
from dvca_sumo.run import StopRule, Task
from dvca_sumo.scenario import load_scenario

DETECTORS = "".join(
    f'<{kind} id="{kind}" lane="bc_0" pos="100" {extent} period="1" file="{kind}.xml"/>'
    for kind, extent in (("inductionLoop", ""), ("laneAreaDetector", 'length="50"'))
)
OUTPUTS = {name: f"{name}.xml" for name in ("tripinfo_output", "fcd_output", "summary_output", "netstate_dump")}


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return tmp_path / "log"


@pytest.fixture
def text(tmp_path: Path) -> Path:
    path = tmp_path / "text"
    path.write_bytes(b"0123456789")
    return path


def owned(log: Path, job: Callable[[], Any]) -> Any:
    """What a job answers in a forked process whose descriptors are its own."""

    def work() -> Any:
        make_own(log)
        return job()

    return in_child(work)


@pytest.mark.parametrize("mode", ["rb", "r+b"])
def test_a_child_reads_on_where_its_parent_was_and_leaves_that_where_it_is(text: Path, log: Path, mode: str) -> None:
    with text.open(mode, buffering=0) as file:
        file.read(3)
        assert owned(log, lambda: file.read(4)) == b"3456"
        assert file.read(2) == b"34"


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="only Linux opens a file that has no name")
@pytest.mark.parametrize("mode", ["rb", "r+b"])
def test_a_file_that_was_deleted_is_read_on(text: Path, log: Path, mode: str) -> None:
    with text.open(mode, buffering=0) as file:
        text.unlink()
        file.read(3)
        assert owned(log, lambda: file.read(4)) == b"3456"
        assert file.read(2) == b"34"


@pytest.mark.parametrize("mode", ["wb", "ab"])
def test_what_a_child_writes_into_a_file_of_its_parent_goes_nowhere(text: Path, log: Path, mode: str) -> None:
    with text.open(mode, buffering=0) as file:
        file.write(b"abc")
        before = text.read_bytes()
        assert owned(log, lambda: file.write(b"from the child")) == 14
        assert text.read_bytes() == before
        file.write(b"def")
    assert text.read_bytes() != before


def test_a_child_is_told_that_it_cannot_write_into_a_file_that_its_parent_reads_and_writes(
    text: Path, log: Path
) -> None:
    with text.open("r+b", buffering=0) as file:
        with pytest.raises(OSError, match="Bad file descriptor"):
            owned(log, lambda: file.write(b"from the child"))
        assert text.read_bytes() == b"0123456789"
        file.write(b"abc")
    assert text.read_bytes() == b"abc3456789"


@pytest.mark.parametrize("journal", ["delete", "wal"])
def test_a_child_asks_on_of_a_data_base_that_its_parent_has_open(tmp_path: Path, log: Path, journal: str) -> None:
    with contextlib.closing(sqlite3.connect(tmp_path / "map.db")) as lanes:
        lanes.execute(f"pragma journal_mode={journal}")
        lanes.execute("create table lane (number integer primary key, width real)")
        lanes.executemany("insert into lane values (?, ?)", ((number, 3.2) for number in range(20_000)))
        lanes.commit()
        widest = "select count(*), max(width) from lane"
        assert owned(log, lambda: lanes.execute(widest).fetchone()) == (20_000, 3.2)
        lanes.execute("update lane set width = 3.5 where number = 7")
        lanes.commit()
        assert lanes.execute(widest).fetchone() == (20_000, 3.5)


def test_what_a_child_prints_goes_to_its_log(log: Path) -> None:
    owned(log, lambda: [os.write(1, b"out\n"), os.write(2, b"err\n")])
    assert log.read_text() == "out\nerr\n"


def test_pipes_stay_shared(log: Path) -> None:
    reader, writer = os.pipe()
    owned(log, lambda: os.write(writer, b"hello"))
    assert os.read(reader, 9) == b"hello"
    os.close(reader)
    os.close(writer)


def test_descriptors_do_not_become_more(text: Path, log: Path) -> None:
    def count() -> int:
        return len(os.listdir(descriptors._FOLDER))  # noqa: PTH208

    with text.open("rb"), text.open("ab"):
        assert owned(log, count) == in_child(count)


def test_a_file_that_cannot_be_opened_again_is_not_shared_in_silence(
    text: Path, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(descriptors, "_path_of", lambda number: f"/nowhere/{number}")
    with text.open("rb"), pytest.raises(FileNotFoundError):
        owned(log, int)


def test_a_file_for_reading_and_writing_that_cannot_be_opened_again_stands_in_nobodys_way(
    text: Path, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(descriptors, "_path_of", lambda number: f"/nowhere/{number}")
    with text.open("r+b", buffering=0) as file:
        owned(log, int)
        with pytest.raises(OSError, match="Bad file descriptor"):
            owned(log, lambda: file.read(4))
        assert file.read(2) == b"01"


def piecemeal(folder: Path, net: Path) -> Task:
    """3000 vehicles over 3000 s, of which SUMO reads 200 s at a time, and a mebibyte of the file at a time.

    It reads the second one, which begins with what departs at 206 s, while the ego drives.
    """
    ego = '<trip id="ego" from="ab" to="bc" depart="190" departPos="20" departSpeed="10" arrivalPos="90"/>'
    leaving = [
        f'<vehicle id="v{time}" depart="{time}" departSpeed="10"><route edges="{edge}"/></vehicle>'.ljust(2**20 // 206)
        for time, edge in enumerate(1500 * ("bn", "bs"))
    ]
    routes = "".join([*leaving[:190], ego, *leaving[190:]])
    return Task(load_scenario(scenario_file(folder, net, routes)), stop=StopRule(at=230.0))


def test_branches_see_every_vehicle_of_a_route_file_that_is_read_piecemeal(tmp_path: Path, street: Path) -> None:
    task = piecemeal(tmp_path, street)
    with fork_engine(street, spacing=50) as engine:
        record = engine.record(task)
        assert len({name for moment in record.moments for name in moment.objects.ids}) > 15
        later = [ideal(task, since, Component.LOCALIZATION, stop=task.stop) for since in (5.0, 8.0, 15.0)]
        assert_as_replayed(engine, street, None, task, *later)


def test_branches_write_nothing_into_what_their_scenario_or_the_analysis_has_open(
    tmp_path: Path, street: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = scenario_file(tmp_path / "scenario", street, EGO, DETECTORS, **OUTPUTS)
    before = {path.name: path.read_bytes() for path in config.parent.iterdir()}
    task = Task(load_scenario(config))
    with (tmp_path / "mine").open("wb", buffering=0) as mine:
        mine.write(b"mine")
        monkeypatch.setattr(forking_stacks, "told", mine.fileno())
        with fork_engine(street, "forking_stacks:scribbling") as engine:
            engine.record(task)
            glimpses(engine, *(ideal(task, since, Component.PERCEPTION) for since in (0.0, 1.0, 2.0)))
    assert (tmp_path / "mine").read_bytes() == b"mine"
    assert {path.name: path.read_bytes() for path in config.parent.iterdir()} == before


def test_a_scenario_that_asks_for_rerouting_threads_is_branched_all_the_same(tmp_path: Path, street: Path) -> None:
    options = {"device__rerouting__threads": "4", "device__rerouting__probability": "1", "threads": "4"}
    follower = '<trip id="behind" depart="0" from="bc" to="bc" departPos="8" departSpeed="10"/>'
    task = Task(load_scenario(scenario_file(tmp_path, street, EGO + follower, **options)))
    with fork_engine(street) as engine:
        engine.record(task)
        assert_as_replayed(engine, street, None, ideal(task, 1.5, Component.PERCEPTION))
