"""Stop signs: who stood at the others of a junction before the ego came, and goes first."""

import enum
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dvca_sumo.messages import ObjectClass, TrackedObjects
from dvca_sumo.roadmap.route import Approach
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.scene import ALONG

_WATCHED_CLASSES = (int(ObjectClass.VEHICLE), int(ObjectClass.BICYCLE))
_SAME = 1.0  # [m] from where a track was lost, one found is the same
_DOUBT = 1.0  # [m] of where somebody is who waits


class Stage(enum.StrEnum):
    """Of passing a stop sign; creeping over the line and cruising on are meetings like any others."""

    PRE_STOP = "pre_stop"  # coming to the line: who stands at other stop signs is noted
    STOP = "stop"  # standing: who was noted is waited for


class _Place(NamedTuple):
    """Where one was last seen, and which sign it stood at."""

    x: float  # [m]
    y: float  # [m]
    approach: Approach


class WatchList:
    """Those who go before the ego at one stop sign: noted while it comes to its line, crossed out as they leave.

    Who is lost and found again at the same place under another number is still the same one.
    """

    def __init__(self, approaches: Sequence[Approach], config: PlanningConfig) -> None:
        self._approaches = approaches
        self._config = config
        self._stage = Stage.PRE_STOP
        self._watched: dict[int, _Place] = {}  # by track

    def step(self, objects: TrackedObjects, *, is_standing: bool) -> None:
        """Look around; `is_standing`: the ego stands at its line."""
        if not self._approaches:
            return
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
            along = np.cos(boxes[rows, 2] - line.headings_at(stations))
            reach = max(0.5 * approach.width, config.watch_beside)
            at_line = line.length - (stations + 0.5 * boxes[rows, 3]) <= config.watch_before
            found = rows[at_line & (np.abs(offsets) <= reach) & (along >= ALONG)]
            for row in found.tolist():
                x, y = boxes[row, :2].tolist()
                self._watched[int(objects.ids[row])] = _Place(x, y, approach)

    def _cross_out(self, objects: TrackedObjects) -> None:
        there = {
            track: (x, y)
            for track, kind, (x, y) in zip(
                objects.ids.tolist(), objects.classes.tolist(), objects.boxes[:, :2].tolist(), strict=True
            )
            if kind in _WATCHED_CLASSES
        }
        half_lengths = dict(zip(objects.ids.tolist(), (0.5 * objects.boxes[:, 3]).tolist(), strict=True))
        watched = {}
        for track, place in sorted(self._watched.items(), key=lambda one: one[0] not in there):  # the lost ones last
            found = track if track in there else _found_again(place, there)
            if found is None:
                continue
            waits_within = self._config.watch_before + half_lengths[found] + _DOUBT  # its middle, however long it is
            if math.dist(there[found], place.approach.line.points[-1]) > max(self._config.watch_until, waits_within):
                continue
            watched[found] = _Place(*there.pop(found), place.approach)
        self._watched = watched


def _found_again(lost: _Place, there: dict[int, tuple[float, float]]) -> int | None:
    """The track nearest to where one was lost, if it is as near as the same one."""
    nearest = min(there, key=lambda track: math.dist(there[track], lost[:2]), default=None)
    return nearest if nearest is not None and math.dist(there[nearest], lost[:2]) < _SAME else None
