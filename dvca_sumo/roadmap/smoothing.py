"""From a rough line to one a vehicle can follow: kinks rounded, points one metre apart."""

import math

import numpy as np
import numpy.typing as npt

from dvca_sumo.geometry.polyline import Floats, Polyline
from dvca_sumo.roadmap.easing import eased

_FINE = 0.25  # [m] between points while smoothing
_KERNELS = (0.5, 1.0, 2.0, 4.0, 8.0)  # [m] standard deviations; the first always applies
_DEVIATION = 0.25  # [m] from the rough line that wider kernels and easing may cause
_BENT = 0.01  # [1/m] curvature from which on a vehicle has to slow down
_TIGHT = 0.15  # [1/m] curvature from which on it needs a wider turn
_TIGHT_DEVIATION = 0.6  # [m] allowed there: a car still stays in a lane of 3.2 m
_TIGHT_REACH = 3.0  # [m] around a turn too tight for a vehicle to follow
_REVERSAL = -0.34  # cosine of the turn (110 degrees) that begins a step back
_BACKTRACK = 15.0  # [m] at most, back and forth again
_SIDESTEP = 4.0  # [m] sideways at most where the line goes on
_OVERSHOOT = 4.0  # [m] at most that a lane is drawn past the corner where the next begins
_DOUBLED = 0.6  # [m] between the line's way out to the tip and back
_TAIL = 0.3  # [m] the last step is this much to this much and a metre


def smoothed(rough: Polyline) -> tuple[Floats, Floats]:
    """A smooth line along `rough`: points 0.25 m apart, about, and the station on `rough` of each [m].

    Both ends stay. Wider and wider Gaussian kernels are applied wherever the line stays within 0.25 m
    of the rough one (0.6 m around tight turns); a kernel of standard deviation s turns a kink of angle
    a into a bend of curvature 0.4 a / s and cuts its corner by 0.4 a s. A kink so sharp that no kernel
    would do is rounded by the narrowest all the same (0.3 m at a right angle). Bends that remain are
    eased: within the same distances, the line of least curvature. Where the net draws consecutive lanes
    overlapping, so that the line would step back, the step is left out.
    """
    original, along = _resampled(rough.points, rough.stations)
    kept = _advancing(original)
    if not kept.all():
        original, along = _resampled(original[kept], along[kept])
    points = _convolved(original, _KERNELS[0])
    tight = _widened(_bent(_convolved(original, 1.0), _TIGHT), _TIGHT_REACH)
    limits = np.where(tight, _TIGHT_DEVIATION, _DEVIATION)
    for width in _KERNELS[1:]:
        wider = _convolved(original, width)
        gaps = wider - original
        strays = _widened(np.hypot(gaps[:, 0], gaps[:, 1]) > limits, 3.0 * width)
        share = _convolved(1.0 - strays[:, None].astype(float), 0.5 * width)
        points = points + share * (wider - points)
    return _convolved(eased(points, original, tight | _bent(points, _BENT), limits, _FINE), _KERNELS[0]), along


def _resampled(points: Floats, along: Floats) -> tuple[Floats, Floats]:
    """Points every 0.25 m of the line, ends included; `along` interpolated."""
    line = Polyline(points)
    stations = np.linspace(0.0, line.length, math.ceil(line.length / _FINE) + 1)
    distinct = np.concatenate(([True], (np.diff(points, axis=0) != 0.0).any(axis=1)))
    return line.poses(stations)[:, :2], np.interp(stations, line.stations, along[distinct])


