"""Lanes to pass on: where the next lane, on the side of the faster ones, runs along with a route.

It is one to pass on until it ends or the route parts from it: where the route changes lanes or turns, or the lane leads
elsewhere. At pedestrian crossings, and on junctions where somebody may have to wait, nobody begins to pass; who is on
the lane goes on along it.
"""

import itertools
from collections.abc import Iterator, Sequence

import msgspec

from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.roadmap.beside import alongside, faster
from dvca_sumo.roadmap.bounds import evened, way_beside
from dvca_sumo.roadmap.lanes import Lane, Movement
from dvca_sumo.roadmap.reading import NetContents
from dvca_sumo.roadmap.route import PassingLane
from dvca_sumo.roadmap.runs import runs

_SHORTEST = 100.0  # [m]
_NEAR = 3.0  # [m] before the destination one is there
_BEND = 0.5  # [rad] on junctions: in sharper ones lanes come close to each other, and drivers cut across
_FIRST = "M"  # SUMO's letter for movements that give way to nobody
_STRAIGHT = "s"

Span = tuple[float, float]  # [m] from station to station


class Way(msgspec.Struct, frozen=True, eq=False):
    """A trip, as lanes to pass on are looked for along it."""

    line: Polyline
    followed: Sequence[Lane]  # by point of the line
    movements: Sequence[Movement]  # that it takes
    trip: Span
    changes: Sequence[Span]  # of lanes
    crossings: Sequence[Span]  # for people


class _Part(msgspec.Struct, frozen=True, eq=False):
    """A lane to pass on, beside a lane of the route."""

    own: Lane
    lane: Lane
    before: Sequence[Movement]  # from the part before
    rows: slice  # of the line that follow `own`


def passing_lanes(net: NetContents, way: Way) -> tuple[PassingLane, ...]:
    """By station."""
    return tuple(found for parts in _chains(net, way) for found in _drawn(net, parts, way))


def _chains(net: NetContents, way: Way) -> Iterator[list[_Part]]:
    """Parts that lead from one to the next."""
    parts: list[_Part] = []
    taken = 0
    for own, rows in runs(way.followed):
        if own.is_internal:
            continue
        ways = _until(net, own.edge, way.movements[taken:])
        taken += len(ways)
        lane = faster(net, own)
        part = None if lane is None else _part(net, parts, own, lane, ways, rows)
        if parts and (part is None or not part.before):
            yield parts
            parts = []
        if part is not None:
            parts.append(part)
    if parts:
        yield parts


def _until(net: NetContents, edge: str, movements: Sequence[Movement]) -> list[Movement]:
    """The first ones, up to that from `edge`."""
    return list(itertools.takewhile(lambda one: net.lanes[one.from_lane].edge != edge, movements))


def _part(
    net: NetContents, parts: Sequence[_Part], own: Lane, lane: Lane, ways: Sequence[Movement], rows: slice
) -> _Part:
    """Continuing the last one of `parts`, from where the route takes `ways`, if it leads on beside them."""
    before: list[Movement] = []
    came_by = parts[-1].lane if parts else None
    for movement in ways:
        onward = None if came_by is None else alongside(net, movement, came_by, _BEND)
        if onward is None:
            return _Part(own, lane, (), rows)
        before.append(onward)
        came_by = net.lanes[onward.to_lane]
    return _Part(own, lane, before if came_by is lane else (), rows)


def _drawn(net: NetContents, parts: Sequence[_Part], way: Way) -> Iterator[PassingLane]:
    line = way.line
    rows = slice(parts[0].rows.start, parts[-1].rows.stop)
    offsets, is_there, lane_ids = way_beside(line, list(_lanes(net, parts)), rows)
    widths = (min(part.lane.width for part in parts), min(part.own.width for part in parts))
    stations = line.stations[rows]
    is_there &= (stations >= way.trip[0]) & (stations <= way.trip[1])
    for begin, end in way.changes:
        is_there &= (stations <= begin) | (stations >= end)
    halts = sorted((*_junctions(parts, line), *way.crossings))
    for is_open, run in runs(is_there.tolist()):
        if is_open and stations[run][-1] - stations[run][0] >= _SHORTEST:
            first, last = stations[run][[0, -1]].tolist()
            found = evened(offsets[run])
            found.setflags(write=False)
            yield PassingLane(
                lane_ids=lane_ids[run],
                widths=widths,
                stations=stations[run],
                offsets=found,
                leads_on=last + _NEAR > way.trip[1],
                halts=tuple((begin, end) for begin, end in halts if begin < last and end > first),
            )


def _junctions(parts: Sequence[_Part], line: Polyline) -> Iterator[Span]:
    """Where junctions are on which somebody may have to wait."""
    for before, part in itertools.pairwise(parts):
        if not all(_is_plain(movement) for movement in part.before):
            yield float(line.stations[before.rows.stop - 1]), float(line.stations[part.rows.start])


def _is_plain(movement: Movement) -> bool:
    """Whether it leads straight on, and nobody has to give way there."""
    return movement.state == _FIRST and movement.signal_id is None and movement.direction == _STRAIGHT


def _lanes(net: NetContents, parts: Sequence[_Part]) -> Iterator[Lane]:
    """The lanes to pass on, end to end."""
    yield parts[0].lane
    for part in parts[1:]:
        for movement in part.before:
            yield from (net.lanes[lane] for lane in (*movement.internal, movement.to_lane))
