"""Where there is a lane beside the route's to pass on."""

from collections.abc import Callable

import numpy as np
import pytest

from dvca_sumo.roadmap import RoadMap
from dvca_sumo.roadmap.route import PassingLane, Route

NetBuilder = Callable[..., RoadMap]

NODES = """
<node id="a" x="0" y="0"/><node id="b" x="300" y="0"/><node id="c" x="600" y="0"/>
<node id="d" x="900" y="0"/><node id="f" x="900" y="-120"/>"""
EDGES = """
<edge id="ab" from="a" to="b" numLanes="2"/><edge id="bc" from="b" to="c" numLanes="2"/>
<edge id="cd" from="c" to="d" numLanes="2"/><edge id="off" from="c" to="f"/>"""
CONNECTIONS = """
<connection from="bc" to="off" fromLane="0" toLane="0"/>
<connection from="bc" to="cd" fromLane="0" toLane="0"/><connection from="bc" to="cd" fromLane="1" toLane="1"/>"""


def route(roadmap: RoadMap, edges: str, lane: str = "ab_0") -> Route:
    return roadmap.route(edges.split(), lane, 20.0, None, 200.0)


def lanes_of(passing: PassingLane) -> list[str]:
    return [lane for lane in dict.fromkeys(passing.lane_ids) if not lane.startswith(":")]


def test_the_next_lane_runs_along_over_junctions_from_start_to_destination(plain: NetBuilder) -> None:
    found = route(plain(NODES, EDGES, CONNECTIONS), "ab bc cd")
    (passing,) = found.passing_lanes
    assert lanes_of(passing) == ["ab_1", "bc_1", "cd_1"]
    assert passing.leads_on
    assert passing.halts == ()
    assert passing.stations[0] == pytest.approx(found.start, abs=1.0)
    assert passing.stations[-1] == pytest.approx(found.destination, abs=1.0)
    assert np.allclose(passing.offsets, 3.2, atol=0.05)


def test_where_the_route_turns_off_it_ends_and_leads_elsewhere(plain: NetBuilder) -> None:
    (passing,) = route(plain(NODES, EDGES, CONNECTIONS), "ab bc off").passing_lanes
    assert lanes_of(passing) == ["ab_1", "bc_1"]
    assert not passing.leads_on


def test_from_the_fastest_lane_nobody_passes(plain: NetBuilder) -> None:
    assert route(plain(NODES, EDGES, CONNECTIONS), "ab bc cd", "ab_1").passing_lanes == ()


@pytest.mark.parametrize(
    "nodes",
    [
        NODES.replace('x="600" y="0"', 'x="600" y="0" type="traffic_light"'),
        NODES.replace('x="600" y="0"', 'x="600" y="0" type="traffic_light_unregulated"'),
    ],
    ids=["signals", "dark signals"],
)
def test_it_leads_on_over_junctions_where_one_may_have_to_wait(plain: NetBuilder, nodes: str) -> None:
    found = route(plain(nodes, EDGES, CONNECTIONS), "ab bc cd")
    (passing,) = found.passing_lanes
    assert lanes_of(passing) == ["ab_1", "bc_1", "cd_1"]
    assert passing.leads_on
    (line,) = [line for line in found.stop_lines if line.lane == "bc_0"]
    (halt,) = passing.halts
    assert halt == pytest.approx((line.station, line.exit_station), abs=1.0)


def test_it_ends_where_lanes_are_let_go_apart(plain: NetBuilder) -> None:
    """The next lane turns left as well, against oncoming traffic: its signals are others."""
    nodes = NODES.replace('x="600" y="0"', 'x="600" y="0" type="traffic_light"') + '<node id="g" x="600" y="200"/>'
    edges = EDGES + '<edge id="dc" from="d" to="c"/><edge id="cg" from="c" to="g"/>'
    connections = CONNECTIONS.replace('<connection from="bc" to="cd" fromLane="1" toLane="1"/>', "")
    connections += '<connection from="bc" to="cg" fromLane="1" toLane="0"/><connection from="dc" to="cg"/>'
    first, second = route(plain(nodes, edges, connections), "ab bc cd").passing_lanes
    assert lanes_of(first) == ["ab_1", "bc_1"]
    assert not first.leads_on
    assert lanes_of(second) == ["cd_1"]


def test_it_leads_on_over_an_edge_that_is_too_short_for_the_line(plain: NetBuilder) -> None:
    nodes = NODES + '<node id="x" x="601" y="0"/>'
    edges = EDGES.replace('id="cd" from="c"', 'id="xd" from="x"') + '<edge id="cx" from="c" to="x" numLanes="2"/>'
    connections = CONNECTIONS.replace('to="cd"', 'to="cx"')
    connections += "".join(f'<connection from="cx" to="xd" fromLane="{n}" toLane="{n}"/>' for n in (0, 1))
    (passing,) = route(plain(nodes, edges, connections), "ab bc cx xd").passing_lanes
    assert {"ab_1", "bc_1", "xd_1"} <= set(lanes_of(passing))
    assert passing.leads_on


def test_a_lane_that_is_closed_to_the_ego_is_none_to_pass_on(plain: NetBuilder) -> None:
    edges = EDGES.replace(
        '<edge id="bc" from="b" to="c" numLanes="2"/>',
        '<edge id="bc" from="b" to="c" numLanes="2"><lane index="1" allow="bus"/></edge>',
    )
    found = route(plain(NODES, edges, CONNECTIONS), "ab bc off")
    assert [lanes_of(passing) for passing in found.passing_lanes] == [["ab_1"]]


def test_nobody_passes_while_changing_lanes(plain: NetBuilder) -> None:
    connections = '<connection from="bc" to="cd" fromLane="1" toLane="1"/>'
    found = route(plain(NODES, EDGES.replace('numLanes="2"', 'numLanes="3"'), connections), "ab bc cd")
    (change,) = found.lane_changes
    passing = found.passing_lanes[0]
    assert lanes_of(passing)[0] == "ab_2"
    assert change.start_station < passing.stations[0] < change.latest_station


def test_nobody_begins_to_pass_at_a_pedestrian_crossing(grid: NetBuilder) -> None:
    roadmap = grid("--default.lanenumber=2", "--sidewalks.guess", "--crossings.guess")
    found = route(roadmap, "A1B1 B1C1", "A1B1_1")
    spans = [(crossing.start_station, crossing.end_station) for crossing in found.crossings]
    assert spans
    assert found.passing_lanes
    for passing in found.passing_lanes:
        assert {span for span in spans if passing.covers(span[0])} <= set(passing.halts)


def test_the_lane_that_a_body_beside_the_line_is_on(plain: NetBuilder) -> None:
    found = route(plain(NODES, EDGES, CONNECTIONS), "ab bc cd")
    assert [found.lane_at(200.0, offset) for offset in (0.0, 1.5, 1.7, 4.0)] == ["ab_0", "ab_0", "ab_1", "ab_1"]


def test_it_ends_where_the_junction_bends(plain: NetBuilder) -> None:
    """Where lanes turn side by side they come close to each other."""
    nodes = NODES.replace('<node id="d" x="900" y="0"/>', '<node id="d" x="850" y="170"/>')
    first, second = route(plain(nodes, EDGES, CONNECTIONS), "ab bc cd").passing_lanes
    assert lanes_of(first) == ["ab_1", "bc_1"]
    assert not first.leads_on
    assert lanes_of(second) == ["cd_1"]
