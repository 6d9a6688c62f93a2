"""Counterfactual runs of one baseline: each is made once, and all are counted."""

import msgspec

from dvca_sumo.analysis.bisection import Outcome
from dvca_sumo.analysis.dtest import Setting, majority, outcome_of
from dvca_sumo.bench.baselines.procedure import Reply
from dvca_sumo.engine.processes import Failure
from dvca_sumo.engine.protocol import Engine
from dvca_sumo.interventions import Ideal
from dvca_sumo.run import Task


class BudgetSpentError(Exception):
    """One question more than there are probes for."""


class Probing:
    """Asks whether a run is safe with idealized substitutes in place."""

    def __init__(self, engine: Engine, setting: Setting, budget: int | None = None) -> None:
        """At most `budget` runs; None: as many as it takes."""
        self._engine = engine
        self._setting = setting
        self._budget = budget
        self._known: dict[tuple[Ideal, ...], Outcome] = {}
        self._probes = 0
        self._simulated = 0.0  # [s]

    def ask(self, *ideals: Ideal) -> Outcome:
        """The outcome of a run with these substitutes; asked before, it costs nothing.

        Raises:
            BudgetSpentError: No probe is left for it.
        """
        if ideals not in self._known:
            self._known[ideals] = self._asked(ideals)
        return self._known[ideals]

    def reply(self, reply: Reply) -> Reply:
        """The same with its costs filled in."""
        return msgspec.structs.replace(reply, probes=self._probes, simulated=self._simulated)

    def _asked(self, ideals: tuple[Ideal, ...]) -> Outcome:
        setting = self._setting
        if self._budget is not None and self._probes + len(setting.jitters) > self._budget:
            raise BudgetSpentError
        tasks = [
            Task(setting.scenario, (*setting.faults, *ideals), setting.stop, setting.futures, jitter)
            for jitter in setting.jitters
        ]
        self._probes += len(tasks)
        outcomes = []
        for answer in self._engine.glimpses(tasks, lambda _row, _answer: None):
            if isinstance(answer, Failure):
                outcomes.append(Outcome.UNRESOLVED)
                continue
            self._simulated += answer.simulated
            outcomes.append(outcome_of(answer, setting)[0])
        return majority(outcomes)
