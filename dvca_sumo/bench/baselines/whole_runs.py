"""Whole-run substitution: which component, ideal from the ego's departure on, prevents the violation?

Definition 10 of Wan et al. by itself: five questions, each about the whole drive, and no message.
"""

from dvca_sumo.analysis.attribution import setting_of
from dvca_sumo.analysis.components import SUBSTITUTABLE, concluded
from dvca_sumo.bench.baselines.probing import Probing
from dvca_sumo.bench.baselines.procedure import Baseline, Reply, Situation
from dvca_sumo.interventions import Ideal


def whole_runs(situation: Situation) -> Reply:
    """All four ideal, then each alone; concluded from as the analysis does."""
    drive = situation.drive
    probing = Probing(drive.engine, setting_of(drive.request, drive.record, situation.violation))
    all_ideal = probing.ask(*map(Ideal, SUBSTITUTABLE))
    singles = {component: probing.ask(Ideal(component)) for component in SUBSTITUTABLE}
    answer = concluded(all_ideal, singles)
    return probing.reply(Reply(answer.component, None, answer.reason))


WHOLE_RUNS = Baseline(
    name="whole-run",
    title="whole-run substitution",
    names_component=True,
    names_message=False,
    explain=whole_runs,
)
