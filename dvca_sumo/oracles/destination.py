"""Destination: the ego stops where its route ends."""

from dvca_sumo.oracles.findings import Findings
from dvca_sumo.oracles.place import Places
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Category, Ending, Judgement, Violation


class Destination:
    """Kinds "destination_overrun" and "destination_not_reached".

    Reached is standing with the front bumper within the tolerance of the destination; what comes
    after that is not judged. Overrun is passing it by more than the tolerance before that. Cannot tell
    of a run that was cut short.
    """

    kind = "destination"
    overrun = "destination_overrun"
    not_reached = "destination_not_reached"

    def __init__(self, places: Places, thresholds: Thresholds) -> None:
        self._findings = Findings(self.kind, Category.MISSION, places)
        self._places = places
        self._tolerance = thresholds.destination_tolerance
        self._standing_speed = thresholds.standing_speed
        self._is_overrun = False
        self._last: Moment | None = None
        self.has_arrived = False

    def observe(self, moment: Moment) -> Violation | None:
        """See `Oracle`."""
        self._last = moment
        place = self._places.at(moment)
        beyond = place.station - self._places.route.destination
        if self.has_arrived or self._is_overrun or not place.is_on_route:
            return self._findings.next()
        if beyond > self._tolerance:
            self._is_overrun = True
            self._find(moment, self.overrun, beyond, f"{beyond:.1f} m beyond the destination without a stop")
        elif beyond >= -self._tolerance and abs(moment.ego.speed) <= self._standing_speed:
            self.has_arrived = True
        return self._findings.next()

    def conclude(self, ended: Ending) -> Judgement:
        """See `Oracle`."""
        if self.has_arrived or self._is_overrun:
            return self._findings.judgement()
        if self._last is None or ended is Ending.CUT:
            return self._findings.judgement("the run was cut before the ego could arrive")
        short = self._places.route.destination - self._places.at(self._last).station
        self._find(self._last, self.not_reached, short, f"{short:.1f} m short of the destination")
        return self._findings.judgement()

    def _find(self, moment: Moment, kind: str, value: float, detail: str) -> None:
        self._findings.add(self._findings.made(moment, detail, value, self._tolerance, kind=kind))
