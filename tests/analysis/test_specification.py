from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from interventions.scenes import Thing, estimate, trajectory, walker
from msgspec.structs import replace
from small_scenarios import driven, scenario_file

from analysis.scenes import BARE_MAP, START, breach, collision, drive, saying
from dvca_sumo.analysis.specification import FORESIGHT, PlanningFinding, first_unusable_plan, first_violating_plan
from dvca_sumo.messages import SPEED, Component, MessageId, Trajectory, X, Y
from dvca_sumo.record import Record
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import EgoTruth
from dvca_sumo.violations import Category, Violation

PLANNING = Component.PLANNING
WALL = Thing("lead", 70.0, 0.0)  # the ego's front bumper, at 10 m/s from x = 23.6 on, reaches it after 4.41 s
CRASH = collision(START + 4.4)
DEPARTED = breach("lane_departure", Category.TRAFFIC_RULE, START + 4.0)


def stopping(who: EgoTruth) -> Trajectory:
    """Stands from the next row on: shorter than any real stop, so that it can never hit anything."""
    points = trajectory(who).points.copy()
    points[1:, X] = points[0, X] + 0.5
    points[1:, SPEED] = 0.0
    return Trajectory(who.time, points, "stop lead")


def beside(left: float) -> Callable[[EgoTruth], Trajectory]:
    def plan(who: EgoTruth) -> Trajectory:
        points = stopping(who).points.copy()
        points[:, Y] += left
        return Trajectory(who.time, points, "nudge")

    return plan


def first(record: Record, violation: Violation = CRASH, thresholds: Thresholds | None = None) -> PlanningFinding | None:
    return first_violating_plan(record, BARE_MAP, record.thresholds if thresholds is None else thresholds, violation)


def test_sound_plans_that_were_not_followed_are_not_to_blame() -> None:
    assert first(drive([WALL], plan=stopping), collision(START + 4.3)) is None


def test_the_first_missing_plan_is_the_one() -> None:
    record = drive([WALL], plan=stopping)
    for index in (21, 20, 30):
        record = saying(record, MessageId(PLANNING, index), None)
    finding = first(record)
    assert finding is not None
    assert finding.mark.index == 20
    assert finding.mark.time == pytest.approx(START + 2.0)
    assert "no trajectory" in finding.reason


def test_a_plan_missing_after_the_violation_is_too_late_to_matter() -> None:
    record = saying(drive([WALL], plan=stopping), MessageId(PLANNING, 50), None)
    assert first(record, collision(START + 4.3)) is None


@pytest.mark.parametrize(("left", "words"), [(1.5, "1.5 m to the left"), (-2.0, "2.0 m to the right")])
def test_a_plan_that_begins_beside_the_ego_is_the_one(left: float, words: str) -> None:
    finding = first(drive(plan=beside(left)), DEPARTED)
    assert finding is not None
    assert finding.mark.index == 0
    assert words in finding.reason


def test_a_plan_may_begin_a_little_beside_the_ego() -> None:
    assert first(drive(plan=beside(0.9)), DEPARTED) is None


def test_beside_means_beside_where_the_ego_believes_to_be() -> None:
    record = drive(plan=beside(1.5))
    for index in range(600):
        believed = replace(estimate(record.path[index]), y=1.5)
        record.executions[Component.LOCALIZATION][index] = replace(
            record.executions[Component.LOCALIZATION][index], message=believed
        )
    assert first(record, DEPARTED) is None


@pytest.mark.parametrize(("speed", "words"), [(14.0, "+4.0 m/s"), (6.0, "-4.0 m/s")])
def test_a_plan_at_another_speed_than_the_egos_is_the_one(speed: float, words: str) -> None:
    record = saying(drive(), MessageId(PLANNING, 7), trajectory(drive().path[70], speed=speed))
    finding = first(record, DEPARTED)
    assert finding is not None
    assert finding.mark.index == 7
    assert words in finding.reason
    assert "10.0 m/s" in finding.reason


def test_a_plan_may_begin_a_little_faster_than_the_ego() -> None:
    record = saying(drive(), MessageId(PLANNING, 7), trajectory(drive().path[70], speed=12.9))
    assert first(record, DEPARTED) is None


def test_the_first_plan_that_drives_into_the_object_within_the_foresight_is_the_one() -> None:
    finding = first(drive([WALL]))
    assert finding is not None
    contact = 4.41
    ahead = contact - (finding.mark.time - START)
    assert FORESIGHT - 0.1 < ahead < FORESIGHT + 0.5  # a time to collision below its threshold counts as well
    assert "driven as planned it leads to" in finding.reason


def test_a_plan_is_judged_by_where_the_object_really_went() -> None:
    crossing = walker("person:ped", 70.0, -4.41, across=1.0)  # on the ego's line when the ego gets there
    standing = walker("person:ped", 70.0, -4.41)
    violation = collision(START + 4.6, "person:ped")
    assert first(drive([crossing]), violation) is not None
    assert first(drive([standing]), violation) is None


def test_a_plan_that_hits_something_else_is_not_the_one() -> None:
    assert first(drive([WALL]), collision(START + 4.4, "other")) is None


def test_a_plan_that_breaks_another_rule_is_not_the_one() -> None:
    assert first(drive([WALL]), breach("speed_limit", Category.TRAFFIC_RULE, START + 4.4)) is None


@pytest.mark.parametrize("signed_lanes", [frozenset(), frozenset(["in_0"])])
def test_no_plan_is_too_fast_for_a_lane_whose_limit_a_variable_sign_sets(signed_lanes: frozenset[str]) -> None:
    def speeding(who: EgoTruth) -> Trajectory:
        points = trajectory(who).points.copy()
        points[5:, SPEED] = 30.0
        return Trajectory(who.time, points, "cruise")

    record = replace(drive(plan=speeding), signed_lanes=signed_lanes)
    finding = first(record, breach("speed_limit", Category.TRAFFIC_RULE, START + 4.4))
    assert (finding is None) == bool(signed_lanes)


