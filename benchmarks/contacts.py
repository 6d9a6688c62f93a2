"""Where a scenario's own vehicles drive through one another, and people through them, without any ego.

    python benchmarks/contacts.py SUMOCFG [--begin T] [--end T] [--seed S] [--places N]

Counts pairs whose bodies, each `SHRUNK` smaller on every side, overlap while one of them moves, by the junction or edge
that the first of them, by name, is on. Prints the places with most of them.
"""

import argparse
import math
import tempfile
from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely

import dvca_sumo
from dvca_sumo.engine.processes import Failure, isolated
from dvca_sumo.geometry.boxes import corners
from dvca_sumo.messages import Floats
from dvca_sumo.scenario import Scenario, input_words

SHRUNK = 0.1  # [m] bodies that touch do not count
PERIOD = 0.5  # [s] between two looks
MOVING = 0.5  # [m/s]


class Contacts(NamedTuple):
    """Pairs by place."""

    vehicles: Counter[str]
    people: Counter[str]
    present: int  # vehicles that were looked at, in all


def contacts(scenario: Scenario, end: float) -> Contacts:
    """Simulate the scenario's traffic until `end` [s]."""
    import libsumo  # noqa: PLC0415 one simulation a process

    vehicles, people = libsumo.vehicle, libsumo.person
    places: dict[tuple[str, str], str] = {}
    driven: set[str] = set()
    with tempfile.TemporaryDirectory() as folder:
        files = input_words(scenario.configuration, Path(folder))
        options = [word for one in scenario.overrides for word in (f"--{one.option}", one.used)]
        libsumo.start(["sumo", "-c", str(scenario.configuration.path), *files, *options, "--no-warnings", "true"])
        looked = -math.inf
        while libsumo.simulation.getTime() < end:
            libsumo.simulationStep()
            if libsumo.simulation.getTime() - looked < PERIOD:
                continue
            looked = libsumo.simulation.getTime()
            driving = vehicles.getIDList()
            walking = [name for name in people.getIDList() if not people.getVehicle(name)]
            names = [*driving, *walking]
            speeds = [*map(vehicles.getSpeed, driving), *map(people.getSpeed, walking)]
            boxes = [_box_of(name, vehicles, 1.0) for name in driving]
            boxes += [_box_of(name, people, 0.5) for name in walking]
            driven.update(driving)
            for one, other in _overlapping(np.array(boxes).reshape(-1, 5), len(driving)):
                if max(speeds[one], speeds[other]) >= MOVING:
                    places.setdefault((names[one], names[other]), vehicles.getRoadID(names[one]))
        libsumo.close()
    found = {is_vehicle: Counter[str]() for is_vehicle in (True, False)}
    for (_, with_whom), place in places.items():
        found[with_whom in driven][place[1:].rsplit("_", 1)[0] if place.startswith(":") else place] += 1
    return Contacts(found[True], found[False], len(driven))


def _box_of(name: str, domain: Any, ahead: float) -> tuple[float, ...]:
    """Centre, heading, length and width of a body whose reported place is so much of its length `ahead` of its rear."""
    x, y = domain.getPosition(name)
    heading = math.radians(90.0 - domain.getAngle(name))
    length, width = domain.getLength(name), domain.getWidth(name)
    back = (ahead - 0.5) * length
    return x - back * math.cos(heading), y - back * math.sin(heading), heading, length, width


def _overlapping(boxes: Floats, vehicles: int) -> list[tuple[int, int]]:
    """Rows of those who overlap; the first `vehicles` of the boxes are, and one of each pair is."""
    less = np.array([0.0, 0.0, 0.0, 2.0 * SHRUNK, 2.0 * SHRUNK])
    bodies = shapely.polygons(corners(boxes - np.minimum(less, 0.5 * np.abs(boxes))))
    tree = shapely.STRtree(bodies)
    found = tree.query(bodies[:vehicles], predicate="intersects")
    return [(one, other) for one, other in found.T.tolist() if one < other]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("sumocfg", type=Path)
    parser.add_argument("--begin", type=float, default=0.0)
    parser.add_argument("--end", type=float, default=3600.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--places", type=int, default=10)
    options = parser.parse_args()
    scenario = dvca_sumo.load_scenario(options.sumocfg, "auto", options.seed, options.begin)
    ((_, found),) = isolated([partial(contacts, scenario, options.end)], 1, 3600.0)
    if isinstance(found, Failure):
        raise SystemExit(f"{found.reason}\n{found.said}")
    vehicles, people = found.vehicles.total(), found.people.total()
    print(f"{'of ' + str(found.present) + ' vehicles':30}{'with vehicles':>15}{'with people':>13}")
    print(f"{'everywhere':30}{vehicles:15}{people:13}")
    both = found.vehicles + found.people
    for place, _ in sorted(both.items(), key=lambda one: (-one[1], one[0]))[: options.places]:
        print(f"{place:30}{found.vehicles[place]:15}{found.people[place]:13}")


if __name__ == "__main__":
    main()
