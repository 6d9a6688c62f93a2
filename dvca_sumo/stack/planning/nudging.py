"""The path decision: around what stands in the way, on which side and by how much, or not at all."""

import msgspec
import numpy as np

from dvca_sumo.messages import Floats, ObjectClass, VehicleShape
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.junctions import LineView
from dvca_sumo.stack.planning.path import Lateral, Plateau, blend_length
from dvca_sumo.stack.planning.reference import Window
from dvca_sumo.stack.planning.scene import Flags, Scene

_ALONG = 1.0  # [m] kept lengthwise around an object before the ego moves back
_IN_LANE = 1.2  # [m] vehicles whose centre is this near the line are in our lane, not parked beside it
_OVER_LINE = 0.1  # [m] over the lane marking is not yet another lane
_SLOWEST = 3.0  # [m/s] assumed of the ego when it passes
_BAND_GAP = 3.0  # [m] lengthwise to others in the neighbouring lane
_CLOSING = 2.0  # [s] of closing speed kept to those who come from behind


class Nudge(msgspec.Struct, frozen=True):
    """Passing one object at an offset of the rear axle."""

    track: int
    plateau: Plateau

    @property
    def label(self) -> str:
        """As in `Trajectory.decision`."""
        return f"nudge {'left' if self.plateau.offset > 0.0 else 'right'} {self.track}"


class _Blocker(msgspec.Struct, frozen=True):
    """A standing object in or close to the way, in window coordinates."""

    row: int
    low: float  # [m] stations
    high: float  # [m]
    right: float  # [m] offsets
    left: float  # [m]
    wanted: float  # [m] sideways clearance


