"""Which lanes to drive along a list of edges: as few lane changes as possible, where there is room for them."""

import math
from collections.abc import Iterator, Sequence

import msgspec

from dvca_sumo.roadmap.beside import TURN, alongside, faster
from dvca_sumo.roadmap.lanes import Lane, Movement
from dvca_sumo.roadmap.reading import NetContents
from dvca_sumo.roadmap.route import RouteError

_CHANGE_TIME = 3.0  # [s] a comfortable change to the next lane takes
_SHORTEST_CHANGE = 30.0  # [m] it takes at low speed
_LEAST_ROOM = 5.0  # [m] below this a change is no longer driving
_CRAMPED = 5.0  # lane changes that one without any room is worth
_LATER = 1e-4  # lane changes that waiting one edge is worth: of equal ways, change early
_ALONE = 1e-6  # lane changes that a junction without a faster lane beside is worth: of equal ways, leave it free


class Leg(msgspec.Struct, frozen=True, eq=False):
    """One edge of the route: entered on one lane, left on the same or another."""

    entry: Lane
    exit: Lane
    movement: Movement | None  # onto the next edge; none on the last


class _Way(msgspec.Struct, frozen=True, eq=False):
    """The best known way up to some lane of an edge."""

    cost: float
    lane: Lane
    before: "_Way | None" = None  # on the same edge for an exit, on the edge before for an entry
    movement: Movement | None = None  # that led here, for an entry


def change_length(lane: Lane, changes: int) -> float:
    """The distance `changes` lane changes from `lane` take in comfort [m]."""
    return changes * max(_SHORTEST_CHANGE, _CHANGE_TIME * lane.speed_limit)


def lane_sequence(
    net: NetContents,
    edges: Sequence[str],
    start: tuple[str, float],
    arrival: tuple[str | None, float],
) -> tuple[Leg, ...]:
    """The cheapest legs from `start` to `arrival`, each a lane (any, where None) and a position on it [m].

    Exact (dynamic programming over the lanes of each edge); of equal ways the one that changes lanes
    earliest, then the one that over most junctions has the next lane of faster ones beside it. Raises RouteError
    where there is no way.
    """
    ways = {start[0]: _Way(0.0, net.lanes[start[0]])}
    for order, edge in enumerate(edges):
        if order:
            ways = _entered(net, ways, edges[order - 1], edge)
        begin = start[1] if order == 0 else 0.0
        end = arrival[1] if order == len(edges) - 1 else math.inf
        ways = _crossed(net, edge, ways, (begin, end), 1.0 + _LATER * order)
    arrived = [way for way in ways.values() if arrival[0] in (None, way.lane.id)]
    if not arrived:
        raise RouteError(f"lane {arrival[0]} cannot be reached on edge {edges[-1]!r}: no room to change lanes")
    return tuple(_legs(min(arrived, key=lambda way: way.cost)))[::-1]


def _entered(net: NetContents, ways: dict[str, _Way], before: str, edge: str) -> dict[str, _Way]:
    """From the exits of edge `before` to the entries of `edge`."""
    found: dict[str, _Way] = {}
    for way in ways.values():
        for movement in net.movements.get(way.lane.id, ()):
            lane = net.lanes[movement.to_lane]
            if lane.edge != edge or not movement.is_drivable:
                continue
            cost = way.cost + (0.0 if _is_beside(net, movement) else _ALONE)
            if cost < _cost(found, lane):
                found[lane.id] = _Way(cost, lane, way, movement)
    if not found:
        raise RouteError(_gap(net, before, edge))
    return found


def _is_beside(net: NetContents, movement: Movement) -> bool:
    """Whether the next lane of faster ones leads on beside it."""
    beside = faster(net, net.lanes[movement.from_lane])
    return beside is not None and alongside(net, movement, beside, TURN) is not None


def _gap(net: NetContents, before: str, edge: str) -> str:
    movements = [
        movement
        for lane in net.edges[before]
        for movement in net.movements.get(lane, ())
        if net.lanes[movement.to_lane].edge == edge
    ]
    if not movements:
        return f"no connection from edge {before!r} to edge {edge!r}"
    if not any(movement.is_drivable and net.lanes[movement.from_lane].is_drivable for movement in movements):
        return f"the connection from edge {before!r} to edge {edge!r} is closed to this vehicle class"
    return f"no room to change lanes for the connection from edge {before!r} to edge {edge!r}"


def _crossed(
    net: NetContents, edge: str, ways: dict[str, _Way], span: tuple[float, float], weight: float
) -> dict[str, _Way]:
    """From the entries of `edge` to its exits; lane changes must lie within `span` [m]."""
    found: dict[str, _Way] = {}
    for way in ways.values():
        room = min(span[1], way.lane.length) - span[0]
        for lane, changes in _reachable(net, net.edges[edge], way.lane):
            if changes and room < _LEAST_ROOM:
                continue
            cost = way.cost
            if changes:
                cost += weight * changes + _CRAMPED * max(0.0, 1.0 - room / change_length(way.lane, changes))
            if cost < _cost(found, lane):
                found[lane.id] = _Way(cost, lane, way)
    return found


def _reachable(net: NetContents, lane_ids: tuple[str, ...], lane: Lane) -> Iterator[tuple[Lane, int]]:
    """Lanes of the edge joined to `lane` by drivable ones, with the number of changes to each."""
    yield lane, 0
    for direction in (-1, 1):
        index = lane.index + direction
        while 0 <= index < len(lane_ids) and net.lanes[lane_ids[index]].is_drivable:
            yield net.lanes[lane_ids[index]], abs(index - lane.index)
            index += direction


def _cost(ways: dict[str, _Way], lane: Lane) -> float:
    return ways[lane.id].cost if lane.id in ways else math.inf


def _legs(last: _Way) -> Iterator[Leg]:
    """The legs, last one first."""
    way: _Way | None = last
    movement = None
    while way is not None:
        entry = way.before
        assert entry is not None
        yield Leg(entry.lane, way.lane, movement)
        way, movement = entry.before, entry.movement
