"""Where the ego keeps to its line on the way to whom it goes around, and back: others stand beside that, too."""

import math
from collections.abc import Sequence

import numpy as np

from dvca_sumo.messages import VehicleShape
from dvca_sumo.stack.planning.blockers import Beside
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.moves import Lateral
from dvca_sumo.stack.planning.path import Plateau

_ASIDE = 0.2  # [m] from the line, the ego is not on it


def kept(
    nudges: Sequence[Plateau], lateral: Lateral, standing: Beside, shape: VehicleShape, config: PlanningConfig
) -> list[Plateau]:
    """`nudges`, by station, and plateaus on the line between them.

    On those the ego passes who leaves it room there, but none at the offset of a nudge; or none, of who is ahead, at
    its own, `lateral` to the line.
    """
    if not standing.low.size:
        return list(nudges)
    least = config.nudge_clearance_least
    begins, ends = standing.low - shape.front, standing.high + shape.rear_overhang
    in_way = np.zeros(len(standing.low), dtype=np.bool_)
    for nudge in nudges:
        in_way |= standing.clearances(nudge.offset) < least
    if abs(lateral.offset) > _ASIDE:
        in_way |= (standing.clearances(lateral.offset) < least) & (begins > 0.0)
    in_way &= (standing.clearances(0.0) >= least) & (ends > 0.0)
    if not in_way.any():
        return list(nudges)
    plateaus = list(nudges)
    lows, highs = [-math.inf, *(nudge.end for nudge in nudges)], [*(nudge.begin for nudge in nudges), math.inf]
    for low, high in zip(lows, highs, strict=True):
        between = in_way & (standing.low >= low) & (standing.high <= high)
        if between.any():
            plateaus.append(Plateau(float(begins[between].min()), float(ends[between].max()), 0.0))
    return sorted(plateaus)
