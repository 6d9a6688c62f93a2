import gzip
import pickle
from collections.abc import Callable
from pathlib import Path

import pytest

from dvca_sumo.roadmap import RoadMap, RoadMapError

NetBuilder = Callable[..., RoadMap]

TWO_NODES = '<node id="a" x="0" y="0"/><node id="b" x="200" y="0"/>'
BUS_LANE = """
<edge id="e" from="a" to="b" numLanes="3">
  <lane index="0" allow="bus"/>
</edge>"""


def test_lane_says_what_the_net_says(grid: NetBuilder) -> None:
    lane = grid("--default.lanenumber=2").lanes["A0B0_1"]
    assert (lane.edge, lane.index, lane.width, lane.speed_limit) == ("A0B0", 1, 3.2, 13.89)
    assert lane.line.length == pytest.approx(lane.length, abs=0.1)
    assert lane.is_drivable
    assert not lane.is_internal


def test_lane_leads_through_internal_lanes_to_the_next(grid: NetBuilder) -> None:
    lanes = grid().lanes
    through = [lanes[successor] for successor in lanes["A0B0_0"].successors]
    assert all(lane.is_internal for lane in through)
    reached = set()
    while through:
        lane = through.pop()
        if lane.is_internal:
            through += [lanes[successor] for successor in lane.successors]
        else:
            reached.add(lane.edge)
    assert reached == {"B0A0", "B0B1", "B0C0"}


def test_lane_leads_straight_to_the_next_in_a_net_without_internal_lanes(grid: NetBuilder) -> None:
    lanes = grid("--no-internal-links").lanes
    assert {lanes[successor].edge for successor in lanes["A0B0_0"].successors} == {"B0A0", "B0B1", "B0C0"}


def test_higher_lane_lies_to_the_left_in_a_right_hand_net(grid: NetBuilder) -> None:
    lanes = grid("--default.lanenumber=2").lanes
    assert (lanes["A0B0_0"].left, lanes["A0B0_0"].right) == ("A0B0_1", None)


def test_higher_lane_lies_to_the_right_in_a_left_hand_net(grid: NetBuilder) -> None:
    lanes = grid("--default.lanenumber=2", "--lefthand").lanes
    assert (lanes["A0B0_0"].left, lanes["A0B0_0"].right) == (None, "A0B0_1")
    _, offsets = lanes["A0B0_0"].line.project(lanes["A0B0_1"].line.points)
    assert (offsets < 0.0).all()


@pytest.mark.parametrize(("kind", "is_motorway"), [("highway.primary", False), ("highway.motorway", True)])
def test_a_gap_in_the_ego_s_map_hides_a_limit_that_holds_nevertheless(
    plain: NetBuilder,
    kind: str,
    is_motorway: bool,  # noqa: FBT001
) -> None:
    gap = '<param key="dvca.map.speed_limit" value="missing"/>'
    nodes = TWO_NODES + '<node id="c" x="350" y="0"/>'
    edges = (
        f'<edge id="ab" from="a" to="b" speed="20" type="{kind}">{gap}</edge><edge id="bc" from="b" to="c" speed="20"/>'
    )
    roadmap = plain(nodes, edges)
    assert [roadmap.lanes[lane].is_limit_mapped for lane in ("ab_0", "bc_0")] == [False, True]
    route = roadmap.route(["ab", "bc"], "ab_0", 20.0, None, 100.0)
    assert set(route.speed_limits.tolist()) == {20.0}
    (unmapped,) = route.unmapped_limits
    assert unmapped.is_motorway is is_motorway
    hidden = (route.line.stations >= unmapped.start_station) & (route.line.stations <= unmapped.end_station)
    assert [lane == "ab_0" for lane in route.lane_ids] == hidden.tolist()


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("dvca.map.speed_limit", "mising", "speed_limit of the edge 'ab' is 'mising' .allowed: missing"),
        (
            "dvca.map.speed_limits",
            "missing",
            "no parameter dvca.map.speed_limits of the edge 'ab' .*dvca.map.speed_limit",
        ),
        ("dvca.safe_distance", "1", "no parameter dvca.safe_distance of the edge 'ab'"),
    ],
)
def test_a_parameter_of_an_edge_that_would_be_ignored_is_refused(
    plain: NetBuilder, key: str, value: str, says: str
) -> None:
    edges = f'<edge id="ab" from="a" to="b"><param key="other" value="1"/><param key="{key}" value="{value}"/></edge>'
    with pytest.raises(RoadMapError, match=says):
        plain(TWO_NODES, edges)


