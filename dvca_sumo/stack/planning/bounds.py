"""The bounds of the path: the road's edges, moved in by what stands on the road or beside it."""

import numpy as np

from dvca_sumo.messages import Integers, VehicleShape
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.st_graph import Graph


def blocking(graph: Graph, shape: VehicleShape, config: PlanningConfig) -> int | None:
    """The first standing object ahead that leaves less than the ego's width between the bounds; its row in the scene.

    Whatever stands bounds the path on that side of it where it is, grown by the buffers of `config`.
    None where the ego's body finds room between the bounds all along.
    """
    window, path, scene = graph.window, graph.path, graph.scene
    now, buffer = scene.now, config.lateral_buffer
    lows = now.stations - now.half_lengths
    stands_ahead = scene.is_standing & (lows > shape.front)
    if not np.count_nonzero(stands_ahead):
        return None
    rows: Integers = scene.rows_now[0]
    highs = now.stations + now.half_lengths
    is_left = now.offsets > 0.5 * (path.left[rows] + path.right[rows])
    inner = now.offsets + np.where(is_left, -1.0, 1.0) * (now.half_widths + buffer)
    narrows = stands_ahead & np.where(is_left, inner < window.road_left[rows], inner > window.road_right[rows])
    left, right = window.road_left.copy(), window.road_right.copy()
    for row in sorted(narrows.nonzero()[0].tolist(), key=lambda row: float(lows[row])):
        span = window.span(float(lows[row]) - config.buffer_before, float(highs[row]) + config.buffer_behind)
        was_open = left[span] - right[span] >= shape.width
        if is_left[row]:
            np.minimum(left[span], inner[row], out=left[span])
        else:
            np.maximum(right[span], inner[row], out=right[span])
        if (was_open & (left[span] - right[span] < shape.width)).any():
            return row
    return None
