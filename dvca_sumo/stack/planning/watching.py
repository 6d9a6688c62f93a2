"""Stop signs: who stood at the others of a junction before the ego came, and goes first."""

import enum
import math
from collections.abc import Sequence

import numpy as np

from dvca_sumo.messages import ObjectClass, TrackedObjects
from dvca_sumo.roadmap.route import Approach
from dvca_sumo.stack.planning.config import PlanningConfig

_WATCHED_CLASSES = (int(ObjectClass.VEHICLE), int(ObjectClass.BICYCLE))
_ALONG = 0.5  # cosine of the largest angle (60 degrees) to a lane at which someone drives on it


class Stage(enum.StrEnum):
    """Of passing a stop sign; creeping over the line and cruising on are meetings like any others."""

    PRE_STOP = "pre_stop"  # coming to the line: who stands at other stop signs is noted
    STOP = "stop"  # standing: who was noted is waited for


class WatchList:
    """Those who go before the ego at one stop sign: noted while it comes to its line, crossed out as they leave."""

    def __init__(self, approaches: Sequence[Approach], config: PlanningConfig) -> None:
        self._approaches = approaches
        self._config = config
        self._stage = Stage.PRE_STOP
        self._watched: dict[int, Approach] = {}  # by track: where it stood

    def step(self, objects: TrackedObjects, *, is_standing: bool) -> None:
        """Look around; `is_standing`: the ego stands at its line."""
        if is_standing:
            self._stage = Stage.STOP
        if self._stage is Stage.PRE_STOP:
            self._note(objects)
        self._cross_out(objects)

    def waits_for(self, stood: float) -> list[int]:
        """The tracks that an ego which has `stood` so long [s] still has to let go first."""
        is_patience_over = len(self._watched) == 1 and stood >= self._config.sign_patience
        return [] if is_patience_over else sorted(self._watched)

    def _note(self, objects: TrackedObjects) -> None:
        config, boxes = self._config, objects.boxes
        speeds = np.hypot(objects.velocities[:, 0], objects.velocities[:, 1])
        waits = np.isin(objects.classes, _WATCHED_CLASSES) & (speeds < config.standing_speed)
        rows = waits.nonzero()[0]
        for approach in self._approaches if rows.size else ():
            line = approach.line
            stations, offsets = line.project(boxes[rows, :2])
            along = np.cos(boxes[rows, 2] - line.poses(stations)[:, 2])
            reach = max(0.5 * approach.width, config.watch_beside)
            at_line = line.length - (stations + 0.5 * boxes[rows, 3]) <= config.watch_before
            found = rows[at_line & (np.abs(offsets) <= reach) & (along >= _ALONG)]
            self._watched.update(dict.fromkeys(objects.ids[found].tolist(), approach))

    def _cross_out(self, objects: TrackedObjects) -> None:
        places = dict(zip(objects.ids.tolist(), objects.boxes[:, :2].tolist(), strict=True))
        self._watched = {
            track: approach
            for track, approach in self._watched.items()
            if track in places and math.dist(places[track], approach.line.points[-1]) <= self._config.watch_until
        }
