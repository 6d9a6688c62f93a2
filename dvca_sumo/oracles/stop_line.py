"""Stop lines: stop at a stop sign, and do not come to rest beyond the line on red."""

import math

from dvca_sumo.messages import SignalColour
from dvca_sumo.oracles.ahead import ahead
from dvca_sumo.oracles.findings import Findings
from dvca_sumo.oracles.lines import PassedLine, PassedLines
from dvca_sumo.oracles.place import Places
from dvca_sumo.roadmap import Control
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Category, Ending, Judgement, Violation

_NEAR_LINE = 5.0  # [m] resting farther beyond the line is waiting inside the junction, not stopping at the line
_QUEUE_GAP = 10.0  # [m] an object so near ahead is why the ego rests


class StopAtLine:
    """Kind "stop_line", once for each line.

    At stop signs and all-way stops: the front bumper passes the line by more than the tolerance
    without having been slower than the stop speed in the zone before it. At signals: the ego passes
    the line on yellow or red and then rests beyond it on red, up to 5 m, with nothing in its way.
    Cannot tell of a signal whose colour was not recorded, or of lines passed off the route.
    """

    kind = "stop_line"

    def __init__(self, places: Places, thresholds: Thresholds) -> None:
        self._findings = Findings(self.kind, Category.TRAFFIC_RULE, places)
        self._places = places
        self._thresholds = thresholds
        self._signs = PassedLines(places, (Control.STOP, Control.ALL_WAY_STOP))
        self._signals = PassedLines(places, (Control.SIGNAL,))
        self._slowest = math.inf  # [m/s] in the zone of the next sign
        self._resting_since: float | None = None  # [s]
        self._blind = ""

    def observe(self, moment: Moment) -> Violation | None:
        """See `Oracle`."""
        self._observe_signs(moment)
        self._observe_signals(moment)
        return self._findings.next()

    def conclude(self, ended: Ending) -> Judgement:  # noqa: ARG002  the answer holds for whatever part was seen
        """See `Oracle`."""
        return self._findings.judgement(self._blind or self._signs.blind)

    def _observe_signs(self, moment: Moment) -> None:
        self._signs.observe(moment)
        station = self._places.at(moment).station
        passed = next((each for each in self._signs.passed if not each.is_settled), None)
        line = passed.line if passed else self._signs.next_line
        if line is None:
            return
        if passed and station - line.station > self._thresholds.stop_line_tolerance:
            passed.is_settled = True
            if self._slowest >= self._thresholds.stop_speed:
                detail = f"passed the {line.control.replace('_', ' ')} line of {line.lane} without a stop"
                violation = self._findings.made(moment, detail, self._slowest, self._thresholds.stop_speed)
                self._findings.add(violation)
            self._slowest = math.inf
        elif line.station - station <= self._thresholds.stop_line_zone:
            self._slowest = min(self._slowest, moment.ego.speed)

    def _observe_signals(self, moment: Moment) -> None:
        for passed in self._signals.observe(moment):
            if not passed.colours:
                self._blind = f"the colour of {passed.line.signal_id} was not known at {moment.time:.1f} s"
        if abs(moment.ego.speed) > self._thresholds.standing_speed:
            self._resting_since = None
            return
        self._resting_since = moment.time if self._resting_since is None else self._resting_since
        if moment.time - self._resting_since < self._thresholds.stop_line_dwell - 1e-9:
            return
        for passed in self._signals.passed:
            if not passed.is_settled and self._rests_beyond(moment, passed):
                passed.is_settled = True
                beyond = self._places.at(moment).station - passed.line.station
                detail = f"stopped {beyond:.1f} m beyond the line of {passed.line.signal_id} on red"
                violation = self._findings.made(moment, detail, beyond, self._thresholds.stop_line_tolerance)
                self._findings.add(violation)

    def _rests_beyond(self, moment: Moment, passed: PassedLine) -> bool:
        line = passed.line
        beyond = self._places.at(moment).station - line.station
        return (
            self._thresholds.stop_line_tolerance < beyond <= _NEAR_LINE
            and passed.was_stop
            and moment.signals.get(line.signal_id or "") == SignalColour.RED
            and not ahead(self._places, moment, _QUEUE_GAP, margin=0.5).rows.size
        )
