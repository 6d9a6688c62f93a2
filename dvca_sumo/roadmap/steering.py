"""Turns that no car can follow, drawn as a car can drive them: steering first, then as little off the road as can be.

Some nets draw a right angle, or a turn back, within the width of one lane. There the line becomes a chain
of short arcs, none sharper than wheels turn, and none more suddenly, so that the corners of a body whose
rear axle follows it leave the road as little as possible (nonlinear least squares by Gauss-Newton steps,
damped as by Levenberg and Marquardt). A driver does the same: swings out, turns the wheel fully, cuts in.
"""

from collections.abc import Iterator
from typing import NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from dvca_sumo.geometry.polyline import Floats, Polyline

Integers = npt.NDArray[np.int64]

_UNSTEERABLE = 0.19  # [1/m] a car of 5 m turns at 0.2 with its wheels at 0.55 rad; the rest is for corrections
_STEERED = 0.18  # [1/m] drawn instead
_TOO_QUICK = 0.06  # [1/m^2] change of curvature: at 3.5 m/s wheels turn by 0.6 rad/s
_QUICKEST = 0.05  # [1/m^2] drawn instead
_REVERSAL = 2.0  # [m] before and after: a shorter kink moves no car off the line
_FRONT, _REAR, _HALF_WIDTH = 4.1, 0.9, 0.9  # [m] such a car's body around its rear axle
_CORNERS = np.array([(ahead, side) for ahead in (_FRONT, -_REAR) for side in (_HALF_WIDTH, -_HALF_WIDTH)])
_STRAY = 0.15  # [m] a corner beyond the edge of the lane that the line is drawn anew for
_CLEARANCE = 0.1  # [m] wanted between a corner and the road's edge
_BETWEEN = 0.25  # [m] points of the line, about
_PASS = 12.0  # [m] of line within which a point of it is looked for: farther on it may have turned back
_ABREAST = 0.25  # [m] between the stations that points are told to be abreast of
_ITERATIONS = 60
_ENOUGH = 1e-4  # relative gain of a step that is not worth another one

# Weights. What must hold outweighs the road, the road outweighs what would only be nice.
_AT_END = 30.0  # [1/m] and [1/rad]
_TOO_SHARP = 300.0  # [m] and [m^2]: too sharp, too quick
_OFF_ROAD = 1.0  # [1/m]
_OFF_LINE = 0.1  # [1/m]
_CHANGE = 5.0  # [m^2] of curvature along the way


class Redrawing(NamedTuple):
    """How the line is drawn anew."""

    run_up: float  # [m] before and after a place over which the line may move
    step: float  # [m] length of an arc, about


WHOLE = Redrawing(20.0, 0.5)  # a turn that cannot be driven
PART = Redrawing(12.0, 1.0)  # one that only wants to be driven better


class _Window(msgspec.Struct, frozen=True, eq=False):
    """A stretch to draw anew, with the road's edges at each of its points [m]."""

    line: Polyline
    left: Floats
    right: Floats


class _Chain(NamedTuple):
    """Arcs of equal length: n turns [rad], n + 1 points, headings, and the middles about which the turns act."""

    turns: Floats
    step: float  # [m]
    points: Floats  # (n + 1, 2)
    headings: Floats  # (n + 1,)
    middles: Floats  # (n, 2)


class _Terms(NamedTuple):
    """Residuals (m,) and their derivatives (m, n + 1) by the turns and the step."""

    values: Floats
    slopes: Floats


def unsteerable(line: Polyline) -> npt.NDArray[np.bool_]:
    """Which points lie where the line, seen over steps of a metre, bends more sharply than a car, or more suddenly."""
    stations = line.stations
    near = np.column_stack(
        [line.poses(np.clip(stations + shift, 0.0, line.length))[:, :2] for shift in (-1.0, 0.0, 1.0)]
    )
    before, after = near[:, 2:4] - near[:, :2], near[:, 4:] - near[:, 2:4]
    crosses = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    inner = (stations >= 1.0) & (stations <= line.length - 1.0)
    curvatures = np.where(inner, np.arctan2(crosses, (before * after).sum(axis=1)), 0.0)
    behind, ahead = (np.interp(stations + shift, stations, curvatures) for shift in (-_REVERSAL, _REVERSAL))
    sharp: npt.NDArray[np.bool_] = np.abs(curvatures) > _UNSTEERABLE
    return sharp | (np.abs(ahead - behind) > 2.0 * _REVERSAL * _TOO_QUICK)


def straying(line: Polyline, left: Floats, right: Floats) -> npt.NDArray[np.bool_]:
    """Which points are abreast of a corner that leaves its lane, of a car whose rear axle follows the line.

    `left`, `right`: the lane's edges at each point of `line` [m].
    """
    stations, poses = line.stations, line.poses(line.stations)
    out = np.zeros(len(stations), dtype=np.bool_)
    for ahead, side in _CORNERS:
        abreast = stations + ahead
        frames = line.poses(abreast)
        x = poses[:, 0] + ahead * np.cos(poses[:, 2]) - side * np.sin(poses[:, 2]) - frames[:, 0]
        y = poses[:, 1] + ahead * np.sin(poses[:, 2]) + side * np.cos(poses[:, 2]) - frames[:, 1]
        offsets = y * np.cos(frames[:, 2]) - x * np.sin(frames[:, 2])
        rows = np.minimum(stations.searchsorted(abreast), len(stations) - 1)
        out[rows[(offsets > left[rows] + _STRAY) | (offsets < right[rows] - _STRAY)]] = True
    return out


