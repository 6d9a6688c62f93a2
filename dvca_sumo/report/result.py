"""The result of a run as data: the JSON contract."""

import math
import platform
from importlib.metadata import PackageNotFoundError, version

import msgspec

from dvca_sumo.analysis.attribution import PAST, Attribution, Request
from dvca_sumo.analysis.dtest import Probe
from dvca_sumo.analysis.planted import Planted
from dvca_sumo.interventions import Fault
from dvca_sumo.messages import COMPONENTS
from dvca_sumo.record import MessageMark
from dvca_sumo.scenario import STEP_LENGTH
from dvca_sumo.stack.sources import StackSource
from dvca_sumo.violations import Violation

SCHEMA = 1
Json = dict[str, object]


class Timing(msgspec.Struct, frozen=True):
    """What an analysis cost."""

    factual_wall_s: float
    attribution_wall_s: float
    engine: str
    jobs: int


def result_of(request: Request, source: StackSource, found: Attribution, timing: Timing) -> Json:
    """The whole result, of JSON types only."""
    scenario, record = request.scenario, found.record
    counts = record.message_counts
    total = sum(counts.values())
    simulated = record.simulated + sum(probe.simulated for probe in found.probes)
    is_wrong = found.planted is not None and not found.planted.message_success
    has_message = found.message is not None and not is_wrong
    return {
        "schema": SCHEMA,
        "scenario": {
            "config": str(scenario.configuration.path),
            "ego": record.ego,
            "stops": list(record.stops),
            "seed": scenario.seed,
            "step_length": STEP_LENGTH,
            "begin": scenario.begin,
            "end": _finite(scenario.end),
            "overrides": [msgspec.to_builtins(override) for override in scenario.overrides],
            "thresholds": {name: _finite(value) for name, value in msgspec.structs.asdict(record.thresholds).items()},
        },
        "faults": [_fault(fault) for fault in request.faults],
        "stack": source.stack,
        "bug": source.bug,
        "jitter": request.repeats is not None,
        "repeats": request.repeats or 1,
        "violations": [_violation(violation, found) for violation in record.violations],
        "judgements": [
            {"kind": one.kind, "answer": one.answer.value, "reason": one.reason} for one in record.judgements
        ],
        "verdict": found.verdict.value,
        "reason": found.reason,
        "violation": None if found.violation is None else _violation(found.violation, found),
        "component": _component(found),
        "alternatives": [] if found.components is None else [one.value for one in found.components.alternatives],
        "substitutions": _substitutions(found),
        "substituted_from": None if found.components is None else _finite(found.components.since),
        "message": None
        if found.message is None
        else {"component": found.message.component.value, **_mark(found.message)},
        "differences": [{"field": one.field, "text": one.text} for one in found.differences],
        "interval": _interval(found),
        "probes": [_probe(probe) for probe in found.probes],
        "messages": {"total": total, **{component.value: counts[component] for component in COMPONENTS}},
        "reduction_rate": 1.0 - 1.0 / total if has_message else 0.0,
        "planted": None if found.planted is None else _planted(found.planted),
        "certificate": _certificate(found),
        "settled_at": _finite(found.stop.at),
        "settled_from": _finite(found.stop.settled),
        "settled_past": PAST if math.isfinite(found.stop.settled) else None,
        "timing": {
            **msgspec.to_builtins(timing),
            "ratio": timing.attribution_wall_s / timing.factual_wall_s,
            "simulated_s": simulated,
        },
        "reproducible": found.is_reproducible,
        "digest": found.digest,
        "versions": versions(),
    }


def versions() -> Json:
    """Of what a result may depend on."""
    return {"dvca_sumo": _version("dvca-sumo"), "sumo": _version("libsumo"), "python": platform.python_version()}


def _fault(fault: Fault) -> Json:
    selection = {
        key: _finite(value) if isinstance(value, float) else value
        for key, value in msgspec.to_builtins(fault.selection).items()
        if value is not None and value != math.inf
    }
    return {
        "name": fault.name,
        "component": fault.component.value,
        "parameters": dict(fault.parameters),
        "selection": selection,
    }


def _violation(violation: Violation, found: Attribution) -> Json:
    """One of the factual run, with whose doing it is."""
    judged = found.judged(violation)
    whose = {"fault": None, "reason": ""} if judged is None else {"fault": judged.fault.value, "reason": judged.reason}
    return {**violation_json(violation), **whose}


def violation_json(violation: Violation) -> Json:
    """One violation, of JSON types only."""
    return {
        "kind": violation.kind,
        "category": violation.category.value,
        "time": violation.time,
        "object": violation.object,
        "position": list(violation.position),
        "lane": violation.lane,
        "value": _finite(violation.value),
        "threshold": _finite(violation.threshold),
        "contact": None if violation.contact is None else violation.contact.value,
        "detail": violation.detail,
    }


def _component(found: Attribution) -> str | None:
    if found.components is None or found.components.component is None:
        return None
    return found.components.component.value


def _substitutions(found: Attribution) -> Json | None:
    answer = found.components
    if answer is None:
        return None
    singles = {component.value: outcome.value for component, outcome in answer.singles.items()}
    return {"all": answer.all_ideal.value, **singles}


def _interval(found: Attribution) -> Json | None:
    answer = found.messages
    if answer is None:
        return None
    first = answer.first_violating
    return {
        "last_safe": {"component": answer.last_safe.component.value, **_mark(answer.last_safe)},
        "first_violating": None if first is None else {"component": first.component.value, **_mark(first)},
        "adjacent": answer.is_adjacent,
        "monotone": answer.is_monotone,
        "probes": [probe.id for probe in found.evidence],
    }


def _certificate(found: Attribution) -> Json | None:
    if not found.certificate:
        return None
    checks = [
        {
            "ideal": [component.value for component in check.question.ideal],
            "from": None if check.question.since is None else _mark(check.question.since),
            "expected": check.expected.value,
            "outcome": check.outcome.value,
            "same_run": check.is_same_run,
        }
        for check in found.certificate
    ]
    return {"agrees": all(check.agrees for check in found.certificate), "checks": checks}


def _mark(mark: MessageMark) -> Json:
    return {"index": mark.index, "time": mark.time, "state": list(mark.state)}


def _probe(probe: Probe) -> Json:
    since = probe.question.since
    return {
        "id": probe.id,
        "ideal": [component.value for component in probe.question.ideal],
        "from": None if since is None else _mark(since),
        "outcome": probe.outcome.value,
        "violation": None if probe.violation is None else violation_json(probe.violation),
        "reason": probe.reason,
        "jitter": probe.jitter,
        "passes": probe.passes,
        "residual": probe.residual,
        "digest": probe.digest,
        "simulated_s": probe.simulated,
        "wall_s": probe.wall,
    }


def _planted(planted: Planted) -> Json:
    return {
        "component": planted.component.value,
        "altered": _ranges(planted.altered),
        "component_success": planted.component_success,
        "message_success": planted.message_success,
        "message_distance_s": planted.message_distance,
    }


def _ranges(indices: tuple[int, ...]) -> list[int | list[int]]:
    """Ascending whole numbers, runs of them as [first, last]."""
    found: list[list[int]] = []
    for index in indices:
        if found and index == found[-1][1] + 1:
            found[-1][1] = index
        else:
            found.append([index, index])
    return [first if first == last else [first, last] for first, last in found]


def _finite(value: float | None) -> float | None:
    """JSON knows no infinity and no NaN."""
    return value if value is not None and math.isfinite(value) else None


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:  # run from a source tree
        return "uninstalled"
