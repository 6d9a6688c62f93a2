"""Speed limit of the ego's lane."""

import numpy as np

from dvca_sumo.messages import Floats
from dvca_sumo.oracles.findings import Findings
from dvca_sumo.oracles.place import Place, Places
from dvca_sumo.roadmap import Lane, Route, is_inner
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Category, Ending, Judgement, Violation


class SpeedLimit:
    """Kind "speed_limit": true speed above limit + tolerance for the dwell time; one for each such episode.

    A slower lane counts from the line on where the front bumper enters it, or from when its middle is off the route's
    lane onto another one of that road. Inside a junction the limit of the lane before holds, where that is higher:
    SUMO's speeds of turns are driving advice, not law. Cannot tell of the time that the ego was off its route, nor of
    lanes where variable signs set the limit.
    """

    kind = "speed_limit"

    def __init__(self, places: Places, thresholds: Thresholds) -> None:
        self._findings = Findings(self.kind, Category.TRAFFIC_RULE, places)
        self._places = places
        self._tolerance = thresholds.speed_tolerance
        self._dwell = thresholds.speed_dwell
        self._limits = _legal_limits(places.route)
        self._signed = _signed(places)
        self._since: float | None = None  # [s] of the current episode
        self._is_reported = False
        self._blind = ""  # the first time that it could not tell, and why

    def observe(self, moment: Moment) -> Violation | None:
        """See `Oracle`."""
        place = self._places.at(moment)
        aside = self._aside(place, moment)
        why = self._unknown(place, aside)
        if why:
            self._blind = self._blind or f"{why} at {moment.time:.1f} s"
            self._since = None
            return None
        limit = float(self._limits[place.row]) if aside is None else aside.speed_limit
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
        return self._findings.judgement(self._blind)

    def _aside(self, place: Place, moment: Moment) -> Lane | None:
        """The lane beside the route's that the ego is on, of the same road; None where it is not on one."""
        route, row = self._places.route, place.row
        if not place.is_on_route or route.lane_right[row] <= place.offset <= route.lane_left[row]:
            return None
        lanes = self._places.roadmap.lanes
        own, found = (lanes.get(name or "") for name in (route.lane_ids[row], self._places.lane(moment)))
        if own is None or found is None or own.is_internal or own.edge != found.edge:
            return None
        return found

    def _unknown(self, place: Place, aside: Lane | None) -> str:
        """Why the limit at a place is not known; empty if it is."""
        if not place.is_on_route:
            return "the ego was off its route"
        lane = self._signed[place.row]
        if aside is not None:
            lane = aside.id if aside.id in self._places.signed_lanes else ""
        return f"the ego was on lane {lane}, whose limit a variable sign sets," if lane else ""


def _signed(places: Places) -> list[str]:
    """For each row of the route the lane with a variable sign that sets the limit there; empty without one."""
    lanes: list[str] = []
    for lane in places.route.lane_ids:
        is_within = is_inner(lane) and lane not in places.signed_lanes
        lanes.append(lanes[-1] if is_within and lanes else lane if lane in places.signed_lanes else "")
    return lanes


def _legal_limits(route: Route) -> Floats:
    """Limit [m/s] for each row of the route."""
    limits = np.array(route.speed_limits, dtype=np.float64)
    for row in range(1, len(limits)):
        if is_inner(route.lane_ids[row]):
            limits[row] = max(limits[row], limits[row - 1])
    return limits
