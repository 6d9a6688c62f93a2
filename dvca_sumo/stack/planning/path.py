"""The path: the reference line moved sideways by minimum-jerk blends, and the room the ego's body needs on it."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeVar

import msgspec
import numpy as np

from dvca_sumo.messages import Floats, VehicleShape
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.reference import BEHIND, Window, swept
from dvca_sumo.stack.planning.start import StartState

_PEAK = 5.7735  # highest second derivative of a minimum-jerk blend of size 1 over length 1: 10 / sqrt(3)
_SHORTEST_BLEND = 6.0  # [m]
_SHORTEST_REST = 1.0  # [m] of a move that is nearly done
_STRETCH = 1.1
_LONGEST = 20.0  # [m] of a move: on more, the front hardly swings out
OVER_LINE = 0.1  # [m] over the lane marking is not yet another lane
_AT_REST = 0.2  # [m] less than that does not make the front swing out
_TOLERANCE = 1.1  # of curvature, so that a move found feasible is found so again from every point on it
_SAMPLES = (0.15, 0.3, 0.5, 0.7, 0.85)
_STEEPEST = 0.55  # [rad] largest angle between path and reference line
_STANDING = 0.05  # [m/s]
_SHARPEST = 0.25  # [1/m] largest initial second derivative taken over from the start state
_UNDERWAY = 1.5  # of a move's length: a move begun early, because the ego was faster then, is not taken back
_FADE: Floats = np.exp(np.arange(30) / -5.0)  # by station: how much is left of what projection missed the start by

_Terms = tuple[float, float, float, float, float]
_Number = TypeVar("_Number", float, Floats)


class Plateau(NamedTuple):
    """A stretch of the window on which the rear axle keeps an offset."""

    begin: float  # [m]
    end: float  # [m]
    offset: float  # [m] left positive


class Lateral(NamedTuple):
    """Offset from the reference line and its first two derivatives by station."""

    offset: float  # [m]
    slope: float
    bend: float  # [1/m]

    @property
    def unsettled(self) -> float:
        """How far it is from rest on the line, a slope of 1 counting for 4 m of offset [m]."""
        return abs(self.offset) + 4.0 * abs(self.slope)


_CENTRED = Lateral(0.0, 0.0, 0.0)


class Path(msgspec.Struct, frozen=True, eq=False):
    """Geometry of the plan for the rear axle; row i lies at station i of the window."""

    x: Floats  # (n,) [m]
    y: Floats  # (n,) [m]
    headings: Floats  # (n,) [rad], continuous
    curvatures: Floats  # (n,) [1/m]
    arcs: Floats  # (n,) [m] length of path from row 0
    left: Floats  # (BEHIND + n,) rows of the window: leftmost offset that the body sweeps at each station [m]
    right: Floats  # (BEHIND + n,) rightmost [m]


def lateral_start(start: StartState, window: Window, offset: float) -> Lateral:
    """The start state relative to the reference line at the window's origin.

    An ego that stands turns its wheels where it is, and is not bound to how they are turned.
    """
    curvature = float(window.curvatures[BEHIND])
    scale = max(1.0 - curvature * offset, 0.2)
    angle = math.remainder(start.heading - float(window.headings[BEHIND]), 2.0 * math.pi)
    tangent = math.tan(min(max(angle, -_STEEPEST), _STEEPEST))
    cosine = 1.0 / math.hypot(1.0, tangent)
    bend = (start.curvature * scale / cosine - curvature) * scale / (cosine * cosine)
    if start.speed < _STANDING:
        bend = 0.0
    return Lateral(offset, scale * tangent, min(max(bend, -_SHARPEST), _SHARPEST))


def blend_length(shift: float, speed: float, config: PlanningConfig) -> float:
    """How long a sideways move of `shift` [m] has to be for comfort at `speed`, and for the steering [m]."""
    sharpest = min(config.curvature, config.shift_acceleration / max(speed * speed, 0.1))
    return max(_SHORTEST_BLEND, math.sqrt(_PEAK * abs(shift) / sharpest))


def feasible_length(state: Lateral, target: float, length: float, speed: float, config: PlanningConfig) -> float:
    """`length` [m] of a move from `state` to `target`, or more where tyres or steering could not follow it."""
    sharpest = min(config.curvature, config.hard_shift_acceleration / max(speed * speed, 0.1))
    sharpest = max(_TOLERANCE * sharpest, abs(state.bend))
    length = max(length, _SHORTEST_REST)
    while True:
        _, second, third, fourth, fifth = _terms(state, target, length)
        peak = max(abs(2.0 * second + u * (6.0 * third + u * (12.0 * fourth + u * 20.0 * fifth))) for u in _SAMPLES)
        if peak <= sharpest * length * length:
            return length
        length *= _STRETCH


def roomy_length(
    state: Lateral, target: float, begin: float, length: float, window: Window, shape: VehicleShape
) -> float:
    """`length` [m] of a move from `state`, at station `begin`, to `target`, or more: the front is not to swing out.

    That is out of the lane, for a target within it, or else out of the road; where it is out already, or is to be, no
    farther. Infinite where no length does it.
    """
    left = target > state.offset
    side, body = (1.0, window.swept_left) if left else (-1.0, window.swept_right)
    lane, road = (window.lane_left, window.road_left) if left else (window.lane_right, window.road_right)
    least = max(side * target, side * (state.offset + shape.front * state.slope))
    if length >= _LONGEST:
        return length
    while length < _LONGEST:
        for ahead, offset in _front_offsets(state, target, length, shape.front):
            row = min(int(begin + ahead) + BEHIND, len(body) - 1)
            room = side * float(road[row] - body[row])
            in_lane = side * float(lane[row] - body[row]) + OVER_LINE
            if side * target <= in_lane:
                room = min(room, in_lane)
            if side * offset > max(room, least):
                break
        else:
            return length
        length *= _STRETCH
    return math.inf


def path_along(
    window: Window,
    start: StartState,
    lateral: Lateral,
    plateaus: Sequence[Plateau],
    shape: VehicleShape,
    config: PlanningConfig,
) -> Path:
    """From the start state onto the reference line, or onto the plateaus where there are any."""
    count = window.rows.shape[1] - BEHIND
    (offsets, slopes), bend = _profile(_blends(lateral, plateaus, start.speed, window, shape, config), lateral, count)
    line = window.rows[:6, BEHIND:]
    _, _, cosines, sines, line_headings, line_curvatures = line
    points = np.empty((2, count))
    x, y = points
    np.subtract(line[0], offsets * sines, out=x)
    np.add(line[1], offsets * cosines, out=y)
    fade = _FADE[:count]  # near the end of the line the window is short
    x[: len(fade)] += (start.x - x[0]) * fade
    y[: len(fade)] += (start.y - y[0]) * fade
    scale = 1.0 - line_curvatures * offsets
    tangents = slopes / scale
    cosines_to_line = 1.0 / np.sqrt(1.0 + tangents * tangents)
    angles, turns = np.arctan(tangents), np.zeros(count)
    turns[0] = bend * cosines_to_line[0] * cosines_to_line[0] / scale[0]
    turns[1:-1] = 0.5 * (angles[2:] - angles[:-2])  # what they are at a row says little of moves as short as rows are
    arcs = np.zeros(count)
    np.hypot(*(points[:, 1:] - points[:, :-1])).cumsum(out=arcs[1:])
    headings = line_headings + angles
    sides = np.empty((2, BEHIND + count))
    sides[:, BEHIND:] = swept(points, headings, line[:4], shape)
    sides[:, :BEHIND] = sides[:, BEHIND : BEHIND + 1]
    return Path(x, y, headings, (line_curvatures + turns) * cosines_to_line / scale, arcs, *sides)


def _profile(blends: list[tuple[float, float, float]], lateral: Lateral, count: int) -> tuple[Floats, float]:
    """Offset and slope at stations 0 ... count-1 (2, count), by holds and blends between; the bend at station 0."""
    profile, bend = np.zeros((2, count)), 0.0
    position, state = 0.0, lateral
    for begin, end, target in blends:
        first, last = math.ceil(begin), min(math.ceil(end), count)
        profile[0, math.ceil(position) : first] = state.offset
        if first < last:
            along = np.arange(first, last, dtype=np.float64) - begin
            profile[:, first:last], bent = _blend(state, target, end - begin, along)
            bend = bend if first else bent
        position, state = end, Lateral(target, 0.0, 0.0)
    profile[0, math.ceil(position) :] = state.offset
    return profile, bend


def _blends(
    lateral: Lateral,
    plateaus: Sequence[Plateau],
    speed: float,
    window: Window,
    shape: VehicleShape,
    config: PlanningConfig,
) -> list[tuple[float, float, float]]:
    """Begin, end and target of each sideways move, in order.

    A move ends at a fixed place (where its plateau begins), so that planning it again from any point on
    it gives the same curve. The ego returns to its lane between plateaus where that takes less than the way.
    """
    blends: list[tuple[float, float, float]] = []
    position, state, unsettled = 0.0, lateral, lateral.unsettled
    for plateau in plateaus:
        length = blend_length(max(abs(plateau.offset - state.offset), unsettled), speed, config)
        back = _way_back(state, position, speed, window, shape, config)
        is_underway = not blends and state.offset * plateau.offset > 0.0
        if plateau.begin - (_UNDERWAY * length if is_underway else length) > position + back:
            blends.append((position, position + back, 0.0))
            position, state, unsettled = position + back, _CENTRED, 0.0
            length = blend_length(plateau.offset, speed, config)
        begin = max(position, plateau.begin - length) if blends else position
        reached = begin + feasible_length(state, plateau.offset, plateau.begin - begin, speed, config)
        blends.append((begin, reached, plateau.offset))
        position, state, unsettled = max(plateau.end, reached), Lateral(plateau.offset, 0.0, 0.0), 0.0
    back = _way_back(state, position, speed, window, shape, config)
    blends.append((position, position + back, 0.0))
    return blends


def _way_back(
    state: Lateral, begin: float, speed: float, window: Window, shape: VehicleShape, config: PlanningConfig
) -> float:
    """How long the move back to the line is [m]."""
    length = feasible_length(state, 0.0, blend_length(state.unsettled, speed, config), speed, config)
    if state.unsettled > _AT_REST:
        roomy = roomy_length(state, 0.0, begin, length, window, shape)
        return roomy if roomy < math.inf else length
    return length


def _front_offsets(state: Lateral, target: float, length: float, front: float) -> Iterator[tuple[float, float]]:
    """Where the middle of the front, so far ahead of the rear axle, comes during a move: stations and offsets [m]."""
    terms = _terms(state, target, length)
    for u in _SAMPLES:
        risen, slope = _risen(terms, u)
        yield u * length + front, state.offset + risen + front * slope / length


def _blend(state: Lateral, target: float, length: float, along: Floats) -> tuple[Floats, float]:
    """The quintic of least jerk from `state` to rest at `target` after `length`.

    Offset and slope at distances `along` (2, n), and the bend at the first of them.
    """
    terms, u = _terms(state, target, length), along / length
    risen, slopes = _risen(terms, u)
    blend = np.empty((2, len(u)))
    np.add(risen, state.offset, out=blend[0])
    np.divide(slopes, length, out=blend[1])
    _, second, third, fourth, fifth = terms
    begin = float(u[0])
    bend = 2.0 * second + begin * (6.0 * third + begin * (12.0 * fourth + begin * (20.0 * fifth)))
    return blend, bend / (length * length)


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