def test_a_plan_off_the_road_is_the_one_for_a_departure() -> None:
    def veering(who: EgoTruth) -> Trajectory:
        points = trajectory(who).points.copy()
        points[:, Y] = 0.25 * (points[:, X] - who.x)
        return Trajectory(who.time, points, "cruise")

    record = saying(drive(), MessageId(PLANNING, 9), veering(drive().path[90]))
    finding = first(record, DEPARTED)
    assert finding is not None
    assert finding.mark.index == 9
    assert "lane_departure" in finding.reason


def test_a_plan_is_read_from_the_egos_true_place() -> None:
    record = drive([WALL])
    shift = np.array([0.0, 8.0])  # the ego believes to be 8 m left of where it is, and plans there
    for component in (Component.LOCALIZATION, PLANNING):
        for index, execution in enumerate(record.executions[component]):
            who = record.path[execution.tick]
            message = estimate(who) if component is Component.LOCALIZATION else trajectory(who)
            if isinstance(message, Trajectory):
                points = message.points.copy()
                points[:, [X, Y]] += shift
                moved = replace(message, points=points)
                record.executions[component][index] = replace(execution, message=moved)
            else:
                record.executions[component][index] = replace(execution, message=replace(message, y=8.0))
    finding = first(record)
    assert finding is not None
    assert "driven as planned" in finding.reason


def standing(who: EgoTruth) -> Trajectory:
    return replace(trajectory(replace(who, speed=0.0)), decision="stop phantom")


def still(record: Record) -> Record:
    """The same drive by an ego that believes to stand."""
    for index, execution in enumerate(record.executions[Component.LOCALIZATION]):
        believed = replace(estimate(record.path[execution.tick]), speed=0.0)
        record.executions[Component.LOCALIZATION][index] = replace(execution, message=believed)
    return record


def test_a_plan_to_stand_is_the_one_for_a_destination_that_is_not_reached() -> None:
    late = breach("destination_not_reached", Category.MISSION, START + 6.0)
    finding = first(still(drive(plan=standing)), late)
    assert finding is not None
    assert finding.mark.index == 0
    assert "stands still without a reason (stop phantom)" in finding.reason
    assert first(drive(), late) is None


def test_for_no_progress_only_plans_of_the_judged_standstill_count() -> None:
    stuck = breach("no_progress", Category.MISSION, START + 5.0)
    finding = first(still(drive(plan=standing)), stuck, Thresholds(no_progress_time=2.0))
    assert finding is not None
    assert finding.mark.time == pytest.approx(START + 3.0)


def test_a_plan_to_stand_is_not_to_blame_for_an_overrun() -> None:
    assert first(still(drive(plan=standing)), breach("destination_overrun", Category.MISSION, START + 5.0)) is None


def test_a_plan_that_nobody_can_follow_is_found_in_its_time_alone() -> None:
    record = saying(drive([WALL], plan=stopping), MessageId(PLANNING, 20), None)
    found = first_unusable_plan(record, START + 1.5, START + 2.5)
    assert found is not None
    assert found.mark.index == 20
    assert first_unusable_plan(record, START + 2.05, START + 4.0) is None
    assert first_unusable_plan(record, START, START + 1.95) is None


def test_of_several_plans_in_a_row_that_nobody_can_follow_the_first_is_named() -> None:
    record = drive([WALL], plan=stopping)
    for index in (18, 19, 20, 30):
        record = saying(record, MessageId(PLANNING, index), None)
    for since, until in ((1.5, 2.5), (1.95, 2.5), (2.0, 4.0)):
        found = first_unusable_plan(record, START + since, START + until)
        assert found is not None
        assert found.mark.index == 18
    later = first_unusable_plan(record, START + 2.1, START + 4.0)
    assert later is not None
    assert later.mark.index == 30


def test_a_plan_that_begins_beside_the_ego_cannot_be_followed_and_one_into_a_wall_can() -> None:
    beside_it = first_unusable_plan(drive([WALL], plan=beside(1.5)), START, START + 1.0)
    assert beside_it is not None
    assert "1.5 m to the left" in beside_it.reason
    assert first_unusable_plan(drive([WALL]), START, START + 4.4) is None


def test_on_a_route_that_comes_by_again_a_plan_is_judged_where_it_was_made(
    tmp_path: Path, plain_file: Callable[..., Path]
) -> None:
    """Round the block, and out of it: the second time along the same road, the way goes straight on."""
    nodes = (("w", -60, 0), ("a", 0, 0), ("b", 70, 0), ("c", 70, 70), ("d", 0, 70), ("x", 230, 0))
    edges = "".join(
        f'<edge id="{way}" from="{way[0]}" to="{way[1]}" speed="11"/>' for way in ["wa", "ab", "bc", "cd", "da", "bx"]
    )
    net = plain_file("".join(f'<node id="{name}" x="{x}" y="{y}"/>' for name, x, y in nodes), edges)
    trip = '<vehicle id="ego" depart="0" departPos="20" departSpeed="8" arrivalPos="140"><route edges="{}"/></vehicle>'
    record = driven(scenario_file(tmp_path, net, trip.format("wa ab bc cd da ab bx")))
    assert record.violations == []
    departed = breach("lane_departure", Category.TRAFFIC_RULE, record.moments[-1].time)
    assert first_violating_plan(record, RoadMap.load(net), record.thresholds, departed) is None
