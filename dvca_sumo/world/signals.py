"""What the signal heads along a route show, in the project's colours."""

from dvca_sumo.messages import SignalColour

_COLOURS = {
    "r": SignalColour.RED,
    "u": SignalColour.RED,
    "y": SignalColour.YELLOW,
    "Y": SignalColour.YELLOW,
    "G": SignalColour.GREEN,
    "g": SignalColour.PERMISSIVE,
    "s": SignalColour.PERMISSIVE,
    "o": SignalColour.OFF,
    "O": SignalColour.OFF,
}


class Signals:
    """Signal heads of one route; what they show is put together anew only when a light has changed."""

    def __init__(self, signal_ids: tuple[str, ...]) -> None:
        parts = [(signal, *signal.rpartition("/")[::2]) for signal in signal_ids]
        self._heads = [(signal, light, int(link)) for signal, light, link in parts]
        self.lights = tuple(dict.fromkeys(light for _, light, _ in self._heads))
        self._states: dict[str, str] = {}
        self._colours: dict[str, SignalColour] = {}

    def showing(self, states: dict[str, str]) -> dict[str, SignalColour]:
        """Colours by signal id, `states` being SUMO's by traffic light."""
        if states != self._states:
            self._states = states
            self._colours = {signal: _COLOURS[states[light][link]] for signal, light, link in self._heads}
        return self._colours
