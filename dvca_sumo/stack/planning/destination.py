"""Where the route ends, as a place to stop at."""

import math

import numpy as np

from dvca_sumo.roadmap.route import Route
from dvca_sumo.stack.planning.config import PlanningConfig

_TOLERANCE = 1e-3  # [m] of projecting


def stop_station(route: Route, config: PlanningConfig) -> float:
    """The route station where the front bumper stops for good [m]; infinite where the destination is not on the lane.

    A destination beside the lane is nothing to stop for: it cannot be told at which station it lies.
    """
    x, y, _ = route.line.poses([route.destination])[0].tolist()
    stations, offsets = route.line.project([[x, x if config.projects_x_twice else y]])
    left = np.interp(stations, route.line.stations, route.lane_left) + _TOLERANCE
    right = np.interp(stations, route.line.stations, route.lane_right) - _TOLERANCE
    return route.destination if right[0] <= offsets[0] <= left[0] else math.inf