def steered(
    line: Polyline, sharp: npt.NDArray[np.bool_], left: Floats, right: Floats, how: Redrawing
) -> tuple[Floats, Floats]:
    """Points of the line, drawn anew around `sharp` ones, and the station on `line` of each [m].

    `left`, `right`: the road's edges at each point of `line` [m]. No drawn curve is sharper than 0.2 1/m
    unless there is no way at all from one end of its stretch to the other; both ends keep place and
    direction.
    """
    parts, stations, done = [], [], 0
    for rows in _stretches(line, sharp, how.run_up):
        window = _Window(Polyline(line.points[rows]), left[rows], right[rows])
        points = _drawn(window, how.step)
        places = line.stations[rows.start] + _abreast(window.line, points)
        shared = int(rows.start < done)  # the point where stretches touch
        parts += [line.points[done : rows.start], points[shared:]]
        stations += [line.stations[done : rows.start], places[shared:]]
        done = rows.stop
    return np.concatenate([*parts, line.points[done:]]), np.concatenate([*stations, line.stations[done:]])


def _stretches(line: Polyline, sharp: npt.NDArray[np.bool_], run_up: float) -> Iterator[slice]:
    """Runs of sharp points with their run-ups; runs whose run-ups meet are one."""
    rows, stations = np.flatnonzero(sharp), line.stations
    for run in np.split(rows, np.flatnonzero(np.diff(stations[rows]) > 2.0 * run_up) + 1):
        begin, end = np.searchsorted(stations, (stations[run[0]] - run_up, stations[run[-1]] + run_up))
        yield slice(int(begin), int(min(end + 1, len(stations))))


def _drawn(window: _Window, length: float) -> Floats:
    """The window's line, drawn anew of arcs of about that length [m]."""
    count = max(round(window.line.length / length), 4)
    step = window.line.length / count
    ends = window.line.poses([0.0, window.line.length])
    turns = np.diff(window.line.headings_at(np.linspace(0.0, window.line.length, count + 1)))
    unknowns = np.append(_spread(turns, _STEERED * step), step)
    terms = _terms(unknowns, window, ends)
    damping = 1.0
    for _ in range(_ITERATIONS):
        hessian = terms.slopes.T @ terms.slopes
        damped = hessian + damping * np.diag(hessian.diagonal())
        trial = unknowns - np.linalg.solve(damped, terms.slopes.T @ terms.values)
        trial[-1] = min(max(trial[-1], 0.5 * step), 2.0 * step)
        tried = _terms(trial, window, ends)
        gain = 1.0 - (tried.values @ tried.values) / (terms.values @ terms.values)
        if gain > 0.0:
            unknowns, terms = trial, tried
            damping /= 3.0
        else:
            damping *= 4.0
        if 0.0 < gain < _ENOUGH:
            break
    parts = round(length / _BETWEEN)
    finer = np.append(np.repeat(unknowns[:-1] / parts, parts), unknowns[-1] / parts)
    points = _chain(finer, ends[0]).points
    missed = ends[1, :2] - points[-1]  # a few millimetres
    points += np.linspace(0.0, 1.0, len(points))[:, None] * missed
    return points


def _abreast(line: Polyline, points: Floats) -> Floats:
    """The station on `line` of each point, from end to end and never back: a turn back has two passes side by side.

    Of all such ways the one with the least squared distances in sum (dynamic time warping, Sakoe and Chiba 1978): where
    the points cut a corner, the station leaps over its tip.
    """
    stations = np.linspace(0.0, line.length, round(line.length / _ABREAST) + 1)
    places = np.arange(len(stations))
    offsets = line.poses(stations)[:, :2] - points[:, None]
    gaps = np.square(offsets).sum(axis=2)
    total = np.where(places == 0, gaps[0], np.inf)
    came_from = []
    for row in gaps[1:]:
        least = np.minimum.accumulate(total)
        came_from.append(np.maximum.accumulate(np.where(total == least, places, 0)))
        total = least + row
    way = [len(stations) - 1]
    for before in reversed(came_from):
        way.append(int(before[way[-1]]))
    return stations[way[::-1]]


