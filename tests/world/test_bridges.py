"""Who is on a bridge over the ego is not met; who comes along its own road is."""

from collections.abc import Callable
from pathlib import Path

import pytest
from small_scenarios import scenario_file
from watched_world import objects_of, watched

NODES = "".join(
    f'<node id="{name}" x="{x}" y="{y}"/>'
    for name, x, y in (("w", 0, 0), ("e", 400, 0), ("s", 200, -150), ("n", 200, 150))
)
EDGES = '<edge id="we" from="w" to="e" speed="13.9"/><edge id="sn" from="s" to="n" speed="13.9"/>'
EGO = '<trip id="ego" from="we" to="we" depart="0" departPos="150" departSpeed="0" departLane="0"/>'


@pytest.fixture
def bridge(plain_file: Callable[..., Path]) -> Path:
    return plain_file(NODES, EDGES)


def vehicle(name: str, edge: str, position: float) -> str:
    return (
        f'<vehicle id="{name}" depart="0" departPos="{position}"><route edges="{edge}"/>'
        f'<stop lane="{edge}_0" endPos="{position + 1.0}" duration="1000"/></vehicle>'
    )


def test_bodies_on_the_bridge_are_not_there_and_those_before_it_are(tmp_path: Path, bridge: Path) -> None:
    others = vehicle("above", "sn", 150.0) + vehicle("coming", "sn", 100.0) + vehicle("ahead", "we", 197.0)
    moment = watched(scenario_file(tmp_path, bridge, EGO + others), 5)[-1]
    rows = objects_of(moment)
    assert set(rows) == {"coming", "ahead"}
    assert moment.objects.lanes[rows["ahead"]] == "we_0"
    assert moment.objects.boxes[rows["ahead"], 0] == pytest.approx(195.5, abs=1.5)
    assert len(moment.objects.classes) == len(moment.objects.velocities) == 2


def test_people_on_the_bridge_are_not_there_either(tmp_path: Path, plain_file: Callable[..., Path]) -> None:
    net = plain_file(NODES, EDGES.replace('speed="13.9"', 'speed="13.9" sidewalkWidth="2"'))
    people = "".join(
        f'<person id="{name}" depart="0" departPos="{at}"><stop edge="{edge}" endPos="{at}" duration="99"/></person>'
        for name, edge, at in (("above", "sn", 150.0), ("coming", "sn", 100.0), ("ahead", "we", 197.0))
    )
    ego = EGO.replace('departLane="0"', 'departLane="1"')
    moment = watched(scenario_file(tmp_path, net, ego + people), 5)[-1]
    assert set(moment.objects.ids) == {"person:coming", "person:ahead"}


def test_a_bridge_far_along_the_route_hides_nobody(tmp_path: Path, plain_file: Callable[..., Path]) -> None:
    """The route comes by the same place again on the other level: what is on its road there is met now."""
    nodes = (
        '<node id="a" x="0" y="0"/><node id="b" x="300" y="0"/><node id="c" x="300" y="250"/>'
        '<node id="d" x="100" y="250"/><node id="f" x="100" y="-200"/>'
    )
    edges = "".join(
        f'<edge id="{one}{two}" from="{one}" to="{two}" speed="13.9"/>' for one, two in ("ab", "bc", "cd", "df")
    )
    ego = '<vehicle id="ego" depart="0" departPos="60" departSpeed="0"><route edges="ab bc cd df"/></vehicle>'
    others = vehicle("ahead", "ab", 105.0) + vehicle("above", "df", 252.0)
    moment = watched(scenario_file(tmp_path, plain_file(nodes, edges), ego + others), 5)[-1]
    assert set(moment.objects.ids) == {"ahead"}
