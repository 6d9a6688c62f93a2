"""Egos see one another where they are, though SUMO is told another place of one."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from small_scenarios import in_child, scenario_file
from watched_world import STEP, objects_of

from dvca_sumo.geometry.boxes import box_of
from dvca_sumo.messages import ControlCommand, Floats, PoseStep
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.scenario import load_scenario
from dvca_sumo.world import Ego, VehicleLimits, World

STANDING = PoseStep(0.0, 0.0, 0.0, 0.0)
ROAD = '<node id="b" x="0" y="0"/><node id="c" x="300" y="0"/>'
TWO_LANES = '<edge id="bc" from="b" to="c" speed="13.9" numLanes="2" width="4"/>'
BEND = '<node id="a" x="0" y="0"/><node id="b" x="200" y="0"/><node id="c" x="300" y="100"/>'
EDGES = '<edge id="ab" from="a" to="b" speed="13.9"/><edge id="bc" from="b" to="c" speed="13.9"/>'


class Sighting(NamedTuple):
    """Of one ego by another, at one world step."""

    box: Floats
    velocity: Floats
    true_box: Floats
    true_velocity: Floats
    told: float  # [m] from its front to where SUMO has that


def sightings(folder: Path, net: Path, trips: str, moves: Sequence[PoseStep]) -> list[Sighting]:
    """What "other", who stands, sees of "ego", who moves."""

    def job() -> list[Sighting]:
        import libsumo  # noqa: PLC0415 one simulation a process: never in the tests' own

        world = World(load_scenario(scenario_file(folder, net, trips)), folder)
        egos = dict[str, Ego]()
        while len(egos) < 2:
            step(world, dict.fromkeys(egos.values(), STANDING))
            egos |= {name: adopted(world, name, net) for name in world.departed()}
        ego, other = egos["ego"], egos["other"]
        found = []
        for move in moves:
            step(world, {ego: move, other: STANDING})
            moment = world.observe(other)
            row, truth = objects_of(moment)["ego"], ego.truth
            ahead = np.array([math.cos(truth.heading), math.sin(truth.heading)])
            front = (truth.x, truth.y) + ego.shape.front * ahead
            found.append(
                Sighting(
                    moment.objects.boxes[row],
                    moment.objects.velocities[row],
                    box_of(truth.x, truth.y, truth.heading, ego.shape),
                    truth.speed * ahead,
                    math.dist(front, libsumo.vehicle.getPosition("ego")),
                )
            )
        return found

    return in_child(job)


def step(world: World, moves: Mapping[Ego, PoseStep]) -> None:
    for ego, move in moves.items():
        ego.vehicle.advance(ControlCommand(world.time, 0.0, 0.0, move), STEP)
    assert world.advance() == ()


def adopted(world: World, name: str, net: Path) -> Ego:
    entry, roadmap = world.entry(name, ()), RoadMap.load(net)
    end = roadmap.lanes[f"{entry.edges[-1]}_0"].length
    return world.adopt(entry, roadmap.route(entry.edges, entry.lane, entry.position, None, end), VehicleLimits())


def assert_true(seen: Sequence[Sighting]) -> None:
    """Though SUMO was told otherwise."""
    assert max(one.told for one in seen) > 0.3
    for one in seen:
        assert one.box == pytest.approx(one.true_box, abs=1e-6)
        assert one.velocity == pytest.approx(one.true_velocity, abs=1e-6)


def trip(name: str, origin: str, position: float, lane: int = 0, to: str = "bc") -> str:
    return (
        f'<trip id="{name}" from="{origin}" to="{to}" depart="0" departPos="{position}" departSpeed="0"'
        f' departLane="{lane}"/>'
    )


def test_one_is_held_on_its_lane_beside_the_other(tmp_path: Path, plain_file: Callable[..., Path]) -> None:
    net = plain_file(ROAD, TWO_LANES)
    trips = trip("ego", "bc", 100.0) + trip("other", "bc", 101.0, lane=1)
    assert_true(sightings(tmp_path, net, trips, [PoseStep(0.1, 0.14, 0.0, 0.0)] * 15 + [STANDING] * 10))


def test_one_is_set_back_at_the_joint_of_two_lanes(tmp_path: Path, plain_file: Callable[..., Path]) -> None:
    net = plain_file(BEND, EDGES)
    trips = trip("ego", "ab", 190.0) + trip("other", "ab", 170.0)
    moves = [PoseStep(0.05, left, 0.0, 0.0) for left in [-0.05] * 24 + [0.0] * 246]
    assert_true(sightings(tmp_path, net, trips, moves))


def test_one_swings_out_beyond_its_lane(tmp_path: Path, plain_file: Callable[..., Path]) -> None:
    net = plain_file(ROAD, TWO_LANES.replace(' numLanes="2" width="4"', ""))
    trips = trip("ego", "bc", 100.0) + trip("other", "bc", 80.0)
    assert_true(sightings(tmp_path, net, trips, [PoseStep(0.2, -0.05, 0.0, 0.0)] * 80))


def test_one_is_beside_the_road_where_sumo_has_it_near_nobody(tmp_path: Path, plain_file: Callable[..., Path]) -> None:
    net = plain_file(ROAD, TWO_LANES.replace(' numLanes="2" width="4"', ""))
    trips = trip("ego", "bc", 100.0) + trip("other", "bc", 80.0)
    for seen in sightings(tmp_path, net, trips, [PoseStep(0.2, -0.2, 0.0, 0.0)] * 40 + [STANDING] * 20):
        assert seen.box == pytest.approx(seen.true_box, abs=1e-6)
        assert seen.velocity == pytest.approx(seen.true_velocity, abs=0.3)  # told, where it was moved sideways
