"""How the cost of an attribution grows with the trip before the violation, and with the traffic.

    python benchmarks/growth.py CITY.sumocfg       for example Bologna, "acosta" of DLR's sumo-scenarios

One ego drives a long way criss-cross through the network, once without a fault. Where it is at the end of
the longest trip a cone is put onto the road, and perception made blind to it. The ego then departs so long
before that moment, on the same way, in the same traffic: same fault, same violation, after trips of
different length. Last come trips of the middle length in thinner and denser traffic (SUMO's `scale`).

Raw libsumo is the same network over the same time without ego stack, oracles or record. It and the factual
run are counted from the ego's departure on. `probes` are the counterfactual runs, `sim` what they simulate
together, `parked` the checkpoints at the end, `MB` what these hold for themselves after the factual run and
at the end. Wall times are the best of `--repeat` rounds, `flat` is attribution / that of the middle length.
"""

import argparse
import math
import random
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import libsumo
import msgspec
import sumolib

import dvca_sumo
from dvca_sumo.analysis.attribution import Attribution, Progress, explain
from dvca_sumo.engine.fork import ForkEngine
from dvca_sumo.engine.processes import Failure, isolated
from dvca_sumo.engine.thinning import private_memory
from dvca_sumo.record import TICK, Record
from dvca_sumo.scenario import Scenario, input_words

TRIPS = (30.0, 120.0, 600.0)  # [s] before the violation; the second is what flatness is held against
SCALES = (0.25, 0.5, 1.0)
WARM_UP = 200.0  # [s] of traffic before the earliest departure
FAULT = "perception.miss:object=cone"
EGO = "growth.ego"
_LANE_TOLERANCE = 3.0  # [m] so that no narrow bend of a real network ends the trip
TICKS_PER_STEP = 10
_WAYS = 30  # ways that are tried
_LEAST = 0.8  # of the longest trip lies before the cone
_FAST = 5.0  # [m/s] at least when the cone is met
_ELSEWHERE = 8.0  # [m] from the cone the ego stays in earlier rounds ...
_APPROACH = 30.0  # [s] ... until so long before


class Trip(msgspec.Struct, frozen=True):
    """A way through the network, from a time on."""

    edges: tuple[str, ...]
    departure: float  # [s]
    position: float = 0.0  # [m] of the front bumper on the first edge
    speed: float = 0.0  # [m/s]


class Row(msgspec.Struct, frozen=True):
    """One attribution."""

    raw: float  # [s] wall, from the departure on
    factual: float  # [s] wall, likewise
    attribution: float  # [s] wall
    parked: int
    held: tuple[int, int]  # [bytes] after the factual run, at the end
    found: Attribution


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("sumocfg")
    parser.add_argument("--departure", type=float, default=1800.0, help="of the longest trip [s]")
    parser.add_argument("--scale", type=float, default=SCALES[1], help="of the traffic while trips are compared")
    parser.add_argument("--repeat", type=int, default=2)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    city = dvca_sumo.load_scenario(options.sumocfg, "auto")
    with tempfile.TemporaryDirectory() as name:
        trips, cone = _trips(city, Path(name), options.departure, options.scale)
        print(
            f"{'trip':>6}{'scale':>7}{'raw':>8}{'factual':>9}{'x raw':>7}{'attribution':>13}{'ratio':>7}{'flat':>6}"
            f"{'probes':>8}{'sim':>6}{'parked':>8}{'MB':>10}  violation",
            flush=True,
        )
        middle = None
        cases = [(trips[1], options.scale), (trips[0], options.scale), *((trip, options.scale) for trip in trips[2:])]
        for trip, scale in [*cases, *((trips[1], scale) for scale in SCALES if scale != options.scale)]:
            scenario = _scenario(city, Path(name), options.departure - WARM_UP, trip, cone, scale)
            row = min(
                (_measured(scenario, options.jobs) for _ in range(options.repeat)), key=lambda one: one.attribution
            )
            middle = middle or row
            _print(row, trip, scale, row.attribution / middle.attribution)


