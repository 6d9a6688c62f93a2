"""What is wrong with a message: field by field against the ideal one at the same moment of the same run."""

import math

import msgspec
import numpy as np

from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.geometry.frames import relative, rotated, transferred
from dvca_sumo.interventions import Futures, Occasion, state_of
from dvca_sumo.interventions.targets import believed_pose, in_way, true_pose
from dvca_sumo.messages import (
    PREDICTION_TIMES,
    Component,
    ControlCommand,
    Floats,
    Integers,
    LocalizationEstimate,
    MessageId,
    ObjectClass,
    PredictedObjects,
    TrackedObjects,
    Trajectory,
)
from dvca_sumo.record import Record
from dvca_sumo.stack.ideal import SUBSTITUTES

MATCHED_WITHIN = 4.0  # [m] a tracked object farther from the true one is not it
_LISTED = 3
_NOTICEABLE = 0.05  # [m] or comparable, see `Difference.size`: less does not show in the text
_NOUNS = {
    ObjectClass.VEHICLE: "driving",
    ObjectClass.BICYCLE: "riding",
    ObjectClass.PEDESTRIAN: "walking",
    ObjectClass.STATIC: "moving",
}


class Difference(msgspec.Struct, frozen=True):
    """One deviation of a message from the ideal one."""

    field: str
    text: str
    size: float  # [m] or [m/s] or comparable: what is listed first


def differences(record: Record, message: MessageId, futures: Futures, focus: str | None) -> tuple[Difference, ...]:
    """How a recorded message differs from what its idealized substitute would have said, worst first.

    Of objects, `focus` (an id) and the one most in the ego's way count.

    Empty for planning, which has no substitute, and for a message that as good as equals the ideal one.
    """
    substitute = SUBSTITUTES.get(message.component)
    execution = record.executions[message.component][message.index]
    if substitute is None or execution.message is None:
        return ()
    occasion = occasion_of(record, message, futures)
    said, ideal = execution.message, substitute(occasion)
    found: list[Difference] = []
    if isinstance(said, LocalizationEstimate) and isinstance(ideal, LocalizationEstimate):
        found = _of_pose(said, ideal)
    elif isinstance(said, TrackedObjects):
        found = _of_objects(said, occasion, focus) + _of_signals(said, occasion)
    elif isinstance(said, PredictedObjects):
        found = _of_predictions(said, occasion, focus)
    elif isinstance(said, ControlCommand):
        found = _of_command(said, occasion)
    noticeable = [one for one in found if one.size >= _NOTICEABLE]
    return tuple(sorted(noticeable, key=lambda one: -one.size)[:_LISTED])


def occasion_of(record: Record, message: MessageId, futures: Futures) -> Occasion:
    """The making of a recorded message."""
    tick = record.executions[message.component][message.index].tick
    ego = record.path[tick]
    trajectory: Trajectory | None = None
    for execution in record.executions[Component.PLANNING]:
        if execution.tick > tick:
            break
        if isinstance(execution.message, Trajectory):
            trajectory = execution.message
    return Occasion(
        message=message,
        elapsed=ego.time - record.start,
        state=state_of(record.stations[tick], ego.speed, ego.acceleration),
        moment=record.moment_at(tick),
        believed=record.believed_at(tick),
        trajectory=trajectory,
        route=record.route,
        sensor_range=record.sensor_range,
        futures=futures,
    )


def _of_pose(said: LocalizationEstimate, ideal: LocalizationEstimate) -> list[Difference]:
    ahead, left, turn = relative((said.x, said.y, said.heading), (ideal.x, ideal.y, ideal.heading))
    return [
        Difference("position", f"believed {_place(ahead, left)} of the true position", math.hypot(ahead, left)),
        Difference("heading", f"off by {math.degrees(wrapped(turn)):+.1f} degrees", 10.0 * abs(wrapped(turn))),
        Difference("speed", f"{said.speed:.1f} m/s; truth: {ideal.speed:.1f} m/s", abs(said.speed - ideal.speed)),
    ]


def _of_signals(said: TrackedObjects, occasion: Occasion) -> list[Difference]:
    """Colours that no signal of the route shows; one that is not told may be out of sight."""
    true = occasion.moment.signals
    return [
        Difference("signals", f"signal {name} {colour.value}; truth: {true[name].value}", math.inf)
        for name, colour in said.signals.items()
        if name in true and colour is not true[name]
    ]


def _of_objects(said: TrackedObjects, occasion: Occasion, focus: str | None) -> list[Difference]:
    truth = occasion.moment.objects
    found: list[Difference] = []
    for row in _relevant(occasion, focus):
        name = truth.ids[row].partition(":")[2] or truth.ids[row]
        box, velocity = _believed(occasion, row)
        if not len(said.ids) or _gaps(said, box).min() > MATCHED_WITHIN:
            text = f"object {name} missing; truth: {_seen(occasion, row)}"
            found.append(Difference("objects", text, math.inf))
            continue
        nearest = int(np.argmin(_gaps(said, box)))
        found += _of_object(name, said, nearest, box, velocity, occasion)
    return found


