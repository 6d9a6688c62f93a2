"""What becomes of those who share the roads: SUMO's own vehicles in a simulation, with egos among them or without.

Many scenarios jam by themselves, so these figures say something only beside those of a simulation without egos.
"""

import math
from collections.abc import Iterable

import msgspec

from dvca_sumo.screen.jams import LONG
from dvca_sumo.world import World

_PERIOD = 10.0  # [s] between two looks at who stands


class Neighbours(msgspec.Struct, frozen=True):
    """SUMO's own vehicles, all together."""

    hours: float  # [h] that they were under way
    stood: int  # of them stood for `LONG`, without a stop of their own
    teleports: int


class Neighbourhood:
    """The watch over one simulation."""

    def __init__(self) -> None:
        self._hours = 0.0
        self._stood: set[str] = set()
        self._teleports = 0
        self._looked = math.nan  # [s]

    def see(self, world: World) -> None:
        """Take in the world after a step."""
        self._teleports += len(world.teleported())
        if world.time - self._looked < _PERIOD:
            return
        waits = world.waits()
        if not math.isnan(self._looked):
            self._hours += len(waits) * (world.time - self._looked) / 3600.0
        self._stood |= {name for name, wait in waits.items() if wait >= LONG}
        self._looked = world.time

    def seen(self) -> Neighbours:
        """What has been seen so far."""
        return Neighbours(self._hours, len(self._stood), self._teleports)


def together(parts: Iterable[Neighbours]) -> Neighbours:
    """Those of several simulations."""
    seen = list(parts)
    return Neighbours(
        hours=sum(one.hours for one in seen),
        stood=sum(one.stood for one in seen),
        teleports=sum(one.teleports for one in seen),
    )
