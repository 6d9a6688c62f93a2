"""Which vehicle is the ego, and where it shall arrive."""

import gzip
from pathlib import Path

import pytest
from small_scenarios import scenario_file

from dvca_sumo.scenario import AUTO, Definitions, ScenarioError, load_scenario
from dvca_sumo.scenario.configuration import read_configuration

MARK = '<param key="dvca.ego" value="true"/>'


@pytest.fixture
def net(tmp_path: Path) -> Path:
    path = tmp_path / "some.net.xml"
    path.write_text("<net/>")
    return path


def chosen(folder: Path, net: Path, routes: str, asked: str | None = None, additional: str = "") -> str:
    return load_scenario(scenario_file(folder, net, routes, additional), asked).ego


def test_the_asked_for_vehicle_comes_before_a_marked_one_and_that_before_the_one_called_ego(
    tmp_path: Path, net: Path
) -> None:
    routes = f'<vehicle id="ego"/><trip id="a">{MARK}</trip><vehicle id="b"/>'
    assert chosen(tmp_path, net, routes, "b") == "b"
    assert chosen(tmp_path, net, routes) == "a"
    assert chosen(tmp_path, net, routes.replace(MARK, "")) == "ego"
    assert chosen(tmp_path, net, routes, AUTO) == AUTO


@pytest.mark.parametrize(
    ("value", "ego"),
    [*((word, "a") for word in ("true", "True", "1", "yes", "on")), *((word, "ego") for word in ("false", "0", "NO"))],
)
def test_a_mark_says_so_in_any_word_that_sumo_takes_for_true(tmp_path: Path, net: Path, value: str, ego: str) -> None:
    routes = f'<vehicle id="ego"/><trip id="a">{MARK}</trip>'.replace('"true"', f'"{value}"')
    assert chosen(tmp_path, net, routes) == ego


@pytest.mark.parametrize("value", ["maybe", "2", ""])
def test_a_mark_that_is_neither_true_nor_false_is_refused(tmp_path: Path, net: Path, value: str) -> None:
    routes = f'<vehicle id="ego"/><trip id="a">{MARK}</trip>'.replace('"true"', f'"{value}"')
    with pytest.raises(ScenarioError, match=rf"parameter dvca\.ego of 'a' is '{value}' \(allowed: true, 1, yes, on;"):
        chosen(tmp_path, net, routes)


def test_parameters_are_those_of_vehicles_whose_names_are_this_program_s(tmp_path: Path, net: Path) -> None:
    ours, other = '<param key="dvca.ttc" value="0.7"/>', '<param key="other" value="1"/>'
    routes = f'<trip id="a">{other}{ours}</trip><flow id="f">{ours}</flow>'
    definitions = Definitions(read_configuration(scenario_file(tmp_path, net, routes)))
    assert definitions.parameters == [("a", "ttc", "0.7"), ("f.0", "ttc", "0.7")]


def test_without_any_the_candidates_are_listed(tmp_path: Path, net: Path) -> None:
    routes = "".join(f'<vehicle id="v{number}"/>' for number in range(7))
    with pytest.raises(ScenarioError, match=r"names no ego: use --ego ID.*candidates: v0, v1, v2, v3, v4 and 2 more"):
        chosen(tmp_path, net, routes)


def test_a_scenario_without_vehicles_says_so(tmp_path: Path, net: Path) -> None:
    with pytest.raises(ScenarioError, match="the scenario has no vehicles"):
        chosen(tmp_path, net, '<person id="ego"/>')


def test_an_unknown_vehicle_suggests_the_nearest(tmp_path: Path, net: Path) -> None:
    with pytest.raises(ScenarioError, match=r"no vehicle 'vehicel' in the scenario \(did you mean vehicle\?\)"):
        chosen(tmp_path, net, '<vehicle id="vehicle"/><vehicle id="x"/>', "vehicel")
    with pytest.raises(ScenarioError, match=r"no vehicle 'zzz' .*candidates: vehicle, x"):
        chosen(tmp_path, net, '<vehicle id="vehicle"/><vehicle id="x"/>', "zzz")


@pytest.mark.parametrize("asked", ["many.0", "many.12"])
def test_a_vehicle_of_a_flow_can_be_asked_for(tmp_path: Path, net: Path, asked: str) -> None:
    assert chosen(tmp_path, net, '<flow id="many" number="20"/>', asked) == asked


def test_a_flow_itself_is_no_vehicle(tmp_path: Path, net: Path) -> None:
    with pytest.raises(ScenarioError, match=r"did you mean many\.0\?"):
        chosen(tmp_path, net, '<flow id="many" number="20"/>', "many")


def test_a_marked_flow_gives_its_first_vehicle(tmp_path: Path, net: Path) -> None:
    assert chosen(tmp_path, net, f'<flow id="many" number="20">{MARK}</flow>') == "many.0"


def test_two_marked_vehicles_are_one_too_many(tmp_path: Path, net: Path) -> None:
    with pytest.raises(ScenarioError, match=r"several vehicles are marked dvca\.ego: a, b; choose one"):
        chosen(tmp_path, net, f'<vehicle id="a">{MARK}</vehicle><vehicle id="b">{MARK}</vehicle>')


def test_a_marked_person_is_refused_and_not_taken_for_the_vehicle_before_it(tmp_path: Path, net: Path) -> None:
    with pytest.raises(ScenarioError, match=r"parameter dvca\.ego of person 'b' in .*routes.rou.xml"):
        chosen(tmp_path, net, f'<vehicle id="a"/><person id="b">{MARK}</person>')


def test_a_vehicle_in_a_comment_is_none(tmp_path: Path, net: Path) -> None:
    with pytest.raises(ScenarioError, match="candidates: a"):
        chosen(tmp_path, net, '<!-- <vehicle id="ego"/> --><vehicle id="a"/>')


