"""How near bodies are to the ego's way by their outlines, where their extents are not enough to tell."""

import math

import numpy as np

from dvca_sumo.geometry.boxes import outlines
from dvca_sumo.messages import Flags, Floats, Integers
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.path import Path
from dvca_sumo.stack.planning.reference import BEHIND, Window
from dvca_sumo.stack.planning.scene import Scene

_DOUBT = 1.0  # [m] gaps to what stands, and overlaps, up to which its outline is looked at
_LONG = 6.0  # [m] of bodies which, beside a bend, may come into it by more than `_DOUBT` beyond their extents
_PARTS = 12  # of each side of an outline
_NOBODY = (np.zeros(0, dtype=np.int64), np.zeros((0, 1)), np.zeros((0, 1)))


def hidden_depths(scene: Scene, window: Window) -> Floats:
    """How much nearer to the line each future (h, t) may come than its extents, which are of where its middle is [m].

    So much a line that bends comes nearer to a body within its length; 0 for one that is not long.
    """
    lengths, widths = scene.boxes[:, 3:].T
    if lengths.max(initial=0.0) <= _LONG:
        return np.zeros((len(scene.owners), 1))
    squares = np.where(lengths > _LONG, 0.25 * (lengths * lengths + widths * widths), 0.0)
    reach = math.ceil(math.sqrt(float(squares.max())))
    sharpest = _highest_within(reach, np.abs(window.curvatures))
    of_owners = squares[scene.owners, None]
    found: Floats = np.minimum(of_owners * sharpest[scene.rows[0]], np.sqrt(of_owners))
    return found


def _highest_within(reach: int, values: Floats) -> Floats:
    """The highest of `values` (n,), none of them negative, up to `reach` places from each."""
    count, places = len(values), 2 * reach + 1
    highest = np.zeros(count + 2 * reach)  # of as many values as `taken`, from each place on
    highest[reach : reach + count] = values
    taken = 1
    while 2 * taken <= places:
        highest = np.maximum(highest[:-taken], highest[taken:])
        taken *= 2
    found: Floats = np.maximum(highest[:count], highest[places - taken :])
    return found


def stood_beside(
    gaps: Floats, hidden: Floats, scene: Scene, window: Window, path: Path, config: PlanningConfig
) -> tuple[Integers, Floats, Floats]:
    """Correct the gaps (s, t) to those who stand aslant, or beside a bend: extents are more than they are, or less.

    Returns:
        Those of long bodies (k,), as rows of the graph, that come into the path beyond their extents; the arcs from
        which, and up to which, they do: (k, 1) [m].
    """
    doubtful = ((gaps[:, 0] > -_DOUBT) & (gaps[:, 0] < np.maximum(hidden, _DOUBT))).nonzero()[0]
    if not doubtful.size:
        return _NOBODY
    stations, beside = (
        points.reshape(len(doubtful), -1)
        for points in outlined(scene.boxes[scene.owners[scene.moving + doubtful]], window, path)
    )
    gaps[doubtful] = beside.min(axis=1)[:, None]
    is_near = beside < config.object_margin
    near = (is_near.any(axis=1) & (hidden[doubtful] > 0.0)).nonzero()[0]
    if not near.size:
        return _NOBODY
    begins, ends = _arcs_between(stations[near], is_near[near], path)
    return scene.moving + doubtful[near], begins[:, None], ends[:, None]


def moved_beside(
    scene: Scene, window: Window, path: Path, margins: Floats, rows: Integers, columns: Integers
) -> tuple[Floats, Floats, Floats]:
    """Those who move, at moments of futures (n,), by their outlines: extents are more, in a bend and of who is aslant.

    Returns:
        Gaps sideways; the arcs from which, and up to which, they are nearer than `margins` (n,). All (n,) [m].
    """
    boxes = scene.boxes[scene.owners[rows]]
    boxes[:, :3] = scene.poses[rows, columns]
    stations, gaps = (points.reshape(len(rows), -1) for points in outlined(boxes, window, path))
    is_near = gaps < margins[:, None]
    return gaps.min(axis=1), *_arcs_between(stations, is_near, path)


def outlined(boxes: Floats, window: Window, path: Path) -> tuple[Floats, Floats]:
    """Stations of points all around boxes (n, 5), box by box, and how far each is beside the body there [m]."""
    stations, offsets, _ = window.project(outlines(boxes, _PARTS).reshape(-1, 2))
    rows = window.index(stations)
    return stations, np.maximum(offsets - path.left.take(rows), path.right.take(rows) - offsets)


def _arcs_between(stations: Floats, which: Flags, path: Path) -> tuple[Floats, Floats]:
    """The first and the last arc of those `which` (n, points) of the stations, in each row: (n,) each [m]."""
    begins, ends = np.where(which, stations, np.inf).min(axis=1), np.where(which, stations, -np.inf).max(axis=1)
    metres = np.arange(-BEHIND, len(path.arcs), dtype=np.float64)
    arcs = np.concatenate((metres[:BEHIND], path.arcs))
    return np.interp(begins, metres, arcs), np.interp(ends, metres, arcs)
