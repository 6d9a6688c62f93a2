"""When traffic departs, as the route files tell it."""

from pathlib import Path

from small_scenarios import scenario_file

from dvca_sumo.scenario import last_departure
from dvca_sumo.scenario.configuration import read_configuration


def latest(folder: Path, routes: str, additional: str = "") -> float:
    net = folder / "some.net.xml"
    net.write_text("<net/>")
    return last_departure(read_configuration(scenario_file(folder, net, routes, additional)))


def test_the_latest_of_vehicles_trips_and_flows_in_any_file(tmp_path: Path) -> None:
    routes = '<vehicle id="a" depart="10"/><trip id="b" depart="0:01:00"/><trip id="c" depart="20.5"/>'
    assert latest(tmp_path, routes) == 60.0
    assert latest(tmp_path, routes, '<additional><flow id="f" begin="5" end="90" number="3"/></additional>') == 90.0


def test_a_flow_without_an_end_counts_from_its_begin(tmp_path: Path) -> None:
    assert latest(tmp_path, '<flow id="f" begin="70" number="3"/>') == 70.0


def test_words_for_times_are_passed_over(tmp_path: Path) -> None:
    assert latest(tmp_path, '<trip id="a" depart="triggered"/><trip id="b" depart="3"/>') == 3.0


def test_without_traffic_nothing_departs(tmp_path: Path) -> None:
    assert latest(tmp_path, "") == 0.0
