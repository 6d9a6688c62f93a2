"""Second opinions on the oracles' geometry, as a Markdown table.

1. Distance and contact of random box pairs, with shapely and with commonroad-drivability-checker. That
   package answers only "do they collide?"; the distance d is put to it as two such questions: grown by
   d + tolerance the boxes collide, grown by d - tolerance they do not.
2. Time to collision with SUMO's SSM device, in plain following.

The package is no dependency of this project; without it the table says so. It is best installed with
this project into an environment of its own (it pins an old protobuf):
    pip install '.[test]' commonroad-drivability-checker
    python benchmarks/compare_oracles.py > benchmarks/compare_oracles.md
"""

import math
import subprocess
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

import libsumo
import numpy as np
import shapely
import sumolib

from dvca_sumo.geometry.boxes import Floats, corners, distances
from dvca_sumo.messages import VehicleShape
from dvca_sumo.oracles.place import Places
from dvca_sumo.oracles.ttc import TimeToCollision
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import EgoTruth, Moment, ObjectsTruth

try:
    commonroad: Any = import_module("commonroad_dc.pycrcc")
except ImportError:
    commonroad = None

PAIRS = 20_000
TOLERANCE = 1e-6  # [m]
CHECKER = "commonroad-drivability-checker"
STEP = 0.1  # [s]
LENGTH = 5.0  # [m] of both vehicles
WIDTH = 1.8  # [m]

Row = tuple[str, str, str, str]


def random_boxes(count: int, seed: int) -> Floats:
    """Boxes of everything between a cone and an articulated bus, near the origin."""
    draws = np.random.default_rng(seed)
    centres = draws.uniform(-9.0, 9.0, (count, 2))
    headings = draws.uniform(-math.pi, math.pi, count)
    return np.column_stack([centres, headings, draws.uniform(0.2, 18.0, count), draws.uniform(0.2, 2.6, count)])


def shapely_rows(egos: Floats, others: Floats, found: Floats) -> Iterator[Row]:
    """Distance and contact, pair by pair."""
    expected = shapely.distance(shapely.polygons(corners(egos)), shapely.polygons(corners(others)))
    name = f"shapely {version('shapely')}"
    wrong = int(((expected == 0.0) != (found == 0.0)).sum())
    yield name, "contact or not", f"{PAIRS} random pairs, {int((found == 0.0).sum())} in contact", f"{wrong} differ"
    yield name, "distance", f"{PAIRS} random pairs", f"largest difference {np.abs(expected - found).max():.1e} m"


def commonroad_rows(egos: Floats, others: Floats, found: Floats) -> Iterator[Row]:
    """Contact, and distance by two questions, pair by pair."""
    if commonroad is None:
        yield CHECKER, "contact or not, distance", "-", "**not compared: the package is not installed here**"
        return
    name = f"{CHECKER} {version(CHECKER)}"
    contacts = distances_differ = apart = 0
    for ego, other, distance in zip(egos, others, found, strict=True):
        collides = rectangle(ego).collide(rectangle(other))
        contacts += collides != (distance == 0.0)
        if distance > TOLERANCE:
            apart += 1
            reaches = grown(ego, distance + TOLERANCE).collide(rectangle(other))
            exceeds = grown(ego, distance - TOLERANCE).collide(rectangle(other))
            distances_differ += not reaches or exceeds
    within = f"{PAIRS} random pairs, {int((found == 0.0).sum())} in contact"
    yield name, "contact or not", within, f"{contacts} differ"
    yield name, "distance", f"the {apart} pairs apart", f"{distances_differ} differ by more than {TOLERANCE:.0e} m"


def rectangle(box: Floats, growth: tuple[float, float] = (0.0, 0.0)) -> Any:
    """The box, each half side grown, as the checker's shape."""
    half_length, half_width = 0.5 * box[3] + growth[0], 0.5 * box[4] + growth[1]
    return commonroad.RectOBB(half_length, half_width, box[2], box[0], box[1])


def grown(box: Floats, radius: float) -> Any:
    """All points within `radius` of the box."""
    group = commonroad.ShapeGroup()
    group.add_shape(rectangle(box, (radius, 0.0)))
    group.add_shape(rectangle(box, (0.0, radius)))
    for x, y in corners(box[None])[0]:
        group.add_shape(commonroad.Circle(radius, x, y))
    return group


def ssm_rows(folder: Path) -> Iterator[Row]:
    """Time to collision of a driver that catches up with one who slows down again and again, step by step."""
    net, log = build_scenario(folder)
    ours = following_run(folder, net, log)
    theirs = ssm_values(log)
    both = sorted(time for time in theirs if math.isfinite(ours.get(time, math.inf)))
    differences = np.array([abs(theirs[time] - ours[time]) for time in both])
    smallest = min(theirs.values())
    only_one = len({time for time in ours if math.isfinite(ours[time])} ^ set(theirs))
    name = f"SUMO {version('libsumo')} SSM device"
    what = f"following, {len(both)} steps with a time to collision, {smallest:.2f} s to {max(theirs.values()):.0f} s"
    relative = differences / np.array([theirs[time] for time in both])
    yield name, "time to collision", what, f"largest difference {differences.max():.1e} s ({relative.max():.0e} of it)"
    yield name, "time to collision or none", f"{len(ours)} steps", f"{only_one} differ"


