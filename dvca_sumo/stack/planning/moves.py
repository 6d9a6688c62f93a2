"""Moves sideways off the reference line and back: minimum-jerk quintics, and how long they have to be."""

import math
from typing import NamedTuple, TypeVar

import numpy as np

from dvca_sumo.messages import Floats, VehicleShape
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.reference import BEHIND, Window

OVER_LINE = 0.1  # [m] over the lane marking is not yet another lane

_PEAK = 5.7735  # highest second derivative of a minimum-jerk blend of size 1 over length 1: 10 / sqrt(3)
_SHORTEST_BLEND = 6.0  # [m]
_SHORTEST_REST = 1.0  # [m] of a move that is nearly done
_STRETCH = 1.1
_LONGEST = 20.0  # [m] of a move: on more, the front hardly swings out
_TOLERANCE = 1.1  # of curvature, so that a move found feasible is found so again from every point on it
# The slope where a move begins, times its length, by what is left to the target: up to 2.5 it does not pass that, and
# what is left of such a move does not come to more than this.
_SWINGING = 4.0
_UNNOTICED = 1.0  # [m] of slope times length carry it 0.16 m past
_AWAY = 0.05  # [m] that the bend of the way up to there may carry a move farther from its target first
_SAMPLES = (0.15, 0.3, 0.5, 0.7, 0.85)

_Terms = tuple[float, float, float, float, float]
_Number = TypeVar("_Number", float, Floats)


class Lateral(NamedTuple):
    """Offset from the reference line and its first two derivatives by station."""

    offset: float  # [m]
    slope: float
    bend: float  # [1/m]

    @property
    def unsettled(self) -> float:
        """How far it is from rest on the line, a slope of 1 counting for 4 m of offset [m]."""
        return abs(self.offset) + 4.0 * abs(self.slope)


class Move(NamedTuple):
    """The quintic of least jerk from `state` to rest at `target`."""

    state: Lateral
    target: float  # [m] offset
    begin: float  # [m] station of the window
    length: float  # [m]


def blend_length(shift: float, speed: float, config: PlanningConfig) -> float:
    """How long a sideways move of `shift` [m] has to be for comfort at `speed`, and for the steering [m]."""
    sharpest = min(config.curvature, config.shift_acceleration / max(speed * speed, 0.1))
    return max(_SHORTEST_BLEND, math.sqrt(_PEAK * abs(shift) / sharpest))


def feasible_length(move: Move, speed: float, window: Window, config: PlanningConfig) -> float:
    """The length of `move` [m], less where it would swing past its target, more where tyres or steering cannot follow.

    Against a bend of the line the wheels only turn back: there it may be as much sharper as the line bends.
    """
    state, target, begin, length = move
    sharpest = min(config.curvature, config.hard_shift_acceleration / max(speed * speed, 0.1))
    sharpest = max(_TOLERANCE * sharpest, abs(state.bend))
    gap = target - state.offset
    if state.slope * gap > 0.0:
        length = min(length, max(_SWINGING * abs(gap), _UNNOTICED) / abs(state.slope))
    length = max(length, _SHORTEST_REST)
    while True:
        terms, squared = _terms(state, target, length), length * length
        for u in _SAMPLES:
            line, bend = window.curvatures.item(_row(window, begin + u * length)), _second(terms, u) / squared
            if abs(bend) > sharpest + (abs(line) if bend * line < 0.0 else 0.0):
                break
        else:
            return length
        length *= _STRETCH


def bent_less(move: Move) -> Move:
    """`move`, bent less where it begins if that would carry it farther from its target first, over all of its length.

    The ego was about to follow another bend than the line's. What its slope carries away is left as it is.
    """
    state, target, _, length = move
    side = math.copysign(1.0, target - state.offset)
    away = -side * state.bend
    if away <= 0.0:
        return move
    terms = _terms(state._replace(bend=0.0), target, length)
    for u in _SAMPLES:
        nearer = side * _risen(terms, u)[0]
        if nearer < -_AWAY:
            return move
        # A bend of 1 and nothing else makes a quintic of u^2 (1 - u)^3 / 2, times the square of its length.
        away = min(away, 2.0 * (nearer + _AWAY) / ((length * u) ** 2 * (1.0 - u) ** 3))
    return move._replace(state=state._replace(bend=-side * away))


def roomy_length(move: Move, window: Window, shape: VehicleShape) -> float:
    """The length of `move` [m], or more: the front is not to swing out.

    That is out of the lane, for a target within it, or else out of the road; where it is out already, or is to be, no
    farther. Infinite where no length does it.
    """
    state, target, begin, length = move
    left = target > state.offset
    side, body = (1.0, window.swept_left) if left else (-1.0, window.swept_right)
    lane, road = (window.lane_left, window.road_left) if left else (window.lane_right, window.road_right)
    least = max(side * target, side * (state.offset + shape.front * state.slope))
    if length >= _LONGEST:
        return length
    while length < _LONGEST:
        terms = _terms(state, target, length)
        for u in _SAMPLES:
            risen, slope = _risen(terms, u)
            front = side * (state.offset + risen + shape.front * slope / length)
            row = _row(window, begin + u * length + shape.front)
            room = side * float(road[row] - body[row])
            in_lane = side * float(lane[row] - body[row]) + OVER_LINE
            if side * target <= in_lane:
                room = min(room, in_lane)
            if front > max(room, least):
                break
        else:
            return length
        length *= _STRETCH
    return math.inf


def moved(move: Move, along: Floats) -> tuple[Floats, float]:
    """Offset and slope at distances `along` from where `move` begins (2, n), and the bend at the first of them."""
    state, target, _, length = move
    terms, u = _terms(state, target, length), along / length
    risen, slopes = _risen(terms, u)
    offsets = np.empty((2, len(u)))
    np.add(risen, state.offset, out=offsets[0])
    np.divide(slopes, length, out=offsets[1])
    return offsets, _second(terms, float(u[0])) / (length * length)


def _row(window: Window, station: float) -> int:
    return min(int(station) + BEHIND, len(window.curvatures) - 1)


def _terms(state: Lateral, target: float, length: float) -> _Terms:
    """Coefficients of u ... u^5 of the quintic that rises from `state`, at u = 0, to rest at `target`, at u = 1."""
    first, second = state.slope * length, 0.5 * state.bend * length * length
    gap = target - state.offset - first - second
    slope_gap, bend_gap = -first - 2.0 * second, -2.0 * second
    third = 10.0 * gap - 4.0 * slope_gap + 0.5 * bend_gap
    fourth = -15.0 * gap + 7.0 * slope_gap - bend_gap
    return first, second, third, fourth, 6.0 * gap - 3.0 * slope_gap + 0.5 * bend_gap


def _risen(terms: _Terms, u: _Number) -> tuple[_Number, _Number]:
    """The quintic without its value at u = 0, and its derivative by u."""
    first, second, third, fourth, fifth = terms
    return (
        u * (first + u * (second + u * (third + u * (fourth + u * fifth)))),
        first + u * (2.0 * second + u * (3.0 * third + u * (4.0 * fourth + u * (5.0 * fifth)))),
    )


def _second(terms: _Terms, u: float) -> float:
    """The second derivative of the quintic by u."""
    _, second, third, fourth, fifth = terms
    return 2.0 * second + u * (6.0 * third + u * (12.0 * fourth + u * 20.0 * fifth))
