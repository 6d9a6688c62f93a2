"""Idealized substitutes: what localization, perception, prediction and control would put out if they knew the truth.

Planning has none. Frames: a substitute stands exactly where its component stands, so perception and
prediction place the truth on the map through the localization estimate, and control moves the true ego
relative to the believed pose. No substitute repairs, or is spoilt by, another component's fault.
"""

import math
from collections.abc import Callable

import numpy as np

from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.geometry.frames import Pose, relative, rotated, transferred
from dvca_sumo.geometry.randomness import key_of
from dvca_sumo.interventions import Occasion
from dvca_sumo.interventions.targets import believed_pose, true_pose
from dvca_sumo.messages import (
    ACCELERATION,
    CURVATURE,
    HEADING,
    PREDICTION_TIMES,
    Component,
    ControlCommand,
    Floats,
    Integers,
    LocalizationEstimate,
    Message,
    PoseStep,
    PredictedObjects,
    T,
    TrackedObjects,
    Trajectory,
    X,
    Y,
)

CONTROL_STEP = 0.01  # [s]
# A substitute that takes over beside the trajectory, or at another speed, comes back to it like a vehicle, not
# by a jump: no brake stops an ego at once, and odometry senses no sideways motion.
_CLOSING = 0.1  # [m] lengthwise at most for each metre driven
_CLOSING_TURN = 0.03  # [rad] likewise, on top of the trajectory's own turn
_APPROACH = 3.0  # [m] it heads for a point on the trajectory so far ahead ...
_APPROACH_TIME = 0.5  # [s] ... and so much time
_SAME = 2.0  # [m] from where perception has an object at most, it is the same one
_GAINING, _BRAKING = 4.0, 9.0  # [m/s^2] at most, until its speed is the trajectory's
_LOST_BRAKING = 3.0  # [m/s^2] without any trajectory left to follow


def ideal_localization(occasion: Occasion) -> LocalizationEstimate:
    """The true pose, speed, acceleration and yaw rate."""
    ego = occasion.moment.ego
    return LocalizationEstimate(ego.time, ego.x, ego.y, ego.heading, ego.speed, ego.acceleration, ego.yaw_rate)


def ideal_perception(occasion: Occasion) -> TrackedObjects:
    """Every object in sensor range with true pose, size, class and velocity, and all signal states.

    An object goes on under the id that perception itself gave it, else under one derived from the
    simulator's, and keeps it for life: who follows it must not take it for a new one.
    """
    return _true_objects(occasion)[0]


def ideal_prediction(occasion: Occasion) -> PredictedObjects:
    """Every object in sensor range with the one trajectory that it follows in the recorded run.

    An object that the record does not hold keeps its velocity.
    """
    tracked, names = _true_objects(occasion)
    source, target = true_pose(occasion), believed_pose(occasion)
    poses = np.empty((len(names), len(PREDICTION_TIMES), 3))
    lanes: list[tuple[str, ...]] = []
    for row, name in enumerate(names):
        known = occasion.futures.of(name, occasion.moment.time)
        if known is None:
            poses[row, :, :2] = tracked.boxes[row, :2] + PREDICTION_TIMES[:, None] * tracked.velocities[row]
            poses[row, :, 2] = tracked.boxes[row, 2]
            lanes.append(())
        else:
            poses[row] = transferred(known[0], source, target)
            lanes.append(known[1])
    count = len(names)
    return PredictedObjects(tracked, np.arange(count), np.ones(count), poses, tuple(lanes))


