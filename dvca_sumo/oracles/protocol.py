"""What every oracle is: a deterministic fold over recorded truth, without effects."""

from typing import Protocol

from dvca_sumo.oracles.place import Places
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Ending, Judgement, Violation


class Oracle(Protocol):
    """Judges one rule over one run.

    Its state is plain data: it may be pickled or forked in the middle of a run, and the copy goes on
    to the same answers. An oracle sees the truth and never the simulator, so it cannot disturb a run.
    """

    kind: str

    def __init__(self, places: Places, thresholds: Thresholds) -> None:
        """An oracle at the beginning of a run; oracles of one run may share `places`."""
        ...

    def observe(self, moment: Moment) -> Violation | None:
        """Take in the next moment of the run.

        Called once a world step, in the order of time. A violation is returned when it is established,
        once for each object (or line, or episode); where two are established at one moment, the second
        is returned with the next call that has none of its own.
        """
        ...

    def conclude(self, ended: Ending) -> Judgement:
        """The answer for the run up to the last moment; its violations include all that were returned."""
        ...
