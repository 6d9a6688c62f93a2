from collections.abc import Callable

import numpy as np
import pytest
from soundness import check_sound

from dvca_sumo.roadmap import RoadMap, Route

NetBuilder = Callable[..., RoadMap]

LONG_ROAD = '<node id="a" x="0" y="0"/><node id="b" x="500" y="0"/>'
THREE_LANES = '<edge id="e" from="a" to="b" numLanes="3" speed="13.89"/>'

AROUND_AND_ON = ["A1B1", "B1B0", "B0A0", "A0A1", "A1B1", "B1C1"]  # four right turns, then straight over B1


def widest_offset(route: Route, roadmap: RoadMap, lane: str, rows: slice) -> float:
    return float(np.abs(roadmap.lanes[lane].line.project(route.line.points[rows])[1]).max())


def test_straight_lane_is_followed_in_its_middle(plain: NetBuilder) -> None:
    roadmap = plain(LONG_ROAD, THREE_LANES)
    route = roadmap.route(["e"], "e_1", 100.0, None, 300.0)
    check_sound(route)
    assert set(route.lane_ids) == {"e_1"}
    assert np.abs(roadmap.lanes["e_1"].line.project(route.line.points)[1]).max() < 1e-6
    assert route.destination - route.start == pytest.approx(200.0)
    assert route.start == pytest.approx(20.0)
    assert route.line.length == pytest.approx(320.0)
    assert route.lane_left == pytest.approx(1.6)
    assert route.lane_right == pytest.approx(-1.6)
    assert route.road_left == pytest.approx(4.8)
    assert route.road_right == pytest.approx(-4.8)
    assert (route.stop_lines, route.crossings) == ((), ())


def test_line_begins_behind_a_start_at_the_very_begin_of_the_net(plain: NetBuilder) -> None:
    route = plain(LONG_ROAD, THREE_LANES).route(["e"], "e_0", 0.0, None, 300.0)
    assert route.start == pytest.approx(10.0)


def test_line_ends_with_the_net(plain: NetBuilder) -> None:
    roadmap = plain(LONG_ROAD, THREE_LANES)
    route = roadmap.route(["e"], "e_0", 50.0, None, 490.0)
    assert route.line.points[-1] == pytest.approx(roadmap.lanes["e_0"].line.points[-1])


def test_line_goes_on_past_the_destination(grid: NetBuilder) -> None:
    route = grid().route(["A0B0"], "A0B0_0", 5.0, None, 130.0)
    assert route.line.length == pytest.approx(route.destination + 100.0, abs=1e-3)
    assert route.lane_ids[-1] == "B0C0_0"


def test_bend_is_rounded_close_to_the_lane(plain: NetBuilder) -> None:
    nodes = '<node id="a" x="0" y="0"/><node id="b" x="200" y="60"/>'
    roadmap = plain(nodes, '<edge id="e" from="a" to="b" shape="0,0 100,0 200,60"/>')
    route = roadmap.route(["e"], "e_0", 10.0, None, 200.0)
    check_sound(route)
    assert np.abs(np.diff(route.line.headings)).max() < 0.15
    assert np.abs(roadmap.lanes["e_0"].line.project(route.line.points[:-5])[1]).max() < 0.65
    assert route.line.headings[-1] == pytest.approx(np.arctan2(60.0, 100.0), abs=0.01)


def test_bend_drawn_with_kinks_is_driven_steadily_within_the_lane(plain: NetBuilder) -> None:
    radius, angles = 50.0, np.arange(0.0, 1.5 * np.pi, 0.3)  # a ramp, with a kink every 15 m
    ramp = [(radius * np.sin(angle), radius * (1.0 - np.cos(angle))) for angle in angles]
    shape = " ".join(f"{x:.2f},{y:.2f}" for x, y in [(-100.0, 0.0), *ramp])
    nodes = f'<node id="a" x="-100" y="0"/><node id="b" x="{ramp[-1][0]:.2f}" y="{ramp[-1][1]:.2f}"/>'
    roadmap = plain(nodes, f'<edge id="e" from="a" to="b" shape="{shape}"/>')
    route = roadmap.route(["e"], "e_0", 10.0, None, 300.0)
    check_sound(route)
    assert np.abs(route.curvatures).max() < 1.75 / radius
    assert np.abs(roadmap.lanes["e_0"].line.project(route.line.points[:-5])[1]).max() < 0.3


