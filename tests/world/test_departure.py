"""Waiting for an ego: chosen, late, hindered, never; and an ego that is taken away."""

from pathlib import Path

import pytest
from small_scenarios import EGO, in_child, scenario_file
from watched_world import STANDING, entered

from dvca_sumo.roadmap import RoadMap
from dvca_sumo.scenario import ScenarioError, load_scenario
from dvca_sumo.world import VehicleLimits, World

FLOW = '<flow id="many" from="ab" to="bc" begin="0" period="2" number="60"/>'


def test_an_ego_that_departs_long_after_the_first_routes_are_read_is_awaited(tmp_path: Path, street: Path) -> None:
    assert entered(scenario_file(tmp_path, street, EGO.replace('"0"', '"900"'))).time == pytest.approx(900.1)


def test_a_vehicle_of_a_flow_can_be_the_ego(tmp_path: Path, street: Path) -> None:
    entry = entered(scenario_file(tmp_path, street, FLOW), ego="many.3")
    assert (entry.ego, entry.edges) == ("many.3", ("ab", "bc"))


def test_auto_takes_the_first_car_that_meets_traffic(tmp_path: Path, street: Path) -> None:
    bus = '<vType id="bus" vClass="bus"/><vehicle id="bus" type="bus" depart="60"><route edges="nb bs"/></vehicle>'
    entry = entered(scenario_file(tmp_path, street, FLOW + bus), ego="auto")
    assert entry.vehicle_class == "passenger"
    assert 60.0 <= entry.time < 65.0


def test_auto_says_when_no_trip_is_fit(tmp_path: Path, street: Path) -> None:
    scenario = load_scenario(scenario_file(tmp_path, street, FLOW), "auto", end=65.0)

    def job() -> None:
        World(scenario, tmp_path).await_ego((), lambda _: False)

    with pytest.raises(ScenarioError, match="no vehicle fit to be the ego departs between 0 s and 65 s"):
        in_child(job)


def test_an_ego_whose_time_comes_after_the_end_never_departs(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path, street, EGO.replace('"0"', '"40"'), end="30")
    with pytest.raises(ScenarioError, match="the ego 'ego' never departs between 0 s and 30 s"):
        entered(config)


def test_an_ego_that_waits_for_a_ride_never_departs(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path, street, STANDING.replace('depart="0"', 'depart="triggered"'), end="5")
    with pytest.raises(ScenarioError, match="the ego 'ego' never departs"):
        entered(config)


def test_an_ego_whose_place_stays_taken_is_not_awaited_for_ever(tmp_path: Path, street: Path) -> None:
    blocked = (
        '<vehicle id="first" depart="0" departPos="20"><route edges="bc"/>'
        '<stop lane="bc_0" endPos="21" duration="1e6"/></vehicle>'
    )
    config = scenario_file(tmp_path, street, blocked + STANDING, time_to_teleport="-1")
    with pytest.raises(ScenarioError, match="the ego 'ego' finds no room to depart until 60"):
        entered(config)


def test_an_ego_that_sumo_removes_ends_the_run(tmp_path: Path, street: Path) -> None:
    scenario = load_scenario(scenario_file(tmp_path, street, STANDING))
    roadmap = RoadMap.load(street)

    def job() -> None:
        import libsumo  # noqa: PLC0415

        world = World(scenario, tmp_path)
        entry = world.await_ego((), lambda _: True)
        world.adopt(entry, roadmap.route(entry.edges, entry.lane, entry.position, None, 200.0), VehicleLimits())
        world.advance()
        step = libsumo.simulationStep
        libsumo.simulationStep = lambda: (step(), libsumo.vehicle.remove("ego"))
        world.advance()

    with pytest.raises(ScenarioError, match=r"SUMO removed the ego 'ego' at 0\.3 s"):
        in_child(job)
