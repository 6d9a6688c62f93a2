"""Lanes, and how traffic moves from one to the next: what a net says, as frozen values."""

import math

import msgspec

from dvca_sumo.geometry.polyline import Polyline

TURNS_BACK = ("t", "T")  # directions of movements, by SUMO's letters


def is_inner(lane: str) -> bool:
    """Whether a lane is one of a junction, by its name."""
    return lane.startswith(":")


class RoadMapError(ValueError):
    """The net cannot be used; says in one line which file and why."""


class Lane(msgspec.Struct, frozen=True, eq=False, gc=False):
    """One lane of the net, or one pedestrian crossing.

    Neighbours are where the ego's class may drive in the same direction. Successors are for all
    classes, and lead through internal lanes where the net has them.
    """

    id: str
    edge: str
    index: int
    line: Polyline  # centre line in driving direction, as long as the drawn lane
    length: float  # [m] as SUMO counts lane positions: may differ from line.length
    width: float  # [m]
    speed_limit: float  # [m/s] by law
    is_limit_mapped: bool  # whether the map that an ADS drives on has the limit, too
    is_motorway: bool
    is_internal: bool  # on a junction
    is_crossing: bool  # for pedestrians across the road
    is_pavement: bool  # for pedestrians alone, beside or away from the road
    is_drivable: bool  # for the vehicle class the map was loaded for
    is_for_buses: bool  # whether they may use it, maybe with others
    is_for_bicycles: bool
    left: str | None
    right: str | None
    successors: tuple[str, ...]

    @property
    def mapped_limit(self) -> float:
        """The speed limit [m/s] as far as the map of an ADS goes: infinite where that has none."""
        return self.speed_limit if self.is_limit_mapped else math.inf

    def station(self, position: float) -> float:
        """Where on `line` SUMO's lane position [m] lies [m], within the lane."""
        return min(max(position / self.length, 0.0), 1.0) * self.line.length


class Movement(msgspec.Struct, frozen=True, eq=False, gc=False):
    """A way across a junction: one connection of the net (for pedestrians: a crossing)."""

    junction: str
    index: int  # the junction's link index, a bit in foes and responses
    from_lane: str
    to_lane: str
    internal: tuple[str, ...]  # lanes on the junction in driving order, none in a net without
    direction: str  # SUMO's letter: s straight, t turnaround, l, r, L, R, ...
    state: str  # SUMO's letter of right of way: M, m, =, s, w, ...
    signal_id: str | None  # "tls/linkIndex"
    signal_group: str | None  # the same for all signals that show the same at any time
    is_drivable: bool  # for the vehicle class the map was loaded for

    @property
    def lanes(self) -> tuple[str, ...]:
        """Where traffic on this movement is found: approach and internal lanes."""
        return (self.from_lane, *self.internal)


class Junction(msgspec.Struct, frozen=True, eq=False):
    """Who meets whom on a junction, and who waits for whom."""

    id: str
    movements: tuple[Movement, ...]  # by link index
    foes: dict[int, str]  # by link index: bits, that of link 0 last; "1" where paths conflict
    responses: dict[int, str]  # likewise; "1" where the other has priority
    crossings: tuple[str, ...]  # lane ids of pedestrian crossings
    outline: tuple[tuple[float, float], ...]  # [m] as drawn; () in a net that does not
    walking: dict[str, tuple[tuple[float, float], ...]]  # [m] by lane id: outlines of its areas for people on foot

    def conflicting(self, movement: Movement) -> frozenset[str]:
        """Lanes of all movements whose paths conflict with `movement`'s."""
        return frozenset(lane for one in self.conflicting_movements(movement) for lane in one.lanes)

    def conflicting_movements(self, movement: Movement) -> tuple[Movement, ...]:
        """All movements whose paths conflict with `movement`'s, by link index."""
        return self._marked(self.foes.get(movement.index, ""))

    def prior_movements(self, movement: Movement) -> tuple[Movement, ...]:
        """The movements that have priority over `movement`, by link index."""
        return self._marked(self.responses.get(movement.index, ""))

    def _marked(self, bits: str) -> tuple[Movement, ...]:
        return tuple(movement for bit, movement in zip(reversed(bits), self.movements, strict=False) if bit == "1")
