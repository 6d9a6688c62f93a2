from collections.abc import Callable

import pytest

from dvca_sumo.roadmap import RoadMap, RouteError

NetBuilder = Callable[..., RoadMap]

NODES = """
<node id="a" x="0" y="0"/><node id="b" x="300" y="0"/><node id="c" x="600" y="0"/>
<node id="d" x="900" y="60"/><node id="f" x="900" y="-60"/>"""
FORK = """
<edge id="ab" from="a" to="b" numLanes="2"/><edge id="bc" from="b" to="c" numLanes="2"/>
<edge id="left" from="c" to="d"/><edge id="right" from="c" to="f"/>"""
FORK_CONNECTIONS = """
<connection from="bc" to="left" fromLane="1" toLane="0"/>
<connection from="bc" to="right" fromLane="0" toLane="0"/>"""


def lanes_of(roadmap: RoadMap, edges: list[str], start: str, arrival: str | None = None) -> list[str]:
    route = roadmap.route(edges, start, 10.0, arrival, 50.0)
    return [lane for lane in dict.fromkeys(route.lane_ids) if not lane.startswith(":")]


def test_lane_that_leads_on_is_kept(plain: NetBuilder) -> None:
    roadmap = plain(NODES, FORK, FORK_CONNECTIONS)
    assert lanes_of(roadmap, ["ab", "bc", "right"], "ab_0") == ["ab_0", "bc_0", "right_0"]


def test_lane_that_does_not_lead_on_is_left_early(plain: NetBuilder) -> None:
    roadmap = plain(NODES, FORK, FORK_CONNECTIONS)
    assert lanes_of(roadmap, ["ab", "bc", "left"], "ab_0") == ["ab_0", "ab_1", "bc_1", "left_0"]


def test_change_waits_for_an_edge_with_room(plain: NetBuilder) -> None:
    nodes = NODES.replace('id="b" x="300"', 'id="b" x="30"')
    roadmap = plain(nodes, FORK, FORK_CONNECTIONS)
    assert lanes_of(roadmap, ["ab", "bc", "left"], "ab_0") == ["ab_0", "bc_0", "bc_1", "left_0"]


def test_arrival_lane_is_reached(plain: NetBuilder) -> None:
    roadmap = plain(NODES, FORK, FORK_CONNECTIONS)
    assert lanes_of(roadmap, ["ab", "bc"], "ab_0", "bc_1") == ["ab_0", "ab_1", "bc_1"]


WIDENING = """
<edge id="ab" from="a" to="b" numLanes="2"/><edge id="bc" from="b" to="c" numLanes="3"/>"""
WIDENING_CONNECTIONS = """
<connection from="ab" to="bc" fromLane="0" toLane="0"/><connection from="ab" to="bc" fromLane="0" toLane="1"/>
<connection from="ab" to="bc" fromLane="1" toLane="{beside}"/>"""


@pytest.mark.parametrize(("beside", "taken"), [(2, "bc_1"), (1, "bc_0")])
def test_where_its_lane_forks_the_half_is_taken_beside_which_the_faster_lane_runs_on(
    plain: NetBuilder, beside: int, taken: str
) -> None:
    roadmap = plain(NODES, WIDENING, WIDENING_CONNECTIONS.format(beside=beside))
    assert lanes_of(roadmap, ["ab", "bc"], "ab_0") == ["ab_0", taken]


def test_where_the_fastest_lane_forks_the_slower_half_is_taken(plain: NetBuilder) -> None:
    roadmap = plain(
        NODES,
        WIDENING.replace('numLanes="2"', 'numLanes="1"').replace('numLanes="3"', 'numLanes="2"'),
        WIDENING_CONNECTIONS.split("\n")[1],
    )
    assert lanes_of(roadmap, ["ab", "bc"], "ab_0") == ["ab_0", "bc_0"]


