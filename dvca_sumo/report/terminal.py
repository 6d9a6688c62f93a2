"""The verdict a person reads."""

import math
from collections.abc import Iterator

from dvca_sumo.analysis.attribution import PAST, Attribution
from dvca_sumo.analysis.bisection import Outcome
from dvca_sumo.analysis.components import Verdict
from dvca_sumo.analysis.dtest import Probe
from dvca_sumo.analysis.planted import Planted
from dvca_sumo.interventions import UNITS
from dvca_sumo.oracles.destination import Destination
from dvca_sumo.record import MessageMark, Record
from dvca_sumo.report.result import Timing
from dvca_sumo.responsibility.judging import AtFault, Judged
from dvca_sumo.stack.bugs import BUGS
from dvca_sumo.violations import Contact, Violation

_CONTACTS = {
    Contact.STOPPED_EGO: "the other one ran into the standing ego",
    Contact.HIT_FROM_BEHIND: "the other one ran into the ego from behind",
    Contact.ACTIVE_FRONT: "the ego ran into it",
    Contact.ACTIVE_SIDE: "the ego touched it with its side",
}
_WHOSE = {AtFault.OTHER: "the other one's", AtFault.SIMULATOR: "the simulator's, not the driver's"}
_ANSWERS = {
    Outcome.SAFE: "safe: this alone prevents it",
    Outcome.VIOLATES: "still violates",
    Outcome.UNRESOLVED: "could not be told",
}


def verdict_text(found: Attribution, timing: Timing, bug: str | None = None) -> str:
    """The whole verdict as lines of plain text, without a trailing newline."""
    return "\n".join(_lines(found, timing, bug))


def _lines(found: Attribution, timing: Timing, bug: str | None) -> Iterator[str]:
    record = found.record
    if found.violation is None:
        said = "No violation" if found.verdict is Verdict.NONE else "No violation seen, but it could not be told"
        yield f"{said}. The ego {record.ego} {_came_out(record)} after {_driven(record):.1f} s."
        if found.reason:
            yield f"  because  {found.reason}"
        yield from _stops(record)
        if found.planted is not None:
            yield f"  planted  {_altered(found.planted)}, to no violation"
        if bug is not None:
            yield f"  bug      {bug} ({BUGS[bug].component.value}), to no violation"
        yield _cost(found, timing)
        return
    yield from _what_happened(found.violation, found)
    yield from _which_component(found)
    yield from _which_message(found)
    yield from _certificate(found)
    yield from _planted(found)
    yield from _built_with(found, bug)
    yield _cost(found, timing)


def _what_happened(violation: Violation, found: Attribution) -> Iterator[str]:
    record = found.record
    whom = f" with {violation.object}" if violation.object else ""
    yield f"VIOLATION  {violation.kind.replace('_', ' ')}{whom} at {violation.time:.1f} s"
    x, y = violation.position
    where = f", lane {violation.lane}" if violation.lane else ""
    yield f"  where    ({x:.1f}, {y:.1f}){where}"
    yield f"  what     {violation.detail}"
    if violation.contact is not None:
        yield f"  contact  {violation.contact.value.replace('_', ' ')}: {_CONTACTS[violation.contact]}"
    yield from _whose(violation, found.judged(violation))
    others = [one for one in record.violations if one is not violation]
    if others:
        listed = ", ".join(f"{one.kind.replace('_', ' ')} at {one.time:.1f} s" for one in others[:4])
        yield f"  also     {listed}{' ...' if len(others) > 4 else ''}"
    yield from _stops(record)


def _whose(violation: Violation, judged: Judged | None) -> Iterator[str]:
    """Unless it is the ego's own, or nobody has asked: an attribution was interrupted before."""
    if violation.kind == Destination.not_reached:
        yield "  doing    not known: it takes SUMO's own driver on the same trip, as `dvca-sumo screen` has it"
    elif judged is not None and judged.fault is not AtFault.DRIVER:
        yield f"  doing    {_WHOSE[judged.fault]}: {judged.reason}"
        yield "           what follows is what would have avoided it all the same"


def _stops(record: Record) -> Iterator[str]:
    if record.stops:
        yield f"  stops    not made, the vehicle's own: {', '.join(record.stops)}"


