from collections.abc import Callable

import numpy as np
import pytest

from dvca_sumo.roadmap import Control, RoadMap, StopLine

NetBuilder = Callable[..., RoadMap]

# A main road from west to east, a side road from the south.
NODES = """
<node id="w" x="-200" y="0"/><node id="e" x="200" y="0"/><node id="s" x="0" y="-200"/>
<node id="x" x="0" y="0" type="{}"/>"""
EDGES = """
<edge id="wx" from="w" to="x" priority="3"/><edge id="xe" from="x" to="e" priority="3"/>
<edge id="ex" from="e" to="x" priority="3"/><edge id="xw" from="x" to="w" priority="3"/>
<edge id="sx" from="s" to="x" priority="1"/><edge id="xs" from="x" to="s" priority="1"/>"""


def first_line(roadmap: RoadMap, before: str, after: str) -> StopLine:
    return roadmap.route([before, after], f"{before}_0", 10.0, None, 100.0).stop_lines[0]


def tee(plain: NetBuilder, kind: str) -> RoadMap:
    return plain(NODES.format(kind), EDGES)


def approaches(lanes: frozenset[str]) -> set[str]:
    return {lane for lane in lanes if not lane.startswith(":")}


def test_main_road_has_priority(plain: NetBuilder) -> None:
    line = first_line(tee(plain, "priority"), "wx", "xe")
    assert line.control is Control.PRIORITY
    assert line.signal_id is None
    assert line.yields_to == frozenset()
    assert approaches(line.crosses) == {"sx_0", "ex_0"}


def test_side_road_yields_to_both_directions_when_turning_left(plain: NetBuilder) -> None:
    roadmap = tee(plain, "priority")
    line = first_line(roadmap, "sx", "xw")
    assert line.control is Control.YIELD
    assert approaches(line.yields_to) == {"wx_0", "ex_0"}
    assert all(roadmap.lanes[lane].is_internal for lane in line.yields_to - {"wx_0", "ex_0"})
    assert line.yields_to <= line.crosses


def test_side_road_yields_only_to_the_lane_it_joins_when_turning_right(plain: NetBuilder) -> None:
    assert approaches(first_line(tee(plain, "priority"), "sx", "xe").yields_to) == {"wx_0"}


def test_left_turn_off_the_main_road_yields_to_oncoming_traffic(plain: NetBuilder) -> None:
    line = first_line(tee(plain, "priority"), "ex", "xs")
    assert line.control is Control.YIELD
    assert approaches(line.yields_to) == {"wx_0"}


@pytest.mark.parametrize(
    ("before", "after", "lanes"),
    [("sx", "xw", {"wx_0", "ex_0"}), ("sx", "xe", {"wx_0"}), ("ex", "xs", {"wx_0"}), ("wx", "xe", set())],
)
def test_lanes_from_where_somebody_with_priority_comes_are_known(
    plain: NetBuilder, before: str, after: str, lanes: set[str]
) -> None:
    roadmap = tee(plain, "priority")
    prior = first_line(roadmap, before, after).prior
    assert {each.lane for each in prior} == lanes
    for each in prior:
        lane = roadmap.lanes[each.lane]
        assert each.line is lane.line
        assert (each.width, each.speed_limit) == (lane.width, lane.speed_limit)


def test_of_those_with_priority_people_and_who_merges_have_no_such_lane(plain: NetBuilder, grid: NetBuilder) -> None:
    ramp = plain(
        '<node id="a" x="0" y="0"/><node id="m" x="300" y="0"/><node id="z" x="600" y="0"/>'
        '<node id="r" x="0" y="-60"/>',
        '<edge id="main" from="a" to="m" priority="3"/><edge id="on" from="m" to="z" priority="3"/>'
        '<edge id="ramp" from="r" to="m" priority="1"/>',
    )
    line = first_line(ramp, "ramp", "on")
    assert approaches(line.yields_to) == {"main_0"}
    assert line.prior == ()
    roadmap = grid("--sidewalks.guess", "--crossings.guess")
    turning = roadmap.route(["A1B1", "B1B0"], "A1B1_1", 10.0, None, 100.0).stop_lines[0]
    assert any(roadmap.lanes[lane].is_crossing for lane in turning.yields_to)
    assert not any(roadmap.lanes[each.lane].is_crossing for each in turning.prior)


