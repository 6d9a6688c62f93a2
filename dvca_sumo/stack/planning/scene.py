"""Predicted objects in the coordinates of the window: where each may be, and when."""

from collections.abc import Container, Mapping, Sequence

import msgspec
import numpy as np

from dvca_sumo.messages import PREDICTION_TIMES, Flags, Floats, Integers, ObjectClass, PredictedObjects
from dvca_sumo.roadmap.route import Overpass
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.reference import BEHIND, Window

_PERSON = int(ObjectClass.PEDESTRIAN)
IN_LANE = 1.2  # [m] vehicles whose middle is this near the middle of a lane are in it, not parked beside it
ALONG = 0.5  # cosine of the largest angle (60 degrees) to a lane or path at which someone drives along it, not across
SOON = int(np.searchsorted(PREDICTION_TIMES, 1.0))  # far enough to tell going from staying, too near for a guess
SOON_TIME = float(PREDICTION_TIMES[SOON])  # [s]
BRIDGE = 20.0  # [m] of path under a bridge, before and after the middle of a lane on it
_SPARSE = 4  # every so many times of a hypothesis do to bound it
_FEW = 8  # hypotheses are placed in less time than it takes to find out which are far away
_AROUND = 6.0  # [m] beyond the window's bounding box, hypotheses are left out


class Extents(msgspec.Struct, frozen=True, eq=False):
    """Boxes in window coordinates, all arrays of one shape: (n,) or (h, times)."""

    stations: Floats  # [m] of the centres
    offsets: Floats  # [m] of the centres
    half_lengths: Floats  # [m] along the reference line
    half_widths: Floats  # [m] across it
    directions: Floats  # cosine of the angle between box and reference line

    def gaps(self, left: Floats, right: Floats) -> Floats:
        """Sideways to a body from offset `right` to `left` beside each; negative where they would overlap [m]."""
        gaps: Floats = np.maximum(self.offsets - left, right - self.offsets) - self.half_widths
        return gaps


class Scene(msgspec.Struct, frozen=True, eq=False):
    """Objects now, and futures of each: its likely hypotheses, or staying where it is.

    Rows of the window are those under their middles, near and far ends: a body may pass a middle with room to spare,
    and yet sweep over an end.
    """

    ids: list[int]  # (n,)
    classes: Integers  # (n,)
    boxes: Floats  # (n, 5) as in `TrackedObjects`
    speeds: Floats  # (n,) [m/s]
    is_standing: Flags  # (n,) not predicted to go anywhere, and on the level of the ego
    now: Extents  # (n,)
    rows_now: Integers  # (3, n) of the window
    times: Floats  # (t,) [s] from the present
    owners: Integers  # (h,) row of the object
    is_person: Flags  # (h,) whether that is one
    probabilities: Floats  # (h,)
    lanes: list[tuple[str, ...]]  # (h,) followed; the one it is on of who stays
    futures: Extents  # (h, t)
    rows: Integers  # (3, h, t) of the window
    moving: int  # the first `moving` futures move, the others stay where they are
    poses: Floats  # (moving, t, 3) [m], [m], [rad] of the box centres


def scene_in(
    window: Window,
    predicted: PredictedObjects,
    time: float,
    stood: Container[int],
    overpasses: Sequence[Overpass],
    config: PlanningConfig,
) -> Scene:
    """All objects with their futures at `time` [s] and after.

    `stood`: the tracks that stood in the last cycle. An object stands that is predicted to stay, or of
    which nothing is predicted. It gets the one future of staying: its heading is no intention, and its
    noise no motion. On another of the `overpasses` of the route it gets none.
    """
    objects = predicted.objects
    speeds = np.hypot(objects.velocities[:, 0], objects.velocities[:, 1])
    ids: list[int] = objects.ids.tolist()
    is_person: Flags = objects.classes == _PERSON
    counts = predicted.probabilities >= config.possible
    slowest = _slowest_moving(ids, is_person.tolist(), stood, config)
    standing = np.ones(len(ids), dtype=np.bool_)
    stays = _foreseen_speeds(predicted) < np.array(slowest)[predicted.owners]
    standing[predicted.owners[counts & ~stays]] = False
    counts &= ~standing[predicted.owners]
    on = dict(zip(predicted.owners.tolist(), predicted.lanes, strict=True))
    if overpasses:
        standing[_on_overpasses(window, objects.boxes, on, overpasses)] = False
    rows, still = counts.nonzero()[0], standing.nonzero()[0]
    poses = predicted.poses.take(rows, axis=0)
    if len(rows) > _FEW:
        around = _is_around(window, poses)
        rows, poses = rows[around], poses[around]
    owners = predicted.owners[rows]
    now, futures, rows_now, rows_then = _extents(window, objects.boxes, poses, owners, still)
    owners = np.concatenate((owners, still))
    probabilities = np.ones(len(owners))
    probabilities[: len(rows)] = predicted.probabilities[rows]
    return Scene(
        ids=ids,
        classes=objects.classes,
        boxes=objects.boxes,
        speeds=speeds,
        is_standing=standing,
        now=now,
        rows_now=rows_now,
        times=PREDICTION_TIMES - (time - predicted.time),
        owners=owners,
        is_person=is_person[owners],
        probabilities=probabilities,
        lanes=[predicted.lanes[row] for row in rows.tolist()] + [on.get(row, ()) for row in still.tolist()],
        futures=futures,
        rows=rows_then,
        moving=len(rows),
        poses=poses,
    )


