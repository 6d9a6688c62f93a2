"""Vehicle dynamic states: the buckets over which messages of different runs are matched.

State(p, v, a) = (floor(p / p_unit), floor(v / v_unit), floor(a / a_unit)) of the true ego when a
message was made (Wan et al., section on vehicle dynamic state-based analysis). p is the distance along
the ego's route, which orders the states of one drive.
"""

import math
from typing import NamedTuple

import msgspec


class StateUnits(msgspec.Struct, frozen=True):
    """Bucket sizes: small enough to hold a few 10 Hz messages, large enough to meet again in a re-run."""

    position: float = 2.0  # [m]
    speed: float = 1.0  # [m/s]
    acceleration: float = 1.0  # [m/s^2]


class State(NamedTuple):
    """One bucket."""

    position: int
    speed: int
    acceleration: int

    def __str__(self) -> str:
        return f"{self.position}:{self.speed}:{self.acceleration}"


UNITS = StateUnits()


def state_of(station: float, speed: float, acceleration: float, units: StateUnits = UNITS) -> State:
    """The bucket of an ego at `station` [m] of its route with `speed` [m/s] and `acceleration` [m/s^2]."""
    return State(
        math.floor(station / units.position),
        math.floor(speed / units.speed),
        math.floor(acceleration / units.acceleration),
    )
