"""How far a road reaches on a junction."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import shapely
import sumolib

from dvca_sumo.geometry.polyline import Floats
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.roadmap.areas import area_of, narrowed, polygon, widened

SQUARE = [(0.0, -3.0), (10.0, -3.0), (10.0, 20.0), (0.0, 20.0)]
POINTS = np.array([[-1.0, 0.0], [1.0, 0.0], [5.0, 0.0], [9.0, 0.0], [11.0, 0.0]])  # a line east, two of them outside


def edges(side: float, outline: list[tuple[float, float]], *walking: list[tuple[float, float]]) -> Floats:
    """Of a lane 3.2 m wide, and half a metre."""
    return widened(np.full(5, 2.1 * side), POINTS, np.zeros(5), area_of(outline, walking))


def test_the_edge_is_where_the_area_ends_or_as_far_out_as_is_of_use() -> None:
    assert edges(1.0, SQUARE) == pytest.approx([2.1, 3.6, 3.6, 3.6, 2.1])
    assert edges(-1.0, SQUARE) == pytest.approx([-2.1, -3.0, -3.0, -3.0, -2.1])


def test_what_is_for_people_is_left_to_them() -> None:
    corner = [(4.0, -3.0), (10.0, -3.0), (10.0, -2.5), (4.0, -2.5)]
    assert edges(-1.0, SQUARE, corner) == pytest.approx([-2.1, -3.0, -2.5, -2.5, -2.1])


def test_where_vehicles_lanes_lead_across_people_walk_on_the_road() -> None:
    island = [(4.0, -3.0), (10.0, -3.0), (10.0, -2.5), (4.0, -2.5)]
    across, along = np.array([[5.0, -3.0], [5.0, 9.0]]), np.array([[0.0, 0.0], [10.0, 0.0]])
    for lane, edge in ((across, -3.0), (along, -2.5)):
        found = widened(np.full(5, -2.1), POINTS, np.zeros(5), area_of(SQUARE, [island], [(lane, 2.0)]))
        assert found == pytest.approx([-2.1, -3.0, edge, edge, -2.1])


def test_lanes_are_road_where_the_outline_leaves_them_out() -> None:
    beside = np.array([[4.0, -2.0], [10.0, -2.0]])
    narrow = [(0.0, -1.0), (10.0, -1.0), (10.0, 20.0), (0.0, 20.0)]
    found = widened(np.full(5, -2.1), POINTS, np.zeros(5), area_of(narrow, (), [(beside, 3.0)]))
    assert found == pytest.approx([-2.1, -2.1, -3.5, -3.5, -2.1])


@pytest.mark.parametrize(
    "outline",
    [[], [(0.0, 0.0)], [(0.0, 0.0), (10.0, 0.0)], [(0.0, 0.0), (10.0, 0.0), (5.0, 0.0)], [*SQUARE[:2], SQUARE[0]]],
)
def test_a_junction_drawn_without_an_area_changes_nothing(outline: list[tuple[float, float]]) -> None:
    assert edges(1.0, outline) == pytest.approx([2.1] * 5)


def test_an_outline_that_crosses_itself_is_an_area_too() -> None:
    crossed = [(0.0, -3.0), (10.0, 20.0), (10.0, -3.0), (0.0, 20.0)]
    found = edges(1.0, crossed)
    assert np.isfinite(found).all()
    assert (found >= 2.1).all()


def test_ground_for_people_moves_an_edge_in_so_that_it_stays_off_it_but_not_across_the_line() -> None:
    ground = polygon([(4.0, -3.0), (10.0, -3.0), (8.0, -0.2), (4.0, -2.0)])
    moved = narrowed(np.full(5, -1.6), POINTS, np.zeros(5), ground, 0.5)
    assert moved == pytest.approx([-1.6, -1.6, -1.05, -1.1, -1.6])
    assert narrowed(np.full(5, 1.6), POINTS, np.zeros(5), ground, 0.5) == pytest.approx([1.6] * 5)
    beside = POINTS + np.array([3.0, -0.3])
    assert narrowed(np.full(5, -1.6), beside, np.zeros(5), ground, 0.5)[2] == 0.0


WITH_PEOPLE = ("--sidewalks.guess.from-permissions", "--crossings.guess")


def test_a_sharp_turn_keeps_off_the_corner_where_people_wait(grid_file: Callable[..., Path]) -> None:
    net = grid_file(*WITH_PEOPLE)
    line = RoadMap.load(net, "passenger").route(("A1B1", "B1B0"), "A1B1_1", 10.0, None, 60.0).line
    edges = sumolib.net.readNet(str(net), withInternal=True, withPedestrianConnections=True).getEdges()
    walking = [polygon(edge.getLane(0).getShape()) for edge in edges if edge.getFunction() == "walkingarea"]
    assert np.abs(line.curvatures).max() < 0.2
    assert shapely.distance(shapely.union_all(walking), shapely.points(line.points)).min() > 1.1


def test_but_not_onto_those_who_turn_beside_it(grid_file: Callable[..., Path]) -> None:
    roads = RoadMap.load(grid_file(*WITH_PEOPLE, "--default.lanenumber=2", "--turn-lanes=1"), "passenger")
    line = roads.route(("B0C0", "C0C1"), "B0C0_2", 90.0, "C0C1_2", 30.0).line
    beside = roads.route(("B0C0", "C0C1"), "B0C0_1", 90.0, "C0C1_1", 30.0).line
    frames = line.poses(line.stations)
    ahead = 4.1 * np.column_stack((np.cos(frames[:, 2]), np.sin(frames[:, 2])))
    across = 0.9 * np.column_stack((np.sin(frames[:, 2]), -np.cos(frames[:, 2])))
    corners_of_a_car = np.concatenate((line.points + across, line.points + ahead + across))
    _, offsets = beside.project(corners_of_a_car)
    assert np.abs(offsets).min() > 1.4