def _advancing(points: Floats) -> npt.NDArray[np.bool_]:
    """Which points to keep so that the line does not go back and forth again; a true turnaround stays."""
    steps = np.diff(points, axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    cosines = (steps[1:] * steps[:-1]).sum(axis=1) / np.maximum(lengths[1:] * lengths[:-1], 1e-12)
    kept = np.ones(len(points), dtype=bool)
    for tip in np.flatnonzero(cosines < _REVERSAL) + 1:
        if kept[tip]:
            kept[_backtrack(points, int(tip), steps[tip - 1])] = False
    return kept


def _backtrack(points: Floats, tip: int, step: Floats) -> slice:
    """The points to leave out around a `tip` where the line, arriving by `step`, turns back."""
    ahead = (points[tip + 1 : tip + int(_BACKTRACK / _FINE)] - points[tip]) @ _frame(step)
    onward = np.flatnonzero((ahead[:, 0] > 0.0) & (np.abs(ahead[:, 1]) < _SIDESTEP))
    if len(onward):
        return slice(tip + 1, tip + 1 + onward[0])
    reach = min(int(_OVERSHOOT / _FINE), tip, len(points) - 1 - tip)
    gaps = points[tip + 1 : tip + reach + 1] - points[tip - reach : tip][::-1]
    apart = np.flatnonzero(np.hypot(gaps[:, 0], gaps[:, 1]) > _DOUBLED)
    overlap = int(apart[0]) if len(apart) else 0
    return slice(tip - overlap, tip + overlap + 1) if overlap else slice(tip, tip)


def _frame(step: Floats) -> Floats:
    """(2, 2) unit vectors along and across `step`, as columns."""
    x, y = step / np.hypot(*step)
    return np.array([[x, -y], [y, x]])


def _bent(points: Floats, curvature: float) -> npt.NDArray[np.bool_]:
    """Points where the line is bent more than that [1/m]."""
    steps = np.diff(points, axis=0)
    turns = np.abs(np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))))
    return np.concatenate(([False], turns > curvature * _FINE, [False]))


def _widened(marked: npt.NDArray[np.bool_], reach: float) -> npt.NDArray[np.bool_]:
    """Marked points and all within `reach` [m] of one."""
    count = np.concatenate(([0], np.cumsum(marked)))
    rows = np.arange(len(marked))
    span = math.ceil(reach / _FINE)
    return count[np.minimum(rows + span + 1, len(marked))] > count[np.maximum(rows - span, 0)]


def _reach(width: float, count: int) -> int:
    """Half the kernel, in points, at most what `count` points can be mirrored by."""
    return min(math.ceil(3.0 * width / _FINE), count - 1)


def _convolved(values: Floats, width: float) -> Floats:
    """Columns of `values` under a Gaussian kernel; point symmetric continuation keeps both ends in place."""
    reach = _reach(width, len(values))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) * _FINE / width) ** 2)
    kernel /= kernel.sum()
    before = 2.0 * values[0] - values[reach:0:-1]
    after = 2.0 * values[-1] - values[-2 : -reach - 2 : -1]
    padded = np.concatenate((before, values, after))
    return np.column_stack([np.convolve(column, kernel, mode="valid") for column in padded.T])


def stepped(points: Floats, along: Floats) -> tuple[Polyline, Floats]:
    """Points cut into straight steps, not arcs, of 1 m: stations of the result are whole numbers."""
    picked = [0.0]
    xs, ys = points.T.tolist()
    x, y = xs[0], ys[0]
    for i in range(len(xs) - 1):
        while (share := _departure(xs[i] - x, ys[i] - y, xs[i + 1] - xs[i], ys[i + 1] - ys[i])) is not None:
            x = xs[i] + share * (xs[i + 1] - xs[i])
            y = ys[i] + share * (ys[i + 1] - ys[i])
            picked.append(i + share)
    if len(xs) - 1 - picked[-1] < _TAIL / _FINE and len(picked) > 1:
        picked.pop()
    rows = np.array([*picked, len(xs) - 1.0])
    indices = np.arange(len(xs))
    line = np.column_stack([np.interp(rows, indices, column) for column in points.T])
    return Polyline(line), np.interp(rows, indices, along)


def _departure(x: float, y: float, dx: float, dy: float) -> float | None:
    """The share of the segment from (x, y) along (dx, dy) at which it leaves the unit circle, if it does."""
    if (x + dx) ** 2 + (y + dy) ** 2 < 1.0:
        return None
    a, half_b, c = dx * dx + dy * dy, x * dx + y * dy, x * x + y * y - 1.0
    return (math.sqrt(max(half_b * half_b - a * c, 0.0)) - half_b) / a
