"""A street and the truth of moments on it, and small screenings."""

import math
from collections.abc import Iterable
from functools import partial
from pathlib import Path

import numpy as np
from small_scenarios import in_child, scenario_file

from dvca_sumo.messages import ObjectClass, VehicleShape
from dvca_sumo.oracles import Places
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.scenario import AUTO, Scenario, load_scenario
from dvca_sumo.screen.driving import Driven, driven
from dvca_sumo.screen.trips import Draw, drawn
from dvca_sumo.stack.sources import StackSource
from dvca_sumo.truth import EgoTruth, Moment, ObjectsTruth

SHAPE = VehicleShape(length=4.6, width=1.8, wheelbase=2.8, rear_overhang=1.0)
LANE_Y = -4.8  # [m] of lane ab_0, the right one of two

# Two cars that go the same way one after the other, two that cross, and some that are none.
TRAFFIC = """
<vType id="bus" vClass="bus"/>
<trip id="first" from="ab" to="bc" depart="1"/>
<trip id="bus" type="bus" from="ab" to="bc" depart="2"/>
<trip id="second" from="ab" to="bc" depart="8"/>
<trip id="north" from="cb" to="bn" depart="9"/>
<trip id="east" from="cb" to="ba" depart="11"/>
<trip id="short" from="nb" to="bs" depart="12"/>
<trip id="stopping" from="ab" to="bc" depart="13"><stop lane="bc_0" endPos="90" duration="9"/></trip>
"""
HEAR = lambda time, done: None  # noqa: E731, ARG005

Row = tuple[str, tuple[float, float], float]  # name, x and y of its centre [m], speed along +x [m/s]


def places(roadmap: RoadMap) -> Places:
    """Of a trip straight on over the junction."""
    return Places(roadmap.route(["ab", "bc"], "ab_0", 20.0, None, 250.0), roadmap)


def moment(time: float, front: float, speed: float, objects: Iterable[Row] = (), *, y: float = LANE_Y) -> Moment:
    """The ego along +x with its front bumper at `front`."""
    rows = list(objects)
    boxes = [(x, side, 0.0, 4.6, 1.8) for _, (x, side), _ in rows]
    return Moment(
        ego=EgoTruth(time, front - SHAPE.front, y, 0.0, speed, 0.0, 0.0, 0.0),
        shape=SHAPE,
        objects=ObjectsTruth(
            time=time,
            ids=tuple(name for name, _, _ in rows),
            classes=np.full(len(rows), int(ObjectClass.VEHICLE)),
            boxes=np.array(boxes, dtype=np.float64).reshape(-1, 5),
            velocities=np.array([(speed, 0.0) for _, _, speed in rows], dtype=np.float64).reshape(-1, 2),
        ),
        signals={},
    )


def cruise(seconds: float, speed: float, objects: Iterable[Row] = ()) -> list[Moment]:
    """An ego at constant speed among others at theirs, from the front bumper at 40 m on."""
    rows = list(objects)
    times = [0.1 * k for k in range(math.ceil(10 * seconds) + 1)]
    return [
        moment(time, 40.0 + speed * time, speed, [(name, (x + v * time, y), v) for name, (x, y), v in rows])
        for time in times
    ]


def traffic(folder: Path, street: Path, routes: str = TRAFFIC, **options: str) -> Scenario:
    """The scenario of some trips on the street."""
    return load_scenario(scenario_file(folder, street, routes, **options), AUTO)


def draw(scenario: Scenario, count: int) -> Draw:
    """Trips of it."""
    return in_child(partial(drawn, scenario, count))


def drive(scenario: Scenario, egos: Iterable[str], concurrent: int = 10, stack: str | None = None) -> Driven:
    """Those egos' trips, in one simulation."""
    trips = [trip for trip in draw(scenario, 10).trips if trip.ego in set(egos)]
    return in_child(partial(driven, scenario, StackSource(stack), trips, concurrent, HEAR))
