"""Ideal predictions in reactive traffic: what is predicted must be what then happens.

SUMO's drivers react to the ego, so their futures depend on the branch. A run with ideal prediction is
repeated with the futures that its own previous pass recorded, until they agree.
"""

import bisect
import math
import time
from collections.abc import Callable, Sequence

import msgspec
import numpy as np

from dvca_sumo.engine.protocol import Glimpse
from dvca_sumo.interventions import Futures, Ideal, Intervention, recorded_futures
from dvca_sumo.messages import Component
from dvca_sumo.record import Record
from dvca_sumo.run import Task
from dvca_sumo.truth import Moment

MOST_PASSES = 3
TOLERANCE = 0.5  # [m] between a predicted and a real place
_MATTERING = 30.0  # [m] from the ego, and not behind it: followers make way for it, not the reverse
_COMPARED_EVERY = 5  # world steps


class Pass(msgspec.Struct, frozen=True):
    """One run of a task, in short."""

    glimpse: Glimpse
    futures: Futures  # what happened from the first substituted message on; empty without ideal prediction


def predicts_ideally(task: Task) -> bool:
    """Whether a task substitutes prediction."""
    return any(map(is_ideal_prediction, task.interventions))


def is_ideal_prediction(intervention: Intervention) -> bool:
    """Whether it is one that asks for recorded futures."""
    return isinstance(intervention, Ideal) and intervention.component is Component.PREDICTION


def summary(task: Task, record: Record, simulated: float, wall: float) -> Pass:
    """What is kept of a run of `task` that took `simulated` [s] of simulation and `wall` [s]."""
    residual, futures = None, Futures()
    if predicts_ideally(task):
        since = record.start if record.substituted is None else record.substituted
        # Found without touching the others: a forked process makes a copy of all that it touches.
        moments = record.moments[bisect.bisect_left(record.moments, since, key=lambda moment: moment.time) :]
        residual, futures = divergence(task.futures, moments), recorded_futures(moments)
    glimpse = Glimpse(
        violations=tuple(record.violations),
        judgements=record.judgements,
        ending=record.ending,
        digest=record.digest,
        last_step=record.digests[-1] if record.digests else b"",
        steps=len(record.digests),
        simulated=simulated,
        wall=wall,
        passes=1,
        residual=residual,
    )
    return Pass(glimpse, futures)


def settled(task: Task, run: Callable[[Task], Pass]) -> Glimpse:
    """Run a task, as many passes as its ideal predictions need; the last one, with the cost of all."""
    begin = time.perf_counter()
    last, simulated, passes = run(task), 0.0, 1
    while (last.glimpse.residual or 0.0) > TOLERANCE and passes < MOST_PASSES:
        simulated += last.glimpse.simulated
        passes += 1
        # Objects that the pass did not meet again keep their factual future.
        task = msgspec.structs.replace(task, futures=Futures({**task.futures.tracks, **last.futures.tracks}))
        last = run(task)
    return msgspec.structs.replace(
        last.glimpse,
        simulated=simulated + last.glimpse.simulated,
        wall=time.perf_counter() - begin,
        passes=passes,
    )


def divergence(futures: Futures, moments: Sequence[Moment]) -> float:
    """Largest distance [m] between where `futures` had the objects near the ego and where they were.

    An object that `futures` does not hold was predicted at constant velocity from where it was seen:
    it is not counted.
    """
    worst = 0.0
    for moment in moments[::_COMPARED_EVERY]:
        ego, objects = moment.ego, moment.objects
        dx, dy = objects.boxes[:, 0] - ego.x, objects.boxes[:, 1] - ego.y
        is_ahead = dx * math.cos(ego.heading) + dy * math.sin(ego.heading) > 0.0
        near = (np.hypot(dx, dy) < _MATTERING) & is_ahead
        for row in np.flatnonzero(near):
            track = futures.tracks.get(objects.ids[row])
            if track is not None and track.times[0] <= moment.time <= track.times[-1]:
                x, y = (np.interp(moment.time, track.times, track.poses[:, column]) for column in (0, 1))
                worst = max(worst, float(np.hypot(objects.boxes[row, 0] - x, objects.boxes[row, 1] - y)))
    return worst
