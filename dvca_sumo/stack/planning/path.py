"""The path: the reference line moved sideways, and the room the ego's body needs on it."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from dvca_sumo.messages import Floats, VehicleShape
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.moves import Lateral, Move, bent_less, blend_length, feasible_length, moved, roomy_length
from dvca_sumo.stack.planning.reference import BEHIND, Window, swept
from dvca_sumo.stack.planning.start import STANDING, StartState

_AT_REST = 0.2  # [m] less than that does not make the front swing out
_STEEPEST = 0.55  # [rad] largest angle between path and reference line
_SHARPEST = 0.25  # [1/m] largest initial second derivative taken over from the start state
_UNDERWAY = 1.5  # of a move's length: a move begun early, because the ego was faster then, is not taken back
_FADE: Floats = np.exp(np.arange(30) / -5.0)  # by station: how much is left of what projection missed the start by
_CENTRED = Lateral(0.0, 0.0, 0.0)


class Plateau(NamedTuple):
    """A stretch of the window on which the rear axle keeps an offset."""

    begin: float  # [m]
    end: float  # [m]
    offset: float  # [m] left positive


class Path(msgspec.Struct, frozen=True, eq=False):
    """Geometry of the plan for the rear axle; place i lies at station i of the window."""

    rows: Floats  # (5, n), the next five
    arcs: Floats  # (n,) [m] length of path from place 0
    x: Floats  # (n,) [m]
    y: Floats  # (n,) [m]
    headings: Floats  # (n,) [rad], continuous
    curvatures: Floats  # (n,) [1/m]
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
    if start.speed < STANDING:
        bend = 0.0
    return Lateral(offset, scale * tangent, min(max(bend, -_SHARPEST), _SHARPEST))


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
    (offsets, slopes), bend = _profile(_moves(lateral, plateaus, start.speed, window, shape, config), lateral, count)
    line = window.rows[:6, BEHIND:]
    _, _, cosines, sines, line_headings, line_curvatures = line
    rows = np.empty((5, count))
    arcs, x, y, headings, curvatures = rows
    np.subtract(line[0], offsets * sines, out=x)
    np.add(line[1], offsets * cosines, out=y)
    fade = _FADE[:count]  # near the end of the line the window is short
    x[: len(fade)] += (start.x - x[0]) * fade
    y[: len(fade)] += (start.y - y[0]) * fade
    scale = 1.0 - line_curvatures * offsets
    tangents = slopes / scale
    ways = scale * np.sqrt(1.0 + tangents * tangents)  # along the path, per metre of the line
    angles, turns = np.arctan(tangents), np.zeros(count)
    turns[0] = bend * scale[0] / (ways[0] * ways[0])
    turns[1:-1] = 0.5 * (angles[2:] - angles[:-2])  # what they are at a row says little of moves as short as rows are
    np.add(line_headings, angles, out=headings)
    np.divide(line_curvatures + turns, ways, out=curvatures)
    arcs[0] = 0.0
    np.hypot(x[1:] - x[:-1], y[1:] - y[:-1]).cumsum(out=arcs[1:])
    sides = np.empty((2, BEHIND + count))
    sides[:, BEHIND:] = swept(rows[1:3], headings, line[:4], shape)
    sides[:, :BEHIND] = sides[:, BEHIND : BEHIND + 1]
    return Path(rows, *rows, *sides)


def way_back(
    state: Lateral, begin: float, speed: float, window: Window, shape: VehicleShape, config: PlanningConfig
) -> Move:
    """The move back to the line, from station `begin` [m]: in comfort, if tyres, steering and the front allow it."""
    unsettled = state.unsettled
    comfortable = Move(state, 0.0, begin, blend_length(unsettled, speed, config))
    move = Move(state, 0.0, begin, feasible_length(comfortable, speed, window, config))
    if unsettled > _AT_REST:
        roomy = roomy_length(move, window, shape)
        return move if roomy == math.inf else Move(state, 0.0, begin, roomy)
    return move


def _profile(moves: list[Move], lateral: Lateral, count: int) -> tuple[Floats, float]:
    """Offset and slope at stations 0 ... count-1 (2, count), by holds and moves between; the bend at station 0."""
    profile, bend = np.zeros((2, count)), 0.0
    position, offset = 0.0, lateral.offset
    for move in moves:
        end = move.begin + move.length
        first, last = math.ceil(move.begin), min(math.ceil(end), count)
        profile[0, math.ceil(position) : first] = offset
        if first < last:
            along = np.arange(first, last, dtype=np.float64) - move.begin
            profile[:, first:last], bent = moved(move, along)
            bend = bend if first else bent
        position, offset = end, move.target
    profile[0, math.ceil(position) :] = offset
    return profile, bend


def _moves(
    lateral: Lateral,
    plateaus: Sequence[Plateau],
    speed: float,
    window: Window,
    shape: VehicleShape,
    config: PlanningConfig,
) -> list[Move]:
    """The sideways moves, in order.

    A move ends at a fixed place (where its plateau begins), so that planning it again from any point on
    it gives the same curve. The ego returns to its lane between plateaus where that takes less than the way.
    """
    moves: list[Move] = []
    position, state, unsettled = 0.0, lateral, lateral.unsettled
    for plateau in plateaus:
        length = blend_length(max(abs(plateau.offset - state.offset), unsettled), speed, config)
        back = way_back(state, position, speed, window, shape, config)
        is_underway = not moves and state.offset * plateau.offset > 0.0
        if plateau.begin - (_UNDERWAY * length if is_underway else length) > position + back.length:
            moves.append(back)
            position, state, unsettled = position + back.length, _CENTRED, 0.0
            length = blend_length(plateau.offset, speed, config)
        begin = max(position, plateau.begin - length) if moves else position
        move = Move(state, plateau.offset, begin, plateau.begin - begin)
        move = move._replace(length=feasible_length(move, speed, window, config))
        moves.append(move)
        position = max(plateau.end, begin + move.length)
        state, unsettled = Lateral(plateau.offset, 0.0, 0.0), 0.0
    moves.append(way_back(state, position, speed, window, shape, config))
    moves[0] = bent_less(moves[0])
    return moves
