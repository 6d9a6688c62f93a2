"""How much of a lane a body takes up that is beside the one SUMO has it on.

SUMO has a vehicle on one lane. Its drivers on another one do not see a car that stands across both, half-way through
turning back, between two lanes of a queue, or where ways on a junction lie side by side, and drive into it.
"""

import math

import shapely

from dvca_sumo.geometry.boxes import box_of, corners
from dvca_sumo.messages import VehicleShape
from dvca_sumo.truth import EgoTruth

SLOW = 5.0  # [m/s] above, an ego is on its way from one lane to the other, and soon on one
ROOM = 0.4  # [m] into a lane: up to that, a car in its middle has room to pass
_SHORTEST = 0.1  # [m] of a lane, less is nobody's way


def outline(truth: EgoTruth, shape: VehicleShape) -> shapely.Polygon:
    """Where an ego's body is."""
    return shapely.Polygon(corners(box_of(truth.x, truth.y, truth.heading, shape)[None])[0])


def strip(middle: shapely.LineString, width: float) -> shapely.Polygon:
    """A lane of `width` [m] along its centre line."""
    return middle.buffer(0.5 * width, cap_style="flat", join_style="mitre")


def taken(
    body: shapely.Polygon, middle: shapely.LineString, width: float, room: float = ROOM
) -> tuple[float, float] | None:
    """From where to where a body is in the way on a lane of `width` [m], along its centre line [m]; None: it is not.

    `room`: how far into the lane it may be, and not in the way [m].
    A body that is on what comes before the lane, too, begins at less than 0: as far back as it reaches.
    """
    width = max(width - 2.0 * room, 0.0)
    if body.distance(middle) >= 0.5 * width:
        return None
    way = strip(middle, width)
    stations = shapely.line_locate_point(middle, shapely.points(shapely.get_coordinates(way.intersection(body))))
    begin, end = float(stations.min(initial=math.inf)), float(stations.max(initial=0.0))
    if end - begin <= _SHORTEST:
        return None
    if begin > _SHORTEST:
        return begin, end
    origin, ahead = shapely.get_coordinates(shapely.line_interpolate_point(middle, (0.0, end)))
    along = (shapely.get_coordinates(body) - origin) @ (ahead - origin) / math.dist(ahead, origin)
    return min(begin, float(along.min())), end
