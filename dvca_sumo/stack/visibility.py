"""What a ray-casting sensor at the origin sees of flat boxes.

A box is a row of x, y (centre), heading, length, width in the sensor's frame. Heights are unknown, so
a body either hides what is behind it or, when it is too narrow, hides nothing.
"""

import numpy as np

from dvca_sumo.geometry.angles import wrapped_all
from dvca_sumo.messages import Flags, Floats

RAYS = 8  # cast per box, evenly over the angle it fills; the sensor resolves shares of 1/8

_RAY_SHARES = (np.arange(RAYS) + 0.5) / RAYS - 0.5  # from the middle of the angle
_SIDES = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]]).T[:, None, :] / 2.0  # of the four corners


def nearest_distances(boxes: Floats) -> Floats:
    """Distance from the origin to the nearest point of each box [m], shape (n,); 0 where it lies inside."""
    along, across = _centres_in_box_axes(boxes)
    beyond_x = np.maximum(np.abs(along) - boxes[:, 3] / 2.0, 0.0)
    beyond_y = np.maximum(np.abs(across) - boxes[:, 4] / 2.0, 0.0)
    distances: Floats = np.hypot(beyond_x, beyond_y)
    return distances


def visible_shares(boxes: Floats, occluder_width: float) -> Floats:
    """Share of the angle each box fills that no nearer body covers, shape (n,), in steps of 1 / RAYS.

    Bodies narrower or shorter than `occluder_width` [m] and those that contain the origin hide nothing.
    Hits are exact (slab method, Kay and Kajiya: Ray tracing complex scenes, 1986): a long wall hides
    what is behind it, not what stands in front of its far end.
    """
    count = len(boxes)
    hides = np.minimum(boxes[:, 3], boxes[:, 4]) >= occluder_width
    if count < 2 or not hides.any():
        return np.ones(count)
    middles, halves = _angles(boxes)
    apart = np.abs(middles[:, None] - middles)
    overlap = np.minimum(apart, 2.0 * np.pi - apart) <= halves[:, None] + halves
    overlap &= hides
    np.fill_diagonal(overlap, val=True)
    seen, hiding = overlap.nonzero()
    if len(seen) == count:  # each is alone in its direction
        return np.ones(count)
    entries = _entries(boxes[hiding], (middles[:, None] + 2.0 * halves[:, None] * _RAY_SHARES)[seen])
    own = entries[seen == hiding]
    nearest = np.minimum.reduceat(entries, seen.searchsorted(np.arange(count)))
    # A box is never hidden by itself; an origin inside it has no entry point, and it is seen.
    unhidden = (own <= nearest + 1e-9) | np.isinf(own)
    shares: Floats = unhidden.sum(axis=1) / RAYS
    return shares


def are_hidden(points: Floats, boxes: Floats, margin: float) -> Flags:
    """Which `points` (k, 2) lie more than `margin` [m] behind the near side of one of the `boxes` (n, 5): (k,)."""
    bearings = np.arctan2(points[:, 1], points[:, 0])
    entries = _entries(boxes, bearings[None])
    hidden: Flags = np.any(entries < np.hypot(points[:, 0], points[:, 1]) - margin, axis=0)
    return hidden


def _angles(boxes: Floats) -> tuple[Floats, Floats]:
    """The angle each box fills [rad]: bearing of its middle, in [-pi, pi], and half of it."""
    half_length, half_width = boxes[:, 3, None] * _SIDES[0], boxes[:, 4, None] * _SIDES[1]
    cos, sin = np.cos(boxes[:, 2, None]), np.sin(boxes[:, 2, None])
    x, y = boxes[:, 0, None], boxes[:, 1, None]
    corner_x = x + cos * half_length - sin * half_width
    corner_y = y + sin * half_length + cos * half_width
    offsets = np.arctan2(x * corner_y - y * corner_x, x * corner_x + y * corner_y)  # from the bearing of the centre
    low, high = offsets.min(axis=1), offsets.max(axis=1)
    return wrapped_all(np.arctan2(boxes[:, 1], boxes[:, 0]) + 0.5 * (low + high)), 0.5 * (high - low)


def _entries(boxes: Floats, bearings: Floats) -> Floats:
    """Distance at which rays enter their boxes [m], inf where they miss or start inside.

    Args:
        boxes: (p, 5).
        bearings: (p, r) [rad], of the rays cast at each box.

    Returns:
        (p, r).
    """
    ray_x, ray_y = np.cos(bearings), np.sin(bearings)
    cos, sin = np.cos(boxes[:, 2, None]), np.sin(boxes[:, 2, None])
    along, across = _centres_in_box_axes(boxes)
    enter_x, leave_x = _slab(cos * ray_x + sin * ray_y, along, boxes[:, 3])
    enter_y, leave_y = _slab(cos * ray_y - sin * ray_x, across, boxes[:, 4])
    enter = np.maximum(enter_x, enter_y)
    is_hit = (enter > 0.0) & (enter <= np.minimum(leave_x, leave_y))
    entries: Floats = np.where(is_hit, enter, np.inf)
    return entries


def _slab(slopes: Floats, centres: Floats, sizes: Floats) -> tuple[Floats, Floats]:
    """Where rays enter and leave strips: (p, r) slopes to the strips' normals, (p,) centres and sizes."""
    slopes[slopes == 0.0] = 1e-12  # parallel: the strip is crossed far away or never
    inverse = 1.0 / slopes
    middle = centres[:, None] * inverse
    half = 0.5 * sizes[:, None] * np.abs(inverse)
    return middle - half, middle + half


def _centres_in_box_axes(boxes: Floats) -> tuple[Floats, Floats]:
    cos, sin = np.cos(boxes[:, 2]), np.sin(boxes[:, 2])
    x, y = boxes[:, 0], boxes[:, 1]
    return cos * x + sin * y, cos * y - sin * x
