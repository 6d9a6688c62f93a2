"""What of a junction is there to drive on: all of its area that is not for people on foot."""

from collections.abc import Iterable, Sequence

import numpy as np
import shapely

from dvca_sumo.geometry.polyline import Floats

_FARTHEST = 1.5  # [m] beyond the edge of the road beside its lane, up to which a junction's area is an ego's to use

Shape = Sequence[tuple[float, float]]


def area_of(outline: Shape, walking: Iterable[Shape]) -> shapely.Geometry:
    """A junction within its `outline`, without the `walking` areas; empty where the net draws none."""
    area = polygon(outline)
    for corner in walking:
        area = area.difference(polygon(corner))
    return area


def widened(edges: Floats, points: Floats, headings: Floats, area: shapely.Geometry) -> Floats:
    """Offsets (n,) [m] of a road's edge beside `points` (n, 2) of a line across `area`, moved out as that allows.

    `edges` are those beside the lane: all positive, on the left, or all negative. No edge comes nearer.
    """
    outside = edges + np.sign(edges) * _FARTHEST
    ways = np.column_stack((-np.sin(headings), np.cos(headings))) * outside[:, None]
    rays = shapely.linestrings(np.stack((points, points + ways), axis=1))
    hits = shapely.intersection(rays, area.boundary)
    origins = shapely.points(points)
    reach = np.where(shapely.is_empty(hits), np.abs(outside), shapely.distance(origins, hits))
    reach[~shapely.contains(area, origins)] = 0.0
    found: Floats = np.sign(edges) * np.maximum(np.abs(edges), reach)
    return found


def polygon(shape: Shape) -> shapely.Geometry:
    """The area within an outline; empty where that is none."""
    if len(shape) < 3:
        return shapely.Polygon()
    return shapely.buffer(shapely.Polygon(shape), 0.0)  # an outline that crosses itself becomes one that does not
