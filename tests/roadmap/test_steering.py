"""Turns that the net draws sharper than a car can steer."""

from collections.abc import Callable

import numpy as np
import pytest
from soundness import check_sound

from dvca_sumo.geometry.polyline import Floats, Polyline
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.roadmap.smoothing import smoothed
from dvca_sumo.roadmap.steering import PART, WHOLE, steered, straying, unsteerable

NetBuilder = Callable[..., RoadMap]

SHARPEST = np.tan(0.55) / 3.0  # [1/m] of a car of 5 m, its wheels turned fully
FRONT, REAR, HALF_WIDTH = 4.1, 0.9, 0.9  # [m] its body around the rear axle


def swept(line: Polyline, drawn: Polyline) -> Floats:
    """(n, 2) stations on `line` and offsets from it [m] of the corners of a car whose rear axle follows `drawn`."""
    cos, sin = np.cos(drawn.headings), np.sin(drawn.headings)
    corners = [
        drawn.points + np.column_stack((ahead * cos - side * sin, ahead * sin + side * cos))
        for ahead in (FRONT, -REAR)
        for side in (HALF_WIDTH, -HALF_WIDTH)
    ]
    return np.column_stack(line.project(np.concatenate(corners)))


def corner(radius: float, angle: float, spacing: float = 0.25) -> Polyline:
    """30 m straight on, a bend to the left, 30 m straight on."""
    count = max(round(radius * angle / spacing), 1)
    turns = np.concatenate((np.zeros(120), np.full(count, angle / count), np.zeros(120)))
    headings = np.cumsum(turns)
    return Polyline(spacing * np.cumsum(np.column_stack((np.cos(headings), np.sin(headings))), axis=0))


def room(line: Polyline, half: float) -> tuple[Floats, Floats]:
    return np.full(len(line), half), np.full(len(line), -half)


def redrawn(line: Polyline, half: float) -> Polyline:
    return Polyline(steered(line, unsteerable(line), *room(line, half), WHOLE)[0])


def sharpest(line: Polyline) -> float:
    poses = line.poses(np.arange(0.0, line.length, 1.0))
    return float(np.abs(np.diff(poses[:, 2])).max())


@pytest.mark.parametrize("angle", [0.5 * np.pi, -0.5 * np.pi, 0.8 * np.pi])
@pytest.mark.parametrize("radius", [0.5, 3.0])
def test_corner_is_drawn_as_a_car_steers(radius: float, angle: float) -> None:
    line = corner(radius, angle)
    assert unsteerable(line).any()
    drawn = redrawn(line, 1.6)
    assert not unsteerable(drawn).any()
    assert sharpest(drawn) < SHARPEST
    assert drawn.points[[0, -1]] == pytest.approx(line.points[[0, -1]], abs=0.02)
    assert drawn.headings[[0, -1]] == pytest.approx(line.headings[[0, -1]], abs=0.01)


def test_bend_that_a_car_can_steer_is_no_sharp_one() -> None:
    assert not unsteerable(corner(5.6, 0.5 * np.pi)).any()
    assert not unsteerable(corner(50.0, 1.0)).any()


def test_wheels_have_time_to_turn_the_other_way() -> None:
    """From lock to lock in the 7 m that a car crawls in two seconds, not at once."""
    bend = corner(5.6, 0.5 * np.pi, 0.25).points[: 120 + 20]
    line = Polyline(np.concatenate((bend, 2.0 * bend[-1] - bend[-2::-1])))  # point symmetric: a left bend, a right one
    assert unsteerable(line).any()
    drawn = Polyline(redrawn(line, 1.6).poses(np.arange(0.0, line.length, 1.0))[:, :2])
    assert np.abs(np.diff(drawn.curvatures)).max() < 0.06


def test_body_stays_on_a_road_that_is_wide_enough() -> None:
    line, half = corner(0.5, 0.5 * np.pi), 2.6
    stations, offsets = swept(line, redrawn(line, half)).T
    assert np.abs(offsets[(stations > 0.0) & (stations < line.length)]).max() < half + 0.1


def test_line_swings_out_before_the_corner_and_cuts_in_at_it() -> None:
    line = corner(0.5, 0.5 * np.pi)
    stations, offsets = line.project(redrawn(line, 1.6).points)
    assert offsets[(stations > 20.0) & (stations < 28.0)].min() < -0.3
    assert offsets[np.abs(stations - 30.0) < 2.0].max() > 0.8


def test_rest_of_the_line_is_left_as_it_is() -> None:
    line = corner(0.5, 0.5 * np.pi)
    points, stations = steered(line, unsteerable(line), *room(line, 1.6), WHOLE)
    kept = (stations < 7.0) | (stations > line.length - 7.0)
    assert kept.sum() > 50
    assert line.poses(stations[kept])[:, :2] == pytest.approx(points[kept], abs=1e-9)
    assert (np.diff(stations) >= 0.0).all()


