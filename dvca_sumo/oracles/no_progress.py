"""No progress: the ego stays where it is for a long time without a reason."""

import math

import numpy as np

from dvca_sumo.messages import SignalColour
from dvca_sumo.oracles.ahead import ahead
from dvca_sumo.oracles.findings import Findings
from dvca_sumo.oracles.place import Places
from dvca_sumo.roadmap import Control
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Category, Ending, Judgement, Violation

_SIGNAL_REACH = 40.0  # [m] a red or yellow signal so near ahead is a reason to wait
_OBJECT_REACH = 15.0  # [m] and so is an object in the way,
_OBJECT_MARGIN = 0.5  # [m] the way being so much wider than the ego on each side,
_JUNCTION_REACH = 15.0  # [m] and traffic at a junction or crossing so near ahead,
_TRAFFIC_REACH = 50.0  # [m] so near to the ego
_TRAFFIC_SPEED = 0.5  # [m/s] and so fast at least
_SIGN_REACH = 5.0  # [m] a stop sign so near ahead is one, too, to an ego that stands
_SIGN_TIME = 2.0  # [s] not longer than so


class NoProgress:
    """Kind "no_progress": less than the distance moved in the time, and no reason to wait in all that time.

    One for each standstill. Standing at the destination is a reason. Cannot tell of a run cut short
    during an unexplained standstill or before the time has passed once, nor of a standstill that only
    a signal of unknown colour would explain.
    """

    kind = "no_progress"

    def __init__(self, places: Places, thresholds: Thresholds) -> None:
        self._findings = Findings(self.kind, Category.MISSION, places)
        self._places = places
        self._thresholds = thresholds
        route = places.route
        spans = [(line.station - _JUNCTION_REACH, line.exit_station) for line in route.stop_lines]
        spans += [(crossing.start_station - _JUNCTION_REACH, crossing.end_station) for crossing in route.crossings]
        self._conflicts = spans
        self._signs = [line for line in route.stop_lines if line.control in (Control.STOP, Control.ALL_WAY_STOP)]
        self._signals = [line for line in route.stop_lines if line.control is Control.SIGNAL]
        self._standing_since = math.inf  # [s]
        self._anchor: tuple[float, float] | None = None
        self._begun = self._now = 0.0  # [s]
        self._idle_since = 0.0  # [s] neither progress nor a reason since
        self._unexplained_since = 0.0  # [s] likewise, taking signals of unknown colour for no reason
        self._is_reported = False
        self._blind = ""

    def observe(self, moment: Moment) -> Violation | None:
        """See `Oracle`."""
        here, self._now = (moment.ego.x, moment.ego.y), moment.time
        is_standing = moment.ego.speed <= self._thresholds.standing_speed
        self._standing_since = min(self._standing_since, moment.time) if is_standing else math.inf
        if self._anchor is None:
            self._begun = moment.time
        if self._anchor is None or math.dist(here, self._anchor) >= self._thresholds.no_progress_distance:
            self._anchor = here
            self._is_reported = False
            self._idle_since = self._unexplained_since = moment.time
            return self._findings.next()
        if self.has_reason(moment):
            self._idle_since = self._unexplained_since = moment.time
        elif self._is_signal_unknown(moment):
            self._idle_since = moment.time
        self._judge(moment)
        return self._findings.next()

    def conclude(self, ended: Ending) -> Judgement:
        """See `Oracle`."""
        standstill = self._now - self._idle_since
        is_short = self._now - self._begun < self._thresholds.no_progress_time
        if ended is Ending.CUT and (is_short or standstill > 1.0):
            return self._findings.judgement(f"the run was cut after {self._now - self._begun:.1f} s")
        return self._findings.judgement(self._blind)

    def _judge(self, moment: Moment) -> None:
        limit, idle = self._thresholds.no_progress_time, moment.time - self._idle_since
        if idle >= limit - 1e-9 and not self._is_reported:
            self._is_reported = True
            detail = f"stood for {idle:.0f} s without a reason"
            self._findings.add(self._findings.made(moment, detail, idle, limit))
        elif moment.time - self._unexplained_since >= limit - 1e-9:
            self._blind = f"the colour of the signal ahead was not known at {moment.time:.1f} s"

    def has_reason(self, moment: Moment) -> bool:
        """Whether there is a reason to stand: destination, signal, stop sign, something in the way or crossing."""
        place, route = self._places.at(moment), self._places.route
        if abs(place.station - route.destination) <= self._thresholds.destination_tolerance:
            return True
        if self._colour_ahead(moment) in {SignalColour.RED, SignalColour.YELLOW}:
            return True
        if self._is_at_sign(place.station) and moment.time - self._standing_since < _SIGN_TIME:
            return True
        if any(begin <= place.station <= end for begin, end in self._conflicts) and _has_traffic(moment):
            return True
        return bool(ahead(self._places, moment, _OBJECT_REACH, _OBJECT_MARGIN).rows.size)

    def _is_at_sign(self, station: float) -> bool:
        return any(0.0 <= line.station - station <= _SIGN_REACH for line in self._signs)

    def _is_signal_unknown(self, moment: Moment) -> bool:
        return self._colour_ahead(moment) is None

    def _colour_ahead(self, moment: Moment) -> SignalColour | None:
        """What the next signal in reach shows, None if that is not known; OFF where there is none."""
        station = self._places.at(moment).station - self._thresholds.red_light_tolerance
        for line in self._signals:
            if line.station >= station:
                is_near = line.station - station <= _SIGNAL_REACH
                return moment.signals.get(line.signal_id or "") if is_near else SignalColour.OFF
        return SignalColour.OFF


def _has_traffic(moment: Moment) -> bool:
    """Whether anything moves near the ego."""
    objects = moment.objects
    away = np.hypot(objects.boxes[:, 0] - moment.ego.x, objects.boxes[:, 1] - moment.ego.y)
    speeds = np.hypot(objects.velocities[:, 0], objects.velocities[:, 1])
    return bool(((away < _TRAFFIC_REACH) & (speeds > _TRAFFIC_SPEED)).any())