def test_bus_lane_is_not_taken_by_a_car(plain: NetBuilder) -> None:
    edges = FORK.replace(
        '<edge id="bc" from="b" to="c" numLanes="2"/>',
        '<edge id="bc" from="b" to="c" numLanes="2"><lane index="0" allow="bus"/></edge>',
    )
    connections = FORK_CONNECTIONS + '<connection from="bc" to="right" fromLane="1" toLane="0"/>'
    car, bus = (plain(NODES, edges, connections, vehicle_class=name) for name in ("passenger", "bus"))
    assert "bc_0" not in lanes_of(car, ["ab", "bc", "right"], "ab_0")
    assert lanes_of(bus, ["ab", "bc", "right"], "ab_0") == ["ab_0", "bc_0", "right_0"]


def test_edges_that_do_not_meet_are_named(grid: NetBuilder) -> None:
    with pytest.raises(RouteError, match="no connection from edge 'A0B0' to edge 'B1C1'"):
        grid().route(["A0B0", "B1C1"], "A0B0_0", 5.0, None, 50.0)


def test_closed_connection_is_told_from_a_missing_one(plain: NetBuilder) -> None:
    edges = FORK.replace('id="right" from="c" to="f"', 'id="right" from="c" to="f" allow="bus"')
    roadmap = plain(NODES, edges, FORK_CONNECTIONS)
    with pytest.raises(RouteError, match="from edge 'bc' to edge 'right' is closed to this vehicle class"):
        roadmap.route(["bc", "right"], "bc_0", 5.0, None, 50.0)


def test_start_too_late_for_a_lane_change_is_refused(plain: NetBuilder) -> None:
    roadmap = plain(NODES, FORK, FORK_CONNECTIONS)
    with pytest.raises(RouteError, match=r"no room to change lanes .* from edge 'bc' to edge 'left'"):
        roadmap.route(["bc", "left"], "bc_0", roadmap.lanes["bc_0"].length - 3.0, None, 50.0)


def test_arrival_lane_out_of_reach_is_refused(plain: NetBuilder) -> None:
    with pytest.raises(RouteError, match="lane bc_1 cannot be reached"):
        plain(NODES, FORK, FORK_CONNECTIONS).route(["bc"], "bc_0", 50.0, "bc_1", 52.0)


@pytest.mark.parametrize(
    ("edges", "start", "arrival", "message"),
    [
        ([], "ab_0", None, "at least one edge"),
        (["ab", "nowhere"], "ab_0", None, "edge 'nowhere' is not in the net"),
        (["ab", ":b_0"], "ab_0", None, "edge ':b_0' is not in the net"),
        (["ab", "bc"], "bc_0", None, "lane 'bc_0' is not on edge 'ab'"),
        (["ab", "bc"], "ab_0", "bc_7", "lane 'bc_7' is not on edge 'bc'"),
    ],
)
def test_route_that_makes_no_sense_is_refused(
    plain: NetBuilder, edges: list[str], start: str, arrival: str | None, message: str
) -> None:
    with pytest.raises(RouteError, match=message):
        plain(NODES, FORK, FORK_CONNECTIONS).route(edges, start, 5.0, arrival, 50.0)


def test_start_on_a_lane_closed_to_the_class_is_refused(plain: NetBuilder) -> None:
    edges = '<edge id="e" from="a" to="b" numLanes="2"><lane index="0" allow="bus"/></edge>'
    with pytest.raises(RouteError, match="lane 'e_0' is closed to this vehicle class"):
        plain('<node id="a" x="0" y="0"/><node id="b" x="300" y="0"/>', edges).route(["e"], "e_0", 5.0, None, 50.0)


def test_destination_behind_the_start_is_refused(plain: NetBuilder) -> None:
    with pytest.raises(RouteError, match="50 m lies behind the start at 80 m"):
        plain(NODES, FORK, FORK_CONNECTIONS).route(["ab"], "ab_0", 80.0, None, 50.0)
