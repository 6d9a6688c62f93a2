"""Attribution of a driving violation: Algorithm 1 with its premise, every step kept as evidence."""

from collections.abc import Iterator, Sequence

import msgspec
from msgspec.structs import replace

from dvca_sumo.analysis.at_fault import at_fault
from dvca_sumo.analysis.bisection import Outcome
from dvca_sumo.analysis.certificate import Check, certified
from dvca_sumo.analysis.components import (
    SUBSTITUTABLE,
    ComponentAnswer,
    Verdict,
    concluded,
    named_instead,
    planning_named_instead,
    responsible_component,
    undecided,
)
from dvca_sumo.analysis.differences import Difference, differences
from dvca_sumo.analysis.dtest import Dtest, Probe, Setting, could_not_tell
from dvca_sumo.analysis.last_chance import UndecidedError, decisive, is_by_luck
from dvca_sumo.analysis.messages import MessageAnswer
from dvca_sumo.analysis.planted import Planted, planted
from dvca_sumo.analysis.premise import UntoldError, why_not_reproduced
from dvca_sumo.analysis.specification import PlanningFinding, first_unusable_plan, first_violating_plan
from dvca_sumo.analysis.violating import principal
from dvca_sumo.engine.protocol import Engine
from dvca_sumo.interventions import Fault, recorded_futures
from dvca_sumo.messages import PREDICTION_TIMES, MessageId
from dvca_sumo.record import TICK, MessageMark, Record
from dvca_sumo.responsibility.judging import Judged
from dvca_sumo.run import StopRule, Task
from dvca_sumo.scenario import Scenario
from dvca_sumo.violations import Answer, Category, Violation

# A counterfactual run is safe without any violation until so long after the factual one ...
SETTLE = 4.0  # [s]
# ... or so long, when by then it has left the place of the factual violation behind.
LEAST_SETTLE = 2.5  # [s]
PAST = 10.0  # [m]
# From so long before the last chance of who is named, up to the violation, plans must be such that one can follow.
_USABLE = 1.0  # [s]
_FURTHER = 60.0  # [s] the factual run goes on for past its first violation, to show what else happens
_HORIZON = float(PREDICTION_TIMES[-1])  # [s] the factual run goes on for, so that its last futures are whole


class Request(msgspec.Struct, frozen=True):
    """What is to be attributed, and how carefully."""

    scenario: Scenario
    faults: tuple[Fault, ...] = ()
    repeats: int | None = None  # None: exact mode; else jitter mode with so many runs of each question


class Attribution(msgspec.Struct, frozen=True):
    """The answer, and all that proves it."""

    record: Record
    digest: str
    violation: Violation | None
    verdict: Verdict
    is_reproducible: bool
    reason: str
    stop: StopRule  # of the probes, see Setting
    at_fault: tuple[Judged, ...] = ()  # whose doing violations of the record are, of those where that is known
    components: ComponentAnswer | None = None
    messages: MessageAnswer | None = None
    message: MessageMark | None = None
    differences: tuple[Difference, ...] = ()
    probes: tuple[Probe, ...] = ()
    evidence: tuple[Probe, ...] = ()  # the two adjacent probes
    planted: Planted | None = None
    certificate: tuple[Check, ...] = ()  # empty: not asked for

    def judged(self, violation: Violation) -> Judged | None:
        """Whose doing a violation of the record is; None where that is not known."""
        return next((one for one in self.at_fault if one.violation == violation), None)


class AttributionStoppedError(Exception):
    """The user interrupted an attribution; `partial` holds all that was found until then."""

    def __init__(self, partial: Attribution) -> None:
        super().__init__("interrupted")
        self.partial = partial


class Progress:
    """Hears of an attribution as it goes; does nothing by itself."""

    def factual(self, record: Record) -> None:
        """The factual run is done."""

    def probe(self, probe: Probe) -> None:
        """A probe is done."""


def factual_run(engine: Engine, request: Request) -> Record:
    """The run that is to be explained, continued past a contact so that the last futures are whole.

    Raises:
        ScenarioError, StackError: The scenario cannot be run with this stack.
        RunFailedError: The process crashed or hung.
    """
    return engine.record(_factual_task(request))


