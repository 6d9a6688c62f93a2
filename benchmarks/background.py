"""What becomes of a scenario's own traffic, without any ego, as it is configured and as it is run here.

    python benchmarks/background.py SUMOCFG [--begin T] [--end T] [--seeds 1,2]

Three ways: as configured but for what a run needs; in world steps, as every run does; and in world steps with drivers
who keep acting once in a configured step. For each seed: how many vehicles are under way on average, how many stood
for two minutes or longer, and how many SUMO teleported. Exits 1 if the traffic as it is run stands more often.
"""

import argparse
import sys
import tempfile
from functools import partial
from pathlib import Path

import msgspec

import dvca_sumo
from dvca_sumo.engine.processes import Failure, isolated
from dvca_sumo.scenario import Scenario, input_words

LONG = 120.0  # [s]
WAYS = ("as configured", "in world steps", "acting as configured")


class Flow(msgspec.Struct, frozen=True):
    """Of one simulation."""

    under_way: float  # vehicles, on average
    stood: int
    teleports: int


def flow(scenario: Scenario, way: str, end: float) -> Flow:
    """Simulate the scenario's traffic until `end` [s]."""
    import libsumo  # noqa: PLC0415 one simulation a process

    overrides = {one.option: one.used for one in scenario.overrides}
    step = scenario.configuration.options.get("step-length", "1")
    if way == "as configured":
        overrides["step-length"] = step
    if way == "acting as configured":
        overrides["default.action-step-length"] = step
    with tempfile.TemporaryDirectory() as folder:
        files = input_words(scenario.configuration, Path(folder))
        options = [word for name, value in overrides.items() for word in (f"--{name}", value)]
        libsumo.start(["sumo", "-c", str(scenario.configuration.path), *files, *options, "--no-warnings", "true"])
        counts, stood, teleports, looked = [], set(), 0, scenario.begin
        while libsumo.simulation.getTime() < end:
            libsumo.simulationStep()
            teleports += libsumo.simulation.getStartingTeleportNumber()
            if libsumo.simulation.getTime() - looked >= 5.0:
                looked = libsumo.simulation.getTime()
                present = libsumo.vehicle.getIDList()
                counts.append(len(present))
                waited = ((name, libsumo.vehicle.getWaitingTime(name)) for name in present)
                stood |= {name for name, time in waited if time >= LONG and not libsumo.vehicle.isStopped(name)}
        libsumo.close()
    return Flow(sum(counts) / len(counts), len(stood), teleports)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("sumocfg", type=Path)
    parser.add_argument("--begin", type=float, default=0.0)
    parser.add_argument("--end", type=float, default=3600.0)
    parser.add_argument("--seeds", default="1,2")
    options = parser.parse_args()
    print(f"{'':22}{'seed':>5}{'under way':>11}{'stood 2 min':>13}{'teleported':>12}")
    stood = dict.fromkeys(WAYS, 0)
    for seed in map(int, options.seeds.split(",")):
        scenario = dvca_sumo.load_scenario(options.sumocfg, "auto", seed, options.begin)
        jobs = [partial(flow, scenario, way, options.end) for way in WAYS]
        for row, found in sorted(isolated(jobs, 2, 3600.0), key=lambda one: one[0]):
            if isinstance(found, Failure):
                raise SystemExit(f"{found.reason}\n{found.said}")
            stood[WAYS[row]] += found.stood
            print(f"{WAYS[row]:22}{seed:5}{found.under_way:11.0f}{found.stood:13}{found.teleports:12}", flush=True)
    sys.exit(stood["in world steps"] > stood["as configured"])


if __name__ == "__main__":
    main()
