"""Finding an object in a component's message: by id, or the one most in the ego's way."""

import numpy as np

from dvca_sumo.geometry.frames import Pose, transferred
from dvca_sumo.interventions.selection import Occasion
from dvca_sumo.interventions.states import UNITS
from dvca_sumo.messages import Floats, Integers, ObjectClass, TrackedObjects
from dvca_sumo.truth import ObjectsTruth, whole

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

    The id of a drawn thing names all its parts. Messages carry no simulator ids: a true object is placed as the ego
    would believe it, and the nearest tracked object within a gate is taken to be it.
    """
    if which == ALL:
        return np.arange(len(tracked.ids))
    truth = occasion.moment.objects
    first = in_way(occasion) if which == IN_WAY else None
    rows = _rows_by_id(which, truth.ids) if which != IN_WAY else [] if first is None else [first]
    if not rows or len(tracked.ids) == 0:
        return np.zeros(0, dtype=np.int64)
    places = transferred(truth.boxes[rows, :3], true_pose(occasion), believed_pose(occasion))
    gaps = np.hypot(*(tracked.boxes[:, axis] - places[:, axis, None] for axis in (0, 1)))
    nearest = gaps.argmin(axis=1)[gaps.min(axis=1) < _GATE]
    return np.unique(nearest)


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
    reach = 0.5 * moment.shape.width + _half_widths(objects, line.headings_at(stations), owners) + _MARGIN
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


def _half_widths(objects: ObjectsTruth, headings: Floats, rows: Integers) -> Floats:
    """How far objects `rows` (k,) reach across a line of such `headings` (k,) [m]; people as far however they turn."""
    lengths, widths = objects.boxes[rows, 3:].T
    turns = np.where(objects.classes[rows] == ObjectClass.PEDESTRIAN, 0.0, objects.boxes[rows, 2] - headings)
    found: Floats = 0.5 * (lengths * np.abs(np.sin(turns)) + widths * np.abs(np.cos(turns)))
    return found


def words_for(known: str) -> tuple[str, ...]:
    """What an object of that id may be called."""
    return *_words(known), *_words(whole(known))


def _rows_by_id(name: str, ids: tuple[str, ...]) -> list[int]:
    found = [row for row, known in enumerate(ids) if name in _words(known)]
    return found or [row for row, known in enumerate(ids) if name in _words(whole(known))]


def _words(known: str) -> tuple[str, str]:
    """What an object may be called: its id, or that without its kind."""
    return known, known.partition(":")[2]
