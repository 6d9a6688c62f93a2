"""Observation only: whose messages are farthest from the ideal ones?

Each message of the factual run, up to the violation, is held against what the idealized substitute
would have said on the same occasion. How far off is usual, the drive without the defect tells: a
developer seldom has that one, so this is a generous reading of the idea. Nothing is run again.
"""

import numpy as np

from dvca_sumo.analysis.components import SUBSTITUTABLE
from dvca_sumo.analysis.differences import MATCHED_WITHIN, occasion_of
from dvca_sumo.bench.baselines.procedure import Baseline, Reply, Situation
from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.interventions import Futures, recorded_futures
from dvca_sumo.messages import (
    PREDICTION_TIMES,
    Component,
    ControlCommand,
    Floats,
    Integers,
    LocalizationEstimate,
    Message,
    MessageId,
    PredictedObjects,
    TrackedObjects,
)
from dvca_sumo.record import Record
from dvca_sumo.stack.ideal import SUBSTITUTES

# A deviation is a row of sizes: [m] or comparable, or a number of objects; an angle counts as what it moves so far off.
_HEADING_LEVER = 10.0  # [m]
_STEERING_LEVER = 20.0  # [m]
_LEAST_SPREAD = 0.05  # a component that is exact in the healthy drive must not be blamed for a hair
_AHEAD = int(np.searchsorted(PREDICTION_TIMES, 3.0))  # where futures are compared


def most_deviating(situation: Situation) -> Reply:
    """The component of the message with the largest z-score, and that message.

    The z-score of a message is the largest of its sizes, each less the mean of the healthy drive, over the
    standard deviation there; sizes that the healthy drive has as well do not count. Planning has no ideal:
    it is named when nothing counts.
    """
    record = situation.drive.record
    tops: dict[Component, tuple[float, int]] = {}
    for component in SUBSTITUTABLE:
        usual = deviations(situation.healthy, component)
        here = deviations(record, component)[: record.first_at(component, situation.violation.time)]
        if not len(usual) or not len(here):
            continue
        mean, spread = usual.mean(axis=0), np.maximum(usual.std(axis=0), _LEAST_SPREAD)
        scores = np.where(here > usual.max(axis=0), (here - mean) / spread, -np.inf).max(axis=1)
        index = int(np.argmax(scores))
        if scores[index] > -np.inf:
            tops[component] = (float(scores[index]), index)
    if not tops:
        return Reply(Component.PLANNING, None, "no other component deviates more than in the healthy drive")
    component = max(tops, key=lambda one: tops[one][0])
    score, index = tops[component]
    reason = f"message {index} deviates by {score:.1f} standard deviations"
    return Reply(component, record.mark(MessageId(component, index)), reason)


def deviations(record: Record, component: Component) -> Floats:
    """(messages, sizes) how far each message is from the ideal one; one that was not published repeats the last."""
    futures = recorded_futures(record.moments)
    made = record.executions[component]
    known = {
        index: _deviation(record, MessageId(component, index), execution.message, futures)
        for index, execution in enumerate(made)
        if execution.message is not None
    }
    if not known:
        return np.empty((0, 1))
    latest = known[min(known)]
    return np.array([latest := known.get(index, latest) for index in range(len(made))])


def _deviation(record: Record, message: MessageId, said: Message, futures: Futures) -> tuple[float, ...]:
    ideal = SUBSTITUTES[message.component](occasion_of(record, message, futures))
    if isinstance(said, LocalizationEstimate) and isinstance(ideal, LocalizationEstimate):
        turn = _HEADING_LEVER * abs(wrapped(said.heading - ideal.heading))
        return float(np.hypot(said.x - ideal.x, said.y - ideal.y)), turn, abs(said.speed - ideal.speed)
    if isinstance(said, TrackedObjects) and isinstance(ideal, TrackedObjects):
        return _of_objects(said, ideal)
    if isinstance(said, PredictedObjects) and isinstance(ideal, PredictedObjects):
        return _of_futures(said, ideal)
    assert isinstance(said, ControlCommand)  # planning, the only other one, has no ideal
    assert isinstance(ideal, ControlCommand)
    turn = _STEERING_LEVER * abs(said.steering - ideal.steering)
    return abs(said.acceleration - ideal.acceleration), turn


def _of_objects(said: TrackedObjects, ideal: TrackedObjects) -> tuple[float, ...]:
    """Largest error of place, size and velocity; how many objects are missing, how many are none."""
    rows, gaps = _matched(said, ideal)
    found = rows >= 0
    place = gaps[found].max(initial=0.0)
    sizes = np.abs(said.boxes[rows[found], 3:] - ideal.boxes[found, 3:])
    speeds = np.hypot(*(said.velocities[rows[found]] - ideal.velocities[found]).T)
    missing, others = int(np.sum(~found)), len(said.ids) - len(np.unique(rows[found]))
    return float(place), float(sizes.max(initial=0.0)), float(speeds.max(initial=0.0)), missing, others


def _of_futures(said: PredictedObjects, ideal: PredictedObjects) -> tuple[float, ...]:
    """Largest error of place, 3 s later, where an object without a future is taken to stay; how many are missing."""
    rows, _ = _matched(said.objects, ideal.objects)
    worst = 0.0
    for which in np.flatnonzero(rows >= 0):
        row = rows[which]
        own = np.flatnonzero(said.owners == row)
        place = said.objects.boxes[row, :2]
        if own.size:
            place = said.poses[own[int(np.argmax(said.probabilities[own]))], _AHEAD, :2]
        worst = max(worst, float(np.hypot(*(place - ideal.poses[which, _AHEAD, :2]))))
    return worst, int(np.sum(rows < 0))


def _matched(said: TrackedObjects, ideal: TrackedObjects) -> tuple[Integers, Floats]:
    """For each true object the row of the nearest tracked one (-1: none is near), and how far that is [m]."""
    if not len(said.ids) or not len(ideal.ids):
        return np.full(len(ideal.ids), -1), np.full(len(ideal.ids), np.inf)
    off = ideal.boxes[:, None, :2] - said.boxes[None, :, :2]
    gaps = np.hypot(off[..., 0], off[..., 1])
    nearest, least = gaps.argmin(axis=1), gaps.min(axis=1)
    return np.where(least <= MATCHED_WITHIN, nearest, -1), least


OBSERVATION = Baseline(
    name="observation",
    title="observation only",
    names_component=True,
    names_message=True,
    explain=most_deviating,
)
