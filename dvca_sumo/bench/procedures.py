"""What each procedure comes to over the same cases: ours, and the baselines beside it."""

import statistics
from collections.abc import Sequence

import msgspec

from dvca_sumo.bench.baselines import BASELINES
from dvca_sumo.bench.score import BaselineScore, Score
from dvca_sumo.intervals import Share, share_of

_OURS = "ours"


class ProcedureSummary(msgspec.Struct, frozen=True):
    """One procedure."""

    name: str
    title: str
    components: Share | None  # None: it is told the component
    messages: Share | None  # None: it names components only
    probes: float  # average
    simulated_s: float  # average, of the probes
    median_wall_s: float
    worst_wall_s: float


def procedures_of(scores: Sequence[Score]) -> tuple[ProcedureSummary, ...]:
    """Ours first, then each baseline that was asked for; empty when none was."""
    names = [name for name in BASELINES if any(name in score.baselines for score in scores)]
    if not names:
        return ()
    found = [_summary(name, BASELINES[name].title, [score.baselines.get(name) for score in scores]) for name in names]
    return (_summary(_OURS, "this analysis", [_ours(score) for score in scores]), *found)


def _ours(score: Score) -> BaselineScore:
    return BaselineScore(
        component=score.component,
        component_success=score.component_success,
        message_success=score.message_success,
        message_distance_s=score.message_distance_s,
        probes=score.probes,
        simulated_s=score.simulated_s,
        wall_s=score.attribution_wall_s,
        reason=score.reason,
    )


def _summary(name: str, title: str, scores: Sequence[BaselineScore | None]) -> ProcedureSummary:
    """Of a case that could not be analysed there is no score: it counts as wrong, and costs nothing."""
    known = [score for score in scores if score is not None]
    return ProcedureSummary(
        name=name,
        title=title,
        components=_share([one.component_success for one in known], len(scores)),
        messages=_share([one.message_success for one in known], len(scores)),
        probes=statistics.fmean(one.probes for one in known),
        simulated_s=statistics.fmean(one.simulated_s for one in known),
        median_wall_s=statistics.median(one.wall_s for one in known),
        worst_wall_s=max(one.wall_s for one in known),
    )


def _share(successes: Sequence[bool | None], total: int) -> Share | None:
    return None if None in successes else share_of(sum(map(bool, successes)), total)
