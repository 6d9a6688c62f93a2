"""What lies beside a lane, and leads on beside it."""

import math

from dvca_sumo.roadmap.lanes import Lane, Movement
from dvca_sumo.roadmap.reading import NetContents

TURN = 1.2  # [rad] sharper ways across a junction are turns, on which lanes are not beside each other


def faster(net: NetContents, lane: Lane) -> Lane | None:
    """The next lane that faster ones take: SUMO numbers lanes from the slow side."""
    for side in (lane.left, lane.right):
        if side is not None and net.lanes[side].index > lane.index:
            found = net.lanes[side]
            return found if found.speed_limit >= lane.speed_limit else None
    return None


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
