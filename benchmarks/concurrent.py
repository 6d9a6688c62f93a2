"""What N egos in one simulation cost: one simulation plus N stacks, nothing quadratic.

    python benchmarks/concurrent.py SUMOCFG [--begin T] [--window S] [--egos 1,10,50] [--seconds 30]

For each number, that many trips are driven at once in one simulation in this thread; the clock runs from the moment
when the last of them has departed. Prints the processor time of one simulated second, the share of it that SUMO alone
takes, and what one more ego adds to a cycle; exits 1 if the largest number is slower than half of real time.
"""

import argparse
import sys
import time
from functools import partial
from pathlib import Path

import msgspec

import dvca_sumo
from dvca_sumo.engine.processes import Failure, isolated
from dvca_sumo.engine.replay import roadmap
from dvca_sumo.run import Departing, Simulation, Task, opened
from dvca_sumo.scenario import Scenario, ScenarioError
from dvca_sumo.stack.reference import StackError, reference_stack

SLOWEST = 0.5  # of real time


class Cost(msgspec.Struct, frozen=True):
    """Of one simulation with its egos."""

    egos: float  # under way, on average
    seconds: float  # [s] simulated while the clock ran
    processor: float  # [s]
    sumo: float  # [s] of that, in SUMO's steps


def measured(scenario: Scenario, egos: int, window: float, seconds: float) -> Cost:
    """Adopt the first `egos` cars after the window begins, then drive them on."""
    departing = Departing(scenario, partial(roadmap, scenario.configuration.net), reference_stack)
    with opened(scenario) as world:
        simulation = Simulation(world, scenario.begin)
        left = egos
        while left or world.time < scenario.begin + window:
            simulation.cycle()
            simulation.advance()
            for name in world.departed():
                if not left or world.time < scenario.begin + window:
                    continue
                entry = departing.entry(name, world)
                if entry.why_no_car:
                    continue
                try:
                    drive = departing.drive(
                        entry, Task(msgspec.structs.replace(scenario, ego=name)), world, is_whole=False
                    )
                except (ScenarioError, StackError):
                    continue
                simulation.drives.append(drive)
                left -= 1
        begin, under_way, sumo, steps = time.process_time(), 0, 0.0, 0
        while steps < 10 * seconds and simulation.drives:
            under_way += len(simulation.drives)
            simulation.cycle()
            before = time.process_time()
            simulation.advance()
            sumo += time.process_time() - before
            steps += 1
        return Cost(under_way / steps, steps / 10, time.process_time() - begin, sumo)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("sumocfg", type=Path)
    parser.add_argument("--begin", type=float)
    parser.add_argument("--window", type=float, default=300.0)
    parser.add_argument("--egos", default="1,10,50")
    parser.add_argument("--seconds", type=float, default=30.0)
    options = parser.parse_args()
    scenario = dvca_sumo.load_scenario(options.sumocfg, "auto", begin=options.begin)
    roadmap(scenario.configuration.net, "passenger")
    print(f"{'egos':>5}{'under way':>11}{'[s] a second':>14}{'x real time':>13}{'SUMO':>8}{'[ms] an ego-cycle':>19}")
    speed = 0.0
    for egos in map(int, options.egos.split(",")):
        ((_, cost),) = isolated([partial(measured, scenario, egos, options.window, options.seconds)], 1, 3600.0)
        if isinstance(cost, Failure):
            raise SystemExit(f"{cost.reason}\n{cost.said}")
        a_second, speed = cost.processor / cost.seconds, cost.seconds / cost.processor
        ego_cycle = 100.0 * (cost.processor - cost.sumo) / cost.seconds / cost.egos
        share = cost.sumo / cost.processor
        print(f"{egos:5}{cost.egos:11.1f}{a_second:14.3f}{speed:13.2f}{share:8.0%}{ego_cycle:19.2f}", flush=True)
    sys.exit(speed < SLOWEST)


if __name__ == "__main__":
    main()
