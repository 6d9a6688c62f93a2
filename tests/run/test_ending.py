"""When a drive ends, and what is judged until then."""

from functools import partial
from pathlib import Path

import pytest
from small_scenarios import EGO, driven, in_child, scenario_file

from dvca_sumo.engine.replay import roadmap
from dvca_sumo.record import Record
from dvca_sumo.run import StopRule, Task, departed
from dvca_sumo.scenario import load_scenario
from dvca_sumo.stack.reference import reference_stack
from dvca_sumo.violations import Answer, Contact, Ending

STOPPED = (
    '<vehicle id="stopped" depart="0" departPos="50"><route edges="bc"/>'
    '<stop lane="bc_0" endPos="51" duration="1000"/></vehicle>'
)
SLOW_EGO = '<trip id="ego" from="bc" to="bc" depart="0" departPos="20" departSpeed="0" departLane="0"/>'


def to(position: float) -> str:
    """The slow ego on a trip that ends there [m]."""
    return SLOW_EGO.replace("/>", f' arrivalPos="{position:g}"/>')


def test_a_drive_ends_when_the_ego_stands_at_its_destination(tmp_path: Path, street: Path) -> None:
    record = driven(scenario_file(tmp_path, street))
    assert record.ending is Ending.ARRIVED
    assert record.path[-1].speed < 0.1
    assert {judgement.answer for judgement in record.judgements} == {Answer.KEPT}
    station = record.stations[-1] + record.moments[-1].shape.front
    assert abs(station - record.route.destination) < 3.0


def test_who_waits_short_of_a_destination_told_more_narrowly_has_not_arrived(tmp_path: Path, street: Path) -> None:
    """Behind somebody who goes on after 40 s."""
    waiting = STOPPED.replace('departPos="50"', 'departPos="60"').replace(
        'endPos="51" duration="1000"', 'endPos="99" duration="40"'
    )
    ego = to(91.0).replace("/>", '><param key="dvca.destination_tolerance" value="1"/></trip>')
    record = driven(scenario_file(tmp_path, street, waiting + ego))
    assert record.ending is Ending.ARRIVED
    assert record.violations == []
    assert record.moments[-1].time > 40.0


def test_a_stop_time_cuts_the_drive_and_leaves_the_mission_open(tmp_path: Path, street: Path) -> None:
    record = driven(scenario_file(tmp_path, street), stop=StopRule(at=2.0))
    assert record.ending is Ending.CUT
    assert record.moments[-1].time == pytest.approx(2.0)
    assert record.violations == []
    assert Answer.UNKNOWN in {judgement.answer for judgement in record.judgements}


@pytest.mark.parametrize("after", [0.0, 1.0])
def test_a_contact_ends_the_drive_after_the_time_allowed(tmp_path: Path, street: Path, after: float) -> None:
    config = scenario_file(tmp_path, street, SLOW_EGO + STOPPED)
    record = driven(config, stack="small_stacks:full_throttle", stop=StopRule(after_contact=after))
    collision = next(one for one in record.violations if one.contact is not None)
    assert (collision.kind, collision.object, collision.contact) == ("collision", "stopped", Contact.ACTIVE_FRONT)
    assert record.ending is Ending.CUT
    assert record.moments[-1].time == pytest.approx(collision.time + after)
    assert record.moments[-1].objects.ids == ("stopped",)


def test_what_follows_a_contact_is_recorded_but_not_judged(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path, street, SLOW_EGO + STOPPED)
    short = driven(config, stack="small_stacks:full_throttle")
    record = driven(config, stack="small_stacks:full_throttle", stop=StopRule(after_contact=6.0))
    assert record.path[-1].speed > 20.0
    assert len(record.moments) == len(short.moments) + 60
    assert record.violations == short.violations
    assert max(one.time for one in record.violations) <= short.moments[-1].time


def test_what_is_concluded_at_the_end_does_not_count_after_a_contact(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path, street, to(110.0) + STOPPED, end="8")
    record = driven(config, stack="small_stacks:full_throttle", stop=StopRule(after_contact=60.0))
    assert record.ending is Ending.TIME_OVER
    assert record.moments[-1].time == pytest.approx(8.0)
    assert {one.kind for one in record.violations} == {"ttc", "collision"}
    assert {one.kind: one.answer for one in record.judgements}["destination"] is Answer.UNKNOWN


@pytest.mark.parametrize(("end", "ending"), [("8", Ending.TIME_OVER), ("5", Ending.CUT)])
def test_at_the_scenarios_end_who_could_be_there_is_late_and_of_others_it_is_not_known(
    tmp_path: Path, street: Path, end: str, ending: Ending
) -> None:
    record = driven(scenario_file(tmp_path, street, to(110.0), end=end), stack="small_stacks:standing")
    assert record.ending is ending
    assert record.moments[-1].time == pytest.approx(float(end))
    (answer,) = [one.answer for one in record.judgements if one.kind == "destination"]
    assert answer is (Answer.VIOLATED if ending is Ending.TIME_OVER else Answer.UNKNOWN)


def test_without_anything_in_the_way_the_same_drive_is_too_fast(tmp_path: Path, street: Path) -> None:
    record = driven(
        scenario_file(tmp_path, street, SLOW_EGO), stack="small_stacks:full_throttle", stop=StopRule(at=9.0)
    )
    assert [one.kind for one in record.violations] == ["speed_limit"]


def test_a_violation_ends_the_drive_after_the_time_allowed(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path, street, SLOW_EGO)
    record = driven(config, stack="small_stacks:full_throttle", stop=StopRule(after_violation=0.5))
    (violation,) = record.violations
    assert record.ending is Ending.CUT
    assert record.moments[-1].time - violation.time == pytest.approx(0.5, abs=0.11)


def test_an_ego_that_drives_past_its_destination_is_lost_at_last(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path, street, EGO.replace('"60"', '"40"'))
    record = driven(config, stack="small_stacks:full_throttle")
    assert record.ending is Ending.TIME_OVER
    beyond = record.stations[-1] + record.moments[-1].shape.front - record.route.destination
    assert 50.0 < beyond < 65.0
    assert "destination" in {one.kind.split("_")[0] for one in record.violations}


def test_an_ego_that_never_starts_is_stuck(tmp_path: Path, street: Path) -> None:
    record = driven(scenario_file(tmp_path, street, SLOW_EGO, time_to_teleport="5"), stack="small_stacks:standing")
    assert record.ending is Ending.TIME_OVER
    assert "no_progress" in {one.kind for one in record.violations}
    assert record.moments[-1].time - record.start == pytest.approx(record.thresholds.no_progress_time, abs=1.0)


def test_violations_are_in_the_order_of_time_and_agree_with_the_judgements(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path, street, to(150.0), end="12")
    record = driven(config, stack="small_stacks:full_throttle")
    assert [one.time for one in record.violations] == sorted(one.time for one in record.violations)
    judged = [one for judgement in record.judgements for one in judgement.violations]
    assert sorted(judged, key=lambda one: one.time) == record.violations
    assert len(record.violations) >= 2


def test_what_is_concluded_at_the_end_counts_once_however_often_it_is_asked(tmp_path: Path, street: Path) -> None:
    task = Task(load_scenario(scenario_file(tmp_path, street, end="4")))

    def job() -> tuple[Record, Record]:
        with departed(task, partial(roadmap, street), reference_stack) as simulation:
            drive = simulation.drive
            return simulation.proceed(), drive.record(0.0)

    first, second = in_child(job)
    assert [one.kind for one in first.violations] == ["destination_not_reached"]
    assert second.violations == first.violations
    assert second.judgements == first.judgements