def test_bus_lane_is_no_neighbour_of_a_car(plain: NetBuilder) -> None:
    lanes = plain(TWO_NODES, BUS_LANE).lanes
    assert not lanes["e_0"].is_drivable
    assert (lanes["e_1"].right, lanes["e_1"].left) == (None, "e_2")


def test_bus_lane_is_a_neighbour_of_a_bus(plain: NetBuilder) -> None:
    lanes = plain(TWO_NODES, BUS_LANE, vehicle_class="bus").lanes
    assert lanes["e_0"].is_drivable
    assert lanes["e_1"].right == "e_0"


def test_lane_position_is_scaled_to_the_drawn_length(plain: NetBuilder) -> None:
    edge = '<edge id="e" from="a" to="b" length="400"/>'
    lane = plain(TWO_NODES, edge).lanes["e_0"]
    assert lane.length == 400.0
    assert lane.station(100.0) == pytest.approx(50.0)
    assert lane.station(500.0) == pytest.approx(lane.line.length)


def test_near_lanes_come_nearest_first(plain: NetBuilder) -> None:
    roadmap = plain(TWO_NODES, BUS_LANE)
    y = [roadmap.lanes[f"e_{index}"].line.points[0, 1] for index in range(3)]
    near, further, nowhere = roadmap.lanes_near([[50.0, y[0] + 0.1], [50.0, y[2] - 0.1], [50.0, 90.0]], 4.0)
    assert near == ("e_0", "e_1")
    assert further == ("e_2", "e_1")
    assert nowhere == ()


def test_crossings_are_lanes_but_not_near_any_point(grid: NetBuilder) -> None:
    roadmap = grid("--sidewalks.guess", "--crossings.guess")
    crossing = next(lane for lane in roadmap.lanes.values() if lane.is_crossing)
    assert not crossing.is_drivable
    assert crossing.id not in roadmap.lanes_near(crossing.line.points, 5.0)[0]


def test_gzipped_net_reads_the_same(grid_file: Callable[..., Path], tmp_path: Path) -> None:
    packed = tmp_path / "net.xml.gz"
    packed.write_bytes(gzip.compress(grid_file().read_bytes()))
    assert RoadMap.load(packed).lanes.keys() == RoadMap.load(grid_file()).lanes.keys()


def test_pickled_map_plans_the_same_route(grid: NetBuilder) -> None:
    again = pickle.loads(pickle.dumps(grid()))  # noqa: S301 our own bytes
    routes = [roadmap.route(["A0B0", "B0B1"], "A0B0_0", 5.0, None, 50.0) for roadmap in (grid(), again)]
    assert routes[0].line.points.tolist() == routes[1].line.points.tolist()


def test_lanes_cannot_be_replaced(grid: NetBuilder) -> None:
    roadmap = grid()
    with pytest.raises(TypeError):
        roadmap.lanes["A0B0_0"] = roadmap.lanes["A0B0_0"]  # type: ignore[index]


def test_missing_net_is_named(tmp_path: Path) -> None:
    with pytest.raises(RoadMapError, match=r"not found: .*nowhere\.net\.xml"):
        RoadMap.load(tmp_path / "nowhere.net.xml")


@pytest.mark.parametrize(
    "text", ["no xml at all", "<net/>", "<routes><vehicle id='x'/></routes>", '<net version="1.20">']
)
def test_file_that_is_no_net_is_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "odd.net.xml"
    path.write_text(text)
    with pytest.raises(RoadMapError, match=r"^not a SUMO net: .*odd\.net\.xml.*$"):
        RoadMap.load(path)


def test_unknown_vehicle_class_is_refused(grid_file: Callable[..., Path]) -> None:
    with pytest.raises(RoadMapError, match="'passanger'"):
        RoadMap.load(grid_file(), "passanger")
