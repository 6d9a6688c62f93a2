"""Delta debugging: the smallest set of messages that, being ideal, prevents the violation.

ddmin (A. Zeller and R. Hildebrandt, Simplifying and Isolating Failure-Inducing Input, IEEE TSE 2002) as
picire does it, over the messages of one component up to the violation. It knows nothing of time: any
subset may be asked for. It is told which component it is, since it has no way to tell, and what comes
after the violation is ideal in all its runs, since it is no cause. Its answer is the last message of
the set, as the last that could still have prevented the violation.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from importlib.util import find_spec
from itertools import groupby

from dvca_sumo.analysis.attribution import setting_of
from dvca_sumo.analysis.bisection import Outcome
from dvca_sumo.analysis.components import SUBSTITUTABLE
from dvca_sumo.bench.baselines.probing import BudgetSpentError, Probing
from dvca_sumo.bench.baselines.procedure import Baseline, Reply, Situation
from dvca_sumo.interventions import Ideal, Selection
from dvca_sumo.messages import Component, MessageId
from dvca_sumo.record import TICK, Record

BUDGET = 100  # probes for one case; then it could not tell

IS_AVAILABLE = find_spec("picire") is not None  # it comes with the extra "test"


def ddmin(situation: Situation) -> Reply:
    """The last message of a 1-minimal set of messages that prevents the violation."""
    drive, component = situation.drive, situation.defective
    if component not in SUBSTITUTABLE:
        return Reply(reason=f"{component} has no idealized substitute")
    if drive.request.repeats is not None:
        return Reply(reason="messages of one run are not those of another in jitter mode")
    record = drive.record
    probing = Probing(drive.engine, setting_of(drive.request, record, situation.violation), BUDGET)
    times = _times(record, component, situation.violation.time)

    def is_prevented(chosen: Sequence[int]) -> bool:
        return probing.ask(*substitutes(component, times, chosen)) is Outcome.SAFE

    every = range(len(times))
    try:
        if not is_prevented(every):
            return probing.reply(Reply(reason=f"ideal {component} does not prevent it"))
        found = _minimal(is_prevented, every)
    except BudgetSpentError:
        return probing.reply(Reply(reason=f"could not tell: {BUDGET} probes are spent"))
    message = record.mark(MessageId(component, max(found)))
    return probing.reply(Reply(component, message, f"{len(found)} messages are a smallest set"))


def substitutes(component: Component, times: Sequence[float], chosen: Sequence[int]) -> Iterator[Ideal]:
    """One for each stretch of `chosen` messages, and for all that comes after the last of `times`.

    They select by time [s] after departure: exact where runs repeat, and an engine sees by it from where
    on a run can differ from the factual one.
    """
    moments = [*times, times[-1] + TICK]
    rows = [*sorted(chosen), len(times)]
    for _, pairs in groupby(enumerate(rows), key=lambda pair: pair[1] - pair[0]):
        stretch = [row for _, row in pairs]
        is_last = stretch[-1] == len(times)
        yield Ideal(
            component,
            Selection(
                start=moments[stretch[0]] - TICK / 2.0,
                end=math.inf if is_last else moments[stretch[-1]] + TICK / 2.0,
            ),
        )


def _times(record: Record, component: Component, until: float) -> list[float]:
    """[s] after departure of each message up to `until` [s]."""
    made = (execution.tick * TICK for execution in record.executions[component])
    return [time for time in made if record.start + time <= until]


def _minimal(is_prevented: Callable[[Sequence[int]], bool], messages: Sequence[int]) -> list[int]:
    picire = import_module("picire")  # untyped, and only there with the extra

    def test(chosen: Sequence[int], _name: object) -> object:
        return picire.Outcome.FAIL if is_prevented(chosen) else picire.Outcome.PASS

    return list(picire.DD(test)(list(messages)))


DELTA_DEBUGGING = Baseline(
    name="ddmin",
    title="delta debugging (ddmin)",
    names_component=False,
    names_message=True,
    explain=ddmin,
)
