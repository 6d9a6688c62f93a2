"""How many of the trips that `screen` draws SUMO's own driver finishes in time when chance falls otherwise.

    python benchmarks/chance.py SUMOCFG --begin T --end T [--seed 1] [--egos 100] [--others 11,12,13]

The trips are those of `dvca-sumo screen` with `--seed`: drawn of those that SUMO's driver finishes in time under that
seed. Under each of the others the same trips depart in the same scenario, without any ADS; in time is as for an ego.
What is missing then is missing without anybody else in the traffic.
"""

import argparse
from functools import partial
from pathlib import Path

import msgspec

import dvca_sumo
from dvca_sumo.engine.processes import Failure, isolated
from dvca_sumo.intervals import share_of
from dvca_sumo.run import patience
from dvca_sumo.scenario import AUTO
from dvca_sumo.screen.anchor import anchored
from dvca_sumo.screen.results import TripOutcome
from dvca_sumo.screen.trips import drawn

TIMEOUT = 3600.0  # [s] of wall time


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("sumocfg", type=Path)
    parser.add_argument("--begin", type=float, required=True)
    parser.add_argument("--end", type=float, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--egos", type=int, default=100)
    parser.add_argument("--others", default="11,12,13")
    options = parser.parse_args()
    scenario = dvca_sumo.load_scenario(options.sumocfg, AUTO, options.seed, options.begin)
    window = msgspec.structs.replace(scenario, end=options.end)
    ((_, draw),) = isolated([partial(drawn, window, options.egos)], 1, TIMEOUT)
    if isinstance(draw, Failure):
        raise SystemExit(f"{draw.reason}\n{draw.said}")
    allowed = {trip.ego: patience(trip.free_flow) for trip in draw.trips}
    seeds = [options.seed, *map(int, options.others.split(","))]
    others = [dvca_sumo.load_scenario(options.sumocfg, AUTO, seed, options.begin) for seed in seeds]
    jobs = [partial(anchored, other, draw.trips, lambda _, __: None) for other in others]
    print(f"{'seed':>6}{'in time':>10}{'share':>9}  95 % interval")
    for row, found in sorted(isolated(jobs, 2, TIMEOUT), key=lambda one: one[0]):
        if isinstance(found, Failure):
            raise SystemExit(f"{found.reason}\n{found.said}")
        driven = [one for one in found.results if one.outcome is not TripOutcome.NOT_DRIVEN]
        count = sum(one.outcome is TripOutcome.ARRIVED and one.duration <= allowed[one.ego] for one in driven)
        share = share_of(count, len(driven))
        print(f"{seeds[row]:6}{f'{count}/{len(driven)}':>10}{share.value:9.1%}  [{share.low:.1%}, {share.high:.1%}]")


if __name__ == "__main__":
    main()
