"""What every baseline is given, and what it gives back."""

from collections.abc import Callable

import msgspec

from dvca_sumo.api import FactualDrive
from dvca_sumo.messages import Component
from dvca_sumo.record import MessageMark, Record
from dvca_sumo.violations import Violation


class Situation(msgspec.Struct, frozen=True):
    """A drive that violates, and what only a benchmark has beside it."""

    drive: FactualDrive
    violation: Violation  # to be explained
    healthy: Record  # the same drive without the defect
    defective: Component  # the truth: for a procedure that searches within the right component only


class Reply(msgspec.Struct, frozen=True):
    """What a baseline answers, and what that took."""

    component: Component | None = None  # None: none is named
    message: MessageMark | None = None
    reason: str = ""
    probes: int = 0
    simulated: float = 0.0  # [s]


class Baseline(msgspec.Struct, frozen=True):
    """One procedure to hold the analysis against."""

    name: str
    title: str
    names_component: bool  # False: it is told
    names_message: bool
    explain: Callable[[Situation], Reply]
