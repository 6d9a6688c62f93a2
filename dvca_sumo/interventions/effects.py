"""What faults do to messages: small, named distortions, each a pure function.

An effect returns the very message it was given when there was nothing to distort, so that a run can
record exactly which messages a fault altered; None means that nothing is published.
"""

import math
from collections.abc import Callable, Mapping

import msgspec
import numpy as np

from dvca_sumo.geometry.frames import rotated
from dvca_sumo.interventions.selection import Occasion
from dvca_sumo.interventions.targets import rows_of
from dvca_sumo.messages import (
    COMPONENTS,
    CURVATURE,
    HEADING,
    PREDICTION_TIMES,
    SPEED,
    Component,
    ControlCommand,
    Floats,
    Integers,
    LocalizationEstimate,
    Message,
    PredictedObjects,
    T,
    TrackedObjects,
    Trajectory,
    X,
    Y,
)

Parameters = Mapping[str, float | str]

_OBJECT = {"object": "object"}  # what effects on single objects read: which of them


class Effect(msgspec.Struct, frozen=True):
    """A distortion and what a fault has to know of it; it is called like the function that it is."""

    distort: Callable[[Message, Parameters, Occasion], Message | None]
    components: tuple[Component, ...]  # whose messages it distorts
    reads: dict[str, str]  # the parameters it reads, all of them each time, and the kind of each: number, object

    def __call__(self, message: Message, parameters: Parameters, occasion: Occasion) -> Message | None:
        return self.distort(message, parameters, occasion)


def drop_objects(message: Message, parameters: Parameters, occasion: Occasion) -> Message:
    """The chosen tracked object is missing."""
    tracked = _tracked(message)
    rows = _rows(tracked, parameters, occasion)
    if rows.size == 0:
        return message
    kept = np.setdiff1d(np.arange(len(tracked.ids)), rows)
    return TrackedObjects(
        tracked.time,
        tracked.ids[kept],
        tracked.classes[kept],
        tracked.boxes[kept],
        tracked.velocities[kept],
        tracked.signals,
    )


def resize_objects(message: Message, parameters: Parameters, occasion: Occasion) -> Message:
    """`length` and `width` [m] are added to the chosen object's box, which keeps its centre."""
    change = np.array([0.0, 0.0, 0.0, _number(parameters, "length"), _number(parameters, "width")])

    def resized(boxes: Floats) -> Floats:
        grown: Floats = boxes + change
        grown[:, 3:] = np.maximum(grown[:, 3:], 0.1)  # a box has an extent
        return grown

    return _with_boxes(message, parameters, occasion, resized)


def shift_objects(message: Message, parameters: Parameters, occasion: Occasion) -> Message:
    """The chosen object is moved by `ahead` and `left` [m], as the ego is headed."""
    shift = _in_map(parameters, "ahead", "left", occasion)
    return _with_boxes(message, parameters, occasion, lambda boxes: boxes + np.array([*shift, 0.0, 0.0, 0.0]))


def speed_objects(message: Message, parameters: Parameters, occasion: Occasion) -> Message:
    """The chosen object's velocity is off by `ahead` and `left` [m/s], as the ego is headed."""
    tracked = _tracked(message)
    rows = _rows(tracked, parameters, occasion)
    error = _in_map(parameters, "ahead", "left", occasion)
    if rows.size == 0 or not error.any():
        return message
    velocities = tracked.velocities.copy()
    velocities[rows] += error
    return msgspec.structs.replace(tracked, velocities=velocities)


def drop_predictions(message: Message, parameters: Parameters, occasion: Occasion) -> Message:
    """The chosen object has no predicted trajectory."""
    predicted = _predicted(message)
    doomed = np.isin(predicted.owners, _rows(predicted.objects, parameters, occasion))
    if not doomed.any():
        return message
    kept = np.flatnonzero(~doomed)
    return PredictedObjects(
        predicted.objects,
        predicted.owners[kept],
        predicted.probabilities[kept],
        predicted.poses[kept],
        tuple(predicted.lanes[row] for row in kept),
    )


def drift_predictions(message: Message, parameters: Parameters, occasion: Occasion) -> Message:
    """The chosen object's predicted trajectories drift by `ahead` and `left` [m/s], as the ego is headed."""
    predicted = _predicted(message)
    touched = np.flatnonzero(np.isin(predicted.owners, _rows(predicted.objects, parameters, occasion)))
    drift = _in_map(parameters, "ahead", "left", occasion)
    if touched.size == 0 or not drift.any():
        return message
    poses = predicted.poses.copy()
    poses[touched, :, :2] += PREDICTION_TIMES[:, None] * drift
    return msgspec.structs.replace(predicted, poses=poses)


def shift_path(message: Message, parameters: Parameters, occasion: Occasion) -> Message:  # noqa: ARG001
    """The whole trajectory lies `left` [m] beside the planned one."""
    trajectory, left = _trajectory(message), _number(parameters, "left")
    if left == 0.0:
        return message
    points = trajectory.points.copy()
    points[:, X] -= left * np.sin(points[:, HEADING])
    points[:, Y] += left * np.cos(points[:, HEADING])
    return msgspec.structs.replace(trajectory, points=points)