@pytest.mark.parametrize(
    ("kind", "control"), [("unregulated", Control.YIELD), ("traffic_light_unregulated", Control.SIGNAL)]
)
@pytest.mark.parametrize(
    ("before", "after", "others"),
    [("wx", "xe", {"sx_0", "ex_0"}), ("wx", "xs", {"ex_0"}), ("ex", "xw", {"sx_0"}), ("sx", "xe", {"wx_0"})],
)
def test_where_a_junction_is_unregulated_the_ego_gives_way_to_all_whose_way_meets_its_own(
    plain: NetBuilder, kind: str, control: Control, before: str, after: str, others: set[str]
) -> None:
    ways = ("wx xe", "wx xs", "ex xw", "ex xs", "sx xe", "sx xw")
    connections = "".join('<connection from="{}" to="{}"/>'.format(*way.split()) for way in ways)
    line = first_line(plain(NODES.format(kind), EDGES, connections), before, after)
    assert line.control is control
    assert approaches(line.yields_to) == others
    assert line.crosses == line.yields_to


def test_internal_lanes_of_a_waiting_left_turn_are_all_foes(plain: NetBuilder) -> None:
    roadmap = tee(plain, "priority")
    route = roadmap.route(["ex", "xs"], "ex_0", 10.0, None, 100.0)
    turning = {lane for lane in route.lane_ids if lane.startswith(":")}
    assert len(turning) == 2
    assert turning <= first_line(roadmap, "wx", "xe").crosses


@pytest.mark.parametrize(
    ("kind", "control"),
    [
        ("priority_stop", Control.STOP),
        ("allway_stop", Control.ALL_WAY_STOP),
        ("right_before_left", Control.RIGHT_BEFORE_LEFT),
        ("zipper", Control.YIELD),
        ("unregulated", Control.YIELD),
    ],
)
def test_sign_at_the_side_road(plain: NetBuilder, kind: str, control: Control) -> None:
    assert first_line(tee(plain, kind), "sx", "xw").control is control


def test_right_before_left(plain: NetBuilder) -> None:
    line = first_line(tee(plain, "right_before_left"), "wx", "xe")
    assert line.control is Control.RIGHT_BEFORE_LEFT
    assert approaches(line.yields_to) == {"sx_0"}


def test_where_all_stop_nobody_who_stops_goes_first_by_rule(plain: NetBuilder) -> None:
    line = first_line(tee(plain, "allway_stop"), "wx", "xe")
    assert line.control is Control.ALL_WAY_STOP
    assert approaches(line.crosses) == {"sx_0", "ex_0"}
    assert line.yields_to == frozenset()


def test_all_way_stop_knows_the_other_stop_signs(plain: NetBuilder) -> None:
    roadmap = tee(plain, "allway_stop")
    signs = first_line(roadmap, "wx", "xe").stop_signs
    assert {sign.lane for sign in signs} == {"sx_0", "ex_0"}
    for sign in signs:
        assert sign.width == roadmap.lanes[sign.lane].width
        assert sign.line.points[-1] == pytest.approx(roadmap.lanes[sign.lane].line.points[-1])


def test_a_stop_sign_at_the_side_road_is_the_only_one(plain: NetBuilder) -> None:
    roadmap = tee(plain, "priority_stop")
    assert first_line(roadmap, "sx", "xw").stop_signs == ()
    assert first_line(roadmap, "wx", "xe").stop_signs == ()