def test_turn_at_a_junction_can_be_driven(grid: NetBuilder) -> None:
    route = grid().route(["A0B0", "B0B1"], "A0B0_0", 5.0, None, 100.0)
    check_sound(route)
    assert np.abs(route.curvatures).max() < 0.22
    assert route.line.headings[-30] == pytest.approx(np.pi / 2, abs=0.02)
    assert any(lane.startswith(":B0_") for lane in route.lane_ids)


def test_speed_limit_is_that_of_the_lane(grid: NetBuilder) -> None:
    roadmap = grid()
    route = roadmap.route(["A0B0", "B0B1"], "A0B0_0", 5.0, None, 100.0)
    assert route.speed_limits.tolist() == [roadmap.lanes[lane].speed_limit for lane in route.lane_ids]
    assert route.speed_limits.min() < 13.89 == route.speed_limits[0]


@pytest.mark.parametrize("options", [(), ("--lefthand",), ("--no-internal-links",), ("--default.lanenumber=2",)])
def test_loop_over_the_same_edge_is_driven_twice(grid: NetBuilder, options: tuple[str, ...]) -> None:
    route = grid(*options).route(AROUND_AND_ON, "A1B1_0", 10.0, None, 60.0)
    check_sound(route)
    rows = [row for row, lane in enumerate(route.lane_ids) if lane.startswith("A1B1_")]
    assert (np.diff(rows) > 1).sum() == 1
    assert abs(route.line.headings[int(route.destination)] - route.line.headings[0]) == pytest.approx(
        2.0 * np.pi, abs=0.02
    )


def test_gap_between_lanes_is_bridged_where_the_net_has_no_internal_lanes(grid: NetBuilder) -> None:
    route = grid("--no-internal-links").route(["A0B0", "B0B1"], "A0B0_0", 5.0, None, 100.0)
    check_sound(route)
    assert np.abs(route.curvatures).max() < 0.3
    assert dict.fromkeys(route.lane_ids[: int(route.destination)]) == {"A0B0_0": None, "B0B1_0": None}
    line = route.stop_lines[0]
    assert line.exit_station - line.station > 8.0


def test_turnaround_is_a_route_too(grid: NetBuilder) -> None:
    route = grid().route(["A1B1", "B1A1"], "A1B1_0", 10.0, None, 100.0)
    check_sound(route)
    assert abs(route.line.headings[int(route.destination)]) == pytest.approx(np.pi, abs=0.02)


def test_turns_keep_left_positive_in_a_left_hand_net(grid: NetBuilder) -> None:
    roadmap = grid("--lefthand", "--default.lanenumber=2")
    route = roadmap.route(["A0B0", "B0C0"], "A0B0_0", 10.0, "B0C0_0", 100.0)
    row = int(route.start) + 20
    assert route.lane_ids[row] == "A0B0_0"
    assert (route.road_left[row], route.road_right[row]) == pytest.approx((1.6, -4.8))


def test_lane_change_is_blended_early_and_gently(plain: NetBuilder) -> None:
    roadmap = plain(LONG_ROAD, THREE_LANES)
    route = roadmap.route(["e"], "e_0", 50.0, "e_1", 400.0)
    check_sound(route)
    crossed = np.flatnonzero(np.array(route.lane_ids) == "e_1")[0]
    assert 20.0 < crossed - route.start < 45.0
    assert np.abs(route.curvatures).max() < 0.02
    assert widest_offset(route, roadmap, "e_0", slice(int(route.start))) < 0.05
    assert widest_offset(route, roadmap, "e_1", slice(int(route.start) + 60, 300)) < 0.05


