"""Several egos in one simulation, and SUMO's own drivers before the same oracles."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import msgspec
import pytest
from screen_scenes import HEAR, TRAFFIC, draw, drive, traffic
from small_scenarios import driven as driven_alone
from small_scenarios import in_child, scenario_file

from dvca_sumo.responsibility.judging import AtFault
from dvca_sumo.scenario import AUTO, Scenario, load_scenario
from dvca_sumo.screen import anchor
from dvca_sumo.screen.anchor import anchored
from dvca_sumo.screen.driving import driven
from dvca_sumo.screen.neighbours import Neighbours
from dvca_sumo.screen.results import TripOutcome
from dvca_sumo.screen.summary import summary_of
from dvca_sumo.screen.trips import Trip
from dvca_sumo.stack.sources import StackSource


@pytest.fixture
def lane(plain_file: Callable[..., Path]) -> Path:
    """A single lane, 400 m long."""
    return plain_file(
        '<node id="w" x="0" y="0"/><node id="e" x="400" y="0"/>', '<edge id="we" from="w" to="e" speed="13.9"/>'
    )


def behind_a_slow_one(folder: Path, lane: Path, speed: str, end: str) -> tuple[Scenario, list[Trip]]:
    """An ego on that lane behind a vehicle no faster than `speed` [m/s], until `end` [s]."""
    routes = (
        f'<vType id="slow" maxSpeed="{speed}"/><vehicle id="other" type="slow" depart="0" departPos="95">'
        '<route edges="we"/></vehicle><trip id="ego" from="we" to="we" depart="1"/>'
    )
    return traffic(folder, lane, routes, end=end), [Trip("ego", 1.0, 395.0, 29.0, 400.0)]


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
    results = {one.ego: one for one in in_child(partial(anchored, scenario, draw(scenario, 5).trips, HEAR)).results}
    assert {result.outcome for result in results.values()} == {TripOutcome.ARRIVED}
    assert {(one.violation.kind, one.fault) for one in results["second"].violations} == {
        ("speed_limit", AtFault.DRIVER)
    }
    assert [result.ego for result in results.values() if result.violations] == ["second"]
    assert results["first"].distance > 450.0


def test_what_comes_of_a_trip_is_not_known_where_sumo_gives_its_driver_another_route(
    tmp_path: Path, grid_file: Callable[..., Path]
) -> None:
    closed = (
        '<rerouter id="r" edges="A1B1"><interval begin="0" end="99"><closingReroute id="B1C1"/></interval></rerouter>'
    )
    routes = '<vehicle id="v" depart="1" departPos="100"><route edges="A0A1 A1B1 B1C1 C1C2"/></vehicle>'
    scenario = load_scenario(scenario_file(tmp_path, grid_file(), routes, closed), AUTO)
    (sumo,) = in_child(partial(anchored, scenario, [Trip("v", 1.0, 300.0, 22.0, 60.0)], HEAR)).results
    assert sumo.outcome is TripOutcome.CUT
    assert sumo.reason.startswith("SUMO gave it another route at ")
    found = summary_of([msgspec.structs.replace(sumo, outcome=TripOutcome.ARRIVED)], [sumo], Neighbours(0.0, 0, 0, 0))
    assert found.travel_time_ratio.count == 0


def test_a_trip_on_which_sumo_teleports_its_driver_is_not_completed(tmp_path: Path, lane: Path) -> None:
    routes = (
        '<vehicle id="parked" depart="0" departPos="195"><route edges="we"/><stop lane="we_0" endPos="200" '
        'duration="1000"/></vehicle><trip id="v" from="we" to="we" depart="1" departPos="170"/>'
    )
    scenario = traffic(tmp_path, lane, routes, time_to_teleport="5")
    (sumo,) = in_child(partial(anchored, scenario, [Trip("v", 1.0, 300.0, 22.0, 60.0)], HEAR)).results
    assert sumo.outcome is TripOutcome.ABORTED
    assert sumo.reason.startswith("SUMO teleported it or took it away at ")


def test_sumos_drivers_are_measured_up_to_a_contact_and_have_not_completed_their_trip(
    tmp_path: Path, lane: Path
) -> None:
    box = '<poly id="box" type="obstacle.box" fill="1" shape="200,0 204,0 204,-4 200,-4"/>'
    config = scenario_file(tmp_path, lane, '<trip id="v" from="we" to="we" depart="1"/>', box)
    scenario = load_scenario(config, AUTO)
    (sumo,) = in_child(partial(anchored, scenario, [Trip("v", 1.0, 395.0, 29.0, 40.0)], HEAR)).results
    assert sumo.outcome is TripOutcome.ARRIVED
    assert [(one.violation.kind, one.fault) for one in sumo.violations][-1] == ("collision", AtFault.DRIVER)
    assert sumo.distance - sumo.distance_after == pytest.approx(195.0, abs=3.0)
    assert sumo.start + sumo.duration - sumo.duration_after == pytest.approx(sumo.violations[-1].violation.time)
    found = summary_of([sumo], [sumo], Neighbours(0.0, 0, 0, 0))
    assert (found.completed.count, found.completed.total, found.at_fault_collisions) == (0, 1, 1)
    assert found.travel_time_ratio.count == 1


def test_sumos_drivers_have_an_egos_patience_at_least(
    tmp_path: Path, lane: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(anchor, "_PATIENCE", 10.0)
    scenario, trips = behind_a_slow_one(tmp_path, lane, "4", "600")
    (sumo,) = in_child(partial(anchored, scenario, trips, HEAR)).results
    assert sumo.outcome is TripOutcome.ARRIVED
    assert sumo.duration > 60.0


def test_sumos_drivers_make_no_stops_that_the_ads_does_not_make(tmp_path: Path, street: Path) -> None:
    scenario = traffic(tmp_path, street, TRAFFIC.replace('duration="9"', 'duration="900"'))
    trips = [trip for trip in draw(scenario, 10).trips if trip.ego == "stopping"]
    assert trips[0].expected < 100.0
    (sumo,) = in_child(partial(anchored, scenario, trips, HEAR)).results
    (ads,) = drive(scenario, ["stopping"]).results
    assert (sumo.outcome, ads.outcome) == (TripOutcome.ARRIVED, TripOutcome.ARRIVED)
    assert max(sumo.duration, ads.duration) < 100.0


def test_a_trip_ends_on_the_same_edge_whoever_drives(tmp_path: Path, street: Path) -> None:
    routes = '<route id="back" edges="ab bc cb ba"/><vehicle id="v" route="back" depart="1" arrivalEdge="1"/>'
    scenario = traffic(tmp_path, street, routes)
    trips = draw(scenario, 1).trips
    assert trips[0].length == pytest.approx(495.0, abs=5.0)
    ((ads,), (sumo,)) = (
        drive(scenario, ["v"]).results,
        in_child(partial(anchored, scenario, trips, HEAR)).results,
    )
    assert (ads.outcome, sumo.outcome) == (TripOutcome.ARRIVED, TripOutcome.ARRIVED)
    assert (ads.distance, sumo.distance) == pytest.approx((trips[0].length, trips[0].length), abs=20.0)


@pytest.mark.parametrize(
    ("other", "stop", "fault"),
    [
        ('type="stuck"', "", AtFault.OTHER),
        ("", '<stop lane="we_0" endPos="200" duration="1000"/>', AtFault.DRIVER),
    ],
    ids=["in a jam", "behind who stops there"],
)
def test_an_ego_held_up_in_a_jam_is_not_at_fault(
    tmp_path: Path, lane: Path, other: str, stop: str, fault: AtFault
) -> None:
    """SUMO's vehicles stand in jams that only a teleport ends; one that means to stand there is to be passed."""
    routes = (
        f'<vType id="stuck" maxSpeed="0.01"/><vehicle id="other" {other} depart="0" departPos="195">'
        f'<route edges="we"/>{stop}</vehicle><trip id="ego" from="we" to="we" depart="1"/>'
    )
    scenario = traffic(tmp_path, lane, routes, end="400")
    found = in_child(partial(driven, scenario, StackSource(), [Trip("ego", 1.0, 395.0, 29.0, 40.0)], 1, HEAR))
    (result,) = found.results
    assert result.outcome is TripOutcome.TIME_OVER
    assert [(one.violation.kind, one.fault) for one in result.violations] == [("destination_not_reached", fault)]
    assert ("other" in result.violations[0].reason) == (fault is AtFault.OTHER)
    assert found.neighbours.stood == (fault is AtFault.OTHER)
    assert found.neighbours.hours == pytest.approx(result.duration / 3600.0, abs=0.005)
    assert (result.held > 60.0) == (fault is AtFault.OTHER)


