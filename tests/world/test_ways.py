"""A junction with ways from two lanes: left with a place to wait at, straight on, right with one, and back."""

import pytest

from dvca_sumo.roadmap import is_inner
from dvca_sumo.world.net import Link, edge_of
from dvca_sumo.world.ways import End, Ways

LINKS = {
    "in_0": [
        Link("left_0", ":c_0_0"),
        Link("on_0", ":c_1_0"),
        Link("right_0", ":c_2_0"),
        Link("back_0", ":c_3_0", turns_back=True),
    ],
    "in_1": [Link("on_1", ":c_1_1")],
    ":c_0_0": [Link("left_0", ":c_4_0")],
    ":c_2_0": [Link("right_0", ":c_5_0")],
    ":c_3_0": [Link("back_0", ":c_6_0", turns_back=True)],
    ":c_1_0": [Link("on_0", "")],
    ":c_1_1": [Link("on_1", "")],
    ":c_4_0": [Link("left_0", "")],
    ":c_5_0": [Link("right_0", "")],
    ":c_6_0": [Link("back_0", "", turns_back=True)],
    ":c_7_0": [Link("back_0", "")],
    ":d_1_0": [Link("against_0", "")],
    ":d_2_0": [Link("aside_0", "")],
    "against_0": [Link("left_0", ":c_7_0"), Link("on_0", ":c_3_0", turns_back=True), Link("back_0", "")],
}
JUNCTIONS = {"in": ("b", "c"), "on": ("c", "d"), "against": ("d", "c"), "aside": ("d", "e")}
# Whom who turns left minds, and who minds it, as far as the net has it.
FOES = {":c_4_0": (":c_1_1", ":c_7_0"), ":c_1_1": (":c_4_0",), ":c_7_0": (":c_4_0",)}
ON_ROAD = End("in_0", "")


class Junction:
    """The lanes of this one, and a few that lead nowhere."""

    def lanes(self) -> list[str]:
        return [*LINKS, ":c_8_0", ":c_c0_0", ":c_w0_0", ":d_0_0", "left_0"]

    def links(self, lane: str) -> list[Link]:
        return LINKS.get(lane, [])

    def foes(self, lane: str) -> tuple[str, ...]:
        return FOES.get(lane, ())

    def adjacent(self, lane: str) -> list[str]:
        return {"in_0": ["in_1"], "in_1": ["in_0"]}[lane]

    def junctions_of(self, road: str) -> tuple[str, str]:
        return JUNCTIONS[road]


@pytest.fixture
def ways() -> Ways:
    return Ways(Junction())


def test_who_leaves_the_same_lane_sees_one_surely_only_while_both_are_on_their_first_lanes(ways: Ways) -> None:
    assert ways.beside(End(":c_0_0", "in_0")) == [":c_5_0", ":c_1_1"]
    assert ways.beside(End(":c_1_0", "in_0")) == [":c_4_0", ":c_5_0", ":c_1_1"]
    assert ways.beside(End(":c_4_0", "in_0")) == [":c_1_0", ":c_2_0", ":c_5_0"]
    assert ways.beside(End(":c_5_0", "in_0")) == [":c_0_0", ":c_4_0", ":c_1_0", ":c_1_1"]
    assert ways.beside(ON_ROAD) == []


def test_who_leaves_the_next_lane_sees_one_on_a_way_that_touches_theirs_in_the_net(ways: Ways) -> None:
    assert ":c_1_1" not in ways.beside(End(":c_4_0", "in_0"))
    assert ":c_1_1" in ways.beside(End(":c_0_0", "in_0"))
    assert ways.beside(End(":c_1_1", "in_1")) == [":c_0_0", ":c_1_0", ":c_2_0", ":c_5_0"]


def test_who_comes_from_elsewhere_is_left_to_what_the_net_says(ways: Ways) -> None:
    assert ":c_7_0" not in ways.beside(End(":c_0_0", "in_0"))


def test_a_tail_may_be_on_all_lanes_of_vehicles_on_the_junction_but_its_own_and_those_next_to_it(ways: Ways) -> None:
    found = ways.behind(End("on_0", ""), End(":c_1_0", "in_0"))
    assert found == [":c_0_0", ":c_2_0", ":c_3_0", ":c_4_0", ":c_5_0", ":c_6_0", ":c_7_0"]
    assert ":c_0_0" not in ways.behind(End("left_0", ""), End(":c_4_0", "in_0"))
    for rear in (ON_ROAD, End(":c_0_0", "in_0"), End(":c_4_0", "in_0")):
        assert ways.behind(End(":c_4_0", "in_0"), rear) == []


def test_a_tail_is_on_no_lane_of_who_comes_from_the_junction_that_the_front_is_on(ways: Ways) -> None:
    found = ways.behind(End(":d_0_0", "on_0"), End(":c_1_0", "in_0"))
    assert found == [":c_0_0", ":c_2_0", ":c_4_0", ":c_5_0"]


def test_names_tell_edges_and_junctions(ways: Ways) -> None:
    assert edge_of("a_b_1") == "a_b"
    assert is_inner(":c_0_0")
    assert not is_inner("c_0")
    assert ways.lane_after(":c_0_0") == "left_0"
    assert ways.inner_lanes("nowhere") == []


def test_lanes_of_people_and_those_that_lead_nowhere_are_nobodys_way(ways: Ways) -> None:
    assert {*ways.inner_lanes(":c")} == {lane for lane in LINKS if lane.startswith(":c_")}
