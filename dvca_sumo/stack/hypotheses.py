"""Hypotheses of several sources, before they are one message."""

from typing import NamedTuple

import numpy as np

from dvca_sumo.messages import Floats, Integers, PredictedObjects, TrackedObjects


class Hypotheses(NamedTuple):
    """As in `PredictedObjects`, but for the order."""

    owners: Integers  # (h,)
    probabilities: Floats  # (h,)
    poses: Floats  # (h, t, 3)
    lanes: list[tuple[str, ...]]  # (h,)


def message_of(tracked: TrackedObjects, *parts: Hypotheses) -> PredictedObjects:
    """The hypotheses of all `parts`, ordered by owner."""
    owners = np.concatenate([part.owners for part in parts])
    order = owners.argsort(kind="stable")
    lanes = [lanes for part in parts for lanes in part.lanes]
    return PredictedObjects(
        objects=tracked,
        owners=owners[order],
        probabilities=np.concatenate([part.probabilities for part in parts])[order],
        poses=np.concatenate([part.poses for part in parts]).take(order, axis=0),
        lanes=tuple(lanes[row] for row in order.tolist()),
    )
