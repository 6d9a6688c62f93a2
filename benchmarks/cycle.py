"""What one cycle of the stack costs, component by component, and how much faster than real time a run is.

    python benchmarks/cycle.py [SUMOCFG ...] [--ego ID|auto] [--begin T]

A cycle is one 10 Hz pass of all five components with its ten 100 Hz control steps. Times are medians
over the cycles of one run without faults. Real time is measured on a second run, without the clock.
"""

import argparse
import statistics
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import dvca_sumo
from dvca_sumo.messages import Component
from dvca_sumo.record import Record
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.run import Task, rtest
from dvca_sumo.scenario import Scenario
from dvca_sumo.stack.reference import Stack, StackContext, StackFactory, reference_stack

BUILT_IN = [f"nets/cs{number}.sumocfg" for number in range(1, 6)]
PARTS = ("sensors", *(component.value for component in Component))


class Clock:
    """Sums up what each part costs in each world step."""

    def __init__(self) -> None:
        self.cycles: dict[str, list[float]] = defaultdict(list)
        self._sums: dict[str, float] = defaultdict(float)

    def timed(self, part: str, call: Callable[..., Any]) -> Callable[..., Any]:
        """`call`, its duration added to the present cycle's."""

        def measured(*arguments: object) -> object:
            begin = time.perf_counter()
            result = call(*arguments)
            self._sums[part] += time.perf_counter() - begin
            return result

        return measured

    def next_cycle(self) -> None:
        """Close the present cycle."""
        for part in PARTS:
            self.cycles[part].append(self._sums[part])
        self._sums.clear()


class Timed:
    """A component or the sensors, every method measured."""

    def __init__(self, part: str, inner: object, clock: Clock) -> None:
        for name in ("step", "odometry", "detections"):
            if hasattr(inner, name):
                setattr(self, name, clock.timed(part, getattr(inner, name)))
        if hasattr(inner, "fix"):
            fix = clock.timed(part, inner.fix)

            def first_of_cycle(*arguments: object) -> object:
                clock.next_cycle()
                return fix(*arguments)

            self.fix = first_of_cycle


def timed_stack(clock: Clock) -> StackFactory:
    """The reference stack under a clock."""

    def build(context: StackContext) -> Stack:
        stack = reference_stack(context)
        parts: dict[str, Any] = {part: Timed(part, getattr(stack, part), clock) for part in PARTS}
        return replace(stack, **parts)

    return build


def driven(scenario: Scenario, factory: StackFactory) -> tuple[Record, float]:
    """One run, and its wall time per simulated second of driving."""

    @cache
    def roadmap_of(vehicle_class: str) -> RoadMap:
        return RoadMap.load(scenario.configuration.net, vehicle_class)

    roadmap_of("passenger")
    begin = time.perf_counter()
    record = rtest(Task(scenario), roadmap_of, factory)
    return record, time.perf_counter() - begin


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("sumocfg", nargs="*", default=BUILT_IN)
    parser.add_argument("--ego")
    parser.add_argument("--begin", type=float)
    options = parser.parse_args()
    print(f"{'[ms]':<12}" + "".join(f"{part:>14}" for part in PARTS) + f"{'cycle':>9}{'x real time':>13}")
    for path in options.sumocfg:
        scenario = dvca_sumo.load_scenario(path, options.ego, begin=options.begin)
        clock = Clock()
        driven(scenario, timed_stack(clock))
        record, wall = driven(scenario, reference_stack)
        cycles = {part: clock.cycles[part][1:] for part in PARTS}
        medians = [1e3 * statistics.median(cycles[part]) for part in PARTS]
        components = [sum(times) for times in zip(*(cycles[part] for part in PARTS[1:]), strict=True)]
        cells = "".join(f"{median:14.3f}" for median in medians)
        speed = record.simulated / wall
        print(f"{Path(path).stem:<12}{cells}{1e3 * statistics.median(components):9.3f}{speed:13.1f}")


if __name__ == "__main__":
    main()
