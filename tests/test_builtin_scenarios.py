"""The built-in scenarios as SUMO itself sees them: no stack drives here."""

import importlib.util
import math
import multiprocessing
import re
import subprocess
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import pytest
import sumolib
from shapely import affinity
from shapely.geometry import LineString, box
from shapely.geometry.base import BaseGeometry

ROOT = Path(__file__).parents[1]
NETS = ROOT / "nets"
SCENARIOS = ("cs1", "cs2", "cs3", "cs4", "cs5")
PERSON_LENGTH, PERSON_WIDTH = 0.215, 0.478  # [m] SUMO's defaults


class Drive(NamedTuple):
    """What happened while the ego followed its lane."""

    departed: float  # [s]
    arrived: float  # [s], nan: not within the scenario
    distances: dict[str, float]  # [m] least distance of the ego's box to each object
    ran_over: set[tuple[str, str]]  # background vehicle, static object or person
    vehicles: set[str]
    signals: tuple[str, ...]  # on the ego's route
    red_for_ego: bool  # while it approached the signal
    traffic: tuple[tuple[float, float], ...]  # positions of all others at 30 s


def _body(position: tuple[float, float], angle: float, length: float, width: float) -> BaseGeometry:
    """A box from its front centre and SUMO's angle [deg, clockwise from north]."""
    at_origin = box(-length, -width / 2, 0.0, width / 2)
    turned = affinity.rotate(at_origin, 90.0 - angle, origin=(0.0, 0.0))
    return affinity.translate(turned, *position)


def _static_objects() -> dict[str, BaseGeometry]:
    import libsumo  # noqa: PLC0415  (one simulation per process: never in the tests' own)

    found: dict[str, BaseGeometry] = {}
    for poi in libsumo.poi.getIDList():
        if libsumo.poi.getType(poi).startswith("obstacle."):
            half = libsumo.poi.getWidth(poi) / 2, libsumo.poi.getHeight(poi) / 2
            x, y = libsumo.poi.getPosition(poi)
            found[poi] = box(x - half[0], y - half[1], x + half[0], y + half[1])
    for polygon in libsumo.polygon.getIDList():
        if libsumo.polygon.getType(polygon).startswith("obstacle."):
            line = LineString(libsumo.polygon.getShape(polygon))
            found[polygon] = line.buffer(libsumo.polygon.getLineWidth(polygon) / 2, cap_style="flat")
    return found


def _moving_objects() -> dict[str, BaseGeometry]:
    import libsumo  # noqa: PLC0415

    bodies = {
        vehicle: _body(
            libsumo.vehicle.getPosition(vehicle),
            libsumo.vehicle.getAngle(vehicle),
            libsumo.vehicle.getLength(vehicle),
            libsumo.vehicle.getWidth(vehicle),
        )
        for vehicle in libsumo.vehicle.getIDList()
    }
    for person in libsumo.person.getIDList():
        where = libsumo.person.getPosition(person)
        bodies[person] = _body(where, libsumo.person.getAngle(person), PERSON_LENGTH, PERSON_WIDTH)
    return bodies


def _drive(name: str, seed: int, blind: bool) -> Drive:  # noqa: FBT001  (one loop, read top-down)
    """Lets SUMO drive the ego; `blind`: at the speed limit, whatever stands in its way."""
    import libsumo  # noqa: PLC0415

    libsumo.start(["sumo", "-c", str(NETS / f"{name}.sumocfg"), "--seed", str(seed), "--collision.action", "none"])
    departed = arrived = math.nan
    statics = _static_objects()
    distances: dict[str, float] = {}
    ran_over: set[tuple[str, str]] = set()
    vehicles: set[str] = set()
    signals: tuple[str, ...] = ()
    red_for_ego = False
    traffic: tuple[tuple[float, float], ...] = ()
    while (now := libsumo.simulation.getTime()) < 90.0:
        libsumo.simulationStep()
        moving = _moving_objects()
        everything = moving | statics
        vehicles.update(libsumo.vehicle.getIDList())
        if "ego" in libsumo.simulation.getDepartedIDList():
            departed = now
            signals = tuple(upcoming[0] for upcoming in libsumo.vehicle.getNextTLS("ego"))
            if blind:
                libsumo.vehicle.setSpeedMode("ego", 0)
                libsumo.vehicle.setSpeed("ego", 13.8)
        if "ego" in libsumo.simulation.getArrivedIDList():
            arrived = now
        if "ego" in moving:
            ego = moving.pop("ego")
            upcoming = libsumo.vehicle.getNextTLS("ego")
            red_for_ego |= any(distance < 60.0 and colour in "rR" for _, _, distance, colour in upcoming)
            for identity, body in everything.items():
                if identity != "ego":
                    distances[identity] = min(distances.get(identity, math.inf), ego.distance(body))
        if round(now, 1) == 30.0:
            traffic = tuple(sorted((body.centroid.x, body.centroid.y) for body in moving.values()))
        in_the_way = statics | {who: moving[who] for who in ("pedestrian", "parked_van") if who in moving}
        for vehicle, body in moving.items():
            ran_over.update((vehicle, it) for it, what in in_the_way.items() if it != vehicle and body.intersects(what))
    return Drive(departed, arrived, distances, ran_over, vehicles, signals, red_for_ego, traffic)


