"""Oriented boxes: rows of x, y (centre) [m], heading [rad], length, width [m].

One box is compared with many at once, by the separating axis theorem: two rectangles are apart exactly
when their projections onto the length or width of one of them are.
"""

import math
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

_STILL = 1e-12  # [m/s]
_SIGNS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
_NEXT = np.array([1, 2, 3, 0])  # corner after each


class Body(Protocol):
    """A vehicle body, given relative to its rear axle."""

    @property
    def length(self) -> float:
        """[m]."""

    @property
    def width(self) -> float:
        """[m]."""

    @property
    def centre(self) -> float:
        """Distance from the rear axle forward to the box centre [m]."""


def box_of(x: float, y: float, heading: float, shape: Body) -> Floats:
    """The box (5,) of a body whose rear axle centre is at `x`, `y` [m] and which points along `heading` [rad]."""
    return np.array(
        [
            x + shape.centre * math.cos(heading),
            y + shape.centre * math.sin(heading),
            heading,
            shape.length,
            shape.width,
        ]
    )


def corners(boxes: Floats) -> Floats:
    """Corners of each box, (n, 5) -> (n, 4, 2), in the order front left, rear left, rear right, front right."""
    half = boxes[:, None, 3:5] * (0.5 * _SIGNS)
    cos, sin = np.cos(boxes[:, 2, None]), np.sin(boxes[:, 2, None])
    along, across = half[..., 0], half[..., 1]
    found = np.empty((len(boxes), 4, 2))
    found[..., 0] = boxes[:, 0, None] + along * cos - across * sin
    found[..., 1] = boxes[:, 1, None] + along * sin + across * cos
    return found


def outlines(boxes: Floats, parts: int) -> Floats:
    """Points all around each box, so many a side and the corners among them: (n, 5) -> (n, 4 parts, 2)."""
    ends = corners(boxes)[:, :, None]
    shares = (np.arange(parts) * (1.0 / parts))[:, None]
    return (ends + shares * (ends.take(_NEXT, axis=1) - ends)).reshape(len(boxes), -1, 2)


def radii(boxes: Floats) -> Floats:
    """Half the diagonal of each box [m], (..., 5) -> (...): no point of the box is farther from its centre."""
    return 0.5 * np.hypot(boxes[..., 3], boxes[..., 4])


class Neighbours(NamedTuple):
    """How far boxes may be from one box, by the circles around them: (n,) each."""

    squares: Floats  # [m^2] of the distance between the centres
    touching: Floats  # [m] between the centres, beyond which the boxes certainly do not touch

    def within(self, reach: float | Floats) -> npt.NDArray[np.int64]:
        """Rows, ascending, that may be closer than `reach` [m], one for all or (n,); all others certainly are not."""
        limit = self.touching + reach
        return (self.squares <= limit * limit).nonzero()[0]


def neighbours(box: Floats, boxes: Floats) -> Neighbours:
    """The `boxes` (n, 5) as neighbours of `box` (5,)."""
    dx, dy = boxes[:, 0] - box[0], boxes[:, 1] - box[1]
    return Neighbours(dx * dx + dy * dy, radii(boxes) + 0.5 * math.hypot(box[3], box[4]))


def distances(box: Floats, boxes: Floats) -> Floats:
    """Exact distance [m] from `box` (5,) to each of `boxes` (n, 5) -> (n,); 0 where they overlap or touch.

    Between disjoint convex polygons the shortest segment ends in a corner of one of them, so it is the
    least of eight distances from a point to an axis-parallel rectangle, each in the rectangle's frame.
    """
    turns = boxes[:, 2] - box[2]
    cos, sin = np.cos(turns), np.sin(turns)
    centres = _on_axes(boxes[:, :2] - box[:2], box, boxes)
    is_apart = (np.abs(centres) > _reaches(box, boxes, cos, sin)).any(axis=1)
    half_box, half_boxes = 0.5 * box[3:5], 0.5 * boxes[:, 3:5]
    here = _least_squares(centres[:, :2], half_box, half_boxes, cos, sin)
    there = _least_squares(-centres[:, 2:], half_boxes, half_box, cos, -sin)
    return np.where(is_apart, np.sqrt(np.minimum(here, there)), 0.0)


