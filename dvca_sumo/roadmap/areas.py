"""What of a junction is there to drive on: its lanes, and all of its area that is not for people on foot."""

from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt
import shapely

from dvca_sumo.geometry.polyline import Floats

_FARTHEST = 1.5  # [m] beyond the edge of the road beside its lane, up to which a junction's area is an ego's to use
_PASSABLE = 1.0  # [m] wide is enough for people to pass

Shape = Sequence[tuple[float, float]]
Strip = tuple[npt.ArrayLike, float]  # centre line (n, 2) and width of a lane [m]


def area_of(outline: Shape, walking: Iterable[Shape] = (), lanes: Sequence[Strip] = ()) -> shapely.Geometry:
    """A junction within its `outline`, with its vehicles' `lanes`, without the `walking` areas beside those.

    A walking area that one of them leads across is road: what people walk on from crossing to crossing in the middle of
    a junction. Empty where the net draws none of all that.
    """
    corners = walking_corners(walking, lanes)
    return shapely.union_all([polygon(outline).difference(corners), *_strips(lanes)])


def walking_corners(walking: Iterable[Shape], lanes: Sequence[Strip]) -> shapely.Geometry:
    """The `grounds` of a junction's `walking` areas that no centre line of its vehicles' `lanes` crosses, together."""
    driven = _centres(lanes)
    return shapely.union_all([ground for ground in grounds(walking, lanes) if not driven.intersects(ground)])


def grounds(walking: Iterable[Shape], lanes: Sequence[Strip]) -> list[shapely.Geometry]:
    """What people walk on of each of a junction's `walking` areas.

    That is what its vehicles' `lanes` leave of an area which one of them leads across, if it is in one piece, and wide
    enough to pass; else all of it.
    """
    driven = _centres(lanes)
    return [_beside(area, lanes) if driven.intersects(area) else area for area in map(polygon, walking)]


def _beside(area: shapely.Geometry, lanes: Sequence[Strip]) -> shapely.Geometry:
    left = area.difference(shapely.union_all(_strips(lanes)))
    middle = shapely.buffer(left, -0.5 * _PASSABLE)
    return area if middle.is_empty or isinstance(left, shapely.MultiPolygon) else left


def _centres(lanes: Sequence[Strip]) -> shapely.Geometry:
    return shapely.MultiLineString([shapely.LineString(line) for line, _ in lanes])


def _strips(lanes: Sequence[Strip]) -> npt.NDArray[np.object_]:
    lines = [shapely.LineString(line) for line, _ in lanes]
    strips: npt.NDArray[np.object_] = shapely.buffer(lines, [0.5 * width for _, width in lanes], cap_style="flat")
    return strips


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


def narrowed(edges: Floats, points: Floats, headings: Floats, ground: shapely.Geometry, kept: float) -> Floats:
    """Offsets (n,) [m] of an edge as in `widened`, moved in so that it stays `kept` [m] off a `ground`.

    No edge comes nearer than the line itself.
    """
    ways = np.column_stack((-np.sin(headings), np.cos(headings))) * (edges + np.sign(edges) * kept)[:, None]
    hits = shapely.intersection(shapely.linestrings(np.stack((points, points + ways), axis=1)), ground)
    reach = np.where(shapely.is_empty(hits), np.inf, shapely.distance(shapely.points(points), hits))
    found: Floats = np.sign(edges) * np.minimum(np.abs(edges), np.maximum(reach - kept, 0.0))
    return found


def polygon(shape: Shape) -> shapely.Geometry:
    """The area within an outline; empty where that is none."""
    if len(shape) < 3:
        return shapely.Polygon()
    return shapely.buffer(shapely.Polygon(shape), 0.0)  # an outline that crosses itself becomes one that does not