@pytest.mark.parametrize("options", [(), ("--lefthand",), ("--no-internal-links",), ("--default.lanenumber=2",)])
@pytest.mark.parametrize("edges", [["B0A0", "A0A1"], ["A1A0", "A0B0"], ["A1B1", "B1A1"]])
def test_every_turn_of_a_grid_can_be_steered(grid: NetBuilder, options: tuple[str, ...], edges: list[str]) -> None:
    route = grid(*options).route(edges, f"{edges[0]}_0", 30.0, None, 100.0)
    check_sound(route)
    assert np.abs(route.curvatures).max() < SHARPEST


def test_turn_back_uses_both_lanes_of_the_road(grid: NetBuilder) -> None:
    roadmap = grid("--default.lanenumber=2")
    route = roadmap.route(["A1B1", "B1A1"], "A1B1_1", 30.0, None, 100.0)
    _, before = roadmap.lanes["A1B1_1"].line.project(route.line.points[: int(route.stop_lines[0].station)])
    assert before.min() < -1.0  # towards lane 0, before it turns left
    assert before.max() < 2.0


@pytest.mark.parametrize("kink", [-20.0, 10.0, 20.0])
def test_before_and_after_a_turn_back_the_line_keeps_off_the_opposite_lane(plain: NetBuilder, kink: float) -> None:
    """They are side by side: who is on the one is beside the other one, too."""
    nodes = '<node id="a" x="0" y="0"/><node id="b" x="100" y="0"/>'
    shape = f"0,0 75,{kink} 100,0"
    back = f"100,0 75,{kink} 0,0"
    edges = f"""<edge id="ab" from="a" to="b" speed="13.9" shape="{shape}"/>
        <edge id="ba" from="b" to="a" speed="13.9" shape="{back}"/>"""
    net = plain(nodes, edges)
    route = net.route(["ab", "ba"], "ab_0", 5.0, None, 90.0)
    driven = (route.line.stations >= route.start) & (route.line.stations <= route.destination)
    for lane_id in ("ab_0", "ba_0"):
        lane = net.lanes[lane_id].line
        rows = [row for row in driven.nonzero()[0].tolist() if route.lane_ids[row] == lane_id]
        stations, offsets = lane.project(route.line.points[rows])
        assert offsets[(stations > 8.0) & (stations < lane.length - 8.0)].max() < 0.9


def beyond(line: Polyline, drawn: Polyline, half: float) -> float:
    """How far a corner comes beyond a lane so wide on each side of `line` [m]."""
    found = swept(line, drawn)
    inner = (found[:, 0] > 1.0) & (found[:, 0] < line.length - 1.0)
    return float(np.abs(found[inner, 1]).max()) - half


@pytest.mark.parametrize("angle", [0.45 * np.pi, 0.5 * np.pi, 0.7 * np.pi])
@pytest.mark.parametrize("radius", [7.0, 7.5])
def test_a_turn_that_can_be_steered_is_drawn_so_that_the_body_stays_in_its_lane(radius: float, angle: float) -> None:
    line, half = Polyline(smoothed(corner(radius, angle))[0]), 1.6
    assert not unsteerable(line).any()
    out = straying(line, *room(line, half))
    drawn = Polyline(steered(line, out, *room(line, half), PART)[0])
    assert beyond(line, line, half) > 0.25
    assert beyond(line, drawn, half) < 0.0
    assert sharpest(drawn) < SHARPEST


def test_stretches_that_touch_share_a_point() -> None:
    line = Polyline([(0.7 * step, np.sin(0.1 * step)) for step in range(120)])
    sharp = np.zeros(120, dtype=np.bool_)
    sharp[[40, 75]] = True  # the run-up of one ends between the points where the other's begins
    points, stations = steered(line, sharp, *room(line, 1.6), PART)
    assert np.hypot(*np.diff(points, axis=0).T).min() > 0.1
    assert np.diff(stations).min() >= 0.0
    assert points[[0, -1]] == pytest.approx(line.points[[0, -1]])


def test_a_wide_turn_is_left_as_it_is() -> None:
    line = corner(25.0, 0.5 * np.pi)
    assert not straying(line, *room(line, 1.6)).any()


@pytest.mark.parametrize(("x", "y"), [(0.0, -15.0), (30.0, -30.0), (40.0, -80.0)])
def test_where_the_line_cuts_a_sharp_tip_it_is_on_the_next_lane_at_once(plain: NetBuilder, x: float, y: float) -> None:
    """Not on the one before until it has come as far as that reached."""
    nodes = f'<node id="a" x="0" y="0"/><node id="b" x="100" y="0" radius="0.5"/><node id="c" x="{x}" y="{y}"/>'
    edges = '<edge id="ab" from="a" to="b" speed="13.9"/><edge id="bc" from="b" to="c" speed="13.9"/>'
    net = plain(nodes, edges)
    route = net.route(["ab", "bc"], "ab_0", 5.0, None, 60.0)
    driven = (route.line.stations >= route.start) & (route.line.stations <= route.destination)
    for row in driven.nonzero()[0].tolist():
        lane, point = net.lanes[route.lane_ids[row]].line, route.line.points[row]
        station, _ = lane.project([point])
        assert np.hypot(*(lane.poses(station)[0, :2] - point)) < 6.5