def test_signal_is_named_and_keeps_the_priorities_of_permissive_green(plain: NetBuilder) -> None:
    roadmap = tee(plain, "traffic_light")
    left, straight = first_line(roadmap, "ex", "xs"), first_line(roadmap, "wx", "xe")
    assert left.control is straight.control is Control.SIGNAL
    assert left.signal_id != straight.signal_id
    assert str(left.signal_id).startswith("x/")
    assert approaches(left.yields_to) == {"wx_0"}
    assert straight.yields_to == frozenset()


def test_left_turn_waits_on_the_junction_before_the_way_of_the_oncoming_traffic(plain: NetBuilder) -> None:
    roadmap = tee(plain, "traffic_light")
    route = roadmap.route(["ex", "xs"], "ex_0", 10.0, None, 100.0)
    line = route.stop_lines[0]
    assert line.waiting_station is not None
    assert line.station + 1.0 < line.waiting_station < line.exit_station - 1.0
    place = route.line.poses([line.waiting_station])[:, :2]
    _, beside = roadmap.lanes["wx_0"].line.project(place + np.array([-50.0, 0.0]))
    assert beside[0] > 0.5 * roadmap.lanes["wx_0"].width
    assert first_line(roadmap, "wx", "xe").waiting_station is None


def test_stop_line_lies_at_the_end_of_its_lane(plain: NetBuilder) -> None:
    roadmap = tee(plain, "priority")
    route = roadmap.route(["wx", "xe"], "wx_0", 10.0, None, 100.0)
    line = route.stop_lines[0]
    end = roadmap.lanes["wx_0"].line.points[-1]
    assert line.lane == "wx_0"
    assert line.position == pytest.approx(tuple(end))
    assert route.line.poses([line.station])[0, :2] == pytest.approx(end, abs=0.05)
    begin = roadmap.lanes["xe_0"].line.points[0]
    assert route.line.poses([line.exit_station])[0, :2] == pytest.approx(begin, abs=0.05)


def test_every_junction_on_the_way_has_its_line(grid: NetBuilder) -> None:
    route = grid().route(["A0B0", "B0B1", "B1B2"], "A0B0_0", 10.0, None, 20.0)
    assert [line.lane for line in route.stop_lines[:2]] == ["A0B0_0", "B0B1_0"]


def test_signals_are_named_in_a_net_without_internal_lanes(grid: NetBuilder) -> None:
    line = first_line(grid("--no-internal-links", "-j", "traffic_light"), "A1B1", "B1C1")
    assert str(line.signal_id).startswith("B1/")
    assert approaches(line.crosses) == set(line.crosses) != set()


def test_crossings_before_and_behind_a_junction_are_passed_in_order(grid: NetBuilder) -> None:
    roadmap = grid("--sidewalks.guess", "--crossings.guess")
    route = roadmap.route(["A1B1", "B1C1"], "A1B1_1", 10.0, None, 100.0)
    passed = route.crossings[:2]
    line = route.stop_lines[0]
    assert line.station - 1.0 < passed[0].start_station < passed[1].start_station < line.exit_station + 1.0
    for crossing in passed:
        lane = roadmap.lanes[crossing.lane]
        assert crossing.end_station - crossing.start_station == pytest.approx(lane.width, abs=0.3)
        middle = 0.5 * (crossing.start_station + crossing.end_station)
        _, offsets = lane.line.project(route.line.poses([middle])[:, :2])
        assert np.abs(offsets).max() < 0.2


def test_pedestrians_with_priority_are_yielded_to(grid: NetBuilder) -> None:
    roadmap = grid("--sidewalks.guess", "--crossings.guess")
    route = roadmap.route(["A1B1", "B1C1"], "A1B1_1", 10.0, None, 100.0)
    assert {crossing.lane for crossing in route.crossings[:2]} <= route.stop_lines[0].crosses


def test_no_crossings_without_sidewalks(grid: NetBuilder) -> None:
    assert grid().route(["A1B1", "B1C1"], "A1B1_0", 10.0, None, 100.0).crossings == ()
