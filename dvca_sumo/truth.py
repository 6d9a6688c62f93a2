"""Frozen snapshots of the simulator's truth.

Made by `world`, judged by `oracles`, measured by the stack's sensors, and known to the idealized
substitutes. No other part of a stack may be given one.
"""

import msgspec

from dvca_sumo.messages import Floats, Integers, SignalColour, VehicleShape

SURROUNDINGS = 150.0  # [m] around an ego, within which others are told of
DRAWN = "polygon:"  # before the names of what is drawn as an area or a line


def part_of(name: str, number: int) -> str:
    """The id of one of several parts of a drawn thing."""
    return f"{name}#{number}"


def whole(name: str) -> str:
    """The id of a drawn thing, of that of one of its parts; of everything else it is the same."""
    return name.rpartition("#")[0] if name.startswith(DRAWN) and "#" in name else name


class EgoTruth(msgspec.Struct, frozen=True, gc=False):
    """The ego's true motion at one instant; the pose is that of the rear axle centre."""

    time: float  # [s]
    x: float  # [m]
    y: float  # [m]
    heading: float  # [rad]
    speed: float  # [m/s]
    acceleration: float  # [m/s^2] along the heading
    yaw_rate: float  # [rad/s]
    steering: float  # [rad] front wheel angle


class ObjectsTruth(msgspec.Struct, frozen=True):
    """Every other traffic object near the ego at one instant."""

    time: float  # [s]
    ids: tuple[str, ...]  # (n,) SUMO ids, prefixed "person:" / "poi:" / "polygon:" unless a vehicle
    classes: Integers  # (n,) ObjectClass
    boxes: Floats  # (n, 5) x, y of the centre, heading, length, width
    velocities: Floats  # (n, 2) [m/s]
    lanes: tuple[str, ...] = ()  # (n,) lane each one is on, "" off the road; () when it was not asked for


class Moment(msgspec.Struct, frozen=True):
    """All truth about one ego at one instant."""

    ego: EgoTruth
    shape: VehicleShape
    objects: ObjectsTruth
    signals: dict[str, SignalColour]  # by signal id, those of the ego's route

    @property
    def time(self) -> float:
        """In seconds, SUMO's clock."""
        return self.ego.time
