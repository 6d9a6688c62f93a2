"""Who stands, and will stay: parked, broken down, or waiting for as long as nobody does who only queues."""

import numpy as np

from dvca_sumo.messages import ObjectClass, VehicleShape
from dvca_sumo.stack.planning.blockers import PARALLEL, Blocker
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.junctions import LineView
from dvca_sumo.stack.planning.scene import ALONG, IN_LANE
from dvca_sumo.stack.planning.situation import Situation

_VEHICLE, _PERSON, _STATIC = (int(kind) for kind in (ObjectClass.VEHICLE, ObjectClass.PEDESTRIAN, ObjectClass.STATIC))
_DRIVING = 1.0  # [s] of moving: what is seen first may seem to move for less
_HESITATING = 1.0  # [s] people stand still and yet are on their way


class Staying:
    """Remembers since when each object stands, and who was seen driving."""

    def __init__(self, shape: VehicleShape, config: PlanningConfig) -> None:
        self.since: dict[int, float] = {}  # by track, of those who stand: when they came to [s]
        self.stood: set[int] = set()  # tracks of those, but for people who may have slowed down for a moment
        self._shape = shape
        self._config = config
        self._moving: dict[int, float] = {}  # by track: when it came to move [s]
        self._driven: set[int] = set()  # tracks that were seen driving

    def see(self, situation: Situation) -> None:
        """Take in the next cycle's scene."""
        ids, time = situation.scene.ids, situation.time
        stood, moved = self.since, self._moving
        self.since, self.stood, self._moving = {}, set(), {}
        self._driven.intersection_update(ids)
        scene = situation.scene
        for track, is_standing, kind in zip(ids, scene.is_standing.tolist(), scene.classes.tolist(), strict=True):
            if is_standing:
                since = self.since[track] = stood.get(track, time)
                if kind != _PERSON or time - since > _HESITATING:
                    self.stood.add(track)
                continue
            since = self._moving[track] = moved.get(track, time)
            if time - since > _DRIVING:
                self._driven.add(track)

    def will_stay(self, blocker: Blocker, situation: Situation, *, is_passing: bool) -> bool:
        """Whether it has stood for so long, where it is, that it will not move by itself.

        `is_passing`: whether the ego is going around somebody already.
        """
        if blocker.track not in self.since:
            return False
        kind, stood = situation.scene.classes[blocker.row], situation.time - self.since[blocker.track]
        if kind == _STATIC:
            return True
        patience = self._config.parked_after
        if kind == _PERSON:
            if self._is_near_line(blocker.high, situation.views):  # who waits at a crossing will go
                patience = max(patience, self._config.person_patience)
                if not is_passing and situation.speed >= self._config.standing_speed:
                    return False
            return stood >= patience
        if self._is_in_traffic(blocker, situation):
            patience = max(patience, self._config.broken_down_after)
        return stood >= patience and not self._is_queueing(blocker, situation)

    def _is_in_traffic(self, blocker: Blocker, situation: Situation) -> bool:
        """Who stands in the middle of our lane may be in a queue that it hides.

        Near a junction anyone may; farther away, who was seen driving.
        """
        if self.turns_in(blocker, situation):
            return True
        if abs(float(situation.scene.now.offsets[blocker.row])) >= IN_LANE:
            return False
        to_lines = [view.distance + self._shape.front - blocker.high for view in situation.views]
        is_near = any(0.0 < distance < self._config.queue_length for distance in to_lines)
        return is_near or blocker.track in self._driven

    def turns_in(self, blocker: Blocker, situation: Situation) -> bool:
        """Whether a vehicle stands aslant in our way at a junction: it drives on into our lane as soon as it can."""
        scene, row = situation.scene, blocker.row
        if scene.classes[row] != _VEHICLE or blocker.clearance(0.0) >= self._config.object_margin:
            return False
        is_aslant = ALONG < float(scene.now.directions[row]) < PARALLEL
        return is_aslant and self._is_near_line(blocker.high, situation.views)

    def _is_queueing(self, blocker: Blocker, situation: Situation) -> bool:
        """A vehicle in our lane may just wait, however long it has stood: near a line, or behind one that waits."""
        scene, now = situation.scene, situation.scene.now
        is_vehicle = (scene.classes != _PERSON) & (scene.classes != _STATIC)
        in_lane = is_vehicle & (np.abs(now.offsets) < IN_LANE)
        if not in_lane[blocker.row]:
            return False
        lows, highs = now.stations - now.half_lengths, now.stations + now.half_lengths
        nose = blocker.high
        while not self._is_near_line(nose, situation.views):
            ahead = np.flatnonzero(in_lane & (lows > nose) & (lows < nose + self._config.queue_gap))
            if not len(ahead):
                return False
            nearest = ahead[lows[ahead].argmin()]
            if not scene.is_standing[nearest]:
                return True
            nose = float(highs[nearest])
        return True

    def _is_near_line(self, station: float, views: list[LineView]) -> bool:
        """Whether the place lies on a junction or shortly before its stop line."""
        for view in views:
            to_line = view.distance + self._shape.front - station
            if view.line.station - view.line.exit_station < to_line < self._config.queue_reach:
                return True
        return False