def _slowest_moving(
    ids: list[int], is_person: list[bool], stood: Container[int], config: PlanningConfig
) -> list[float]:
    """The speed (n,) below which each object stands [m/s]: people who walk may slow down, vehicles that stood creep."""
    people = (config.lingering_speed, config.standing_speed)
    others = (config.standing_speed, config.moving_speed)
    return [(people if person else others)[track in stood] for track, person in zip(ids, is_person, strict=True)]


def _on_overpasses(
    window: Window, boxes: Floats, on: Mapping[int, tuple[str, ...]], overpasses: Sequence[Overpass]
) -> list[int]:
    """Which of the boxes (n, 5) are where the lane that they are `on` passes over or under the window's line."""
    found = []
    for overpass in overpasses:
        rows = [row for row, lanes in on.items() if overpass.lane in lanes]
        if rows:
            stations, _, _ = window.project(boxes[rows, :2])
            ahead = overpass.station - window.station
            found += [
                row for row, station in zip(rows, stations.tolist(), strict=True) if abs(station - ahead) <= BRIDGE
            ]
    return found


def _foreseen_speeds(predicted: PredictedObjects) -> Floats:
    """Mean speed (h,) [m/s] over the next second in each hypothesis."""
    moved = predicted.poses[:, SOON, :2] - predicted.poses[:, 0, :2]
    speeds: Floats = np.hypot(moved[:, 0], moved[:, 1]) / SOON_TIME
    return speeds


def _is_around(window: Window, poses: Floats) -> Flags:
    """Hypotheses that come near the window's bounding box at all."""
    line = window.rows[:2, BEHIND:]
    (west, south), (east, north) = line.min(axis=1) - _AROUND, line.max(axis=1) + _AROUND
    x, y = poses[:, ::_SPARSE, 0], poses[:, ::_SPARSE, 1]
    around: Flags = (x.max(axis=1) > west) & (x.min(axis=1) < east) & (y.max(axis=1) > south) & (y.min(axis=1) < north)
    return around


def extents(window: Window, boxes: Floats, poses: Floats, owners: Integers) -> Extents:
    """Of hypotheses (h, t, 3) of the boxes (n, 5) whose rows their `owners` (h,) are."""
    hypotheses, times, _ = poses.shape
    halves = 0.5 * boxes[owners, 3:].T
    placed = _placed(window, poses.reshape(-1, 3), halves.repeat(times, axis=1))
    return Extents(*placed.reshape(5, hypotheses, times))


def _extents(
    window: Window, boxes: Floats, poses: Floats, owners: Integers, still: Integers
) -> tuple[Extents, Extents, Integers, Integers]:
    """Of boxes (n, 5) now; and of their futures: hypotheses (h, t, 3), then one for each of `still` that stays.

    With them the rows of the window under both, as in `Scene`.
    """
    count, (moving, times, _) = len(boxes), poses.shape
    flat = np.concatenate((boxes[:, :3], poses.reshape(-1, 3)))
    halves = 0.5 * boxes[:, 3:].T
    halves = np.concatenate((halves, halves.take(owners, axis=1).repeat(times, axis=1)), axis=1)
    placed = _placed(window, flat, halves)
    stations, half_lengths = placed[0], placed[2]
    ends = np.empty((3, len(flat)))
    ends[0] = stations
    np.subtract(stations, half_lengths, out=ends[1])
    np.add(stations, half_lengths, out=ends[2])
    rows = window.index(ends)
    columns = np.empty((moving + len(still), times), dtype=np.int64)
    columns[:moving] = np.arange(count, len(flat)).reshape(moving, times)
    columns[moving:] = still[:, None]
    futures = Extents(*placed.take(columns, axis=1))
    return Extents(*placed[:, :count]), futures, rows[:, :count], rows.take(columns, axis=1)


def _placed(window: Window, poses: Floats, halves: Floats) -> Floats:
    """The fields of `Extents` (5, k) of boxes at `poses` (k, 3), of half lengths and half widths `halves` (2, k)."""
    placed = np.empty((5, len(poses)))
    placed[0], placed[1], headings = window.project(poses[:, :2])
    half_lengths, half_widths = halves
    directions = np.cos(poses[:, 2] - headings)
    cosines, sines = np.abs(directions), np.sqrt(1.0 - directions * directions)
    placed[2] = half_lengths * cosines + half_widths * sines
    placed[3] = half_lengths * sines + half_widths * cosines
    placed[4] = directions
    return placed