def ideal_control(occasion: Occasion) -> ControlCommand:
    """The ego moves exactly as the current trajectory says (Apollo's sim-control).

    The planned motion over the next control step is applied in the ego's own frame; what the ego is
    beside the trajectory, by its own belief, and what its speed is off, is closed gradually.
    """
    time = occasion.moment.time
    speed = occasion.moment.ego.speed
    trajectory = occasion.trajectory
    if trajectory is None or time + CONTROL_STEP > trajectory.time + trajectory.points[-1, T]:
        slower = max(0.0, speed - _LOST_BRAKING * CONTROL_STEP)
        braking = (slower - speed) / CONTROL_STEP
        return ControlCommand(time, braking, 0.0, PoseStep(slower * CONTROL_STEP, 0.0, 0.0, braking))
    here = _row_at(trajectory, time)
    there = _row_at(trajectory, time + CONTROL_STEP)
    gap = relative(_pose(here), believed_pose(occasion))
    ahead, left, turn = relative(_pose(there), _pose(here))
    homing = gap[2] + math.atan2(gap[1], _APPROACH + _APPROACH_TIME * speed)
    forward = ahead + _clipped(gap[0], _CLOSING * abs(ahead))
    slowest, fastest = speed - _BRAKING * CONTROL_STEP, speed + _GAINING * CONTROL_STEP
    step = PoseStep(
        forward=min(max(forward, slowest * CONTROL_STEP), fastest * CONTROL_STEP),
        left=left,
        turn=wrapped(turn) + _clipped(wrapped(homing), _CLOSING_TURN * abs(ahead)),
        acceleration=float(there[ACCELERATION]),
    )
    curvature = float(there[CURVATURE])
    return ControlCommand(time, step.acceleration, math.atan(occasion.moment.shape.wheelbase * curvature), step)


SUBSTITUTES: dict[Component, Callable[[Occasion], Message]] = {
    Component.LOCALIZATION: ideal_localization,
    Component.PERCEPTION: ideal_perception,
    Component.PREDICTION: ideal_prediction,
    Component.CONTROL: ideal_control,
}


def _true_objects(occasion: Occasion) -> tuple[TrackedObjects, tuple[str, ...]]:
    moment = occasion.moment
    objects = moment.objects
    gaps = np.hypot(objects.boxes[:, 0] - moment.ego.x, objects.boxes[:, 1] - moment.ego.y)
    rows = np.flatnonzero(gaps < occasion.sensor_range)
    source, target = true_pose(occasion), believed_pose(occasion)
    boxes = objects.boxes[rows].copy()
    boxes[:, :3] = transferred(boxes[:, :3], source, target)
    names = tuple(objects.ids[row] for row in rows)
    tracked = TrackedObjects(
        moment.time,
        _tracks(occasion, names, boxes),
        objects.classes[rows],
        boxes,
        rotated(objects.velocities[rows], target[2] - source[2]),
        dict(moment.signals),
    )
    return tracked, names


def _tracks(occasion: Occasion, names: tuple[str, ...], boxes: Floats) -> Integers:
    """The id of each object; new ones are noted."""
    tracks, told = occasion.tracks, occasion.told
    new = [row for row, name in enumerate(names) if name not in tracks]
    if new and told is not None and len(told.ids):
        taken = set(tracks.values())
        apart = np.hypot(*(boxes[new, None, :2] - told.boxes[None, :, :2]).transpose(2, 0, 1))
        for pair in np.argsort(apart, axis=None, kind="stable").tolist():
            one, other = divmod(pair, len(told.ids))
            if apart[one, other] > _SAME:
                break
            name, track = names[new[one]], int(told.ids[other])
            if name not in tracks and track not in taken:
                tracks[name] = track
                taken.add(track)
    return np.array([tracks.setdefault(name, key_of(name)) for name in names], dtype=np.int64)


def _row_at(trajectory: Trajectory, time: float) -> Floats:
    points = trajectory.points
    place = (time - trajectory.time) / (points[1, T] - points[0, T])
    row = min(max(int(place), 0), len(points) - 2)
    share = place - row
    between: Floats = points[row] + share * (points[row + 1] - points[row])
    turn = wrapped(float(points[row + 1, HEADING] - points[row, HEADING]))
    between[HEADING] = points[row, HEADING] + share * turn
    return between


def _pose(row: Floats) -> Pose:
    return (float(row[X]), float(row[Y]), float(row[HEADING]))


def _clipped(value: float, most: float) -> float:
    return math.copysign(min(abs(value), most), value)
