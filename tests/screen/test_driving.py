"""Several egos in one simulation, and SUMO's own drivers before the same oracles."""

from functools import partial
from pathlib import Path

from screen_scenes import HEAR, TRAFFIC, draw, drive, traffic
from small_scenarios import driven as driven_alone
from small_scenarios import in_child

from dvca_sumo.screen.anchor import anchored
from dvca_sumo.screen.driving import driven
from dvca_sumo.screen.judging import Fault
from dvca_sumo.screen.results import TripOutcome
from dvca_sumo.stack.sources import StackSource


def test_a_trip_alone_is_bit_for_bit_the_run_of_that_ego(tmp_path: Path, street: Path) -> None:
    scenario = traffic(tmp_path, street)
    (result,) = drive(scenario, ["second"]).results
    record = driven_alone(scenario.configuration.path, ego="second")
    assert result.digest == record.digest
    assert result.outcome is TripOutcome.ARRIVED
    assert result.duration == round(record.moments[-1].time - record.start, 3)


def test_two_egos_share_a_simulation_and_each_has_its_own_result(tmp_path: Path, street: Path) -> None:
    scenario = traffic(tmp_path, street)
    both = {result.ego: result for result in drive(scenario, ["first", "second"]).results}
    assert [result.outcome for result in both.values()] == [TripOutcome.ARRIVED, TripOutcome.ARRIVED]
    assert both["first"].digest != both["second"].digest
    assert both["second"].start > both["first"].start
    assert all(result.distance > 400.0 for result in both.values())
    assert drive(scenario, ["first", "second"]).results == tuple(both.values())


def test_an_ego_that_is_over_leaves_and_the_others_go_on(tmp_path: Path, street: Path) -> None:
    scenario = traffic(
        tmp_path, street, TRAFFIC.replace('id="first" from="ab" to="bc"', 'id="first" from="ab" to="bn"')
    )
    results = {result.ego: result for result in drive(scenario, ["first", "east"]).results}
    assert {result.outcome for result in results.values()} == {TripOutcome.ARRIVED}


def test_an_ego_that_finds_no_place_is_named_and_not_forgotten(tmp_path: Path, street: Path) -> None:
    found = drive(traffic(tmp_path, street), ["first", "second", "east"], concurrent=1)
    assert [result.ego for result in found.results] == ["first"]
    assert found.crowded_out == ("second", "east")


def test_a_stack_that_fails_costs_its_own_trip_only(tmp_path: Path, street: Path) -> None:
    found = drive(traffic(tmp_path, street), ["first", "second"], stack="small_stacks:raising_planning")
    assert [(result.ego, result.outcome) for result in found.results] == [
        ("first", TripOutcome.ABORTED),
        ("second", TripOutcome.ABORTED),
    ]
    assert all("the lidar said 0" in result.reason for result in found.results)


def test_a_vehicle_that_never_departs_is_reported(tmp_path: Path, street: Path) -> None:
    scenario = traffic(tmp_path, street)
    trips = draw(scenario, 10).trips[:1]
    other = traffic(tmp_path / "other", street, '<trip id="else" from="ab" to="bc" depart="0"/>')
    (result,) = in_child(partial(driven, other, StackSource(), trips, 10, HEAR)).results
    assert (result.ego, result.outcome) == ("first", TripOutcome.NOT_DRIVEN)
    assert "did not depart" in result.reason


def test_sumos_drivers_are_judged_by_the_same_oracles(tmp_path: Path, street: Path) -> None:
    fast = '<vType id="fast" speedFactor="1.4" speedDev="0"/>' + TRAFFIC.replace(
        '<trip id="second"', '<trip id="second" type="fast"'
    )
    scenario = traffic(tmp_path, street, fast)
    results = {one.ego: one for one in in_child(partial(anchored, scenario, draw(scenario, 10).trips, HEAR)).results}
    assert {result.outcome for result in results.values()} == {TripOutcome.ARRIVED}
    assert {(one.violation.kind, one.fault) for one in results["second"].violations} == {("speed_limit", Fault.DRIVER)}
    assert [result.ego for result in results.values() if result.violations] == ["second"]
    assert results["first"].distance > 450.0


def test_sumos_drivers_make_no_stops_that_the_ads_does_not_make(tmp_path: Path, street: Path) -> None:
    scenario = traffic(tmp_path, street, TRAFFIC.replace('duration="9"', 'duration="900"'))
    trips = [trip for trip in draw(scenario, 10).trips if trip.ego == "stopping"]
    assert trips[0].expected < 100.0
    (sumo,) = in_child(partial(anchored, scenario, trips, HEAR)).results
    (ads,) = drive(scenario, ["stopping"]).results
    assert (sumo.outcome, ads.outcome) == (TripOutcome.ARRIVED, TripOutcome.ARRIVED)
    assert max(sumo.duration, ads.duration) < 100.0
