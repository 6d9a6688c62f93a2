"""What is asked of SUMO's road net, by the names of lanes and roads.

SUMO names a lane after its edge, and the edge of a junction's lane after the junction: ":78_12_0".
"""

from collections.abc import Collection, Iterable
from typing import NamedTuple, Protocol

import shapely

_NEAR = 0.5  # [m] along a line, before and after a place on it, between which it is taken to be straight


class Link(NamedTuple):
    """How one gets from a lane to a lane of a road."""

    to: str
    via: str  # the next lane of the junction on the way there, "" where there is none
    turns_back: bool = False


class Connections(Protocol):
    """How the lanes of a road net hang together; the answers never change."""

    def lanes(self) -> Iterable[str]:
        """All of them."""

    def links(self, lane: str) -> Iterable[Link]:
        """How one leaves a lane."""

    def foes(self, lane: str) -> Collection[str]:
        """The lanes whose drivers one on a junction's lane minds."""

    def adjacent(self, lane: str) -> list[str]:
        """The lanes to the right and left of a lane, of the same road."""

    def junctions_of(self, road: str) -> tuple[str, str]:
        """Where a road begins and ends."""


class Net(Connections, Protocol):
    """A road net; the answers never change."""

    def allowed(self, lane: str) -> Collection[str]:
        """The classes of those who may use a lane; none where all may."""

    def middle(self, lane: str) -> tuple[shapely.LineString, float]:
        """A lane's centre line, and its width [m]."""

    def lanes_of(self, road: str) -> list[str]:
        """The lanes of a road, from the right."""


def edge_of(lane: str) -> str:
    """The edge of a lane."""
    return lane.rpartition("_")[0]


def junction_of(lane: str) -> str:
    """The junction of one of its lanes, with the colon that begins their names."""
    return edge_of(edge_of(lane))


def is_left_of(middle: shapely.LineString, x: float, y: float) -> bool:
    """Whether a place [m] is on the left of a lane's centre line."""
    along = middle.project(shapely.Point(x, y))
    before, after = middle.interpolate(max(along - _NEAR, 0.0)), middle.interpolate(along + _NEAR)
    return bool((after.x - before.x) * (y - before.y) > (after.y - before.y) * (x - before.x))


def is_for_cars(net: Net, lane: str) -> bool:
    """Whether cars may use a lane."""
    return "passenger" in (net.allowed(lane) or ("passenger",))
