"""How far the ego may move aside for what it passes: lane, road, wheels, and the clearance wanted."""

import math
from typing import NamedTuple

import numpy as np

from dvca_sumo.messages import Floats, VehicleShape
from dvca_sumo.stack.planning.blockers import Blocker
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.moves import OVER_LINE, blend_length
from dvca_sumo.stack.planning.reference import Window


class Room(NamedTuple):
    """Offsets of the rear axle [m], the ego passing one object."""

    lane_left: float  # at most, the body staying in its lane
    lane_right: float  # at least; more than `lane_left` where the lane is too narrow for the body
    road_left: float  # at most, the body staying on the road, on the way there and back too
    road_right: float  # at least
    wanted: list[float]  # one on either side at most: the wanted clearance, or what road and wheels allow

    def is_in_lane(self, offset: float, tolerance: float = 0.0) -> bool:
        """Whether the body stays in its lane at that offset, give or take so much [m]."""
        return self.lane_right - tolerance <= offset <= self.lane_left + tolerance


def room_beside(
    blocker: Blocker, window: Window, speed: float, least: float, shape: VehicleShape, config: PlanningConfig
) -> Room:
    """The room to pass `blocker` at `speed` [m/s] and no nearer than `least` [m].

    The road's edges are looked at on the way out and back, too.
    """
    begin, end = blocker.low - shape.front, blocker.high + shape.rear_overhang
    blend = blend_length(blocker.wanted, speed, config)
    whole = window.span(max(begin - 0.5 * blend, 0.0), end + 0.5 * blend)
    if blocker.walks:  # may be met where the lane is wider than on the way there
        begin = max(begin - blend, 0.0)
    beside = window.span(begin, end)
    edge = config.edge_clearance
    inward_left, inward_right = _steerable(window.curvatures[whole], shape, config)
    leftmost = max(min(float((window.road_left - window.swept_left)[whole].min()) - edge, inward_left), 0.0)
    rightmost = min(max(float((window.road_right - window.swept_right)[whole].max()) + edge, inward_right), 0.0)
    left = min(max(blocker.left + blocker.wanted, 0.0), leftmost)
    right = max(min(blocker.right - blocker.wanted, 0.0), rightmost)
    wanted = []
    if left - blocker.left >= least:
        wanted.append(left)
    if blocker.right - right >= least:
        wanted.append(right)
    return Room(
        float((window.lane_left - window.swept_left)[beside].min()) + OVER_LINE,
        float((window.lane_right - window.swept_right)[beside].max()) - OVER_LINE,
        leftmost,
        rightmost,
        wanted,
    )


def _steerable(curvatures: Floats, shape: VehicleShape, config: PlanningConfig) -> tuple[float, float]:
    """How far into bends of the line the wheels turn the ego, to the left and to the right [m]."""
    tightest = shape.wheelbase / math.tan(config.steering)
    left, right = float(np.max(curvatures, initial=0.0)), float(np.min(curvatures, initial=0.0))
    return (
        1.0 / left - tightest if left > 0.0 else math.inf,
        1.0 / right + tightest if right < 0.0 else -math.inf,
    )