def setting_of(request: Request, record: Record, violation: Violation) -> Setting:
    """What all questions about `violation` of a factual run share."""
    is_mission = violation.category is Category.MISSION
    return Setting(
        scenario=request.scenario,
        faults=request.faults,
        futures=recorded_futures(record.moments),
        stop=StopRule(after_violation=0.0) if is_mission else _settled(record, violation),
        start=record.start,
        is_mission=is_mission,
        jitters=_jitters(request),
        untold=tuple(one.kind for one in could_not_tell(record.judgements)),
    )


def explain(
    engine: Engine,
    request: Request,
    record: Record,
    progress: Progress,
    witness: Engine | None = None,
    *,
    from_start: bool = False,
) -> Attribution:
    """Explain the violation of a factual run, if there is one.

    A run without a violation of which an oracle could not tell is UNRESOLVED, not clean. With a
    `witness` the conclusion is asked of that engine too; where it disagrees, nothing is concluded.
    With `from_start` the premise takes one more run, from time 0: a copy of a run repeats what its stack
    drew before it was made.

    Raises:
        AttributionStoppedError: The user interrupted it.
    """
    found = unexplained(record)
    if not record.violations:
        return _concluded(found, request)
    asked: list[Dtest] = []
    is_answered = False
    try:
        found = replace(found, at_fault=at_fault(record, engine.roadmap))
        setting = setting_of(request, record, principal(record.violations))
        asked.append(Dtest(engine, setting, progress.probe))
        found = replace(found, stop=setting.stop)
        for answer in _steps(found, engine, asked[0], request, from_start=from_start):
            found = answer
        is_answered = True
        if witness is not None:
            asked.append(Dtest(witness, setting, progress.probe, len(asked[0].probes)))
            found = _certified(found, asked[1])
    except KeyboardInterrupt:
        partial = _interrupted(found, is_answered=is_answered)
        raise AttributionStoppedError(_concluded(partial, request, asked)) from None
    return _concluded(found, request, asked)


def unasked(request: Request, record: Record) -> Attribution:
    """What a factual run shows by itself, where its attribution is interrupted before it begins."""
    return _concluded(_interrupted(unexplained(record), is_answered=False), request)


def unexplained(record: Record) -> Attribution:
    """What a factual run shows by itself."""
    doubts = _doubts(record)
    if not record.violations:
        verdict = Verdict.UNRESOLVED if doubts else Verdict.NONE
        return Attribution(record, record.digest, None, verdict, True, doubts, StopRule())
    first = principal(record.violations)
    return Attribution(record, record.digest, first, Verdict.UNRESOLVED, True, doubts, StopRule())


def attribute(engine: Engine, request: Request, progress: Progress) -> Attribution:
    """Run a scenario, and explain its violation if there is one; raises what `factual_run` and `explain` do."""
    record = factual_run(engine, request)
    progress.factual(record)
    return explain(engine, request, record, progress)


def _interrupted(found: Attribution, *, is_answered: bool) -> Attribution:
    """What of it holds all the same: a component named before the last question about it was asked does not."""
    answer = found.components
    if is_answered:
        return replace(found, reason=f"{found.reason}; interrupted before that was certified")
    if answer is None:
        return replace(found, reason="interrupted")
    reason = f"interrupted; up to then: {answer.reason}"
    return replace(found, verdict=Verdict.UNRESOLVED, reason=reason, components=undecided(answer, reason))


def _concluded(found: Attribution, request: Request, asked: Sequence[Dtest] = ()) -> Attribution:
    component = found.components.component if found.components is not None else None
    return replace(
        found,
        probes=tuple(probe for dtest in asked for probe in dtest.probes),
        planted=planted(request.faults, found.record, component, found.message),
    )


def _settled(record: Record, violation: Violation) -> StopRule:
    place = record.stations[min(round((violation.time - record.start) / TICK), len(record.stations) - 1)]
    return StopRule(
        after_violation=0.0, at=violation.time + SETTLE, settled=violation.time + LEAST_SETTLE, place=place + PAST
    )


def _jitters(request: Request) -> tuple[int | None, ...]:
    return (None,) if request.repeats is None else tuple(range(request.repeats))


def _factual_task(request: Request) -> Task:
    return Task(
        request.scenario,
        request.faults,
        StopRule(after_violation=_FURTHER, after_contact=_HORIZON),
        jitter=_jitters(request)[0],
    )


