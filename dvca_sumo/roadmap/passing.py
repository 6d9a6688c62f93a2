"""Lanes to pass on: where the next lane, on the side of the faster ones, runs along with a route.

It is one to pass on until it ends or the route parts from it: where the route changes lanes, turns, gives way to
others or crosses a pedestrian crossing.
"""

from collections.abc import Iterator, Sequence

import msgspec
import numpy as np
import numpy.typing as npt

from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.roadmap.bounds import beside, evened, joined
from dvca_sumo.roadmap.lanes import Lane, Movement
from dvca_sumo.roadmap.reading import NetContents
from dvca_sumo.roadmap.route import PassingLane
from dvca_sumo.roadmap.runs import runs

_SHORTEST = 100.0  # [m]
_FIRST = "M"  # SUMO's letter for movements that give way to nobody
_STRAIGHT = "s"


class _Part(msgspec.Struct, frozen=True, eq=False):
    """A lane to pass on, beside a lane of the route."""

    own: Lane
    lane: Lane
    before: Movement | None  # from the part before
    rows: slice  # of the line that follow `own`


class _Chain(msgspec.Struct, frozen=True, eq=False):
    """Parts that lead from one to the next."""

    parts: list[_Part]
    leads_on: bool


def passing_lanes(
    net: NetContents, line: Polyline, followed: Sequence[Lane], is_closed: npt.NDArray[np.bool_]
) -> tuple[PassingLane, ...]:
    """By station; the points of `line` follow the lanes `followed`, and where `is_closed` (n,) nobody may pass."""
    return tuple(found for chain in _chains(net, followed) for found in _drawn(net, chain, line, is_closed))


def _chains(net: NetContents, followed: Sequence[Lane]) -> Iterator[_Chain]:
    parts: list[_Part] = []
    for own, rows in runs(followed):
        if own.is_internal:
            continue
        lane = _faster(net, own)
        before = None
        if parts and lane is not None and _movement(net, parts[-1].own, own):
            before = _movement(net, parts[-1].lane, lane)
        if before is None and parts:
            onto = (net.lanes[movement.to_lane] for movement in net.movements.get(parts[-1].lane.id, ()))
            yield _Chain(parts, any(lane.edge == own.edge and lane.is_drivable for lane in onto))
            parts = []
        if lane is not None:
            parts.append(_Part(own, lane, before, rows))
    if parts:
        yield _Chain(parts, leads_on=True)


def _faster(net: NetContents, lane: Lane) -> Lane | None:
    """The next lane that faster ones take: SUMO numbers lanes from the slow side."""
    for side in (lane.left, lane.right):
        if side is not None and net.lanes[side].index > lane.index:
            found = net.lanes[side]
            return found if found.speed_limit >= lane.speed_limit else None
    return None


def _movement(net: NetContents, lane: Lane, onto: Lane) -> Movement | None:
    """The way straight on from `lane`, on which one gives way to nobody."""
    for movement in net.movements.get(lane.id, ()):
        if movement.to_lane == onto.id and movement.is_drivable:
            is_first = movement.state == _FIRST and movement.signal_id is None
            return movement if is_first and movement.direction == _STRAIGHT else None
    return None


def _drawn(net: NetContents, chain: _Chain, line: Polyline, is_closed: npt.NDArray[np.bool_]) -> Iterator[PassingLane]:
    parts = chain.parts
    rows = slice(parts[0].rows.start, parts[-1].rows.stop)
    offsets, is_beside, _ = beside(line, joined(_way(net, parts)), rows)
    lane_ids = _lane_ids(parts)
    widths = (min(part.lane.width for part in parts), min(part.own.width for part in parts))
    stations = line.stations[rows]
    for is_open, run in runs((is_beside & ~is_closed[rows]).tolist()):
        if is_open and stations[run][-1] - stations[run][0] >= _SHORTEST:
            found = evened(offsets[run])
            found.setflags(write=False)
            yield PassingLane(tuple(lane_ids[run]), widths, stations[run], found, chain.leads_on)


def _lane_ids(parts: Sequence[_Part]) -> list[str]:
    """By row of the line; on a junction the first lane there."""
    ids: list[str] = []
    first = parts[0].rows.start
    for part in parts:
        if part.before is not None:
            crossed = part.before.internal[0] if part.before.internal else part.lane.id
            ids += [crossed] * (part.rows.start - first - len(ids))
        ids += [part.lane.id] * (part.rows.stop - part.rows.start)
    return ids


def _way(net: NetContents, parts: Sequence[_Part]) -> Iterator[Lane]:
    """The lanes to pass on, end to end."""
    for part in parts:
        if part.before is not None:
            yield from (net.lanes[lane] for lane in part.before.internal)
        yield part.lane
