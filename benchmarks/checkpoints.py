"""What leaving checkpoints costs the factual run, and what memory they hold.

    python benchmarks/checkpoints.py                                                 nets/cs3
    python benchmarks/checkpoints.py CITY.sumocfg --ego ID --begin T [--end T]       another trip

The same drive, by the fork engine and in one process that leaves none, alternating; of each the best of
`--repeat`. The processor time is that of the process that drives, its wall time that of the whole call.
`held` is memory of the checkpoints' own when the run is done, `shared` their share of all they have in
common with others too.
"""

import argparse
import contextlib
import os
import resource
import sys
import time
from pathlib import Path

import msgspec

import dvca_sumo
from dvca_sumo.engine.fork import ForkEngine
from dvca_sumo.engine.processes import Failure, isolated
from dvca_sumo.engine.replay import roadmap
from dvca_sumo.engine.thinning import private_memory
from dvca_sumo.interventions import planted_fault
from dvca_sumo.record import Record
from dvca_sumo.run import Task, rtest
from dvca_sumo.scenario import Scenario
from dvca_sumo.stack.reference import reference_stack
from dvca_sumo.stack.sources import StackSource

BUILT_IN = ["nets/cs3.sumocfg"]
MOST_SLOWER = 0.1
_TICKS = os.sysconf("SC_CLK_TCK")


class Drive(msgspec.Struct, frozen=True):
    """One drive and what it cost."""

    wall: float  # [s]
    processor: float  # [s]
    digest: str
    steps: int
    checkpoints: int = 0
    held: int = 0  # [bytes]
    shared: int = 0  # [bytes]


def main() -> None:
    """Print the table; exits 1 if any trip is slowed more than `MOST_SLOWER`, by processor time."""
    parser = argparse.ArgumentParser()
    parser.add_argument("sumocfg", nargs="*", default=BUILT_IN)
    parser.add_argument("--ego")
    parser.add_argument("--begin", type=float)
    parser.add_argument("--end", type=float)
    parser.add_argument("--fault", action="append", default=[])
    parser.add_argument("--repeat", type=int, default=5)
    options = parser.parse_args()
    print(
        f"{'scenario':<16}{'steps':>7} |{'without':>9}{'with':>8}{'slower':>8} |{'cpu':>8}{'with':>8}{'slower':>8}"
        f" |{'parked':>7}{'held MB':>9}{'shared MB':>11}  same"
    )
    is_cheap = True
    for path in options.sumocfg:
        scenario = dvca_sumo.load_scenario(path, options.ego, begin=options.begin, end=options.end)
        task = Task(scenario, tuple(map(planted_fault, options.fault)))
        pairs = [(_without(scenario, task), _with(scenario, task)) for _ in range(options.repeat)]
        is_cheap &= _print(scenario, [pair[0] for pair in pairs], [pair[1] for pair in pairs]) <= MOST_SLOWER
    sys.exit(0 if is_cheap else 1)


def _without(scenario: Scenario, task: Task) -> Drive:
    net = scenario.configuration.net

    def job() -> Record:
        return rtest(task, lambda kind: roadmap(net, kind), reference_stack)

    roadmap(net, "passenger")
    begin, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    ((_, answer),) = isolated([job], 1, 3600.0)
    wall, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    if isinstance(answer, Failure):
        raise SystemExit(f"the run failed: {answer.reason}\n{answer.said}")
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Drive(wall, processor, answer.digest, len(answer.digests))


def _with(scenario: Scenario, task: Task) -> Drive:
    with contextlib.closing(ForkEngine(scenario.configuration.net, StackSource(), 1, 3600.0)) as engine:
        begin = time.perf_counter()
        record = engine.record(task)
        wall = time.perf_counter() - begin
        if engine.fallback is not None:
            raise SystemExit(engine.fallback)
        parked = engine.checkpoint_processes
        # Whoever forked a checkpoint on the way is the process that drives.
        words = _words(f"/proc/{_words(f'/proc/{parked[0]}/stat')[1]}/stat")
        processor = (int(words[11]) + int(words[12])) / _TICKS
        held, shared = sum(map(private_memory, parked)), sum(map(_share, parked))
        return Drive(wall, processor, record.digest, len(record.digests), len(parked), held, shared)


def _words(stat: str) -> list[str]:
    """What a process's `stat` says behind its name."""
    return Path(stat).read_text().rpartition(")")[2].split()


def _share(process: int) -> int:
    lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()
    return sum(1024 * int(line.split()[1]) for line in lines if line.startswith("Pss:"))


def _print(scenario: Scenario, without: list[Drive], leaving: list[Drive]) -> float:
    walls = [min(one.wall for one in drives) for drives in (without, leaving)]
    processors = [min(one.processor for one in drives) for drives in (without, leaving)]
    last = leaving[-1]
    slower = processors[1] / processors[0] - 1.0
    print(
        f"{scenario.configuration.path.stem:<16}{last.steps:7d} |{walls[0]:9.2f}{walls[1]:8.2f}"
        f"{walls[1] / walls[0] - 1.0:8.1%} |{processors[0]:8.2f}{processors[1]:8.2f}{slower:8.1%} |"
        f"{last.checkpoints:7d}{max(one.held for one in leaving) / 1e6:9.0f}{last.shared / 1e6:11.0f}"
        f"  {'yes' if len({one.digest for one in [*without, *leaving]}) == 1 else 'NO'}",
        flush=True,
    )
    return slower


if __name__ == "__main__":
    main()