def _steps(
    found: Attribution, engine: Engine, dtest: Dtest, request: Request, *, from_start: bool
) -> Iterator[Attribution]:
    """The answer after each step of Algorithm 1."""
    assert found.violation is not None  # or there would be nothing to explain
    try:
        doubt = why_not_reproduced(engine, dtest, _factual_task(request), found.record, from_start=from_start)
    except UntoldError as error:
        yield replace(found, verdict=Verdict.UNRESOLVED, reason=str(error))
        return
    if doubt:
        yield replace(found, verdict=Verdict.NOT_REPRODUCIBLE, is_reproducible=False, reason=doubt)
        return
    answer = responsible_component(dtest, found.record, found.violation.time)
    found = replace(found, verdict=answer.verdict, reason=answer.reason, components=answer)
    yield found
    if answer.verdict is Verdict.PLANNING:
        yield _planning_message(found, engine)
    elif answer.verdict is Verdict.COMPONENT:
        yield _decided(found, dtest, engine, is_exact=request.repeats is None)


def _planning_message(found: Attribution, engine: Engine) -> Attribution:
    assert found.violation is not None
    record = found.record
    finding = first_violating_plan(record, engine.roadmap, record.thresholds, found.violation)
    if finding is None:
        reason = f"{found.reason}; no planning message by itself breaks the specification"
        return replace(found, reason=reason)
    return _with_plan(found, finding)


def _with_plan(found: Attribution, finding: PlanningFinding) -> Attribution:
    return replace(found, message=finding.mark, differences=(Difference("trajectory", finding.reason, 0.0),))


def _decided(found: Attribution, dtest: Dtest, engine: Engine, *, is_exact: bool) -> Attribution:
    answer, violation, record = found.components, found.violation, found.record
    assert answer is not None  # the caller has it
    assert violation is not None
    try:
        component, messages = decisive(dtest, record, answer, violation.time, found.stop.at, is_exact=is_exact)
        has_luck = is_by_luck(dtest, record, component, messages, violation.time)
    except UndecidedError as error:
        answer = undecided(answer, str(error))
        return replace(found, verdict=answer.verdict, reason=answer.reason, components=answer)
    if has_luck:
        answer = concluded(Outcome.VIOLATES, answer.singles, answer.since)
        reason = f"ideal {component} prevents it by luck: the violation stays with all four ideal from further back"
        answer = replace(answer, reason=reason)
        return _planning_message(
            replace(found, verdict=answer.verdict, reason=answer.reason, components=answer), engine
        )
    mark = messages.last_safe
    broken = first_unusable_plan(record, mark.time - _USABLE, violation.time)
    if broken is not None:
        answer = planning_named_instead(answer)
        found = replace(found, verdict=answer.verdict, reason=answer.reason, components=answer)
        return _with_plan(found, broken)
    if component is not answer.component:
        answer = named_instead(answer, component)
    return replace(
        found,
        reason=answer.reason,
        components=answer,
        messages=messages,
        message=mark,
        differences=differences(record, MessageId(component, mark.index), dtest.futures, violation.object),
        evidence=tuple(probe for probe in map(dtest.evidence, messages.proof) if probe is not None),
    )


def _certified(found: Attribution, witness: Dtest) -> Attribution:
    answer = found.components
    if answer is None or answer.component is None:
        return found
    if found.verdict is Verdict.PLANNING:
        certificate = certified(witness, (), SUBSTITUTABLE, answer.all_ideal)
    else:
        certificate = certified(witness, found.evidence, (answer.component,), Outcome.SAFE)
    if all(check.agrees for check in certificate):
        return replace(found, certificate=certificate)
    reason = f"the witness engine disagrees; without it: {found.reason}"
    return replace(
        found,
        certificate=certificate,
        verdict=Verdict.UNRESOLVED,
        reason=reason,
        components=replace(answer, verdict=Verdict.UNRESOLVED, component=None),
        messages=None,
        message=None,
        differences=(),
    )


def _doubts(record: Record) -> str:
    unknown = [one for one in record.judgements if one.answer is Answer.UNKNOWN]
    return "; ".join(f"{one.kind} could not be told: {one.reason}" for one in unknown)