def _which_component(found: Attribution) -> Iterator[str]:
    yield ""
    answer = found.components
    if answer is None:
        yield f"COMPONENT  {'not reproducible' if found.verdict is Verdict.NOT_REPRODUCIBLE else 'could not be told'}"
        yield f"  because  {found.reason}"
        return
    name = answer.component.value if answer.component is not None else "could not be told"
    yield f"COMPONENT  {name}"
    yield f"  because  {found.reason}"
    together = "safe: planning can handle it" if answer.all_ideal is Outcome.SAFE else _ANSWERS[answer.all_ideal]
    yield f"  all four ideal      {together}"
    if math.isfinite(answer.since):
        yield f"  each alone          from {answer.since:.1f} s on:"
    for component, outcome in answer.singles.items():
        yield f"  ideal {component.value:<13} {_ANSWERS[outcome]}"
    if answer.alternatives:
        others = ", ".join(one.value for one in answer.alternatives)
        yield f"  also enough: {others} (a substitute downstream can hide an upstream fault)"


def _which_message(found: Attribution) -> Iterator[str]:
    if found.message is None:
        return
    mark, record = found.message, found.record
    tick = record.executions[mark.component][mark.index].tick
    ego = record.path[tick]
    yield ""
    yield f"MESSAGE    {mark.component.value} #{mark.index} at {mark.time:.2f} s - open this one first"
    acceleration = round(ego.acceleration, 1) + 0.0  # no negative zero
    yield f"  ego      at ({ego.x:.1f}, {ego.y:.1f}), {ego.speed:.1f} m/s, {acceleration:+.1f} m/s^2"
    yield f"  state    {_state(mark)}"
    for row, difference in enumerate(found.differences):
        yield f"  {'wrong' if row == 0 else '':<8} {difference.text}"
    if found.messages is not None:
        yield from _proof(found)


def _proof(found: Attribution) -> Iterator[str]:
    answer = found.messages
    assert answer is not None
    component = answer.last_safe.component.value
    by_id = {probe.id: probe for probe in found.evidence}
    for row, probe in enumerate(by_id.values()):
        head = "proof" if row == 0 else ""
        since = probe.question.since
        from_where = f"#{since.index} on" if since is not None else "the start on"
        yield f"  {head:<8} probe {probe.id}: ideal {component} from {from_where} -> {_outcome(probe)}"
    if answer.first_violating is None:
        yield "           ideal after the last message before the violation -> violates, as driven"
    if answer.note:
        yield f"  note     {answer.note}"


def _certificate(found: Attribution) -> Iterator[str]:
    if found.certificate:
        agreed = sum(check.agrees for check in found.certificate)
        yield ""
        yield f"CERTIFIED  {agreed} of {len(found.certificate)} conclusions hold when driven again from time 0"


def _planted(found: Attribution) -> Iterator[str]:
    planted = found.planted
    if planted is None:
        return
    yield ""
    hit = "found" if planted.component_success else "NOT found"
    which = "one that the fault altered" if planted.message_success else "NOT one that the fault altered"
    tail = f"; the message is {which}" if found.message is not None else ""
    yield f"PLANTED    {_altered(planted)}: component {hit}{tail}"


def _built_with(found: Attribution, bug: str | None) -> Iterator[str]:
    if bug is None:
        return
    component = BUGS[bug].component
    named = found.components.component if found.components is not None else None
    yield ""
    yield f"BUG        {bug} ({component.value}): component {'found' if named is component else 'NOT found'}"


def _altered(planted: Planted) -> str:
    if not planted.altered:
        return f"{planted.component.value} fault, which never acted: no message altered"
    return f"{planted.component.value} fault, {len(planted.altered)} messages altered"


def _cost(found: Attribution, timing: Timing) -> str:
    probes = len(found.probes)
    if probes == 0:
        return f"\n1 run, {timing.factual_wall_s:.1f} s"
    settled, stop = "", found.stop
    if math.isfinite(stop.at):
        settled = f", safe means: none until {stop.at:.1f} s, or {stop.settled:.1f} s once {PAST:g} m past the place"
    total = timing.factual_wall_s + timing.attribution_wall_s
    jobs = "1 job" if timing.jobs == 1 else f"{timing.jobs} jobs"
    return f"\n1 + {probes} runs, {total:.1f} s with {jobs}, engine {timing.engine}{settled}"


def _outcome(probe: Probe) -> str:
    if probe.outcome is Outcome.VIOLATES and probe.violation is not None:
        violation = probe.violation
        return f"violates ({violation.kind.replace('_', ' ')} at {violation.time:.1f} s)"
    return "safe" if probe.outcome is Outcome.SAFE else f"could not be told ({probe.reason})"


def _state(mark: MessageMark) -> str:
    return f"{mark.state} (units {UNITS.position:g} m, {UNITS.speed:g} m/s, {UNITS.acceleration:g} m/s^2)"


def _came_out(record: Record) -> str:
    return (
        "arrived" if record.ending.value == "arrived" else f"was on its way ({record.ending.value.replace('_', ' ')})"
    )


def _driven(record: Record) -> float:
    return record.moments[-1].time - record.start
