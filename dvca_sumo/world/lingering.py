"""How long SUMO's drivers and people wait for an ego that stands.

SUMO takes who stands to set off at once. Of two who wait for each other, where the ego has priority, neither would ever
move: so after a while it is told that the ego does not mean to go, as everybody there can see.
"""

import math

_PATIENCE = 20.0  # [s]: who gives way sooner fills the place that an ego in dense traffic waits for


class Lingering:
    """One ego's, at one world step after another."""

    def __init__(self) -> None:
        self._since = math.inf  # [s] when it came to stand

    def is_long(self, time: float, *, waits: bool) -> bool:
        """Whether at `time` [s] it has waited for so long that others need not wait for it."""
        self._since = min(self._since, time) if waits else math.inf
        return time - self._since >= _PATIENCE
