"""Angles in the mathematical sense: radians, counter-clockwise from +x."""

import math

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def wrapped(angle: float) -> float:
    """The same direction as `angle` [rad], in (-pi, pi]."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi)


def wrapped_all(angles: Floats) -> Floats:
    """`wrapped`, element by element."""
    return np.pi - (np.pi - angles) % (2.0 * np.pi)
