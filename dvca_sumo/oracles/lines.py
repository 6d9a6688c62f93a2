"""Stop lines that the ego's front bumper has passed."""

from collections.abc import Collection

from dvca_sumo.messages import SignalColour
from dvca_sumo.oracles.place import Places
from dvca_sumo.roadmap import Control, StopLine
from dvca_sumo.truth import Moment


class PassedLine:
    """A stop line behind the front bumper, and what its signal showed when it was passed."""

    def __init__(self, line: StopLine, colours: tuple[SignalColour, ...]) -> None:
        self.line = line
        self.colours = colours  # before and after the step in which it was passed; empty if one is not known
        self.is_settled = False  # the oracle that follows it has come to its conclusion

    @property
    def was_red(self) -> bool:
        """Whether it was red during the whole step in which the line was passed."""
        return bool(self.colours) and all(colour == SignalColour.RED for colour in self.colours)

    @property
    def was_stop(self) -> bool:
        """Whether it was yellow or red when the line was passed."""
        return bool(self.colours) and self.colours[0] in {SignalColour.RED, SignalColour.YELLOW}


class PassedLines:
    """Follows the stop lines of some kinds of control along a route.

    Lines behind the place where the ego starts, or comes back to its route, do not count.
    """

    def __init__(self, places: Places, controls: Collection[Control]) -> None:
        self._places = places
        self._ahead = [line for line in places.route.stop_lines if line.control in controls]
        self._signals: dict[str, SignalColour] | None = None  # at the moment before
        self.passed: list[PassedLine] = []
        self.blind = ""  # why a passed line may have been missed

    def observe(self, moment: Moment) -> list[PassedLine]:
        """The lines passed since the moment before, also added to `passed`."""
        place, before = self._places.at(moment), self._signals
        if not place.is_on_route:
            self.blind = self.blind or f"the ego was off its route at {moment.time:.1f} s"
            self._signals = None
            return []
        self._signals = moment.signals
        if before is None:
            self._ahead = [line for line in self._ahead if line.station >= place.station]
            return []
        fresh = []
        while self._ahead and self._ahead[0].station < place.station:
            line = self._ahead.pop(0)
            name = line.signal_id or ""
            is_known = name in before and name in moment.signals
            colours = (before[name], moment.signals[name]) if is_known else ()
            fresh.append(PassedLine(line, colours))
        self.passed += fresh
        return fresh

    @property
    def next_line(self) -> StopLine | None:
        """The nearest line ahead."""
        return self._ahead[0] if self._ahead else None