class NudgeDecider:
    """Decides for each standing object in the way; keeps the side, and the offset within noise."""

    def __init__(self, shape: VehicleShape, config: PlanningConfig) -> None:
        self._shape = shape
        self._config = config
        self._half = 0.5 * shape.width
        self._since: dict[int, float] = {}  # by track: when it came to stand
        self._held: dict[int, float] = {}  # by track: offset of the last cycle

    def step(
        self, time: float, speed: float, lateral: Lateral, window: Window, scene: Scene, views: list[LineView]
    ) -> list[Nudge]:
        """The nudges of this cycle by station; objects without one are passed by staying in lane, or stopped for."""
        standing = [scene.ids[row] for row in np.flatnonzero(scene.is_standing).tolist()]
        self._since = {track: self._since.get(track, time) for track in standing}
        nudges = []
        for blocker in self._blockers(scene, window):
            offset = self._offset(blocker, time, speed, lateral, window, scene, views)
            if offset is not None:
                begin = blocker.low - self._shape.front - _ALONG
                end = blocker.high + self._shape.rear_overhang + _ALONG
                nudges.append(Nudge(scene.ids[blocker.row], Plateau(begin, end, offset)))
        self._held = {nudge.track: nudge.plateau.offset for nudge in nudges}
        return nudges

    def _blockers(self, scene: Scene, window: Window) -> list[_Blocker]:
        """Standing objects that the ego, centred in its lane, would pass with less than the wanted clearance."""
        now, config = scene.now, self._config
        wanted = np.where(scene.classes == ObjectClass.PEDESTRIAN, config.person_clearance, config.nudge_clearance)
        near = scene.is_standing & (np.abs(now.offsets) < self._half + wanted + now.half_widths)
        near &= now.stations + now.half_lengths > -self._shape.rear_overhang - _ALONG
        near &= now.stations - now.half_lengths < window.rows.shape[1] - 40
        blockers = [
            _Blocker(
                row,
                float(now.stations[row] - now.half_lengths[row]),
                float(now.stations[row] + now.half_lengths[row]),
                float(now.offsets[row] - now.half_widths[row]),
                float(now.offsets[row] + now.half_widths[row]),
                float(wanted[row]),
            )
            for row in np.flatnonzero(near).tolist()
        ]
        return sorted(blockers, key=lambda blocker: blocker.low)

    def _offset(
        self,
        blocker: _Blocker,
        time: float,
        speed: float,
        lateral: Lateral,
        window: Window,
        scene: Scene,
        views: list[LineView],
    ) -> float | None:
        """The offset to pass at: on the side of the last cycle if that still works, else the smaller one."""
        span = window.span(blocker.low - self._shape.front, blocker.high + self._shape.rear_overhang)
        held = self._held.get(scene.ids[blocker.row], 0.0)
        offsets = self._candidates(blocker, window, span)
        for offset in sorted(offsets, key=lambda offset: (offset * held <= 0.0, abs(offset))):
            if self._meets_another(blocker, offset, scene):
                continue
            over_left = offset + self._half > window.lane_left[span].min() + _OVER_LINE
            over_right = offset - self._half < window.lane_right[span].max() - _OVER_LINE
            if (over_left or over_right) and not self._may_leave_lane(
                blocker, offset, time, speed, lateral, scene, views
            ):
                continue
            is_same = abs(offset - held) < self._config.nudge_hold and self._clears(blocker, held)
            return held if is_same else offset
        return None

    def _candidates(self, blocker: _Blocker, window: Window, span: slice) -> list[float]:
        """At most one offset to the left and one to the right, with the wanted clearance or what the road allows."""
        room = self._half + self._config.edge_clearance
        leftmost = float(window.road_left[span].min()) - room
        rightmost = float(window.road_right[span].max()) + room
        left = min(blocker.left + self._half + blocker.wanted, leftmost)
        right = max(blocker.right - self._half - blocker.wanted, rightmost)
        return [offset for offset in (left, right) if self._clears(blocker, offset) and abs(offset) > 1e-3]

    def _clears(self, blocker: _Blocker, offset: float) -> bool:
        least = self._half + self._config.nudge_clearance_least
        return offset >= blocker.left + least or offset <= blocker.right - least

    def _meets_another(self, blocker: _Blocker, offset: float, scene: Scene) -> bool:
        """Whether another standing object leaves no room at that offset, alongside this one."""
        now = scene.now
        low = blocker.low - self._shape.front - now.half_lengths - _ALONG
        high = blocker.high + self._shape.rear_overhang + now.half_lengths + _ALONG
        alongside = scene.is_standing & (now.stations > low) & (now.stations < high)
        alongside[blocker.row] = False
        reach = now.half_widths + (self._half + self._config.nudge_clearance_least - 1e-6)
        return bool((alongside & (np.abs(now.offsets - offset) < reach)).any())

    def _may_leave_lane(
        self,
        blocker: _Blocker,
        offset: float,
        time: float,
        speed: float,
        lateral: Lateral,
        scene: Scene,
        views: list[LineView],
    ) -> bool:
        """For what will not move by itself, when the other lane is free; always to finish what was begun."""
        if lateral.offset / offset > 0.5 and self._held.get(scene.ids[blocker.row], 0.0) * offset > 0.0:
            return True
        if scene.classes[blocker.row] != ObjectClass.STATIC:
            parked = time - self._since[scene.ids[blocker.row]] >= self._config.parked_after
            if not parked or self._is_queueing(blocker, scene, views):
                return False
        length = blend_length(offset, speed, self._config)
        band = (blocker.low - self._shape.front - length, blocker.high + length)
        return self._is_free(offset, band, speed, scene)

    def _is_queueing(self, blocker: _Blocker, scene: Scene, views: list[LineView]) -> bool:
        """A vehicle in our lane may just wait, however long it has stood: near a line, or behind one that waits."""
        now = scene.now
        is_vehicle = scene.classes != ObjectClass.PEDESTRIAN
        is_vehicle &= scene.classes != ObjectClass.STATIC
        in_lane = is_vehicle & (np.abs(now.offsets) < _IN_LANE)
        if not in_lane[blocker.row]:
            return False
        lows, highs = now.stations - now.half_lengths, now.stations + now.half_lengths
        nose = blocker.high
        while True:
            for view in views:
                to_line = view.distance + self._shape.front - nose
                if to_line < self._config.queue_reach and view.line.exit_station - view.line.station > -to_line:
                    return True
            ahead = np.flatnonzero(in_lane & (lows > nose) & (lows < nose + self._config.queue_gap))
            if not len(ahead):
                return False
            next_ahead = ahead[lows[ahead].argmin()]
            if not scene.is_standing[next_ahead]:
                return True
            nose = float(highs[next_ahead])

    def _is_free(self, offset: float, band: tuple[float, float], speed: float, scene: Scene) -> bool:
        """Whether nobody who moves comes alongside while the ego is out of its lane."""
        if not scene.moving:
            return True
        futures, moving = scene.futures, slice(0, scene.moving)
        pace = max(speed, _SLOWEST)
        ego: Floats = pace * scene.times
        out: Flags = (ego > band[0]) & (ego < band[1])
        stations, lengths = futures.stations[moving], futures.half_lengths[moving]
        beside = np.abs(futures.offsets[moving] - offset) < futures.half_widths[moving] + self._half + 0.3
        rates = (stations[:, -1:] - stations[:, :1]) / (scene.times[-1] - scene.times[0])
        behind = self._shape.rear_overhang + _BAND_GAP + _CLOSING * np.maximum(rates - pace, 0.0)
        beside &= (stations + lengths > ego - behind) & (stations - lengths < ego + self._shape.front + _BAND_GAP)
        return not bool((beside & out).any())
