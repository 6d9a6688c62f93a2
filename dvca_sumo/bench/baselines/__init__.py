"""Other ways to explain a violation, on the same cases: what each idea of the analysis buys."""

from dvca_sumo.bench.baselines import delta_debugging
from dvca_sumo.bench.baselines.delta_debugging import DELTA_DEBUGGING
from dvca_sumo.bench.baselines.observation import OBSERVATION
from dvca_sumo.bench.baselines.paper_procedure import PAPER_PROCEDURE
from dvca_sumo.bench.baselines.procedure import Baseline
from dvca_sumo.bench.baselines.whole_runs import WHOLE_RUNS

BASELINES = {one.name: one for one in (OBSERVATION, WHOLE_RUNS, PAPER_PROCEDURE, DELTA_DEBUGGING)}


def available_baselines() -> tuple[Baseline, ...]:
    """Those that can be run here: delta debugging needs picire."""
    return tuple(one for one in BASELINES.values() if one is not DELTA_DEBUGGING or delta_debugging.IS_AVAILABLE)
