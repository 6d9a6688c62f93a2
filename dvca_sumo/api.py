"""The same as the command line, from Python: load a scenario, run it, attribute it.

>>> scenario = dvca_sumo.load_scenario("nets/cs1.sumocfg")
>>> drive = dvca_sumo.drive(scenario, faults=["perception.miss"])
>>> answer = dvca_sumo.attribute(drive)
"""

import os
from collections.abc import Sequence
from pathlib import Path

import msgspec

from dvca_sumo.analysis.attribution import (
    Attribution,
    Progress,
    Request,
    explain,
    factual_run,
    unasked,
)
from dvca_sumo.engine.fork import IS_AVAILABLE, ForkEngine
from dvca_sumo.engine.protocol import Engine
from dvca_sumo.engine.replay import ReplayEngine
from dvca_sumo.installation import scenario_path
from dvca_sumo.interventions import assert_met, planted_fault
from dvca_sumo.record import Record
from dvca_sumo.scenario import Scenario
from dvca_sumo.scenario import load_scenario as _load_scenario
from dvca_sumo.stack.sources import StackSource

CPUS = os.cpu_count() or 1
REPEATS = 3  # of each question in jitter mode, unless others are asked for
ENGINES: dict[str, type[ForkEngine] | type[ReplayEngine]] = {"fork": ForkEngine, "replay": ReplayEngine}
DEFAULT_ENGINE = "fork" if IS_AVAILABLE else "replay"


class FactualDrive(msgspec.Struct, frozen=True):
    """A scenario as it was driven, ready to be attributed."""

    request: Request
    engine: Engine
    record: Record
    source: StackSource = StackSource()  # of the stack that drove


def load_scenario(
    path: Path | str,
    ego: str | None = None,
    seed: int | None = None,
    begin: float | None = None,
    end: float | None = None,
) -> Scenario:
    """As `dvca_sumo.scenario.load_scenario`; built-in scenarios (`nets/cs1.sumocfg`) are found from any folder."""
    return _load_scenario(scenario_path(Path(path)), ego, seed, begin, end)


def drive(
    scenario: Scenario,
    faults: Sequence[str] = (),
    stack: str | None = None,
    repeats: int | None = None,
    jobs: int = CPUS,
    engine: str | None = None,
    bug: str | None = None,
) -> FactualDrive:
    """Drive a scenario once; arguments are those of the command line.

    Args:
        scenario: What to run.
        faults: Words of `--fault`.
        stack: Word of `--stack`; None is the reference stack.
        repeats: None for exact mode; else jitter mode with so many runs of each question.
        jobs: Runs at once during attribution.
        engine: "fork" or "replay"; None is fork where the system can, which also is kept alive until
            `attribute` is done or the drive is forgotten.
        bug: Word of `--bug`: a real bug that the reference stack is to have.

    Raises:
        ScenarioError, FaultError, StackError, BugError, RoadMapError: Bad input, in one line.
        RunFailedError: The run's process crashed or hung.
        ValueError: No such number of repeats or jobs, or no such engine.
    """
    if repeats is not None and repeats < 1:
        raise ValueError(f"repeats is {repeats} (allowed: 1 or more, or None)")
    if jobs < 1:
        raise ValueError(f"jobs is {jobs} (allowed: 1 or more)")
    if engine is not None and engine not in ENGINES:
        raise ValueError(f"engine is {engine!r} (allowed: {', '.join(map(repr, ENGINES))}, or None)")
    request = Request(scenario, tuple(planted_fault(text) for text in faults), repeats)
    source = StackSource(stack, bug)
    chosen = ENGINES[engine or DEFAULT_ENGINE](scenario.configuration.net, source, jobs)
    try:
        record = factual_run(chosen, request)
        met = {name for moment in record.moments for name in moment.objects.ids}
        for fault in request.faults:
            assert_met(fault, met)
    except BaseException:
        chosen.close()
        raise
    return FactualDrive(request, chosen, record, source)


def attribute(drive: FactualDrive, progress: Progress | None = None, *, certify: bool = False) -> Attribution:
    """Explain the violation of a drive, if there is one.

    With `certify` the conclusion is asked once more of the replay engine, from time 0.

    Raises:
        AttributionStoppedError: The user interrupted it; what was found is in its `partial`.
    """
    try:
        witness = drive.engine.witness if certify else None
        progress, from_start = progress or Progress(), _is_copied(drive)
        return explain(drive.engine, drive.request, drive.record, progress, witness, from_start=from_start)
    finally:
        drive.engine.close()


def unattributed(drive: FactualDrive) -> Attribution:
    """What a drive shows by itself, when its attribution is interrupted before it begins."""
    return unasked(drive.request, drive.record)


def _is_copied(drive: FactualDrive) -> bool:
    """Whether a stack of the user's own drove, and counterfactuals begin with copies of it."""
    is_branched = drive.engine.fallback is None and drive.engine.witness is not drive.engine
    return is_branched and not drive.source.is_reference