def test_both_lanes_count_during_a_lane_change(plain: NetBuilder) -> None:
    route = plain(LONG_ROAD, THREE_LANES).route(["e"], "e_0", 50.0, "e_1", 400.0)
    crossed = next(row for row, lane in enumerate(route.lane_ids) if lane == "e_1")
    assert route.lane_left[crossed] - route.lane_right[crossed] == pytest.approx(6.4, abs=0.05)
    assert route.lane_left[crossed + 60] - route.lane_right[crossed + 60] == pytest.approx(3.2, abs=0.01)
    assert route.road_left[crossed] - route.road_right[crossed] == pytest.approx(9.6, abs=0.05)


def test_change_over_two_lanes_passes_the_one_between(plain: NetBuilder) -> None:
    route = plain(LONG_ROAD, THREE_LANES).route(["e"], "e_2", 50.0, "e_0", 400.0)
    check_sound(route)
    assert list(dict.fromkeys(route.lane_ids)) == ["e_2", "e_1", "e_0"]


def test_short_edge_squeezes_the_lane_change_into_itself(plain: NetBuilder) -> None:
    route = plain(LONG_ROAD, THREE_LANES).route(["e"], "e_0", 470.0, "e_1", 490.0)
    check_sound(route)
    assert route.lane_ids[int(route.destination)] == "e_1"
    assert abs(route.line.project([[490.0, 0.0]])[0][0] - route.destination) < 1.0


def test_route_to_where_the_ego_stands_is_short_but_sound(plain: NetBuilder) -> None:
    roadmap = plain(LONG_ROAD, THREE_LANES)
    route = roadmap.route(["e"], "e_0", 500.0, None, 500.0)
    check_sound(route)
    assert route.destination == pytest.approx(route.start) == route.line.length


def test_overlapping_lanes_make_no_step_back(plain: NetBuilder) -> None:
    nodes = '<node id="a" x="0" y="0"/><node id="b" x="100" y="0"/><node id="c" x="200" y="0"/>'
    edges = """
    <edge id="e" from="a" to="b" shape="0,0 103,0"/>
    <edge id="f" from="b" to="c" shape="98,0 200,0"/>"""
    route = plain(nodes, edges).route(["e", "f"], "e_0", 20.0, None, 80.0)
    check_sound(route)
    assert np.abs(route.line.headings).max() < 0.1
    assert np.diff(route.line.points[:, 0]).min() > 0.9


def test_on_a_junction_the_road_is_as_wide_as_its_area_allows(grid: NetBuilder) -> None:
    roadmap = grid("--default.lanenumber=2", "--no-turnarounds")
    route = roadmap.route(["A0B0", "B0B1"], "A0B0_1", 5.0, None, 100.0)
    line = route.stop_lines[0]
    middle = int(0.5 * (line.station + line.exit_station))
    before = int(line.station) - 20
    assert (route.road_left[before], route.road_right[before]) == pytest.approx((1.6, -4.8), abs=0.01)
    assert route.road_left[middle] > route.lane_left[middle] + 1.0  # the middle of the junction
    assert route.road_right[middle] < route.lane_right[middle] - 1.0
    inside = slice(int(line.station) + 1, int(line.exit_station))
    assert (route.road_left[inside] <= route.lane_left[inside] + 2.01).all()


def test_corners_for_people_are_no_part_of_the_road(grid: NetBuilder) -> None:
    """A right turn close round the kerb."""
    ways = ["A1B1", "B1B0"]
    with_people = grid("--sidewalks.guess", "--sidewalks.guess.max-speed=30", "--crossings.guess")
    lane = next(name for name in ("A1B1_1", "A1B1_0") if with_people.lanes[name].is_drivable)
    route = with_people.route(ways, lane, 5.0, None, 80.0)
    line = route.stop_lines[0]
    middle = int(0.5 * (line.station + line.exit_station))
    kerb = route.road_right[middle]
    assert kerb > -4.0
