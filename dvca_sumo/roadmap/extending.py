"""Lanes that run on side by side over junctions, and how far on a lane change may thus still be done."""

from collections.abc import Sequence

import msgspec

from dvca_sumo.roadmap.beside import TURN, alongside
from dvca_sumo.roadmap.drawing import Change
from dvca_sumo.roadmap.lane_sequence import Leg, change_length
from dvca_sumo.roadmap.reading import NetContents


def extended(net: NetContents, change: Change, legs: Sequence[Leg], ends: Sequence[float]) -> Change:
    """A change on the first of `legs`, with where its lanes run on side by side; the legs end at `ends` [m].

    That is up to the last one with room to change lanes, before the next change and before a turn.
    """
    found, ways = change, change.ways
    for leg, following, end in zip(legs, legs[1:], ends[1:], strict=False):
        if leg.movement is None or following.entry is not following.exit:
            break
        onward = [alongside(net, leg.movement, way[-1], TURN) for way in ways]
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
