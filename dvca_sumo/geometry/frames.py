"""Moving poses from one frame to another."""

import math

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Pose = tuple[float, float, float]  # x, y [m], heading [rad]


def transferred(poses: Floats, source: Pose, target: Pose) -> Floats:
    """Poses (n, 3) that lie to `target` as the given ones lie to `source`.

    What a sensor on a vehicle at `source` measures is placed so on the map of a vehicle that
    believes to be at `target`.
    """
    turn = target[2] - source[2]
    cos, sin = math.cos(turn), math.sin(turn)
    dx, dy = poses[:, 0] - source[0], poses[:, 1] - source[1]
    return np.column_stack([target[0] + cos * dx - sin * dy, target[1] + sin * dx + cos * dy, poses[:, 2] + turn])


def rotated(vectors: Floats, turn: float) -> Floats:
    """Vectors (n, 2) turned counter-clockwise by `turn` [rad]."""
    cos, sin = math.cos(turn), math.sin(turn)
    return np.column_stack([cos * vectors[:, 0] - sin * vectors[:, 1], sin * vectors[:, 0] + cos * vectors[:, 1]])


def relative(pose: Pose, origin: Pose) -> Pose:
    """`pose` as seen from `origin`: forward, left [m], turn [rad]."""
    dx, dy = pose[0] - origin[0], pose[1] - origin[1]
    cos, sin = math.cos(origin[2]), math.sin(origin[2])
    return (cos * dx + sin * dy, cos * dy - sin * dx, pose[2] - origin[2])
