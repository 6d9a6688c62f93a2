"""Finding an object in a component's message: by id, or the one most in the ego's way."""

import numpy as np

from dvca_sumo.geometry.frames import Pose, transferred
from dvca_sumo.interventions.selection import Occasion
from dvca_sumo.interventions.states import UNITS
from dvca_sumo.messages import Integers, ObjectClass, TrackedObjects

IN_WAY = "in_way"
ALL = "all"

_GATE = 4.0  # [m] a tracked object further from the true one is not it
_AROUND = 30.0  # [m] of where its state says the ego is
_AHEAD = 100.0  # [m] of route that counts as the ego's way
_MARGIN = 0.3  # [m] beside the ego's body
_WALKING_AHEAD = np.arange(13) * 0.5  # [s] people are in the way of an ego that they are walking to
_DRIVING_AHEAD = np.arange(3) * 0.5  # [s] vehicles follow lanes: their course is no forecast for long


def rows_of(which: str, tracked: TrackedObjects, occasion: Occasion) -> Integers:
    """Rows of `tracked` that `which` names: an object id, `IN_WAY` or `ALL`; empty when none does.

    Messages carry no simulator ids: the true object is placed as the ego would believe it, and the
    nearest tracked object within a gate is taken to be it.
    """
    if which == ALL:
        return np.arange(len(tracked.ids))
    truth = occasion.moment.objects
    row = in_way(occasion) if which == IN_WAY else _row_by_id(which, truth.ids)
    if row is None or len(tracked.ids) == 0:
        return np.zeros(0, dtype=np.int64)
    place = transferred(truth.boxes[row : row + 1, :3], true_pose(occasion), believed_pose(occasion))[0]
    gaps = np.hypot(tracked.boxes[:, 0] - place[0], tracked.boxes[:, 1] - place[1])
    nearest = int(np.argmin(gaps))
    return np.array([nearest] if gaps[nearest] < _GATE else [], dtype=np.int64)


def in_way(occasion: Occasion) -> int | None:
    """The true object most in the ego's way: of those on, or heading onto, its route ahead the nearest."""
    moment, line = occasion.moment, occasion.route.line
    objects = moment.objects
    if not objects.ids:
        return None
    near_by = occasion.state.position * UNITS.position  # tells the passes of a loop apart
    own, _ = line.project(np.array([[moment.ego.x, moment.ego.y]]), between=(near_by - _AROUND, near_by + _AROUND))
    front = float(own[0]) + moment.shape.front
    walks = np.flatnonzero(objects.classes == ObjectClass.PEDESTRIAN)
    drives = np.flatnonzero(objects.classes != ObjectClass.PEDESTRIAN)
    owners = np.concatenate([np.repeat(walks, len(_WALKING_AHEAD)), np.repeat(drives, len(_DRIVING_AHEAD))])
    ahead = np.concatenate([np.tile(_WALKING_AHEAD, len(walks)), np.tile(_DRIVING_AHEAD, len(drives))])
    points = objects.boxes[owners, :2] + objects.velocities[owners] * ahead[:, None]
    near = np.hypot(points[:, 0] - moment.ego.x, points[:, 1] - moment.ego.y) < _AHEAD
    if not near.any():
        return None
    owners, points = owners[near], points[near]
    stations, offsets = line.project(points, between=(front - 5.0, front + _AHEAD))
    reach = 0.5 * (moment.shape.width + objects.boxes[owners, 4]) + _MARGIN
    # The ends of the searched stretch collect everything beyond it; those points are not on the way.
    blocks = (np.abs(offsets) < reach) & (stations > front) & (stations < front + _AHEAD - 1.0)
    if not blocks.any():
        return None
    return int(owners[blocks][np.argmin(stations[blocks])])


def true_pose(occasion: Occasion) -> Pose:
    """The ego's true rear axle pose."""
    ego = occasion.moment.ego
    return (ego.x, ego.y, ego.heading)


def believed_pose(occasion: Occasion) -> Pose:
    """The ego's believed rear axle pose."""
    believed = occasion.believed
    return (believed.x, believed.y, believed.heading)


def _row_by_id(name: str, ids: tuple[str, ...]) -> int | None:
    for row, known in enumerate(ids):
        if name in (known, known.partition(":")[2]):
            return row
    return None
