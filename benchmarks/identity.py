"""Is every branch of the fork engine, bit for bit, the run that the replay engine makes?

    python benchmarks/identity.py                                  the built-in scenarios, every fault
    python benchmarks/identity.py CITY.sumocfg --ego ID --begin T  another scenario, every fault
    python benchmarks/identity.py ... --fault NAME[:key=value,...] this fault alone

For each scenario and fault, the drive is repeated without an intervention, with all four substitutable
components ideal, and with each alone, from several times before the violation on (without a violation:
before the end). Compared are violations, judgements, ending and the digest over all messages, motion
and traffic. Prints a line a fault; exits 1 if anything differs.
"""

import argparse
import os
import sys
import time
from collections.abc import Sequence

import dvca_sumo
from dvca_sumo.analysis.components import SUBSTITUTABLE
from dvca_sumo.engine.fork import ForkEngine
from dvca_sumo.engine.processes import Failure
from dvca_sumo.engine.protocol import Engine, Glimpse
from dvca_sumo.interventions import Ideal, Selection, fault_library, planted_fault, recorded_futures
from dvca_sumo.record import Record
from dvca_sumo.run import StopRule, Task
from dvca_sumo.scenario import Scenario
from dvca_sumo.stack.sources import StackSource

BUILT_IN = [f"nets/cs{number}.sumocfg" for number in range(1, 6)]
BEFORE = (0.5, 2.0, 8.0)  # [s]
AFTER = 3.0  # [s] past the violation a branch goes on


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("sumocfg", nargs="*", default=BUILT_IN)
    parser.add_argument("--ego")
    parser.add_argument("--begin", type=float)
    parser.add_argument("--fault", action="append")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    print(f"{'scenario':<14}{'fault':<34}{'violation':<16}{'compared':>9}{'passes':>8}{'fork':>8}{'replay':>8}  same")
    is_same = True
    for path in options.sumocfg:
        scenario = dvca_sumo.load_scenario(path, options.ego, begin=options.begin)
        for fault in options.fault or fault_library():
            is_same &= _compared(scenario, fault, options.jobs)
    sys.exit(0 if is_same else 1)


def _compared(scenario: Scenario, fault: str, jobs: int) -> bool:
    engine = ForkEngine(scenario.configuration.net, StackSource(), jobs)
    try:
        task = Task(scenario, (planted_fault(fault),), StopRule(after_contact=AFTER))
        record = engine.record(task)
        if engine.fallback is not None:
            raise SystemExit(engine.fallback)
        asked = _questions(task, record)
        forked, fork = _answers(engine, asked)
        replayed, replay = _answers(engine.witness, asked)
    finally:
        engine.close()
    pairs = zip(forked, replayed, strict=True)
    different = [row for row, (one, other) in enumerate(pairs) if _outcome(one) != _outcome(other)]
    passes = max(one.passes for one in forked if isinstance(one, Glimpse))
    violation = f"{record.violations[0].kind} {record.violations[0].time:.1f}" if record.violations else "none"
    verdict = f"NO: {[asked[row].interventions[1:] for row in different]}" if different else "yes"
    print(
        f"{scenario.configuration.path.stem:<14}{fault:<34}{violation:<16}{len(asked):9d}{passes:8d}"
        f"{fork:8.1f}{replay:8.1f}  {verdict}",
        flush=True,
    )
    return not different


def _questions(factual: Task, record: Record) -> list[Task]:
    """The whole drive as it was, then substitutions from late to early ones."""
    end = record.violations[0].time if record.violations else record.moments[-1].time
    stop = StopRule(after_violation=0.0, at=end + AFTER)
    futures = recorded_futures(record.moments)
    ideals = [SUBSTITUTABLE, *((component,) for component in SUBSTITUTABLE)]
    starts = [max(end - before - record.start, 0.0) for before in BEFORE]
    return [Task(factual.scenario, factual.interventions, stop, futures)] + [
        Task(
            factual.scenario,
            (*factual.interventions, *(Ideal(component, Selection(start=start)) for component in components)),
            stop,
            futures,
        )
        for start in dict.fromkeys(starts)
        for components in ideals
    ]


def _answers(engine: Engine, asked: Sequence[Task]) -> tuple[list[Glimpse | Failure], float]:
    begin = time.perf_counter()
    answers = engine.glimpses(asked, lambda _row, _answer: None)
    return answers, time.perf_counter() - begin


def _outcome(answer: Glimpse | Failure) -> tuple[object, ...]:
    if isinstance(answer, Failure):
        return (answer.reason,)
    return (answer.violations, answer.judgements, answer.ending, answer.digest, answer.passes, answer.residual)


if __name__ == "__main__":
    main()
