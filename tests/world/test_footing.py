"""People on the ground that SUMO has them on, whatever their places."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from small_scenarios import scenario_file
from watched_world import STEP, asked, watched

from dvca_sumo.messages import ObjectClass
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.world.footing import Footing

AREA, CROSSING = ":J_w0", ":J_c0"
SQUARE = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))
WITH_PEOPLE = ("--sidewalks.guess.from-permissions", "--crossings.guess", "--default-junction-type=traffic_light")
STANDING = '<trip id="ego" from="B1C1" to="B1C1" depart="0" departPos="20" departSpeed="0" departLane="1"/>'
CROWD = "".join(
    f'<person id="{number}" depart="{number}" departPos="110"><walk edges="A1B1 B1C1" arrivalPos="60"/></person>'
    for number in range(8)
)


def square(*lanes: tuple[float, float]) -> Footing:
    """A walking area 4 m wide, and lanes that lead north, given by where along it, and how wide they are."""
    return Footing(lambda _: (SQUARE, [(((x, -5.0), (x, 9.0)), width) for x, width in lanes]))


def follow(
    footing: Footing,
    steps: int,
    edge: str,
    place: tuple[float, float],
    begin: int = 0,
    heading: float = 0.0,
    speed: float = 1.0,
) -> list[list[float]]:
    """Where somebody is at each of so many steps whom SUMO leaves at one place."""
    motion = np.array([place]), np.array([heading]), np.array([speed])
    return [footing.placed(STEP * row, ["p"], [edge], *motion)[0].tolist() for row in range(begin, begin + steps)]


def test_who_stands_beside_a_walking_area_comes_onto_it_and_back_at_a_walk() -> None:
    footing = square()
    there = np.array(follow(footing, 20, AREA, (4.8, 2.0)))
    assert there[0].tolist() == [4.8, 2.0]
    assert there[-1] == pytest.approx([3.5, 2.0])
    assert np.abs(np.diff(there, axis=0)).max() <= 1.0 * STEP + 1e-9
    assert footing.concerns("p", CROSSING)
    back = np.array(follow(footing, 40, CROSSING, (4.8, 2.0), begin=20))
    assert back[-1].tolist() == [4.8, 2.0]
    assert np.abs(np.diff(back, axis=0)).max() <= 0.5 * STEP + 1e-9  # on top of walking: nobody leaps off a kerb
    assert not footing.concerns("p", CROSSING)


def test_who_is_on_the_area_stays_where_sumo_has_it() -> None:
    assert follow(square(), 5, AREA, (3.4, 2.0), speed=0.0) == [[3.4, 2.0]] * 5


def test_who_waits_at_the_kerb_stands_off_it_and_who_steps_off_it_is_not_held_back() -> None:
    waits = follow(square(), 10, AREA, (3.9, 2.0), speed=0.0)
    assert waits[-1] == pytest.approx([3.5, 2.0])
    assert follow(square(), 5, AREA, (3.9, 2.0), speed=0.5) == [[3.9, 2.0]] * 5


def test_on_a_narrow_area_people_stand_nearer_to_the_kerb() -> None:
    narrow = ((0.0, 0.0), (0.8, 0.0), (0.8, 4.0), (0.0, 4.0))
    waits = follow(Footing(lambda _: (narrow, [])), 10, AREA, (0.75, 2.0), speed=0.0)
    assert waits[-1] == pytest.approx([0.55, 2.0])


def test_who_walks_along_its_edge_keeps_off_it_and_who_walks_off_it_is_not_held_back() -> None:
    along = follow(square(), 5, AREA, (3.9, 2.0), heading=0.5 * np.pi)
    assert along[-1] == pytest.approx([3.5, 2.0])
    assert np.abs(np.diff(along, axis=0)).max() <= 1.0 * STEP + 1e-9
    assert follow(square(), 5, AREA, (3.9, 2.0), heading=0.0) == [[3.9, 2.0]] * 5


def test_who_walks_along_a_lane_that_leads_across_the_area_does_so_beside_it() -> None:
    along = follow(square((0.4, 3.2)), 30, AREA, (1.0, 2.0), heading=0.5 * np.pi)
    assert along[-1] == pytest.approx([2.5, 2.0])
    assert np.abs(np.diff(along, axis=0)).max() <= 1.0 * STEP + 1e-9
    assert follow(square((0.4, 3.2)), 5, AREA, (1.0, 2.0), heading=0.0) == [[1.0, 2.0]] * 5


@pytest.mark.parametrize(("x", "width"), [(2.0, 1.0), (0.4, 6.0)])
def test_where_lanes_leave_people_no_way_they_walk_on_the_road(x: float, width: float) -> None:
    """One divides the area, the other leaves 0.6 m of it."""
    assert follow(square((x, width)), 5, AREA, (1.5, 2.0), heading=0.5 * np.pi) == [[1.5, 2.0]] * 5


def test_who_waits_at_a_crossing_does_not_stand_in_the_way_of_those_who_turn(
    tmp_path: Path, grid_file: Callable[..., Path]
) -> None:
    net, steps = grid_file(*WITH_PEOPLE), 450
    config = scenario_file(tmp_path, net, STANDING + CROWD)

    def places(libsumo: Any) -> list[tuple[float, float]]:
        return [libsumo.person.getPosition(name) for name in libsumo.person.getIDList()]

    turning = [lane for lane in RoadMap.load(net, "passenger").lanes.values() if lane.is_drivable and lane.is_internal]
    lines = shapely.MultiLineString([lane.line.points for lane in turning])
    told = shapely.distance(lines, shapely.points(asked(config, steps, places)))
    objects = watched(config, steps)[-1].objects
    people = objects.classes == ObjectClass.PEDESTRIAN
    seen = shapely.distance(lines, shapely.points(objects.boxes[people, :2]))
    assert told.min() < 1.1
    assert seen.min() > 1.6