@pytest.mark.parametrize(("speed", "held"), [("1", 250.0), ("12", 0.0)], ids=["behind a slow one", "in free traffic"])
def test_time_in_a_queue_is_what_the_ego_loses_behind_slow_ones(
    tmp_path: Path, lane: Path, speed: str, held: float
) -> None:
    scenario, trips = behind_a_slow_one(tmp_path, lane, speed, "600")
    ((result,), (native,)) = (
        in_child(partial(driven, scenario, StackSource(), trips, 1, HEAR)).results,
        in_child(partial(anchored, scenario, trips, HEAR)).results,
    )
    if speed == "1":
        assert (result.outcome, native.outcome) == (TripOutcome.TIME_OVER, TripOutcome.ARRIVED)
        assert result.held > 0.8 * (result.duration - 15.0)
        assert native.held > held
    else:
        assert result.held == native.held == held


@pytest.mark.parametrize(("end", "outcome"), [("100", TripOutcome.CUT), ("300", TripOutcome.TIME_OVER)])
def test_what_comes_of_a_trip_is_not_known_where_the_scenario_ends_before_its_patience(
    tmp_path: Path, lane: Path, end: str, outcome: TripOutcome
) -> None:
    scenario, trips = behind_a_slow_one(tmp_path, lane, "1", end)
    (result,) = in_child(partial(driven, scenario, StackSource(), trips, 1, HEAR)).results
    (native,) = in_child(partial(anchored, scenario, trips, HEAR)).results
    assert native.outcome is TripOutcome.CUT  # SUMO's drivers have more patience
    assert result.outcome is outcome
    if outcome is TripOutcome.CUT:
        assert "destination" in result.unknown
        assert result.violations == ()
        assert result.reason == native.reason == "the scenario ended at 100 s"
    else:
        assert [one.violation.kind for one in result.violations] == ["destination_not_reached"]


