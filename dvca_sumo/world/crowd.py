"""The bodies around an ego, step after step: what never changes about them is put together once."""

import math
from collections.abc import Mapping, Sequence

import msgspec
import numpy as np

from dvca_sumo.messages import Floats, Integers, ObjectClass
from dvca_sumo.truth import ObjectsTruth

_STRETCH = 2.0  # times as long as SUMO takes a lane to be it may be drawn
_LEAP = 1.0  # [m] in one step, beyond what the stretched speed allows: set down elsewhere, not driven there
ASIDE = 0.4  # [m] and of people, beyond what their speed allows: SUMO has them step aside by up to 0.35 m
_PERSON = int(ObjectClass.PEDESTRIAN)


class Body(msgspec.Struct, frozen=True):
    """What stays the same about one body."""

    kind: ObjectClass
    length: float  # [m]
    width: float  # [m]
    reach: float  # [m] from its centre forward to where SUMO has its place


class Crowd:
    """The bodies around one ego.

    Their speeds are those at which they are moved. SUMO's own are along lanes of the length that the network gives
    them: on a junction lane that is drawn longer, the body moves faster than SUMO says.
    """

    def __init__(self) -> None:
        self._ids: tuple[str, ...] = ()
        self._classes: Integers = np.empty(0, dtype=np.int64)
        self._sizes: Floats = np.empty((0, 3))  # length, width, reach
        self._time = math.nan
        self._centres: Floats = np.empty((0, 2))  # where they were last, nan for those who were not here

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
        velocities = np.stack([cos, sin], axis=1)
        velocities *= self._speeds(time, boxes[:, :2], velocities, rows[:, 3])[:, None]
        return ObjectsTruth(time, self._ids, self._classes, boxes, velocities, tuple(lanes))

    def _speeds(self, time: float, centres: Floats, ahead: Floats, told: Floats) -> Floats:
        """How fast each one came here along its heading; what SUMO has told of those who did not drive here."""
        passed, moved = time - self._time, centres - self._centres
        self._time, self._centres = time, centres
        way = told * passed
        farthest = np.where(self._classes == _PERSON, way + ASIDE, _STRETCH * way + _LEAP)
        has_driven = np.hypot(moved[:, 0], moved[:, 1]) <= farthest  # not where any is nan
        speeds: Floats = np.where(has_driven, (moved * ahead).sum(axis=1) / passed, told)
        return speeds

    def _gather(self, bodies: Sequence[Body], names: tuple[str, ...]) -> None:
        before = dict(zip(self._ids, self._centres.tolist(), strict=True))
        self._centres = np.array([before.get(name, (math.nan, math.nan)) for name in names]).reshape(-1, 2)
        self._ids = names
        self._classes = np.array([body.kind for body in bodies], dtype=np.int64)
        self._classes.setflags(write=False)  # one array for many moments
        sizes = [(body.length, body.width, body.reach) for body in bodies]
        self._sizes = np.array(sizes, dtype=np.float64).reshape(-1, 3)
