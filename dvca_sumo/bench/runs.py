"""Cases analysed side by side, each in a process of its own, as they finish."""

import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial

import msgspec

from dvca_sumo import api
from dvca_sumo.analysis.attribution import Attribution
from dvca_sumo.analysis.violating import principal
from dvca_sumo.bench.baselines import BASELINES
from dvca_sumo.bench.baselines.procedure import Situation
from dvca_sumo.bench.baselines.scoring import baseline_scores, no_violation
from dvca_sumo.bench.cases import Case
from dvca_sumo.bench.ground_truth import altered_messages
from dvca_sumo.bench.proof import is_proven
from dvca_sumo.bench.score import BaselineScore, Controls, Mode, Score, failed, mode_of, scored
from dvca_sumo.engine.processes import Failure, isolated
from dvca_sumo.record import Record
from dvca_sumo.violations import Answer

TIMEOUT = 3600.0  # [s] of wall time for one case: only a hang takes so long

Attribute = Callable[[api.FactualDrive], Attribution]


class Setting(msgspec.Struct, frozen=True):
    """How cases are analysed."""

    seed: int | None = None  # of the scenario; None: its own
    repeats: int | None = None  # None: exact mode; else jitter mode with so many runs of each question
    has_controls: bool = True
    baselines: tuple[str, ...] = ()  # names of those that are to explain each case as well
    attribute: Attribute = api.attribute

    @property
    def mode(self) -> Mode:
        """Its name."""
        return mode_of(self.repeats)


def analysed(cases: Iterable[Case], setting: Setting, jobs: int) -> Iterator[tuple[int, Score]]:
    """(row of the case, its score), as they finish; `jobs` cases at once.

    A case whose process crashed or hung, or that cannot be run, has a score all the same: `failed`.
    """
    begun: list[Case] = []

    def work() -> Iterator[Callable[[], Score]]:
        for case in cases:
            begun.append(case)
            yield partial(analysis_of, case, setting)

    for row, answer in isolated(work(), jobs, TIMEOUT):
        if isinstance(answer, Failure):
            yield row, failed(begun[row], setting.repeats, setting.seed, answer.reason)
        else:
            yield row, answer


def analysis_of(case: Case, setting: Setting) -> Score:
    """The score of one case, found in this process.

    Raises:
        ScenarioError, FaultError, StackError, BugError: The case cannot be run.
        RunFailedError: A run crashed or hung.
    """
    begin = time.perf_counter()
    drive = driven(case.scenario, case.ego, case.begin, setting, case.fault, case.bug)
    factual = time.perf_counter() - begin
    begin = time.perf_counter()
    found = setting.attribute(drive)
    attribution = time.perf_counter() - begin
    return judged(case, setting, drive, found, (factual, attribution))


def judged(
    case: Case, setting: Setting, drive: api.FactualDrive, found: Attribution, walls: tuple[float, float]
) -> Score:
    """The score of an answer about `drive`; `walls` [s] are what the factual run and the answer took."""
    is_exact = setting.repeats is None
    altered = altered_messages(case, drive.request.scenario, drive.record, None if is_exact else 0)
    return scored(
        case,
        found,
        altered,
        repeats=setting.repeats,
        seed=drive.request.scenario.seed,
        walls=walls,
        is_proven=is_proven(drive, found) if is_exact else None,
        controls=_controls(case, setting, drive.record) if setting.has_controls else None,
        baselines=_baselines(case, setting, altered, drive.record) if setting.baselines else {},
    )


def _baselines(case: Case, setting: Setting, altered: tuple[int, ...], record: Record) -> dict[str, BaselineScore]:
    """On a drive of their own: they must not find what the analysis has left behind."""
    asked = [BASELINES[name] for name in setting.baselines]
    if not record.violations:
        return no_violation(asked)
    healthy = driven(case.scenario, case.ego, case.begin, setting)
    healthy.engine.close()
    drive = driven(case.scenario, case.ego, case.begin, setting, case.fault, case.bug)
    try:
        situation = Situation(drive, principal(drive.record.violations), healthy.record, case.component)
        return baseline_scores(asked, situation, altered)
    finally:
        drive.engine.close()


def driven(
    scenario: str, ego: str | None, begin: float | None, setting: Setting, fault: str = "", bug: str = ""
) -> api.FactualDrive:
    """A drive in this process, with a fault or a bug or with none; raises what `api.drive` does."""
    loaded = api.load_scenario(scenario, ego, setting.seed, begin=begin)
    faults = [fault] if fault else []
    return api.drive(loaded, faults, repeats=setting.repeats, jobs=1, bug=bug or None)


def _controls(case: Case, setting: Setting, record: Record) -> Controls:
    harmless = _is_safe(case, setting, case.harmless, case.bug, case.harmless_scenario)
    return Controls(
        without=_is_safe(case, setting, "", ""),
        defective=None if not record.violations and _doubts(record) else bool(record.violations),
        harmless=harmless,
    )


def _is_safe(case: Case, setting: Setting, fault: str, bug: str, scenario: str = "") -> bool | None:
    drive = driven(scenario or case.scenario, case.ego, case.begin, setting, fault, bug)
    drive.engine.close()
    if drive.record.violations:
        return False
    return None if _doubts(drive.record) else True


def _doubts(record: Record) -> bool:
    return any(one.answer is Answer.UNKNOWN for one in record.judgements)
