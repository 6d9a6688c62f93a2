"""Lane changes that may be done on any of several edges."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dvca_sumo.roadmap import RoadMap
from dvca_sumo.roadmap.route import LaneChange

NetBuilder = Callable[..., RoadMap]

NODES = """
<node id="a" x="0" y="0"/><node id="b" x="300" y="0"/><node id="c" x="600" y="0"/>
<node id="d" x="900" y="0"/><node id="e" x="900" y="-120"/><node id="s" x="300" y="-200"/>"""
EDGES = """
<edge id="ab" from="a" to="b" numLanes="2"/><edge id="bc" from="b" to="c" numLanes="2"/>
<edge id="cd" from="c" to="d" numLanes="1"/><edge id="ce" from="c" to="e" numLanes="1"/>
<edge id="sb" from="s" to="b" numLanes="1"/>"""
CONNECTIONS = """
<connection from="bc" to="ce" fromLane="0" toLane="0"/><connection from="bc" to="cd" fromLane="1" toLane="0"/>"""


def change(roadmap: RoadMap) -> LaneChange:
    (found,) = roadmap.route(["ab", "bc", "cd"], "ab_0", 20.0, None, 200.0).lane_changes
    return found


def roads(lanes: tuple[str, ...]) -> list[str]:
    return [lane for lane in dict.fromkeys(lanes) if not lane.startswith(":")]


def test_it_may_be_done_as_far_as_the_lanes_run_on_side_by_side(plain: NetBuilder) -> None:
    found = change(plain(NODES, EDGES, CONNECTIONS))
    assert [roads(lanes) for lanes in found.lanes] == [["ab_0", "bc_0"], ["ab_1", "bc_1"]]
    assert found.start_station < 60.0
    assert 560.0 < found.latest_station < 620.0
    ((begin, end),) = found.junctions
    assert 280.0 < begin < end < 320.0
    settled = (found.stations > 200.0) & (found.stations < found.latest_station - 20.0)
    assert np.allclose(found.offsets[0][settled], -3.2, atol=0.05)
    assert np.allclose(found.offsets[1][settled], 0.0, atol=0.05)
    assert found.lane(100.0, 0) == "ab_0"
    assert found.lane(500.0, 0) == "bc_0"
    assert found.lane(0.5 * (begin + end), 1).startswith(":b_")


@pytest.mark.parametrize(
    ("nodes", "edges", "connections"),
    [
        (NODES, EDGES, CONNECTIONS + '<connection from="ab" to="bc" fromLane="1" toLane="1"/>'),
        (NODES.replace('x="600"', 'x="320"'), EDGES, CONNECTIONS),
        (NODES.replace('x="600" y="0"', 'x="300" y="300"'), EDGES, CONNECTIONS),
    ],
    ids=["one lane leads on alone", "no room on the next edge", "the road turns off"],
)
def test_it_must_be_done_before(plain: NetBuilder, nodes: str, edges: str, connections: str) -> None:
    found = change(plain(nodes, edges, connections))
    assert [roads(lanes) for lanes in found.lanes] == [["ab_0"], ["ab_1"]]
    assert found.latest_station < 320.0
    assert found.junctions == ()


def test_at_signals_all_lanes_have_to_be_let_go_at_the_same_time(plain_file: Callable[..., Path]) -> None:
    nodes = NODES.replace('x="300" y="0"', 'x="300" y="0" type="traffic_light"')
    net = plain_file(nodes, EDGES, CONNECTIONS)
    assert change(RoadMap.load(net)).latest_station > 560.0
    text = net.read_text()
    link = re.search(r'from="ab" to="bc" fromLane="1".* linkIndex="(\d+)"', text)
    first = re.search(r'<phase duration="\d+" *state="(\w+)"', text)
    assert link
    assert first
    row = first.start(1) + int(link[1])
    apart = net.with_name("apart.net.xml")
    apart.write_text(f"{text[:row]}{'G' if text[row] == 'r' else 'r'}{text[row + 1 :]}")
    assert change(RoadMap.load(apart)).latest_station < 320.0