def build_scenario(folder: Path) -> tuple[Path, Path]:
    """A straight road with two cars; the net's path and the one that the device will write to."""
    nodes, edges, net, log = (folder / name for name in ("n.nod.xml", "e.edg.xml", "road.net.xml", "ssm.xml"))
    nodes.write_text('<nodes><node id="a" x="0" y="0"/><node id="b" x="1600" y="1200"/></nodes>')
    edges.write_text('<edges><edge id="ab" from="a" to="b" numLanes="1" speed="25"/></edges>')
    netconvert = sumolib.checkBinary("netconvert")
    command = [netconvert, "-n", str(nodes), "-e", str(edges), "-o", str(net), "--no-turnarounds", "true"]
    subprocess.run(command, check=True, capture_output=True)  # noqa: S603  our own arguments
    kind = f'length="{LENGTH}" width="{WIDTH}" sigma="0"'
    parameters = {"measures": "TTC", "thresholds": "200", "range": "500", "file": str(log), "trajectories": "true"}
    devices = "".join(f'<param key="device.ssm.{key}" value="{value}"/>' for key, value in parameters.items())
    (folder / "road.rou.xml").write_text(
        f'<routes><vType id="car" {kind}/><vType id="hasty" {kind} tau="0.4" minGap="0.5" speedFactor="1.2"/>'
        '<route id="r" edges="ab"/>'
        '<vehicle id="lead" type="car" route="r" depart="0" departPos="150" departSpeed="10"/>'
        '<vehicle id="ego" type="hasty" route="r" depart="0" departPos="20" departSpeed="20">'
        f'<param key="has.ssm.device" value="true"/>{devices}</vehicle></routes>'
    )
    return net, log


def following_run(folder: Path, net: Path, log: Path) -> dict[float, float]:
    """Our time to collision [s] by time [s], inf where there is none."""
    roadmap = RoadMap.load(net)
    places = Places(roadmap.route(["ab"], "ab_0", 20.0, None, 1900.0), roadmap)
    oracle = TimeToCollision(places, Thresholds(ttc=200.0))
    options = ["--step-length", str(STEP), "--precision", "9", "--no-step-log", "true", "--remote-port", "0"]
    libsumo.start(["sumo", "-n", str(net), "-r", str(folder / "road.rou.xml"), *options])
    found = {}
    for step in range(700):
        if step % 120 == 60:
            libsumo.vehicle.slowDown("lead", 3.0, 4.0)
        if step % 120 == 110:
            libsumo.vehicle.setSpeed("lead", 12.0)
        libsumo.simulationStep()
        moment = observed()
        _, times = oracle.times(moment)
        # The device dates a step by its beginning, libsumo by its end.
        found[round(moment.time - STEP, 3)] = float(times[0]) if times.size else math.inf
    libsumo.close()
    if not log.exists():
        raise RuntimeError(f"the SSM device wrote no {log}")
    return found


def observed() -> Moment:
    """The truth of the two cars now."""
    time = libsumo.simulation.getTime()
    boxes = {}
    for name in ("ego", "lead"):
        x, y = libsumo.vehicle.getPosition(name)
        heading = math.radians(90.0 - libsumo.vehicle.getAngle(name))
        boxes[name] = (x, y, heading, libsumo.vehicle.getSpeed(name))
    x, y, heading, speed = boxes["ego"]
    shape = VehicleShape(length=LENGTH, width=WIDTH, wheelbase=2.8, rear_overhang=1.0)
    ego = EgoTruth(
        time=time,
        x=x - shape.front * math.cos(heading),
        y=y - shape.front * math.sin(heading),
        heading=heading,
        speed=speed,
        acceleration=0.0,
        yaw_rate=0.0,
        steering=0.0,
    )
    x, y, heading, speed = boxes["lead"]
    centre_x, centre_y = x - 0.5 * LENGTH * math.cos(heading), y - 0.5 * LENGTH * math.sin(heading)
    lead = ObjectsTruth(
        time=time,
        ids=("lead",),
        classes=np.zeros(1, dtype=np.int64),
        boxes=np.array([[centre_x, centre_y, heading, LENGTH, WIDTH]]),
        velocities=np.array([[speed * math.cos(heading), speed * math.sin(heading)]]),
    )
    return Moment(ego=ego, shape=shape, objects=lead, signals={})


def ssm_values(log: Path) -> dict[float, float]:
    """The device's time to collision [s] by time [s], where it has one."""
    found = {}
    for conflict in ET.parse(log).getroot().iter("conflict"):  # noqa: S314  written by SUMO just now
        spans = [conflict.find(name) for name in ("timeSpan", "TTCSpan")]
        times, values = ((span.get("values") or "").split() if span is not None else [] for span in spans)
        for time, value in zip(times, values, strict=True):
            if value != "NA":
                found[round(float(time), 3)] = float(value)
    return found


def main() -> None:
    """Print the table."""
    egos, others = random_boxes(PAIRS, seed=1), random_boxes(PAIRS, seed=2)
    found = np.array([distances(ego, other[None])[0] for ego, other in zip(egos, others, strict=True)])
    rows = [*shapely_rows(egos, others, found), *commonroad_rows(egos, others, found)]
    with tempfile.TemporaryDirectory() as folder:
        rows += ssm_rows(Path(folder))
    print("# Second opinions on the oracles\n")
    print("Made by `python benchmarks/compare_oracles.py > benchmarks/compare_oracles.md`, in an environment with")
    print(f"`pip install '.[test]' {CHECKER}`.\n")
    print("| compared with | what | on | result |\n|---|---|---|---|")
    for row in rows:
        print(f"| {' | '.join(row)} |")


if __name__ == "__main__":
    main()
