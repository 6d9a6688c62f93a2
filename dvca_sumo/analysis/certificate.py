"""A second opinion on the conclusion, by an independent engine from time 0."""

from collections.abc import Sequence

import msgspec

from dvca_sumo.analysis.bisection import Outcome
from dvca_sumo.analysis.dtest import Dtest, Probe, Question
from dvca_sumo.messages import Component


class Check(msgspec.Struct, frozen=True):
    """One question asked of the witness."""

    question: Question
    expected: Outcome
    outcome: Outcome
    is_same_run: bool | None  # bit for bit; None where there was no first run to compare with

    @property
    def agrees(self) -> bool:
        """Whether the witness says the same."""
        return self.outcome is self.expected and self.is_same_run is not False


def certified(
    witness: Dtest, evidence: Sequence[Probe], whole: tuple[Component, ...], expected: Outcome
) -> tuple[Check, ...]:
    """Ask `witness` the questions of `evidence` anew, and whether the `whole` drive ideal is as `expected`.

    The last is the dtest of Definition 10, which the search backwards from the violation infers.
    """
    first = Question(whole)
    witness.ask_all([*(probe.question for probe in evidence), first])
    checks = []
    for probe in evidence:
        again = witness.evidence(probe.question)
        assert again is not None  # it was asked two lines above
        is_same = again.digest == probe.digest if probe.jitter is None else None
        checks.append(Check(probe.question, probe.outcome, again.outcome, is_same))
    return (*checks, Check(first, expected, witness.ask(first), None))