def test_an_ego_is_found_in_additional_and_included_files(tmp_path: Path, net: Path) -> None:
    (tmp_path / "deeper").mkdir()
    (tmp_path / "deeper" / "more.xml").write_text('<routes><include href="most.xml"/></routes>')
    (tmp_path / "deeper" / "most.xml").write_text(
        '<routes><include href="more.xml"/><vehicle id="ego" arrivalPos="7"/></routes>'
    )
    config = scenario_file(tmp_path, net, "", '<include href="deeper/more.xml"/>')
    assert load_scenario(config).ego == "ego"
    assert Definitions(read_configuration(config)).arrival_position("ego", 100.0) == 7.0


def test_a_marked_ego_is_found_in_a_gzipped_file(tmp_path: Path, net: Path) -> None:
    config = scenario_file(tmp_path, net, route_files="r.xml.gz")
    (tmp_path / "r.xml.gz").write_bytes(gzip.compress(f'<routes><trip id="a">{MARK}</trip></routes>'.encode()))
    assert load_scenario(config).ego == "a"


def test_names_are_read_in_the_encoding_that_the_file_declares(tmp_path: Path, net: Path) -> None:
    config = scenario_file(tmp_path, net)
    text = f'<?xml version="1.0" encoding="ISO-8859-1"?><routes><trip id="Käfer">{MARK}</trip></routes>'
    (tmp_path / "routes.rou.xml").write_bytes(text.encode("latin-1"))
    assert load_scenario(config).ego == "Käfer"


def test_a_broken_gzip_file_is_refused_in_one_line(tmp_path: Path, net: Path) -> None:
    config = scenario_file(tmp_path, net, route_files="r.xml.gz")
    (tmp_path / "r.xml.gz").write_bytes(gzip.compress(b"<routes/>")[:-9])
    with pytest.raises(ScenarioError, match=r"^[^\n]*r\.xml\.gz cannot be read[^\n]*$"):
        load_scenario(config)


def test_a_marked_vehicle_in_a_file_that_is_not_xml_names_the_file(tmp_path: Path, net: Path) -> None:
    with pytest.raises(ScenarioError, match=r"routes\.rou\.xml is not well-formed XML"):
        chosen(tmp_path, net, f'<vehicle id="a">{MARK}</vehicle><vehicle')


@pytest.mark.parametrize(
    ("attribute", "expected"),
    [
        ("", 80.0),
        ('arrivalPos="max"', 80.0),
        ('arrivalPos="center"', 40.0),
        ('arrivalPos="-5.5"', 74.5),
        ('arrivalPos="-90"', 0.0),
        ("arrivalPos='30'", 30.0),
        ('arrivalPos="90"', 80.0),
    ],
)
def test_the_arrival_position_is_the_vehicles_own(tmp_path: Path, net: Path, attribute: str, expected: float) -> None:
    other = '<vehicle id="other" arrivalPos="99"/>'
    commented = '<!-- <vehicle id="ego" arrivalPos="98"/> -->'
    config = scenario_file(
        tmp_path, net, f'{other}{commented}<vehicle\n  depart="0" id="ego"\n {attribute}>{MARK}</vehicle>'
    )
    assert Definitions(read_configuration(config)).arrival_position("ego", 80.0) == expected


def test_the_arrival_position_of_a_flow_is_that_of_its_vehicles(tmp_path: Path, net: Path) -> None:
    config = scenario_file(tmp_path, net, '<flow id="f" number="3" arrivalPos="12"/>')
    assert Definitions(read_configuration(config)).arrival_position("f.2", 80.0) == 12.0


@pytest.mark.parametrize("position", ["middle", "random"])
def test_an_arrival_position_that_is_none_or_that_sumo_draws_is_refused(
    tmp_path: Path, net: Path, position: str
) -> None:
    config = scenario_file(tmp_path, net, f'<vehicle id="ego" arrivalPos="{position}"/>')
    says = rf"arrivalPos of ego is no position: '{position}' \(allowed: metres, center, max\)"
    with pytest.raises(ScenarioError, match=says):
        Definitions(read_configuration(config)).arrival_position("ego", 80.0)


@pytest.mark.parametrize(
    ("attribute", "row"), [("", 4), ('arrivalEdge="0"', 0), ("arrivalEdge='3'", 3), ('arrivalEdge="9"', 4)]
)
def test_the_arrival_edge_is_counted_along_the_route(tmp_path: Path, net: Path, attribute: str, row: int) -> None:
    config = scenario_file(tmp_path, net, f'<flow id="f" number="3" arrivalPos="2" {attribute}/>')
    assert Definitions(read_configuration(config)).arrival_row("f.1", 5) == row


def test_an_arrival_edge_that_sumo_draws_is_refused(tmp_path: Path, net: Path) -> None:
    config = scenario_file(tmp_path, net, '<vehicle id="ego" arrivalEdge="random"/>')
    with pytest.raises(ScenarioError, match=r"arrivalEdge of ego is no edge: 'random' \(allowed: its number along"):
        Definitions(read_configuration(config)).arrival_row("ego", 5)


def test_lanes_under_variable_speed_signs_are_found_in_all_files(tmp_path: Path, net: Path) -> None:
    (tmp_path / "more.xml").write_text('<additional><variableSpeedSign lanes="c_0" id="u" file="x"/></additional>')
    signs = '<variableSpeedSign id="v" lanes="a_0  b_1"><step time="0" speed="5"/></variableSpeedSign>'
    config = scenario_file(tmp_path, net, additional=f'{signs}<include href="more.xml"/>')
    assert Definitions(read_configuration(config)).signed_lanes == {"a_0", "b_1", "c_0"}
