"""How much of a lane a body takes up that is beside the one SUMO has it on.

SUMO has a vehicle on one lane. Its drivers on another one do not see a car that stands across both, half-way through
turning back, between two lanes of a queue, where ways on a junction lie side by side, or where the net draws one lane
over another, and drive into it.
"""

import math
from collections.abc import Sequence

import shapely

from dvca_sumo.geometry.boxes import box_of, corners
from dvca_sumo.messages import VehicleShape
from dvca_sumo.truth import EgoTruth
from dvca_sumo.world.net import Net, edge_of, is_for_cars, junction_of
from dvca_sumo.world.ways import End, Ways

SLOW = 5.0  # [m/s] above, an ego is on its way from one lane to the other, and soon on one
_ROOM = 0.4  # [m] into a lane: up to that, a car in its middle has room to pass
_SHORTEST = 0.1  # [m] of a lane, less is nobody's way


class Straddling:
    """Of which lanes of a net an ego is in the way, beside the one SUMO has it on."""

    def __init__(self, net: Net, ways: Ways) -> None:
        self._net = net
        self._ways = ways
        self._overlaid: dict[End, tuple[list[str], list[str]]] = {}  # see `_lying_on`
        self._rooms: dict[str, float] = {}  # [m] of lanes, see `_room`

    def parts(
        self, truth: EgoTruth, shape: VehicleShape, ends: Sequence[End], found: str, *, goes: bool
    ) -> dict[str, tuple[float, float]]:
        """From where to where on which lanes an ego is in the way [m].

        Args:
            truth: How it moves now.
            shape: Its body.
            ends: Where its front and its rear axle are on its route; none: it is on no second lane.
            found: The lane that SUMO has it on.
            goes: Whether it means to go on. Else it may wait for those who stop for it in its own way.
        """
        around = self._rooms_around(ends, found, goes=goes) if ends else {}
        rooms = {lane: room for lane, room in around.items() if lane != found}
        if not rooms:
            return {}
        body = _outline(truth, shape)
        parts = {lane: taken(body, *self._net.middle(lane), room) for lane, room in rooms.items()}
        return {lane: part for lane, part in parts.items() if part is not None}

    def _rooms_around(self, ends: Sequence[End], found: str, *, goes: bool) -> dict[str, float]:
        """Lanes whose drivers do not see a body at its route's `ends`, and how far into them it may be [m].

        Those who drive across the road that its rear is on see who waits on the junction, on a way that theirs meets.
        """
        front, rear = ends
        beside = [*self._ways.beside(front)]
        for end in dict.fromkeys(ends):
            if not end.origin:
                near = self._net.adjacent(end.lane)
                beside += [*near, end.lane] if found in near else near
            across, along = self._lying_on(end)
            beside += [lane for lane in across if found not in self._net.foes(lane)]
            beside += along if goes else []
        # Who comes by the ego's tail cuts bends; who comes by its front it may be waiting for.
        return {lane: self._room(lane) for lane in beside} | dict.fromkeys(self._ways.behind(front, rear), 0.0)

    def _room(self, lane: str) -> float:
        """How far into a lane a body may be, and not in the way [m]: buses fill theirs."""
        if lane not in self._rooms:
            is_for_buses = not is_for_cars(self._net, lane) and "bus" in self._net.allowed(lane)
            self._rooms[lane] = 0.0 if is_for_buses else _ROOM
        return self._rooms[lane]

    def _lying_on(self, end: End) -> tuple[list[str], list[str]]:
        """Lanes over an end's lane, by which one gets onward, and whose drivers do not look for who is on it.

        The first ones lead across a road, over the junctions at its ends, from and to elsewhere. The second ones lead
        along or against it: of a road's lane, those that the first ones lead to, but for the same street's other
        direction; of a junction's lane, those whose drivers do not mind it by the net, which has some ways side by side
        that are drawn one over the other.
        """
        if end not in self._overlaid:
            across, along = ([], self._onward_beside(end)) if end.origin else self._onward_past(edge_of(end.lane))
            self._overlaid[end] = self._over(end.lane, across), self._over(end.lane, along)
        return self._overlaid[end]

    def _over(self, lane: str, others: list[str]) -> list[str]:
        """Those of the others that lie over a lane."""
        area = _strip(*self._net.middle(lane))
        return [other for other in dict.fromkeys(others) if _strip(*self._net.middle(other)).intersects(area)]

    def _onward_beside(self, end: End) -> list[str]:
        """The lanes of a junction that lead onward from elsewhere than an end on it, whose drivers do not mind it."""
        own = {lane for way in self._ways.ways_from(end.origin) for lane in way}
        others = (lane for lane in self._ways.onward_lanes(junction_of(end.lane)) if lane not in own)
        return [lane for lane in others if end.lane not in self._net.foes(lane)]

    def _onward_past(self, road: str) -> tuple[list[str], list[str]]:
        """The lanes of the junctions at a road's ends that lead onward, from and to elsewhere, and where they lead."""
        net, ways = self._net, self._ways
        begin, end = net.junctions_of(road)
        own = {lane for each in net.lanes_of(road) for way in ways.ways_from(each) for lane in way}
        lanes = [lane for name in (begin, end) for lane in ways.onward_lanes(f":{name}") if lane not in own]
        onward = [lane for lane in lanes if edge_of(ways.lane_after(lane)) != road]
        after = [ways.lane_after(lane) for lane in onward]
        return onward, [lane for lane in after if net.junctions_of(edge_of(lane)) != (end, begin)]


def taken(
    body: shapely.Polygon, middle: shapely.LineString, width: float, room: float = _ROOM
) -> tuple[float, float] | None:
    """From where to where a body is in the way on a lane of `width` [m], along its centre line [m]; None: it is not.

    `room`: how far into the lane it may be, and not in the way [m].
    A body that is on what comes before the lane, too, begins at less than 0: as far back as it reaches.
    """
    width = max(width - 2.0 * room, 0.0)
    if body.distance(middle) >= 0.5 * width:
        return None
    way = _strip(middle, width)
    stations = shapely.line_locate_point(middle, shapely.points(shapely.get_coordinates(way.intersection(body))))
    begin, end = float(stations.min(initial=math.inf)), float(stations.max(initial=0.0))
    if end - begin <= _SHORTEST:
        return None
    if begin > _SHORTEST:
        return begin, end
    origin, ahead = shapely.get_coordinates(shapely.line_interpolate_point(middle, (0.0, end)))
    along = (shapely.get_coordinates(body) - origin) @ (ahead - origin) / math.dist(ahead, origin)
    return min(begin, float(along.min())), end


def _outline(truth: EgoTruth, shape: VehicleShape) -> shapely.Polygon:
    """Where an ego's body is."""
    return shapely.Polygon(corners(box_of(truth.x, truth.y, truth.heading, shape)[None])[0])


def _strip(middle: shapely.LineString, width: float) -> shapely.Polygon:
    """A lane of `width` [m] along its centre line."""
    return middle.buffer(0.5 * width, cap_style="flat", join_style="mitre")
