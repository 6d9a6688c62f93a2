"""Bridges: lanes that cross where their edges share no junction."""

import math
from collections.abc import Callable

import pytest

from dvca_sumo.roadmap import RoadMap

NetBuilder = Callable[..., RoadMap]


def crossed(x: float, *, angle: float = math.pi / 2.0) -> tuple[str, str]:
    """A road of 400 m along x, and a two-lane road across it at `x`, without a junction there."""
    away, up = 100.0 * math.cos(angle), 100.0 * math.sin(angle)
    nodes = (
        '<node id="w" x="0" y="0"/><node id="e" x="400" y="0"/>'
        f'<node id="s" x="{x - away}" y="{-up}"/><node id="n" x="{x + away}" y="{up}"/>'
    )
    edges = '<edge id="we" from="w" to="e" speed="13.9"/><edge id="sn" from="s" to="n" numLanes="2" speed="13.9"/>'
    return nodes, edges


def test_every_lane_of_a_road_across_is_an_overpass_where_it_crosses(plain: NetBuilder) -> None:
    route = plain(*crossed(200.0)).route(["we"], "we_0", 50.0, None, 390.0)
    assert {one.lane for one in route.overpasses} == {"sn_0", "sn_1"}
    stations = [one.station for one in route.overpasses]
    assert stations == sorted(stations)
    for one in route.overpasses:
        x, y = route.line.poses([one.station])[0, :2]
        assert one.position == pytest.approx((x, y), abs=0.05)
        assert one.position[0] == pytest.approx(200.0, abs=5.0)


def test_the_road_below_is_an_overpass_of_the_road_above(plain: NetBuilder) -> None:
    route = plain(*crossed(200.0)).route(["sn"], "sn_0", 10.0, None, 190.0)
    assert [one.lane for one in route.overpasses] == ["we_0"]


def test_the_far_end_of_a_road_that_is_left_before_it_is_crossed_does_not_matter(plain: NetBuilder) -> None:
    nodes, edges = crossed(350.0)
    assert not plain(nodes, edges).route(["we"], "we_0", 10.0, None, 200.0).overpasses


@pytest.mark.parametrize(("x", "angle"), [(398.0, math.pi / 2.0), (200.0, 0.1)], ids=["at its end", "hardly across"])
def test_lines_drawn_carelessly_are_no_bridges(plain: NetBuilder, x: float, angle: float) -> None:
    assert not plain(*crossed(x, angle=angle)).route(["we"], "we_0", 50.0, None, 390.0).overpasses


def test_a_path_across_the_road_is_no_bridge(plain: NetBuilder) -> None:
    nodes, edges = crossed(200.0)
    path = edges.replace('numLanes="2"', 'allow="pedestrian bicycle"')
    assert not plain(nodes, path).route(["we"], "we_0", 50.0, None, 390.0).overpasses


def test_roads_that_meet_at_a_junction_are_on_one_level(grid: NetBuilder) -> None:
    roadmap = grid()
    route = roadmap.route(["A1B1", "B1C1"], "A1B1_0", 20.0, None, 100.0)
    assert route.overpasses == ()