def _of_object(
    name: str, said: TrackedObjects, row: int, box: Floats, velocity: Floats, occasion: Occasion
) -> list[Difference]:
    heading = occasion.believed.heading
    off = said.boxes[row, :2] - box[:2]
    ahead, left, _ = relative((float(off[0]), float(off[1]), 0.0), (0.0, 0.0, heading))
    size = said.boxes[row, 3:] - box[3:]
    change = float(np.hypot(*(said.velocities[row] - velocity)))
    speeds = f"{np.hypot(*said.velocities[row]):.1f} m/s; truth: {np.hypot(*velocity):.1f} m/s"
    return [
        Difference("position", f"object {name} {_place(ahead, left)} of its true place", math.hypot(ahead, left)),
        Difference(
            "size",
            f"object {name} is {said.boxes[row, 3]:.1f} x {said.boxes[row, 4]:.1f} m; "
            f"truth: {box[3]:.1f} x {box[4]:.1f} m",
            float(np.abs(size).max()),
        ),
        Difference("velocity", f"object {name} at {speeds}", change),
    ]


def _of_predictions(said: PredictedObjects, occasion: Occasion, focus: str | None) -> list[Difference]:
    truth = occasion.moment.objects
    found: list[Difference] = []
    for row in _relevant(occasion, focus):
        name = truth.ids[row].partition(":")[2] or truth.ids[row]
        box, _ = _believed(occasion, row)
        if not len(said.objects.ids) or _gaps(said.objects, box).min() > MATCHED_WITHIN:
            text = f"object {name} missing; truth: {_seen(occasion, row)}"
            found.append(Difference("objects", text, math.inf))
            continue
        nearest = int(np.argmin(_gaps(said.objects, box)))
        own = np.flatnonzero(said.owners == nearest)
        if own.size == 0:
            text = f"object {name} without trajectory; truth: {_seen(occasion, row)}"
            found.append(Difference("hypotheses", text, math.inf))
            continue
        found += _of_future(name, said, own, truth.ids[row], occasion)
    return found


def _of_future(name: str, said: PredictedObjects, own: Integers, known: str, occasion: Occasion) -> list[Difference]:
    future = occasion.futures.of(known, occasion.moment.time)
    if future is None:
        return []
    poses = transferred(future[0], true_pose(occasion), believed_pose(occasion))
    likeliest = own[int(np.argmax(said.probabilities[own]))]
    gaps = np.hypot(*(said.poses[likeliest, :, :2] - poses[:, :2]).T)
    after = int(np.searchsorted(PREDICTION_TIMES, 3.0))
    text = f"object {name} predicted {gaps[after]:.1f} m from where it is 3 s later"
    return [Difference("trajectory", text, float(gaps[after]))]


def _of_command(said: ControlCommand, occasion: Occasion) -> list[Difference]:
    wanted = SUBSTITUTES[Component.CONTROL](occasion)
    assert isinstance(wanted, ControlCommand)
    return [
        Difference(
            "acceleration",
            f"{said.acceleration:+.1f} m/s^2; the trajectory has {wanted.acceleration:+.1f} m/s^2",
            abs(said.acceleration - wanted.acceleration),
        ),
        Difference(
            "steering",
            f"{said.steering:+.3f} rad; the trajectory has {wanted.steering:+.3f} rad",
            20.0 * abs(said.steering - wanted.steering),
        ),
    ]


def _relevant(occasion: Occasion, focus: str | None) -> list[int]:
    """Rows of the true objects in range that matter: `focus` and the one most in the ego's way; all without either."""
    objects, ego = occasion.moment.objects, occasion.moment.ego
    gaps = np.hypot(objects.boxes[:, 0] - ego.x, objects.boxes[:, 1] - ego.y)
    in_range: list[int] = np.flatnonzero(gaps < occasion.sensor_range).tolist()
    matter = [objects.ids.index(focus)] if focus in objects.ids else []
    first = in_way(occasion)
    if first is not None and first not in matter:
        matter.append(first)
    return [row for row in matter if row in in_range] if matter else in_range


def _believed(occasion: Occasion, row: int) -> tuple[Floats, Floats]:
    objects, source, target = occasion.moment.objects, true_pose(occasion), believed_pose(occasion)
    box = objects.boxes[row].copy()
    box[:3] = transferred(objects.boxes[row : row + 1, :3], source, target)[0]
    return box, rotated(objects.velocities[row : row + 1], target[2] - source[2])[0]


def _gaps(said: TrackedObjects, box: Floats) -> Floats:
    gaps: Floats = np.hypot(said.boxes[:, 0] - box[0], said.boxes[:, 1] - box[1])
    return gaps


def _seen(occasion: Occasion, row: int) -> str:
    """Where a true object is from the ego's front bumper, and what it does."""
    moment = occasion.moment
    box, velocity = moment.objects.boxes[row], moment.objects.velocities[row]
    ahead, left, _ = relative((float(box[0]), float(box[1]), 0.0), true_pose(occasion))
    speed = float(np.hypot(*velocity))
    doing = f"{_NOUNS[ObjectClass(int(moment.objects.classes[row]))]} {speed:.1f} m/s" if speed > 0.1 else "standing"
    return f"{_place(ahead - moment.shape.front, left)}, {doing}"


def _place(ahead: float, left: float) -> str:
    along = f"{abs(ahead):.1f} m {'ahead' if ahead >= 0.0 else 'behind'}"
    return f"{along}, {abs(left):.1f} m {'left' if left >= 0.0 else 'right'}"
