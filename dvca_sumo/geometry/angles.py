"""Angles in the mathematical sense: radians, counter-clockwise from +x."""

import math

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

# As arrays: Python's own numbers take numpy longer to read than to add.
_HALF_TURN, _TURN = np.array(math.pi), np.array(2.0 * math.pi)


def wrapped(angle: float) -> float:
    """The same direction as `angle` [rad], in (-pi, pi]."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi)


def wrapped_all(angles: Floats) -> Floats:
    """`wrapped`, element by element."""
    within: Floats = _HALF_TURN - (_HALF_TURN - angles) % _TURN
    return within
