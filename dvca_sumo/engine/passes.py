"""Ideal predictions in reactive traffic: what is predicted must be what then happens.

SUMO's drivers react to the ego, so their futures depend on the branch. A run with ideal prediction is
repeated with the futures that its own previous pass recorded, until they agree.
"""

import time
from collections.abc import Callable

import msgspec
import numpy as np

from dvca_sumo.engine.protocol import Glimpse
from dvca_sumo.interventions import Futures, Ideal, recorded_futures
from dvca_sumo.messages import Component
from dvca_sumo.record import Record, digest_of
from dvca_sumo.run import Task

MOST_PASSES = 3
TOLERANCE = 0.5  # [m] between a predicted and a real place
_MATTERING = 30.0  # [m] from the ego
_COMPARED_EVERY = 5  # world steps


def glimpse(task: Task, rtest: Callable[[Task], Record]) -> Glimpse:
    """Run a task, as many passes as its ideal predictions need, and keep what matters of the last."""
    begin = time.perf_counter()
    record = rtest(task)
    simulated, passes, residual = record.simulated, 1, None
    if any(isinstance(one, Ideal) and one.component is Component.PREDICTION for one in task.interventions):
        residual = divergence(task.futures, record)
        while residual > TOLERANCE and passes < MOST_PASSES:
            futures = Futures({**task.futures.tracks, **recorded_futures(record.moments).tracks})
            task = msgspec.structs.replace(task, futures=futures)
            record = rtest(task)
            simulated, passes, residual = simulated + record.simulated, passes + 1, divergence(futures, record)
    return Glimpse(
        violations=tuple(record.violations),
        judgements=record.judgements,
        ending=record.ending,
        digest=digest_of(record),
        simulated=simulated,
        wall=time.perf_counter() - begin,
        passes=passes,
        residual=residual,
    )


def divergence(futures: Futures, record: Record) -> float:
    """Largest distance [m] between where `futures` had the objects near the ego and where they were.

    An object that `futures` does not hold was predicted at constant velocity from where it was seen:
    it is not counted.
    """
    worst = 0.0
    for moment in record.moments[::_COMPARED_EVERY]:
        ego, objects = moment.ego, moment.objects
        near = np.hypot(objects.boxes[:, 0] - ego.x, objects.boxes[:, 1] - ego.y) < _MATTERING
        for row in np.flatnonzero(near):
            track = futures.tracks.get(objects.ids[row])
            if track is not None and track.times[0] <= moment.time <= track.times[-1]:
                x, y = (np.interp(moment.time, track.times, track.poses[:, column]) for column in (0, 1))
                worst = max(worst, float(np.hypot(objects.boxes[row, 0] - x, objects.boxes[row, 1] - y)))
    return worst
