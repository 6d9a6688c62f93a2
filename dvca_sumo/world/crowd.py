"""The bodies around an ego, step after step: what never changes about them is put together once."""

from collections.abc import Mapping, Sequence

import msgspec
import numpy as np

from dvca_sumo.messages import Floats, Integers, ObjectClass
from dvca_sumo.truth import ObjectsTruth


class Body(msgspec.Struct, frozen=True):
    """What stays the same about one body."""

    kind: ObjectClass
    length: float  # [m]
    width: float  # [m]
    reach: float  # [m] from its centre forward to where SUMO has its place


class Crowd:
    """The bodies around one ego."""

    def __init__(self) -> None:
        self._ids: tuple[str, ...] = ()
        self._classes: Integers = np.empty(0, dtype=np.int64)
        self._sizes: Floats = np.empty((0, 3))  # length, width, reach

    def seen(
        self,
        time: float,
        names: Sequence[str],
        motions: Sequence[float],
        lanes: Sequence[str],
        bodies: Mapping[str, Body],
    ) -> ObjectsTruth:
        """All bodies at `time` [s].

        Args:
            time: SUMO's clock [s].
            names: (n,) keys of `bodies`.
            motions: (4 n,) SUMO's x, y [m], angle [deg, clockwise from north] and speed [m/s], body by body.
            lanes: (n,) the lane each one is on.
            bodies: What is known of them.
        """
        if self._ids != tuple(names):
            self._gather([bodies[name] for name in names], tuple(names))
        rows = np.array(motions, dtype=np.float64).reshape(-1, 4)
        headings = np.radians(90.0 - rows[:, 2])
        cos, sin = np.cos(headings), np.sin(headings)
        boxes = np.empty((len(rows), 5))
        boxes[:, 0] = rows[:, 0] - self._sizes[:, 2] * cos
        boxes[:, 1] = rows[:, 1] - self._sizes[:, 2] * sin
        boxes[:, 2] = headings
        boxes[:, 3:] = self._sizes[:, :2]
        velocities = np.empty((len(rows), 2))
        velocities[:, 0] = rows[:, 3] * cos
        velocities[:, 1] = rows[:, 3] * sin
        return ObjectsTruth(time, self._ids, self._classes, boxes, velocities, tuple(lanes))

    def _gather(self, bodies: Sequence[Body], names: tuple[str, ...]) -> None:
        self._ids = names
        self._classes = np.array([body.kind for body in bodies], dtype=np.int64)
        self._classes.setflags(write=False)  # one array for many moments
        sizes = [(body.length, body.width, body.reach) for body in bodies]
        self._sizes = np.array(sizes, dtype=np.float64).reshape(-1, 3)
