"""The premise of an attribution: the violation comes about again when nothing is replaced."""

from dvca_sumo.analysis.bisection import Outcome
from dvca_sumo.analysis.dtest import Dtest, Question
from dvca_sumo.engine.protocol import Engine, RunFailedError
from dvca_sumo.record import Record
from dvca_sumo.run import Task
from dvca_sumo.scenario import ScenarioError
from dvca_sumo.stack.reference import StackError


class UntoldError(Exception):
    """Whether the violation comes about again could not be told."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"the repeated run could not be told: {reason}")


def why_not_reproduced(engine: Engine, dtest: Dtest, factual: Task, record: Record, *, from_start: bool) -> str:
    """Why the violation of a factual run, that `record`, does not come about again; empty when it does.

    Asks `dtest` its first question. With `from_start` it takes one more run by `engine`, from time 0.

    Raises:
        UntoldError: See there.
    """
    outcome = dtest.ask(Question(()))
    if outcome is Outcome.UNRESOLVED:
        raise UntoldError(next((one.reason for one in dtest.probes if one.reason), "no outcome is that of most runs"))
    if outcome is Outcome.SAFE and factual.jitter is not None:
        return "most re-runs do not violate"
    probe = dtest.probes[0]
    digests = record.digests
    is_at_once = probe.steps == 0 and outcome is Outcome.VIOLATES  # at the departure: nothing was driven before
    is_same = is_at_once or (probe.steps > 0 and digests[probe.steps - 1 : probe.steps] == [probe.last_step])
    if is_same and outcome is Outcome.SAFE:
        return f"the repeated run is the same, but shows no violation until {dtest.until:.1f} s"
    if factual.jitter is not None or (is_same and not from_start):
        return ""
    return _differing(engine, factual, record, is_known=not is_same)


def _differing(engine: Engine, factual: Task, record: Record, *, is_known: bool) -> str:
    """Where one more run of the factual task differs; empty where it does not, unless another is known to."""
    try:
        again = engine.record(factual).digests
    except (ScenarioError, StackError, RunFailedError) as error:
        if not is_known:
            raise UntoldError(f"one more run failed: {error}") from None
        return f"the repeated run differs, and one more run failed: {error}"
    if again == record.digests:
        return "the repeated run differs, one more does not" if is_known else ""
    pairs = enumerate(zip(record.digests, again, strict=False))
    same = next((step for step, pair in pairs if len({*pair}) > 1), len(again))
    return f"the repeated run differs: first at {record.start + 0.1 * same:.1f} s"