def _trips(city: Scenario, folder: Path, departure: float, scale: float) -> tuple[list[Trip], tuple[float, float]]:
    """Trips that all lead to one place at about one time, one for each of `TRIPS`; and that place."""
    longest = max(TRIPS)
    for seed in range(_WAYS):
        whole = Trip(_way(city.configuration.net, 2.0 * longest, seed), departure)
        scenario = _scenario(city, folder, departure - WARM_UP, whole, None, scale, departure + longest + 30.0)
        drive = dvca_sumo.drive(scenario, engine="replay")
        record = drive.record
        met = _meeting(record)
        if met is not None:
            break
    else:
        raise SystemExit(f"no way among {_WAYS} on which the ego drives for {longest:g} s without a violation")
    time_met, cone = record.path[met].time, (record.path[met].x, record.path[met].y)
    print(f"way {seed}: the cone is met at {time_met:.1f} s, {record.stations[met] / 1000.0:.1f} km on")
    return [_begun(record, whole.edges, time_met - length) for length in TRIPS], cone


def _way(net: Path, duration: float, seed: int) -> tuple[str, ...]:
    """Edges of `duration` [s] at the speed limits: shortest ways between edges drawn at random."""
    graph = sumolib.net.readNet(str(net))
    draw = random.Random(seed)  # noqa: S311
    reach = {edge.getID(): _reached(edge) for edge in graph.getEdges() if edge.allows("passenger")}
    core = max(({name for name in names if start in reach[name]} for start, names in reach.items()), key=len)
    targets = [graph.getEdge(name) for name in sorted(core) if graph.getEdge(name).getLength() > 60.0]
    way, lasting = [draw.choice(targets)], 0.0
    while lasting < duration:
        path, _ = graph.getShortestPath(way[-1], draw.choice(targets), vClass="passenger")
        if path is not None and len(path) > 2:
            way += path[1:]
            lasting += sum(edge.getLength() / edge.getSpeed() for edge in path[1:])
    return tuple(edge.getID() for edge in way)


def _reached(edge: sumolib.net.edge.Edge) -> set[str]:
    found, waiting = {edge.getID()}, [edge]
    while waiting:
        for following in waiting.pop().getAllowedOutgoing("passenger"):
            if following.getID() not in found:
                found.add(following.getID())
                waiting.append(following)
    return found


def _meeting(record: Record) -> int | None:
    """The last tick of the longest trip at which a cone may stand under the ego's rear axle; None: at none."""
    path = record.path[: round(max(TRIPS) / TICK) : TICKS_PER_STEP]
    violated = min((one.time for one in record.violations), default=math.inf)
    for step in range(len(path) - 1, round(_LEAST * len(path)), -1):
        met = path[step]
        before = [one for one in path[:step] if one.time < met.time - _APPROACH]
        if (
            met.time < violated
            and min(one.speed for one in path[step - 20 : step]) > _FAST
            and min(math.hypot(one.x - met.x, one.y - met.y) for one in before) > _ELSEWHERE
        ):
            return step * TICKS_PER_STEP
    return None


def _begun(record: Record, edges: Sequence[str], time: float) -> Trip:
    """The rest of the drive from `time` [s] on."""
    if time <= record.start:
        return Trip(tuple(edges), record.start - 0.1)
    row, entered = 0, record.route.start
    tick = round((time - record.start) / TICK)
    front = record.stations[tick] + record.moments[0].shape.front
    for station, lane in zip(record.route.line.stations, record.route.lane_ids, strict=True):
        if station > front:
            break
        edge = lane.rpartition("_")[0]
        if row + 1 < len(edges) and edge == edges[row + 1] != edges[row]:
            row, entered = row + 1, float(station)
    return Trip(tuple(edges[row:]), round(record.path[tick].time, 1), front - entered, record.path[tick].speed)


