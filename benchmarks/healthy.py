"""The healthy stack on the built-in scenarios, over many seeds: it must arrive everywhere without a violation.

    python benchmarks/healthy.py [--seeds 20] [--jobs 2]

Prints for each scenario how many drives were clean, the closest it came to anything while moving, and
its hardest braking; exits 1 if any drive was not clean.
"""

import argparse
import sys
from functools import partial

import msgspec

import dvca_sumo
from dvca_sumo.engine.processes import Failure, isolated
from dvca_sumo.engine.replay import roadmap
from dvca_sumo.geometry.boxes import box_of, distances
from dvca_sumo.run import Task, rtest
from dvca_sumo.scenario import Scenario
from dvca_sumo.stack.reference import reference_stack
from dvca_sumo.truth import Moment

NAMES = [f"cs{number}" for number in range(1, 6)]
MOVING = 0.5  # [m/s]


class Drive(msgspec.Struct, frozen=True):
    """One drive in short."""

    complaint: str  # empty: clean
    closest: float  # [m]
    braking: float  # [m/s^2]


def driven(scenario: Scenario) -> Drive:
    """Drive a scenario without faults."""
    record = rtest(Task(scenario), partial(roadmap, scenario.configuration.net), reference_stack)
    complaints = [f"{one.kind} at {one.time:.1f} s" for one in record.violations]
    complaints += [f"{one.kind}: {one.reason}" for one in record.judgements if one.answer == "unknown"]
    if record.ending != "arrived":
        complaints.append(str(record.ending))
    closest = min(_gap(moment) for moment in record.moments if moment.ego.speed > MOVING)
    return Drive("; ".join(complaints), closest, min(ego.acceleration for ego in record.path))


def _gap(moment: Moment) -> float:
    if not moment.objects.ids:
        return float("inf")
    ego = moment.ego
    return float(distances(box_of(ego.x, ego.y, ego.heading, moment.shape), moment.objects.boxes).min())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    is_clean = True
    print(f"{'':<6}{'clean':>8}{'closest [m]':>13}{'hardest braking [m/s^2]':>25}")
    for name in NAMES:
        seeds = range(1, options.seeds + 1)
        scenarios = [dvca_sumo.load_scenario(f"nets/{name}.sumocfg", seed=seed) for seed in seeds]
        drives: list[Drive] = []
        for row, answer in isolated([partial(driven, one) for one in scenarios], options.jobs, 600.0):
            if isinstance(answer, Failure):
                answer = Drive(answer.reason, 0.0, 0.0)  # noqa: PLW2901 - a crash is a drive that is not clean
            if answer.complaint:
                print(f"{name} seed {seeds[row]}: {answer.complaint}")
            drives.append(answer)
        clean = sum(not drive.complaint for drive in drives)
        is_clean &= clean == len(drives)
        closest, braking = min(drive.closest for drive in drives), min(drive.braking for drive in drives)
        print(f"{name:<6}{clean:>4}/{len(drives):<3}{closest:13.2f}{braking:25.2f}", flush=True)
    sys.exit(not is_clean)


if __name__ == "__main__":
    main()
