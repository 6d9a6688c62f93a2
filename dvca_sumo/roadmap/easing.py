"""Bends as a driver takes them: within a corridor around the lane's centre, the line of least curvature.

Nets draw bends as chains of straight pieces, with a kink every 20 m, and turns of 2 m radius where a car needs
5 m. Drivers go round the one steadily; before the other they swing out, and cut in at its middle. So does
the line.
"""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from dvca_sumo.geometry.polyline import Floats

_STRIDE = 2  # points per node of the optimisation
_RUN_UP = 8.0  # [m] before and after the bend, over which the line may move
_PENALTY = 1e-3  # of the augmented Lagrangian, in units of the Hessian's mean diagonal
_ROUNDS = 200


def eased(points: Floats, original: Floats, bent: npt.NDArray[np.bool_], limits: Floats, spacing: float) -> Floats:
    """`points` (n, 2), moved sideways around `bent` ones to have the least squared curvature.

    Points are `spacing` apart [m] and stay within `limits` (n,) of their counterparts in `original` [m],
    or where they are if that is further already. Where the sharpest point would become sharper (a
    turnaround), nothing moves.
    """
    moved = points.copy()
    for rows in _windows(bent, round(_RUN_UP / spacing)):
        relaxed = _relaxed(points[rows], original[rows], limits[rows])
        if _sharpest(relaxed, spacing) < _sharpest(points[rows], spacing):
            moved[rows] = relaxed
    return moved


def _sharpest(points: Floats, spacing: float) -> float:
    """The largest curvature along `points`, seen over steps of a metre [1/m]."""
    steps = np.diff(points[:: max(round(1.0 / spacing), 1)], axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    turns = np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
    return float((2.0 * np.abs(turns) / (lengths[1:] + lengths[:-1])).max(initial=0.0))


def _windows(bent: npt.NDArray[np.bool_], reach: int) -> Iterator[slice]:
    """Runs of bent points with their run-ups; runs whose run-ups meet are one."""
    marked = np.flatnonzero(bent)
    for run in np.split(marked, np.flatnonzero(np.diff(marked) > 2 * reach) + 1):
        if len(run):
            yield slice(max(run[0] - reach, 0), min(run[-1] + reach + 1, len(bent)))


def _relaxed(points: Floats, original: Floats, limits: Floats) -> Floats:
    """The window's points at the offsets of least sum of squared second differences; its ends stay."""
    nodes = np.append(np.arange(0, len(points) - 1, _STRIDE), len(points) - 1)
    if len(nodes) < 6:
        return points
    line = points[nodes]
    steps = np.gradient(line, axis=0)
    normals = np.column_stack((-steps[:, 1], steps[:, 0])) / np.hypot(steps[:, 0], steps[:, 1])[:, None]
    shift = ((line - original[nodes]) * normals).sum(axis=1)
    low, high = np.minimum(-limits[nodes] - shift, 0.0), np.maximum(limits[nodes] - shift, 0.0)
    low[[0, 1, -2, -1]] = high[[0, 1, -2, -1]] = 0.0
    bending = np.diff(np.eye(len(nodes)), n=2, axis=0)
    operator = np.concatenate([bending * normals[:, axis] for axis in (0, 1)])
    offsets = _boxed(operator, (bending @ line).T.ravel(), low, high)
    moves = offsets[:, None] * normals
    every = np.arange(len(points))
    moved: Floats = points + np.column_stack([np.interp(every, nodes, moves[:, axis]) for axis in (0, 1)])
    return moved


def _boxed(operator: Floats, target: Floats, low: Floats, high: Floats) -> Floats:
    """The x between `low` and `high` that makes |operator x + target| least, nearly.

    Alternating direction method of multipliers: Boyd et al., Distributed optimization and statistical
    learning via ADMM (2011), section 5.2.
    """
    hessian = operator.T @ operator
    penalty = _PENALTY * float(np.trace(hessian)) / len(hessian)
    inverse = np.linalg.inv(hessian + penalty * np.eye(len(hessian)))
    gradient = operator.T @ target
    x: Floats = np.zeros(len(low))
    dual: Floats = np.zeros(len(low))
    for _ in range(_ROUNDS):
        free = inverse @ (penalty * (x - dual) - gradient)
        x = np.clip(free + dual, low, high)
        dual += free - x
    return x