def _scenario(
    city: Scenario,
    folder: Path,
    begin: float,
    trip: Trip,
    cone: tuple[float, float] | None,
    scale: float,
    end: float | None = None,
) -> Scenario:
    files, ego, extra, config = city.configuration, *(folder / name for name in ("e.rou.xml", "c.add.xml", "r.sumocfg"))
    ego.write_text(
        f'<routes><vType id="{EGO}" scale="{1.0 / scale}"/>'  # there is one ego, however much traffic
        f'<vehicle id="{EGO}" type="{EGO}" depart="{trip.departure}" departLane="best"'
        f' departPos="{trip.position}" departSpeed="{trip.speed}">'
        f'<param key="dvca.lane_tolerance" value="{_LANE_TOLERANCE}"/>'
        f'<route edges="{" ".join(trip.edges)}"/></vehicle></routes>'
    )
    poi = '<poi id="cone" type="obstacle.cone" x="{}" y="{}" width="0.4" height="0.4"/>'.format(*cone) if cone else ""
    extra.write_text(f"<additional>{poi}</additional>")
    values = {
        **{name: text for name, text in files.options.items() if not name.endswith(("-output", "-files", "log"))},
        "net-file": files.net,
        "route-files": ",".join(map(str, [*files.routes, ego])),
        "additional-files": ",".join(map(str, [*files.additionals, extra])),
        "scale": scale,
    }
    lines = "".join(f'<{name} value="{value}"/>' for name, value in values.items())
    config.write_text(f"<configuration>{lines}</configuration>")
    return dvca_sumo.load_scenario(config, EGO, begin=begin, end=end)


def _measured(scenario: Scenario, jobs: int) -> Row:
    begin = time.perf_counter()
    drive = dvca_sumo.drive(scenario, [FAULT], engine="fork", jobs=jobs)
    factual = time.perf_counter() - begin
    assert isinstance(drive.engine, ForkEngine)
    held = _held(drive.engine)
    begin = time.perf_counter()
    found = explain(drive.engine, drive.request, drive.record, Progress())
    attribution = time.perf_counter() - begin
    parked, held_at_end = len(drive.engine.checkpoint_processes), _held(drive.engine)
    drive.engine.close()
    ((_, walls),) = isolated([partial(_raw, scenario, (found.record.start, found.record.moments[-1].time))], 1, 600.0)
    if isinstance(walls, Failure):
        raise SystemExit(f"raw libsumo failed: {walls.reason}\n{walls.said}")
    warm_up, whole = walls
    return Row(whole - warm_up, factual - warm_up, attribution, parked, (held, held_at_end), found)


def _held(engine: ForkEngine) -> int:
    return sum(map(private_memory, engine.checkpoint_processes))


def _raw(scenario: Scenario, times: Sequence[float]) -> list[float]:
    """Wall times [s] at which libsumo alone gets to simulation `times` [s]."""
    walls = []
    with tempfile.TemporaryDirectory() as folder:
        files = input_words(scenario.configuration, Path(folder))
        begin = time.perf_counter()
        libsumo.start(["sumo", *scenario.arguments, *files])
        for moment in times:
            while libsumo.simulation.getTime() < moment:
                libsumo.simulationStep()
            walls.append(time.perf_counter() - begin)
        libsumo.close()
    return walls


def _print(row: Row, trip: Trip, scale: float, growth: float) -> None:
    found, violation = row.found, row.found.violation
    ratio, simulated = row.attribution / row.factual, sum(probe.simulated for probe in found.probes)
    lasted = (violation.time if violation is not None else found.record.moments[-1].time) - trip.departure
    held = "/".join(f"{size / 1e6:.0f}" for size in row.held)
    said = f"{violation.kind} {violation.object} {violation.time:.1f}" if violation is not None else "none"
    print(
        f"{lasted:6.0f}{scale:7.1f}{row.raw:8.2f}{row.factual:9.2f}{row.factual / row.raw:7.2f}{row.attribution:13.2f}"
        f"{ratio:7.2f}{growth:6.2f}{len(found.probes):8d}{simulated:6.0f}{row.parked:8d}{held:>10}"
        f"  {said} -> {found.verdict} {found.components and found.components.component}",
        flush=True,
    )


if __name__ == "__main__":
    main()
