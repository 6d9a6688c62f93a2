"""Scores as no run has made them."""

from typing import Literal

from dvca_sumo.bench.score import Controls, Score

HOLDING = Controls(without=True, defective=True, harmless=True)


def score(
    name: str = "perception.miss/cs1",
    expected: str = "perception",
    component: str | None = "perception",
    *,
    suite: str = "injected",
    mode: Literal["exact", "jitter"] = "exact",
    has_message: bool = True,
    is_proven: bool | None = True,
    verdict: str = "component",
    controls: Controls | None = HOLDING,
    wall: float = 1.0,
) -> Score:
    return Score(
        suite=suite,
        name=name,
        scenario="nets/cs1.sumocfg",
        mode=mode,
        seed=1,
        expected_component=expected,
        component=component,
        component_success=component == expected,
        message_success=has_message,
        message_distance_s=0.0 if has_message else 0.4,
        altered_share=0.2,
        reduction_rate=0.9998 if has_message else 0.0,
        component_reduction_rate=0.995 if has_message else 0.0,
        probes=12,
        simulated_s=40.0,
        factual_wall_s=0.5,
        attribution_wall_s=wall,
        violation=None if verdict == "none" else "collision",
        verdict=verdict,
        reason="why",
        is_proven=is_proven,
        controls=controls,
        command="dvca-sumo run nets/cs1.sumocfg --fault perception.miss",
    )
