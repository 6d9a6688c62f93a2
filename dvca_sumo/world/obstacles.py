"""Bodies that never move: cones, dividers, kerbs, drawn in SUMO as POIs and polygons."""

import itertools
import math
from collections.abc import Sequence

import msgspec
import numpy as np
import shapely

from dvca_sumo.messages import Floats, ObjectClass
from dvca_sumo.truth import ObjectsTruth

Box = tuple[float, float, float, float, float]

_LONGEST = 50.0  # [m] of a box: who is placed by its middle would else begin where nobody looks for it


class Obstacles(msgspec.Struct, frozen=True):
    """The static bodies of a scenario."""

    names: tuple[str, ...]
    boxes: Floats  # (n, 5)


def box_of_poi(position: tuple[float, float], heading: float, width: float, height: float) -> Box:
    """A POI's body: `width` across, `height` along its heading, as SUMO draws its image [m]."""
    return (position[0], position[1], heading, height, width)


def boxes_of_polygon(shape: Sequence[tuple[float, float]], is_filled: bool, line_width: float) -> list[Box]:  # noqa: FBT001
    """A polygon's body as boxes: a filled one is its smallest rectangle, a line one box a segment.

    A filled one without an area is a line. Boxes that would be very long are several, end to end.
    """
    rectangle = shapely.MultiPoint(shape).minimum_rotated_rectangle
    if is_filled and rectangle.area > 0.0:
        corners = np.array(rectangle.exterior.coords)
        along, across = corners[1] - corners[0], corners[2] - corners[1]
        centre = corners[:4].mean(axis=0)
        heading = math.atan2(along[1], along[0])
        return _parts((centre[0], centre[1], heading, float(np.hypot(*along)), float(np.hypot(*across))))
    boxes: list[Box] = []
    for (x0, y0), (x1, y1) in itertools.pairwise(shape):
        length = math.hypot(x1 - x0, y1 - y0)
        if length > 0.0:
            boxes += _parts(((x0 + x1) / 2.0, (y0 + y1) / 2.0, math.atan2(y1 - y0, x1 - x0), length, line_width))
    return boxes


def _parts(box: Box) -> list[Box]:
    x, y, heading, length, width = box
    if length < width:
        heading, length, width = heading + 0.5 * math.pi, width, length
    count = max(math.ceil(length / _LONGEST), 1)
    if count == 1:
        return [box]
    part = length / count
    along = [part * (number - 0.5 * (count - 1)) for number in range(count)]
    return [(x + way * math.cos(heading), y + way * math.sin(heading), heading, part, width) for way in along]


def joined(moving: ObjectsTruth, obstacles: Obstacles, centre: tuple[float, float], radius: float) -> ObjectsTruth:
    """Moving bodies first, then the obstacles within `radius` [m] of `centre`, lengths counted in."""
    if not obstacles.names:
        return moving
    gaps = np.hypot(obstacles.boxes[:, 0] - centre[0], obstacles.boxes[:, 1] - centre[1]) - obstacles.boxes[:, 3] / 2.0
    near = np.flatnonzero(gaps < radius)
    if near.size == 0:
        return moving
    return ObjectsTruth(
        moving.time,
        moving.ids + tuple(obstacles.names[row] for row in near),
        np.concatenate([moving.classes, np.full(near.size, ObjectClass.STATIC, dtype=np.int64)]),
        np.concatenate([moving.boxes, obstacles.boxes[near]]),
        np.concatenate([moving.velocities, np.zeros((near.size, 2))]),
        moving.lanes + ("",) * near.size,
    )