def contact_times(box: Floats, velocity: Floats, boxes: Floats, velocities: Floats, horizon: float) -> Floats:
    """When boxes that keep their velocities and headings first touch `box`: (n,) [s], inf if not within `horizon`.

    Exact: on each of the four separating axes the projections overlap over one interval of time, and
    the boxes touch during the intersection of the four. 0 where they touch already.

    Args:
        box: (5,).
        velocity: (2,) of `box` [m/s].
        boxes: (n, 5).
        velocities: (n, 2) [m/s].
        horizon: how far to look ahead [s].
    """
    turns = boxes[:, 2] - box[2]
    reaches = _reaches(box, boxes, np.cos(turns), np.sin(turns))
    vectors = np.empty((2, len(boxes), 2))
    np.subtract(boxes[:, :2], box[:2], out=vectors[0])
    np.subtract(velocities, velocity, out=vectors[1])
    centres, speeds = _on_axes(vectors, box, boxes)
    # A motion too slow to matter stands for none: its interval is as good as endless, or as good as never.
    speeds = np.where(np.abs(speeds) < _STILL, _STILL, speeds)
    one, other = (-reaches - centres) / speeds, (reaches - centres) / speeds
    first = np.maximum(np.minimum(one, other).max(axis=1), 0.0)
    last = np.maximum(one, other).min(axis=1)
    return np.where((first <= last) & (first <= horizon), first, np.inf)


def _on_axes(vectors: Floats, box: Floats, boxes: Floats) -> Floats:
    """Vectors (..., n, 2) along length and width of `box`, then of their own row of `boxes`: (..., n, 4)."""
    found = np.empty((*vectors.shape[:-1], 4))
    x, y = vectors[..., 0], vectors[..., 1]
    for column, heading in ((0, box[2]), (2, boxes[:, 2])):
        cos, sin = np.cos(heading), np.sin(heading)
        found[..., column] = x * cos + y * sin
        found[..., column + 1] = y * cos - x * sin
    return found


def _reaches(box: Floats, boxes: Floats, cos: Floats, sin: Floats) -> Floats:
    """On the axes of `_on_axes`, the distance of the centres below which the projections overlap: (n, 4)."""
    cos, sin = np.abs(cos), np.abs(sin)
    length, width, lengths, widths = box[3], box[4], boxes[:, 3], boxes[:, 4]
    found = np.empty((len(boxes), 4))
    found[:, 0] = length + lengths * cos + widths * sin
    found[:, 1] = width + lengths * sin + widths * cos
    found[:, 2] = lengths + length * cos + width * sin
    found[:, 3] = widths + length * sin + width * cos
    found *= 0.5
    return found


def _least_squares(centres: Floats, target: Floats, half: Floats, cos: Floats, sin: Floats) -> Floats:
    """Least squared distance [m^2] from a rectangle's corners to the target, in the target's frame: (n,).

    Args:
        centres: (n, 2) of the rectangles.
        target: (2,) or (n, 2) half length and width of the targets.
        half: (2,) or (n, 2) half length and width of the rectangles.
        cos: (n,) of the rectangles' heading relative to the target's.
        sin: (n,) likewise.
    """
    along, across = half[..., :1] * _SIGNS[:, 0], half[..., 1:] * _SIGNS[:, 1]
    cos, sin = cos[:, None], sin[:, None]
    beyond_x = np.abs(centres[:, :1] + along * cos - across * sin) - target[..., :1]
    beyond_y = np.abs(centres[:, 1:] + along * sin + across * cos) - target[..., 1:]
    np.maximum(beyond_x, 0.0, out=beyond_x)
    np.maximum(beyond_y, 0.0, out=beyond_y)
    squares: Floats = (beyond_x * beyond_x + beyond_y * beyond_y).min(axis=1)
    return squares