def change_speed(message: Message, parameters: Parameters, occasion: Occasion) -> Message:  # noqa: ARG001
    """The planned path is driven faster: planned speed times `factor` plus `error` [m/s].

    Beyond the planned path's end it goes straight on.
    """
    trajectory = _trajectory(message)
    points = trajectory.points.copy()
    speeds = np.maximum(_number(parameters, "factor") * points[:, SPEED] + _number(parameters, "error"), 0.0)
    if np.array_equal(speeds, points[:, SPEED]):
        return message
    steps = np.hypot(np.diff(points[:, X]), np.diff(points[:, Y]))
    planned = np.concatenate([[0.0], np.cumsum(steps)])
    time_steps = np.diff(points[:, T])
    driven = np.concatenate([[0.0], np.cumsum(0.5 * (speeds[1:] + speeds[:-1]) * time_steps)])
    beyond = np.maximum(driven - planned[-1], 0.0)
    headings = np.unwrap(points[:, HEADING])
    rising = planned + np.arange(len(planned)) * 1e-9  # a standing plan repeats its last station
    for column, values in (
        (X, points[:, X]),
        (Y, points[:, Y]),
        (HEADING, headings),
        (CURVATURE, points[:, CURVATURE]),
    ):
        points[:, column] = np.interp(driven, rising, values)
    points[:, X] += beyond * math.cos(headings[-1])
    points[:, Y] += beyond * math.sin(headings[-1])
    points[beyond > 0.0, CURVATURE] = 0.0
    points[:, SPEED] = speeds
    points[:, SPEED + 1] = np.append(np.diff(speeds) / time_steps, 0.0)
    return msgspec.structs.replace(trajectory, points=points)


def publish_nothing(message: Message, parameters: Parameters, occasion: Occasion) -> Message | None:  # noqa: ARG001
    """The component runs, but its message is lost."""
    return None


def offset_acceleration(message: Message, parameters: Parameters, occasion: Occasion) -> Message:  # noqa: ARG001
    """The longitudinal command is off by `error` [m/s^2]."""
    command, error = _command(message), _number(parameters, "error")
    if error == 0.0:
        return message
    return msgspec.structs.replace(command, acceleration=command.acceleration + error)


def offset_steering(message: Message, parameters: Parameters, occasion: Occasion) -> Message:  # noqa: ARG001
    """The lateral command is off by `error` [rad] of front wheel angle, positive to the left."""
    command, error = _command(message), _number(parameters, "error")
    if error == 0.0:
        return message
    return msgspec.structs.replace(command, steering=command.steering + error)


def shift_pose(message: Message, parameters: Parameters, occasion: Occasion) -> Message:  # noqa: ARG001
    """The believed position lies `left` [m] beside the estimated one."""
    estimate = message
    assert isinstance(estimate, LocalizationEstimate)
    left = _number(parameters, "left")
    if left == 0.0:
        return message
    return msgspec.structs.replace(
        estimate, x=estimate.x - left * math.sin(estimate.heading), y=estimate.y + left * math.cos(estimate.heading)
    )


def _numbers(*names: str) -> dict[str, str]:
    return dict.fromkeys(names, "number")


EFFECTS: dict[str, Effect] = {
    effect.distort.__name__: effect
    for effect in (
        Effect(shift_pose, (Component.LOCALIZATION,), _numbers("left")),
        Effect(drop_objects, (Component.PERCEPTION,), _OBJECT),
        Effect(resize_objects, (Component.PERCEPTION,), _OBJECT | _numbers("length", "width")),
        Effect(shift_objects, (Component.PERCEPTION,), _OBJECT | _numbers("ahead", "left")),
        Effect(speed_objects, (Component.PERCEPTION,), _OBJECT | _numbers("ahead", "left")),
        Effect(drop_predictions, (Component.PREDICTION,), _OBJECT),
        Effect(drift_predictions, (Component.PREDICTION,), _OBJECT | _numbers("ahead", "left")),
        Effect(shift_path, (Component.PLANNING,), _numbers("left")),
        Effect(change_speed, (Component.PLANNING,), _numbers("factor", "error")),
        Effect(publish_nothing, COMPONENTS, {}),
        Effect(offset_acceleration, (Component.CONTROL,), _numbers("error")),
        Effect(offset_steering, (Component.CONTROL,), _numbers("error")),
    )
}


def _with_boxes(
    message: Message, parameters: Parameters, occasion: Occasion, change: Callable[[Floats], Floats]
) -> Message:
    tracked = _tracked(message)
    rows = _rows(tracked, parameters, occasion)
    if rows.size == 0:
        return message
    boxes = tracked.boxes.copy()
    boxes[rows] = change(boxes[rows])
    if np.array_equal(boxes, tracked.boxes):
        return message
    return msgspec.structs.replace(tracked, boxes=boxes)


def _rows(tracked: TrackedObjects, parameters: Parameters, occasion: Occasion) -> Integers:
    return rows_of(str(parameters["object"]), tracked, occasion)


def _in_map(parameters: Parameters, ahead: str, left: str, occasion: Occasion) -> Floats:
    vector = np.array([[_number(parameters, ahead), _number(parameters, left)]])
    turned: Floats = rotated(vector, occasion.believed.heading)[0]
    return turned


def _number(parameters: Parameters, name: str) -> float:
    return float(parameters[name])


def _tracked(message: Message) -> TrackedObjects:
    assert isinstance(message, TrackedObjects)
    return message


def _predicted(message: Message) -> PredictedObjects:
    assert isinstance(message, PredictedObjects)
    return message


def _trajectory(message: Message) -> Trajectory:
    assert isinstance(message, Trajectory)
    return message


def _command(message: Message) -> ControlCommand:
    assert isinstance(message, ControlCommand)
    return message
