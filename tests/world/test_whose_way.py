"""A road of three lanes, the rightmost of buses; over its last metres the junction's lane from elsewhere is drawn.

So is, over other metres, the road where that leads to, and over all of them its own other direction.
"""

import pytest
import shapely

from dvca_sumo.messages import VehicleShape
from dvca_sumo.truth import EgoTruth
from dvca_sumo.world.net import Link, edge_of
from dvca_sumo.world.straddling import Straddling
from dvca_sumo.world.ways import End, Ways

SHAPE = VehicleShape(length=5.0, width=1.8, wheelbase=3.0, rear_overhang=1.0)
WIDTH = 3.2  # [m]
MIDDLES = {
    "in_0": [(0.0, -3.2), (100.0, -3.2)],
    "in_1": [(0.0, 0.0), (100.0, 0.0)],
    "in_2": [(0.0, 3.2), (100.0, 3.2)],
    "left_0": [(80.0, -60.0), (80.0, -10.0)],
    "out_0": [(60.0, 0.0), (40.0, 0.0)],
    "back_0": [(100.0, 0.0), (0.0, 0.0)],
    ":c_0_0": [(80.0, -10.0), (95.0, 10.0)],
    ":c_1_0": [(80.0, -10.0), (70.0, -9.0)],
    ":c_2_0": [(100.0, 0.0), (110.0, 0.0)],
    ":c_3_0": [(100.0, 0.0), (110.0, -10.0)],
}
FOES = {":c_0_0": (":c_2_0",)}
LINKS = {
    "left_0": [Link("out_0", ":c_0_0"), Link("back_0", ":c_1_0")],
    ":c_0_0": [Link("out_0", "")],
    ":c_1_0": [Link("back_0", "")],
}


class Crossroads:
    """The net."""

    def lanes(self) -> list[str]:
        return [*MIDDLES]

    def links(self, lane: str) -> list[Link]:
        return LINKS.get(lane, [])

    def foes(self, lane: str) -> tuple[str, ...]:
        return FOES.get(lane, ())

    def adjacent(self, lane: str) -> list[str]:
        return {"in_0": ["in_1"], "in_1": ["in_0", "in_2"], "in_2": ["in_1"]}[lane]

    def allowed(self, lane: str) -> tuple[str, ...]:
        return ("bus",) if lane == "in_0" else ()

    def middle(self, lane: str) -> tuple[shapely.LineString, float]:
        return shapely.LineString(MIDDLES[lane]), WIDTH

    def lanes_of(self, road: str) -> list[str]:
        return [lane for lane in MIDDLES if edge_of(lane) == road]

    def junctions_of(self, road: str) -> tuple[str, str]:
        return {"in": ("b", "c"), "out": ("c", "d"), "back": ("c", "b")}[road]


@pytest.fixture
def straddling() -> Straddling:
    net = Crossroads()
    return Straddling(net, Ways(net))


def ego_at(x: float, y: float) -> EgoTruth:
    """With its rear axle there, along the road."""
    return EgoTruth(time=0.0, x=x, y=y, heading=0.0, speed=0.0, acceleration=0.0, yaw_rate=0.0, steering=0.0)


def ends_on(lane: str) -> tuple[End, End]:
    return End(lane, ""), End(lane, "")


@pytest.mark.parametrize(("y", "lanes"), [(0.0, []), (1.0, []), (1.2, ["in_2"]), (-0.8, ["in_0"]), (-0.6, [])])
def test_cars_have_room_beside_who_is_little_over_their_edge_and_buses_have_none(
    straddling: Straddling, y: float, lanes: list[str]
) -> None:
    parts = straddling.parts(ego_at(20.0, y), SHAPE, ends_on("in_1"), "in_1", goes=True)
    assert [*parts] == lanes
    assert all(part == pytest.approx((19.0, 24.0)) for part in parts.values())


def test_an_ego_that_sumo_has_on_the_next_lane_is_in_the_way_on_its_own(straddling: Straddling) -> None:
    assert [*straddling.parts(ego_at(20.0, 1.2), SHAPE, ends_on("in_1"), "in_2", goes=True)] == ["in_1"]


def test_who_comes_over_the_road_from_elsewhere_sees_one_on_it(straddling: Straddling) -> None:
    for goes in (True, False):
        assert [*straddling.parts(ego_at(84.0, 0.0), SHAPE, ends_on("in_1"), "in_1", goes=goes)] == [":c_0_0"]


@pytest.mark.parametrize(("found", "lanes"), [(":c_2_0", []), (":c_3_0", [":c_0_0"])])
def test_who_comes_over_the_road_sees_one_whose_front_waits_on_a_way_that_meets_its_own(
    straddling: Straddling, found: str, lanes: list[str]
) -> None:
    """Else all whose way joins that one's would stop behind the ego, too, and the ego wait for them."""
    ends = End(found, "in_1"), End("in_1", "")
    assert [*straddling.parts(ego_at(84.0, 0.0), SHAPE, ends, found, goes=True)] == lanes


@pytest.mark.parametrize(("goes", "parts"), [(True, {"out_0": pytest.approx((11.0, 16.0))}), (False, {})])
def test_who_turns_into_a_road_over_the_egos_sees_one_that_means_to_go_but_not_who_turns_into_the_same_street(
    straddling: Straddling, parts: dict[str, tuple[float, float]], *, goes: bool
) -> None:
    assert straddling.parts(ego_at(45.0, 0.0), SHAPE, ends_on("in_1"), "in_1", goes=goes) == parts


def test_without_a_place_on_its_route_an_ego_is_in_nobodys_way(straddling: Straddling) -> None:
    assert straddling.parts(ego_at(20.0, 1.2), SHAPE, (), "in_1", goes=True) == {}
