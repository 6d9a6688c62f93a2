"""What becomes of those who share the roads: SUMO's own vehicles in a simulation, with egos among them or without.

Many scenarios jam by themselves, so these figures say something only beside those of a simulation without egos. Those
who stand behind one another stand for one reason: chance is in how many queues there are, not in how long they get.
"""

import math
from collections.abc import Iterable

import msgspec

from dvca_sumo.screen.jams import LONG
from dvca_sumo.world import World

_PERIOD = 10.0  # [s] between two looks at who stands
_RIGHT_AHEAD = 15.0  # [m]


class Neighbours(msgspec.Struct, frozen=True):
    """SUMO's own vehicles, all together."""

    hours: float  # [h] that they were under way
    stood: int  # of them stood for `LONG`, without a stop of their own
    queues: int  # they stood in, each right behind another; a ring of them is one
    teleports: int


class Neighbourhood:
    """The watch over one simulation."""

    def __init__(self) -> None:
        self._hours = 0.0
        self._behind: dict[str, str | None] = {}  # who has stood for `LONG`: whom of them who stood, then
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
        for name, wait in waits.items():
            if wait >= LONG and name not in self._behind:
                leader = world.leader(name, _RIGHT_AHEAD)
                self._behind[name] = leader if leader is not None and waits.get(leader, 0.0) > 0.0 else None
        self._looked = world.time

    def seen(self) -> Neighbours:
        """What has been seen so far."""
        return Neighbours(self._hours, len(self._behind), _queues(self._behind), self._teleports)


def _queues(behind: dict[str, str | None]) -> int:
    """How many separate groups those are in who stood `behind` others, or none."""
    ahead: dict[str, str] = {}

    def first(name: str) -> str:
        while name in ahead:
            name = ahead[name]
        return name

    for name, leader in behind.items():
        if leader is not None and first(leader) != first(name):
            ahead[first(name)] = first(leader)
    return len({first(name) for name in behind})


def together(parts: Iterable[Neighbours]) -> Neighbours:
    """Those of several simulations."""
    seen = list(parts)
    return Neighbours(
        hours=sum(one.hours for one in seen),
        stood=sum(one.stood for one in seen),
        queues=sum(one.queues for one in seen),
        teleports=sum(one.teleports for one in seen),
    )
