"""What is kept of one trip."""

import enum

import msgspec

from dvca_sumo.responsibility.disturbances import Disturbances
from dvca_sumo.responsibility.judging import Judged, judged
from dvca_sumo.run import Judging
from dvca_sumo.screen.jams import Jams
from dvca_sumo.screen.measures import Measures
from dvca_sumo.screen.queues import Held, Queues
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Judgement


class TripOutcome(enum.StrEnum):
    """How a trip came out."""

    ARRIVED = "arrived"
    TIME_OVER = "time_over"  # of its patience, or no progress
    CONTACT = "contact"
    CUT = "cut"  # the scenario ended first, or SUMO gave it another route: what would have come of it is not known
    ABORTED = "aborted"  # the stack failed, or SUMO took the vehicle away
    NOT_DRIVEN = "not_driven"


class TripResult(msgspec.Struct, frozen=True):
    """One trip in short."""

    ego: str
    outcome: TripOutcome
    reason: str = ""  # of CUT, ABORTED and NOT_DRIVEN
    start: float = 0.0  # [s] of its departure
    distance: float = 0.0  # [m]
    duration: float = 0.0  # [s]
    held: float = 0.0  # [s] thereof in queues
    distance_after: float = 0.0  # [m] of `distance`: past a contact, where the drive goes on
    duration_after: float = 0.0  # [s] of `duration`, likewise
    hard_brakings: int = 0
    least_ttc: float | None = None  # [s]; None: none below the horizon
    violations: tuple[Judged, ...] = ()
    unknown: tuple[str, ...] = ()  # oracles that could not tell
    digest: str = ""  # of an ego's run, as in the result of `run`


def cut_off(end: float) -> str:
    """Why a trip is CUT that the scenario's end cuts off."""
    return f"the scenario ended at {end:g} s"


class Watch:
    """Measures and disturbances of one drive; `result` sums them up."""

    def __init__(self, ego: str, judging: Judging, queues: Queues) -> None:
        self._ego = ego
        self._roadmap = judging.places.roadmap
        self._measures = Measures(judging.places, judging.thresholds)
        self._disturbances = Disturbances(judging.places)
        self._jams = Jams(judging.places)
        self._held = Held(ego, judging.places, queues)
        self._contact: Moment | None = None

    def see(self, moment: Moment) -> None:
        """Take in the next moment."""
        self._measures.see(moment)
        self._disturbances.see(moment)
        self._jams.see(moment)
        self._held.see(moment)

    def holding(self) -> list[str]:
        """Those who hold up the ego now in a jam, if they make no stops of their own."""
        assert self._measures.last is not None
        return self._jams.holding(self._measures.last)

    def touch(self, moment: Moment) -> None:
        """Take in the moment of the contact, of a drive that goes on after it."""
        self._contact = moment
        self._measures.touch()

    def result(
        self,
        outcome: TripOutcome,
        judgements: tuple[Judgement, ...],
        reason: str = "",
        digest: str = "",
        jam: str | None = None,
    ) -> TripResult:
        """The trip, when it is over; `jam` is who holds up the ego in one."""
        measures, last = self._measures, self._measures.last
        assert last is not None  # a drive begins with a look around
        return TripResult(
            ego=self._ego,
            outcome=outcome,
            reason=reason,
            start=round(last.time - measures.duration, 3),
            distance=measures.distance,
            duration=round(measures.duration, 3),
            held=round(self._held.duration, 3),
            distance_after=measures.distance_after,
            duration_after=round(measures.duration_after, 3),
            hard_brakings=measures.hard_brakings,
            least_ttc=measures.least_ttc,
            violations=judged(judgements, self._disturbances, self._contact or last, self._roadmap, jam),
            unknown=tuple(one.kind for one in judgements if one.answer == "unknown"),
            digest=digest,
        )
