"""Red light: no signal stop line is passed on red."""

from dvca_sumo.messages import SignalColour
from dvca_sumo.oracles.findings import Findings
from dvca_sumo.oracles.lines import PassedLines
from dvca_sumo.oracles.place import Places
from dvca_sumo.roadmap import Control
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Category, Ending, Judgement, Violation


class RedLight:
    """Kind "red_light": the front bumper passes the line on red and is beyond the tolerance while it is still red.

    Yellow is allowed, and so is a line passed in the step in which the signal turned red. Where the
    bumper stops within the tolerance, `StopAtLine` judges. Cannot tell of a line that was passed while
    the colour of its signal was not recorded, or while the ego was off its route.
    """

    kind = "red_light"

    def __init__(self, places: Places, thresholds: Thresholds) -> None:
        self._findings = Findings(self.kind, Category.TRAFFIC_RULE, places)
        self._places = places
        self._tolerance = thresholds.red_light_tolerance
        self._lines = PassedLines(places, (Control.SIGNAL,))
        self._blind = ""

    def observe(self, moment: Moment) -> Violation | None:
        """See `Oracle`."""
        station = self._places.at(moment).station
        for passed in self._lines.observe(moment):
            if not passed.colours:
                self._blind = f"the colour of {passed.line.signal_id} was not known at {moment.time:.1f} s"
        for passed in self._lines.passed:
            signal = passed.line.signal_id or ""
            if passed.is_settled or station - passed.line.station <= self._tolerance:
                continue
            passed.is_settled = True
            if passed.was_red and moment.signals.get(signal) == SignalColour.RED:
                beyond = station - passed.line.station
                detail = f"passed the stop line of {signal} on red"
                self._findings.add(self._findings.made(moment, detail, beyond, self._tolerance))
        return self._findings.next()

    def conclude(self, ended: Ending) -> Judgement:  # noqa: ARG002  the answer holds for whatever part was seen
        """See `Oracle`."""
        return self._findings.judgement(self._blind or self._lines.blind)