def _drives(*jobs: tuple[str, int, bool]) -> tuple[Drive, ...]:
    """Each job in a process of its own, since libsumo holds one simulation per process."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=2, mp_context=context, max_tasks_per_child=1) as pool:
        return tuple(pool.map(_drive, *zip(*jobs, strict=True)))


@pytest.fixture(scope="module")
def blind_drives() -> dict[str, Drive]:
    jobs = tuple((name, 1, True) for name in SCENARIOS)
    return dict(zip(SCENARIOS, _drives(*jobs), strict=True))


@pytest.fixture(scope="module")
def sumo_drives() -> dict[str, Drive]:
    jobs = tuple((name, 2, False) for name in SCENARIOS)
    return dict(zip(SCENARIOS, _drives(*jobs), strict=True))


@pytest.mark.parametrize("name", SCENARIOS)
def test_ego_departs_early_passes_a_signal_and_arrives_within_a_minute(
    sumo_drives: dict[str, Drive], name: str
) -> None:
    drive = sumo_drives[name]
    assert 1.0 <= drive.departed <= 5.0
    assert drive.signals == ("signal",)
    assert 30.0 <= drive.arrived - drive.departed <= 60.0


def test_the_signal_is_red_for_the_ego_in_some_scenarios_only(sumo_drives: dict[str, Drive]) -> None:
    assert {name for name, drive in sumo_drives.items() if drive.red_for_ego} == {"cs2", "cs3", "cs5"}


@pytest.mark.parametrize("name", SCENARIOS)
def test_other_traffic_is_there_and_keeps_off_what_it_cannot_see(sumo_drives: dict[str, Drive], name: str) -> None:
    drive = sumo_drives[name]
    assert len(drive.vehicles) >= 10
    assert {"ego", "follower", "oncoming_1"} <= drive.vehicles
    assert drive.ran_over == set()


@pytest.mark.parametrize(
    ("name", "hazard"), [("cs1", "pedestrian"), ("cs2", "van"), ("cs3", "cone"), ("cs4", "parked_van")]
)
def test_a_car_that_sees_nothing_and_keeps_its_lane_at_the_limit_hits_the_hazard(
    blind_drives: dict[str, Drive], name: str, hazard: str
) -> None:
    assert blind_drives[name].distances[hazard] == 0.0


def test_a_car_that_leaves_its_lane_by_more_than_a_metre_meets_the_divider_or_the_curb(
    blind_drives: dict[str, Drive],
) -> None:
    distances = blind_drives["cs5"].distances
    assert 1.0 < distances["divider"] < 1.5
    assert 1.0 < distances["curb"] < 1.5


def test_another_seed_changes_the_traffic_but_not_the_case() -> None:
    first, again, other = _drives(("cs1", 1, True), ("cs1", 1, True), ("cs1", 2, True))
    assert first == again
    assert other.traffic != first.traffic
    assert other.distances["pedestrian"] == 0.0


@pytest.mark.parametrize("name", sorted(source.stem for source in (NETS / "plain").glob("*.netccfg")))
def test_a_network_rebuilt_from_its_sources_is_the_committed_one(tmp_path: Path, name: str) -> None:
    committed = (NETS / f"{name}.net.xml").read_text(encoding="utf-8")
    built_with = re.search(r"<!-- built by nets/build.py with netconvert (\S+) -->", committed)
    assert built_with is not None
    here = subprocess.run(  # noqa: S603
        (sumolib.checkBinary("netconvert"), "--version"), check=True, capture_output=True, text=True
    ).stdout
    if here.splitlines()[0].split()[-1] != built_with[1]:
        pytest.skip(f"committed with netconvert {built_with[1]}, another one is installed")
    spec = importlib.util.spec_from_file_location("nets_build", NETS / "build.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    script.build(NETS / "plain" / f"{name}.netccfg", tmp_path / "rebuilt.net.xml")
    assert (tmp_path / "rebuilt.net.xml").read_text(encoding="utf-8") == committed