def test_an_ego_held_up_by_another_is_over_with_it(tmp_path: Path, lane: Path) -> None:
    routes = (
        '<vehicle id="parked" depart="0" departPos="195"><route edges="we"/><stop lane="we_0" endPos="200" '
        'duration="1000"/></vehicle><trip id="head" from="we" to="we" depart="1" departPos="170"/>'
        '<trip id="tail" from="we" to="we" depart="1" departPos="150"/>'
    )
    trips = [Trip(name, 1.0, 230.0, 17.0, 40.0) for name in ("head", "tail")]
    scenario = traffic(tmp_path, lane, routes, end="140")
    results = in_child(partial(driven, scenario, StackSource(), trips, 2, HEAR)).results
    assert [(one.ego, one.outcome) for one in results] == [("head", TripOutcome.CUT), ("tail", TripOutcome.CUT)]


def test_an_ego_is_not_held_up_by_a_queue_that_another_ego_heads(tmp_path: Path, lane: Path) -> None:
    routes = (
        '<vehicle id="parked" depart="0" departPos="195"><route edges="we"/><stop lane="we_0" endPos="200" '
        'duration="1000"/></vehicle><trip id="head" from="we" to="we" depart="1" departPos="100"/>'
        '<trip id="between" from="we" to="we" depart="5"/><trip id="tail" from="we" to="we" depart="15"/>'
    )
    scenario = traffic(tmp_path, lane, routes, end="400")
    trips = [Trip(name, at, 395.0, 29.0, 40.0) for name, at in (("head", 1.0), ("tail", 15.0))]
    head, tail = in_child(partial(driven, scenario, StackSource(), trips, 2, HEAR)).results
    assert (head.ego, tail.ego) == ("head", "tail")
    assert {head.outcome, tail.outcome} == {TripOutcome.TIME_OVER}
    assert head.held == 0.0
    assert tail.held <= tail.start + tail.duration - head.start - head.duration  # with `head` gone, others hold it up


@pytest.mark.parametrize(
    ("patience", "farther", "stood", "queues", "teleports"),
    [("-1", "", 2, 1, 0), ("-1", "300", 3, 2, 0), ("130", "", 1, 1, 1)],
    ids=["for ever", "another one farther on", "the first is teleported"],
)
def test_sumos_vehicles_that_stand_and_are_teleported_are_counted(
    tmp_path: Path, lane: Path, patience: str, farther: str, stood: int, queues: int, teleports: int
) -> None:
    stuck = (
        f'<vehicle id="at_{place}" type="stuck" depart="0" departPos="{place}"><route edges="we"/></vehicle>'
        for place in ["195", *farther.split()]
    )
    routes = f'<vType id="stuck" maxSpeed="0.01"/>{"".join(stuck)}<trip id="ego" from="we" to="we" depart="1"/>'
    scenario = traffic(tmp_path, lane, routes, end="200", time_to_teleport=patience)
    found = in_child(partial(anchored, scenario, [Trip("ego", 1.0, 395.0, 29.0, 40.0)], HEAR)).neighbours
    assert (found.stood, found.queues, found.teleports) == (stood, queues, teleports)
    assert 0.0 < found.hours <= (stood + 1) * 200.0 / 3600.0
