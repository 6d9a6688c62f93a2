"""How baselines compare with the truth about a case."""

import time
from collections.abc import Sequence

from dvca_sumo.bench.baselines.procedure import Baseline, Reply, Situation
from dvca_sumo.bench.score import BaselineScore, distance


def baseline_scores(
    baselines: Sequence[Baseline], situation: Situation, altered: tuple[int, ...]
) -> dict[str, BaselineScore]:
    """By name, what each one's answer is worth; `altered` as for `scored`."""
    scores = {}
    for baseline in baselines:
        begin = time.perf_counter()
        reply = baseline.explain(situation)
        scores[baseline.name] = _score(baseline, reply, situation, altered, time.perf_counter() - begin)
    return scores


def no_violation(baselines: Sequence[Baseline]) -> dict[str, BaselineScore]:
    """Their scores where there is nothing to explain: no success of any kind."""
    return {one.name: _wrong(one, "the drive does not violate") for one in baselines}


def _wrong(baseline: Baseline, reason: str) -> BaselineScore:
    return BaselineScore(
        component=None,
        component_success=False if baseline.names_component else None,
        message_success=False if baseline.names_message else None,
        message_distance_s=None,
        probes=0,
        simulated_s=0.0,
        wall_s=0.0,
        reason=reason,
    )


def _score(
    baseline: Baseline, reply: Reply, situation: Situation, altered: tuple[int, ...], wall: float
) -> BaselineScore:
    is_right = reply.component is situation.defective
    message = reply.message if is_right else None
    has_right_message = message is not None and message.index in altered
    return BaselineScore(
        component=None if reply.component is None else reply.component.value,
        component_success=is_right if baseline.names_component else None,
        message_success=has_right_message if baseline.names_message else None,
        message_distance_s=distance(situation.drive.record, message, altered),
        probes=reply.probes,
        simulated_s=reply.simulated,
        wall_s=wall,
        reason=reply.reason,
    )