def _spread(turns: Floats, most: float) -> Floats:
    """The turns with each one shared out over its neighbours, so many that none is more than `most`, if that can be."""
    wide = turns
    for reach in range(1, len(turns) // 2):
        if np.abs(wide).max() <= most:
            break
        wide = np.convolve(turns, np.full(2 * reach + 1, 1.0 / (2 * reach + 1)), mode="same")
    return wide


def _chain(unknowns: Floats, start: Floats) -> _Chain:
    turns, step = unknowns[:-1], float(unknowns[-1])
    headings = start[2] + np.concatenate(([0.0], np.cumsum(turns)))
    along = headings[:-1] + 0.5 * turns
    chords = step * np.column_stack((np.cos(along), np.sin(along)))
    points = start[:2] + np.concatenate((np.zeros((1, 2)), np.cumsum(chords, axis=0)))
    return _Chain(turns, step, points, headings, points[:-1] + 0.5 * chords)


def _terms(unknowns: Floats, window: _Window, ends: Floats) -> _Terms:
    chain = _chain(unknowns, ends[0])
    terms = (_bending(chain), _arrival(chain, ends[1]), _off_line(chain, window), _off_road(chain, window))
    return _Terms(np.concatenate([one.values for one in terms]), np.concatenate([one.slopes for one in terms]))


def _bending(chain: _Chain) -> _Terms:
    """Too sharp, too quick, and any change of curvature; straight before and after."""
    count = len(chain.turns)
    curvatures = chain.turns / chain.step
    changing = np.diff(np.eye(count + 2), axis=0)[:, 1:-1] / chain.step
    changes = changing @ curvatures
    sharp, quick = _excess(curvatures, _STEERED), _excess(changes, _QUICKEST)
    values = np.concatenate((_TOO_SHARP * sharp, _TOO_SHARP * quick, _CHANGE * changes))
    weights = np.concatenate((_TOO_SHARP * (sharp != 0.0), _TOO_SHARP * (quick != 0.0), np.full(count + 1, _CHANGE)))
    by_curvature = weights[:, None] * np.concatenate((np.eye(count), changing, changing))
    slopes = np.column_stack((by_curvature, -by_curvature @ curvatures)) / chain.step
    slopes[count:, -1] *= 2.0  # a change is over a step, too
    return _Terms(values, slopes)


def _excess(values: Floats, most: float) -> Floats:
    return values - np.clip(values, -most, most)


def _arrival(chain: _Chain, end: Floats) -> _Terms:
    """Missing the window's end, in place and heading."""
    slopes = np.zeros((3, len(chain.turns) + 1))
    lever = chain.points[-1] - chain.middles
    slopes[0, :-1], slopes[1, :-1] = -lever[:, 1], lever[:, 0]
    slopes[2, :-1] = 1.0
    slopes[:2, -1] = (chain.points[-1] - chain.points[0]) / chain.step
    missed = np.append(chain.points[-1], chain.headings[-1]) - end
    return _Terms(_AT_END * missed, _AT_END * slopes)


def _off_line(chain: _Chain, window: _Window) -> _Terms:
    rows = np.arange(len(chain.points))
    stations, offsets = _projected(chain.points, rows, chain, window)
    return _Terms(_OFF_LINE * offsets, _OFF_LINE * _offset_slopes(chain, window, rows, chain.points, stations))


def _off_road(chain: _Chain, window: _Window) -> _Terms:
    """How far corners of the body are beyond the road's edges; nothing for those before and after the window."""
    cos, sin = np.cos(chain.headings)[:, None], np.sin(chain.headings)[:, None]
    axles = np.repeat(chain.points, len(_CORNERS), axis=0)
    ahead, side = _CORNERS.T
    spots = axles + np.stack((ahead * cos - side * sin, ahead * sin + side * cos), axis=-1).reshape(-1, 2)
    stations, offsets = _projected(spots, np.arange(len(spots)) // len(_CORNERS), chain, window)
    left, right = (np.interp(stations, window.line.stations, edge) for edge in (window.left, window.right))
    is_left = np.tile(side > 0.0, len(chain.points))
    beyond = np.where(
        is_left, np.maximum(offsets - left + _CLEARANCE, 0.0), np.minimum(offsets - right - _CLEARANCE, 0.0)
    )
    out = np.flatnonzero((beyond != 0.0) & (stations > 0.0) & (stations < window.line.length))
    slopes = _offset_slopes(chain, window, out // len(_CORNERS), spots[out], stations[out])
    return _Terms(_OFF_ROAD * beyond[out], _OFF_ROAD * slopes)


def _projected(spots: Floats, rows: Integers, chain: _Chain, window: _Window) -> tuple[Floats, Floats]:
    """Stations and offsets of `spots` beside the chain's points `rows`, on the same pass of a turn back."""
    shares = np.arange(len(chain.points)) / len(chain.turns)
    return window.line.project_near(spots, window.line.length * shares[rows], _PASS)


def _offset_slopes(chain: _Chain, window: _Window, rows: Integers, spots: Floats, stations: Floats) -> Floats:
    """How the offsets of `spots` (m, 2) from the line change; each is carried by the chain's point of its row.

    A turn swings all that comes after it about its middle; a longer step moves it away from the start.
    """
    headings = window.line.headings_at(stations)
    tangents = np.column_stack((np.cos(headings), np.sin(headings)))
    by_turns = (tangents * spots).sum(axis=1)[:, None] - tangents @ chain.middles.T
    by_turns[rows[:, None] <= np.arange(len(chain.turns))] = 0.0
    moves = (chain.points[rows] - chain.points[0]) / chain.step
    return np.column_stack((by_turns, tangents[:, 0] * moves[:, 1] - tangents[:, 1] * moves[:, 0]))
