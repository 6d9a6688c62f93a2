"""What one run is asked to do."""

import math

import msgspec

from dvca_sumo.interventions import Futures, Intervention
from dvca_sumo.scenario import Scenario


class StopRule(msgspec.Struct, frozen=True):
    """When a run may end before its scenario does."""

    after_violation: float = math.inf  # [s] past the first violation
    after_contact: float = 0.0  # [s] past the first contact: SUMO does not simulate what follows a crash
    at: float = math.inf  # [s] simulation time
    settled: float = math.inf  # [s] simulation time from which an ego ...
    place: float = math.inf  # [m] ... whose rear axle is beyond this station has left the danger behind


class Task(msgspec.Struct, frozen=True):
    """One run to make: equal tasks give equal records."""

    scenario: Scenario
    interventions: tuple[Intervention, ...] = ()
    stop: StopRule = StopRule()
    futures: Futures = Futures()
    jitter: int | None = None  # None: exact mode; else the number of the drawn schedule and noise

    @property
    def seed(self) -> int:
        """Of the stack's sensors; SUMO's own seed stays the scenario's in both modes."""
        return self.scenario.seed if self.jitter is None else self.scenario.seed + 1_000_003 * (self.jitter + 1)
