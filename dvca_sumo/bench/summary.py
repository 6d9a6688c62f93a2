"""What a row of scores comes to, and whether that is good enough."""

import statistics
from collections import Counter
from collections.abc import Sequence

import msgspec

from dvca_sumo.bench.procedures import ProcedureSummary, procedures_of
from dvca_sumo.bench.score import FAILED, Score
from dvca_sumo.intervals import Share, share_of

# What has to hold for an analysis to be trusted; shares of cases.
_COMPONENTS, _MESSAGES = 1.0, 1.0  # of the written suites in exact mode
_JITTER_MESSAGES = 0.98
_RANDOM_COMPONENTS, _RANDOM_MESSAGES = 0.98, 0.97
_REDUCTION = 0.995


class Check(msgspec.Struct, frozen=True):
    """One demand on the whole benchmark."""

    text: str
    holds: bool


class Summary(msgspec.Struct, frozen=True):
    """All cases of one suite in one mode."""

    suite: str
    mode: str
    cases: int
    failures: int  # that could not be analysed: they count as wrong
    components: Share
    messages: Share
    proofs: Share | None  # reported messages of which the definition holds; None: not asked
    controls: Share | None  # None: not run
    reduction_rate: float  # average
    component_reduction_rate: float
    altered_share: float  # average: how often a guess among the component's messages would succeed
    probes: float  # average
    median_wall_s: float  # attribution of one case
    worst_wall_s: float
    confusion: dict[str, dict[str, int]]  # expected component -> reported one, or "none" -> cases
    checks: tuple[Check, ...]
    procedures: tuple[ProcedureSummary, ...]  # ours and the baselines; empty: not asked for


def summary_of(scores: Sequence[Score]) -> Summary:
    """Sum up the scores of one suite in one mode; at least one score."""
    total, failures = len(scores), sum(score.verdict == FAILED for score in scores)
    components = share_of(sum(score.component_success for score in scores), total)
    messages = share_of(sum(score.message_success for score in scores), total)
    controlled = [score.controls for score in scores if score.controls is not None]
    controls = share_of(sum(one.hold for one in controlled), len(controlled)) if controlled else None
    asked = [score.is_proven for score in scores if score.is_proven is not None]
    proofs = share_of(sum(asked), len(asked)) if asked else None
    confusion: dict[str, Counter[str]] = {}
    for score in scores:
        confusion.setdefault(score.expected_component, Counter())[score.component or "none"] += 1
    walls = [score.attribution_wall_s for score in scores]
    reduction = _mean([score.reduction_rate for score in scores])
    return Summary(
        suite=scores[0].suite,
        mode=scores[0].mode,
        cases=total,
        failures=failures,
        components=components,
        messages=messages,
        proofs=proofs,
        controls=controls,
        reduction_rate=reduction,
        component_reduction_rate=_mean([score.component_reduction_rate for score in scores]),
        altered_share=_mean([score.altered_share for score in scores]),
        probes=_mean([score.probes for score in scores]),
        median_wall_s=statistics.median(walls),
        worst_wall_s=max(walls),
        confusion={expected: dict(found) for expected, found in confusion.items()},
        checks=_checks(
            scores[0],
            components,
            messages,
            {"reported messages are proven": proofs, "controls hold": controls},
            reduction,
        ),
        procedures=procedures_of(scores),
    )


def _checks(
    like: Score, components: Share, messages: Share, others: dict[str, Share | None], reduction: float
) -> tuple[Check, ...]:
    wanted = (_COMPONENTS, _MESSAGES if like.mode == "exact" else _JITTER_MESSAGES)
    if like.suite == "random":
        wanted = (_RANDOM_COMPONENTS, _RANDOM_MESSAGES)
    checks = [
        _at_least("components named right", components, wanted[0]),
        _at_least("messages named right", messages, wanted[1]),
    ]
    if like.suite != "random":
        text = f"average reduction: {reduction:.2%} (at least {_REDUCTION:.1%})"
        checks.append(Check(text, reduction >= _REDUCTION))
    asked = [_at_least(what, share, wanted[0]) for what, share in others.items() if share is not None]
    return (*checks, *asked)


def _at_least(what: str, share: Share, wanted: float) -> Check:
    text = f"{what}: {share.count} of {share.total} (at least {wanted:.0%})"
    return Check(text, share.total > 0 and share.value >= wanted)


def _mean(values: Sequence[float]) -> float:
    return statistics.fmean(values) if values else 0.0
