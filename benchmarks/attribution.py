"""Raw libsumo : factual run : whole attribution, for the fork and the replay engine side by side.

    python benchmarks/attribution.py                              the built-in cases
    python benchmarks/attribution.py CITY.sumocfg --ego ID --begin T --fault NAME[:key=value,...]

Raw libsumo is the same network over the same time, at the same step length, without ego stack, oracles
or record. All columns of a row are measured in one go, one after the other. `sim` is the simulated time
of all probes together, `memory` what the parked checkpoints hold for themselves.
"""

import argparse
import statistics
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import libsumo
import msgspec

import dvca_sumo
from dvca_sumo.analysis.attribution import Attribution
from dvca_sumo.engine.fork import ForkEngine
from dvca_sumo.engine.processes import Failure, isolated
from dvca_sumo.engine.thinning import private_memory
from dvca_sumo.scenario import Scenario, input_words

CASES = [
    ("nets/cs1.sumocfg", "perception.miss"),
    ("nets/cs2.sumocfg", "perception.longitudinal"),
    ("nets/cs3.sumocfg", "perception.lateral"),
    ("nets/cs4.sumocfg", "perception.box"),
    ("nets/cs1.sumocfg", "prediction.wrong"),
    ("nets/cs2.sumocfg", "prediction.wrong"),
    ("nets/cs1.sumocfg", "planning.speed:start=8"),
    ("nets/cs4.sumocfg", "planning.path:start=8"),
    ("nets/cs2.sumocfg", "control.longitudinal:start=12"),
    ("nets/cs5.sumocfg", "control.lateral:start=20"),
    ("nets/cs5.sumocfg", "localization.lateral:start=20"),
]


class Row(msgspec.Struct, frozen=True):
    """One case under one engine."""

    factual: float  # [s] wall
    attribution: float  # [s] wall
    probes: int
    simulated: float  # [s]
    memory: int  # [bytes]
    found: Attribution


def raw_wall(scenario: Scenario, end: float) -> float:
    """Wall time [s] of libsumo alone from the scenario's begin to `end` [s]."""
    ((_, answer),) = isolated([partial(_raw, scenario, end)], 1, 600.0)
    if isinstance(answer, Failure):
        raise SystemExit(f"raw libsumo failed: {answer.reason}\n{answer.said}")
    return answer


def _raw(scenario: Scenario, end: float) -> float:
    with tempfile.TemporaryDirectory() as folder:
        files = input_words(scenario.configuration, Path(folder))
        begin = time.perf_counter()
        libsumo.start(["sumo", *scenario.arguments, *files])
        while libsumo.simulation.getTime() < end:
            libsumo.simulationStep()
        wall = time.perf_counter() - begin
        libsumo.close()
    return wall


def analysed(scenario: Scenario, fault: str, engine: str, jobs: int) -> Row:
    """Factual run and attribution of one case."""
    begin = time.perf_counter()
    drive = dvca_sumo.drive(scenario, [fault] if fault else [], engine=engine, jobs=jobs)
    factual = time.perf_counter() - begin
    memory = 0
    if isinstance(drive.engine, ForkEngine):
        memory = sum(map(private_memory, drive.engine.checkpoint_processes))
    begin = time.perf_counter()
    found = dvca_sumo.attribute(drive)
    attribution = time.perf_counter() - begin
    simulated = sum(probe.simulated for probe in found.probes)
    return Row(factual, attribution, len(found.probes), simulated, memory, found)


def main() -> None:
    """Print the table and what the ratios come to."""
    parser = argparse.ArgumentParser()
    parser.add_argument("sumocfg", nargs="*")
    parser.add_argument("--fault", default="")
    parser.add_argument("--ego")
    parser.add_argument("--begin", type=float)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    cases = [(path, options.fault) for path in options.sumocfg] or CASES
    print(
        f"{'case':<42}{'raw':>7}{'factual':>9}{'x raw':>7} |{'fork':>7}{'ratio':>7}{'probes':>8}{'sim':>7}{'MB':>6}"
        f" |{'replay':>8}{'ratio':>7}{'probes':>8}{'sim':>7} | same"
    )
    ratios = [_case(path, fault, options) for path, fault in cases]
    median, worst = statistics.median(ratios), max(ratios)
    print(f"attribution / its own factual run, fork engine: median {median:.2f}, worst {worst:.2f}")


def _case(path: str, fault: str, options: argparse.Namespace) -> float:
    scenario = dvca_sumo.load_scenario(path, options.ego, begin=options.begin)
    fork = analysed(scenario, fault, "fork", options.jobs)
    replay = analysed(scenario, fault, "replay", options.jobs)
    record = fork.found.record
    raw = raw_wall(scenario, record.moments[-1].time)
    same = _conclusion(fork.found) == _conclusion(replay.found)
    ratio = fork.attribution / fork.factual
    print(
        f"{Path(path).stem + ' ' + fault:<42}{raw:7.2f}{replay.factual:9.2f}{replay.factual / raw:7.2f} |"
        f"{fork.attribution:7.2f}{ratio:7.2f}{fork.probes:8d}{fork.simulated:7.0f}{fork.memory / 1e6:6.0f} |"
        f"{replay.attribution:8.2f}{replay.attribution / replay.factual:7.2f}{replay.probes:8d}{replay.simulated:7.0f}"
        f" | {'yes' if same else 'NO'}",
        flush=True,
    )
    return ratio


def _conclusion(found: Attribution) -> Sequence[object]:
    outcomes = [(probe.question, probe.outcome, probe.digest) for probe in found.probes]
    return (found.verdict, found.message, found.digest, outcomes)


if __name__ == "__main__":
    main()
