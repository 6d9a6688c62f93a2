"""Lanes that run on side by side over junctions, and how far on a lane change may thus still be done."""

import math
from collections.abc import Sequence

import msgspec

from dvca_sumo.roadmap.drawing import Change
from dvca_sumo.roadmap.lane_sequence import Leg, change_length
from dvca_sumo.roadmap.lanes import Lane, Movement
from dvca_sumo.roadmap.reading import NetContents

_TURN = 1.2  # [rad] sharper ways across a junction are turns, on which lanes are not beside each other


def extended(net: NetContents, change: Change, legs: Sequence[Leg], ends: Sequence[float]) -> Change:
    """A change on the first of `legs`, with where its lanes run on side by side; the legs end at `ends` [m].

    That is up to the last one with room to change lanes, before the next change and before a turn.
    """
    found, ways = change, change.ways
    for leg, following, end in zip(legs, legs[1:], ends[1:], strict=False):
        if leg.movement is None or following.entry is not following.exit:
            break
        onward = [alongside(net, leg.movement, way[-1], _TURN) for way in ways]
        movements = [movement for movement in onward if movement is not None]
        if len(movements) < len(ways):
            break
        ways = tuple(
            (*way, *(net.lanes[lane] for lane in (*movement.internal, movement.to_lane)))
            for way, movement in zip(ways, movements, strict=True)
        )
        if following.entry.line.length >= change_length(following.entry, len(ways) - 1):
            found = msgspec.structs.replace(change, ways=ways, latest=end)
    return found


def alongside(net: NetContents, movement: Movement, lane: Lane, turn: float) -> Movement | None:
    """The movement from `lane`, beside that of `movement`, which leads on beside it and is let go together with it.

    There is none along a way that turns by more than `turn` [rad].
    """
    own, onto = net.lanes[movement.from_lane], net.lanes[movement.to_lane]
    if abs(math.remainder(float(onto.line.headings[0] - own.line.headings[-1]), 2.0 * math.pi)) > turn:
        return None
    for other in net.movements.get(lane.id, ()):
        to_lane = net.lanes[other.to_lane]
        is_beside = to_lane.edge == onto.edge and to_lane.index - onto.index == lane.index - own.index
        is_same = (other.direction, other.state) == (movement.direction, movement.state)
        if is_beside and is_same and other.is_drivable and other.signal_group == movement.signal_group:
            return other
    return None
