"""Speed limit of the lane under the ego's front bumper."""

import numpy as np

from dvca_sumo.messages import Floats
from dvca_sumo.oracles.findings import Findings
from dvca_sumo.oracles.place import Places
from dvca_sumo.roadmap import Route
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Category, Ending, Judgement, Violation


class SpeedLimit:
    """Kind "speed_limit": true speed above limit + tolerance for the dwell time; one for each such episode.

    A slower lane counts from the line on where the front bumper enters it. Inside a junction the limit
    of the lane before holds, where that is higher: SUMO's speeds of turns are driving advice, not law.
    Cannot tell of the time that the ego was off its route.
    """

    kind = "speed_limit"

    def __init__(self, places: Places, thresholds: Thresholds) -> None:
        self._findings = Findings(self.kind, Category.TRAFFIC_RULE, places)
        self._places = places
        self._tolerance = thresholds.speed_tolerance
        self._dwell = thresholds.speed_dwell
        self._limits = _legal_limits(places.route)
        self._since: float | None = None  # [s] of the current episode
        self._is_reported = False
        self._off_route_at: float | None = None

    def observe(self, moment: Moment) -> Violation | None:
        """See `Oracle`."""
        place = self._places.at(moment)
        if not place.is_on_route:
            self._off_route_at = moment.time if self._off_route_at is None else self._off_route_at
            self._since = None
            return None
        limit = float(self._limits[place.row])
        if moment.ego.speed <= limit + self._tolerance:
            self._since, self._is_reported = None, False
            return None
        self._since = moment.time if self._since is None else self._since
        if not self._is_reported and moment.time - self._since >= self._dwell - 1e-9:
            self._is_reported = True
            detail = f"{3.6 * moment.ego.speed:.0f} km/h where {3.6 * limit:.0f} km/h are allowed"
            self._findings.add(self._findings.made(moment, detail, moment.ego.speed, limit))
        return self._findings.next()

    def conclude(self, ended: Ending) -> Judgement:  # noqa: ARG002  the answer holds for whatever part was seen
        """See `Oracle`."""
        if self._off_route_at is None:
            return self._findings.judgement()
        return self._findings.judgement(f"the ego was off its route at {self._off_route_at:.1f} s")


def _legal_limits(route: Route) -> Floats:
    """Limit [m/s] for each row of the route."""
    limits = np.array(route.speed_limits, dtype=np.float64)
    for row in range(1, len(limits)):
        if route.lane_ids[row].startswith(":"):
            limits[row] = max(limits[row], limits[row - 1])
    return limits
