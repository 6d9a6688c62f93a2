"""Lane changes that the route needs: begun when there is a gap, waited for in the lane until then.

The route's line crosses over as early as it can. Until the planner accepts a gap in the next lane, the
ego keeps to the lane it is in: the line of the cycle runs along that one. Gaps are told by what has to
brake how hard (as in MOBIL: Kesting, Treiber, Helbing, General lane-changing model, 2007).
"""

import math

import msgspec
import numpy as np

from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.messages import Floats, ObjectClass, TrackedObjects, VehicleShape
from dvca_sumo.roadmap.route import LaneChange, Route
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.path import blend_length
from dvca_sumo.stack.planning.reference import BEHIND, Window
from dvca_sumo.stack.planning.speed import Stop

_PERSON = int(ObjectClass.PEDESTRIAN)
_ARRIVED = 0.4  # [m] from the lane's centre
_OVER = 0.2  # [m] of the body over the marking, from which on going on is safer than going back
_LAST_SPEED = 3.0  # [m/s] at which a change in the last moment is done
_SLOWEST = 2.0  # [m/s] beside a gap ...
_FALLING_BACK = 5.0  # [m/s] ... and for one that is yet to come, which the ego does not wait for before it has to
_WAITING = "wait to change lanes"
_SEEN = 120.0  # [m] before and behind the ego
_CATCHES_UP = 0.8  # of the ego's speed: slower ones are come up to ...
_FORWARD = 3.0  # ... while a gap beside faster ones is that much harder to get to than one farther back
_NEAR_END = 3.0  # [m] before the place where it has to


class Keeping(msgspec.Struct, frozen=True, eq=False):
    """What a lane that is not the route's asks of a cycle."""

    offsets: Floats  # (n,) of its centre from the window's line [m]
    width: float  # [m]
    stop: Stop  # before the way to the route's lane would be too short; places along the window's line
    pace: float  # [m/s] that brings the ego beside a gap


class LaneChoice(msgspec.Struct, frozen=True, eq=False):
    """Which lane to follow."""

    keeping: Keeping | None = None  # None: the route's line
    behind: frozenset[int] = frozenset()  # tracks in the lane the ego moves into, who let it in


class _Neighbours(msgspec.Struct, frozen=True, eq=False):
    """Who drives or stands on one lane, from front to back."""

    rears: Floats  # (m,) [m] stations
    fronts: Floats  # (m,) [m]
    speeds: Floats  # (m,) [m/s]
    tracks: list[int]  # (m,)


class LaneChanger:
    """Decides at each change of the route which of its lanes to be on."""

    def __init__(self, route: Route, shape: VehicleShape, config: PlanningConfig) -> None:
        self._line = route.line
        self._changes = route.lane_changes
        self._shape = shape
        self._config = config
        self._next = 0  # row of the change that is to be done
        self._lane = 0  # of its lanes, the one the ego is on
        self._target = 0  # of its lanes, the one the ego is to be on

    def step(self, window: Window, offset: float, speed: float, objects: TrackedObjects) -> LaneChoice:
        """The lane for a cycle in which the rear axle is at the window's origin, `offset` [m] beside its line."""
        nose = window.station + self._shape.front
        while self._next < len(self._changes) and nose >= self._changes[self._next].latest_station:
            self._next, self._lane, self._target = self._next + 1, 0, 0
        if self._next == len(self._changes):
            return LaneChoice()
        change = self._changes[self._next]
        if change.start_station - window.station > window.rows.shape[1]:
            return LaneChoice()
        here = change.centres(np.array([window.station]))[:, 0]
        if nose > change.start_station and abs(offset - here[self._target]) < _ARRIVED:
            self._lane = self._target
        return self._choice(change, window, offset - float(here[self._lane]), speed, objects)

    def _choice(
        self, change: LaneChange, window: Window, aside: float, speed: float, objects: TrackedObjects
    ) -> LaneChoice:
        """`aside` [m] is how far the ego is from its lane's centre."""
        last = len(change.lanes) - 1
        if self._lane == last:
            return LaneChoice()
        stop = self._stop(change, window, last - self._lane, speed)
        is_last_chance = stop.at < _NEAR_END and speed < _LAST_SPEED
        occupied = _occupied(change, self._line, window.station, objects, self._shape)
        target = self._lane
        while target < last and self._is_free(
            occupied[target + 1], change, window, speed, is_pressed=is_last_chance or target < self._target
        ):
            target += 1
        over = abs(aside) - 0.5 * (change.widths[self._lane] - self._shape.width)
        if target < self._target and over > _OVER:
            target = self._target
        self._target = target
        behind = frozenset(
            track
            for lane in occupied[self._lane + 1 : target + 1]
            for track, front in zip(lane.tracks, lane.fronts.tolist(), strict=True)
            if front < self._shape.front
        )
        if target == last:
            return LaneChoice(behind=behind)
        stations = window.station + np.arange(window.rows.shape[1]) - BEHIND
        keeping = Keeping(
            offsets=np.interp(stations, change.stations, change.offsets[target]),
            width=change.widths[target],
            stop=stop,
            pace=self._pace(occupied[target + 1], change, window, speed),
        )
        return LaneChoice(keeping, behind)

    def _stop(self, change: LaneChange, window: Window, lanes: int, speed: float) -> Stop:
        """The last place from which the lanes that are left can be crossed at low speed; past it, the lane's end."""
        config, here = self._config, window.station + self._shape.front
        way = lanes * blend_length(max(change.widths), _LAST_SPEED, config)
        at = max(change.latest_station - way, change.start_station) - here
        if at + 0.5 * way < speed * speed / (2.0 * config.comfort_braking):
            return Stop(change.latest_station - config.stop_line_gap - here, config.stop_line_gap, _WAITING)
        return Stop(at, 0.5 * way, _WAITING)

    def _is_free(
        self, lane: _Neighbours, change: LaneChange, window: Window, speed: float, *, is_pressed: bool
    ) -> bool:
        """Whether nobody on the lane has to brake more than a little when the ego is there.

        That is where the change can begin, those on the lane keeping their speeds until then.
        """
        if not lane.tracks:
            return True
        config, shape = self._config, self._shape
        ahead = max(change.start_station - window.station - shape.front, 0.0)
        wait = ahead / max(speed, _LAST_SPEED)
        rears, fronts = lane.rears + lane.speeds * wait, lane.fronts + lane.speeds * wait
        nose, tail = ahead + shape.front, ahead - shape.rear_overhang
        headway, braking = (
            (0.0, config.comfort_braking) if is_pressed else (config.change_headway, config.change_braking)
        )
        closing = speed - lane.speeds
        is_ahead = 0.5 * (rears + fronts) > 0.5 * (nose + tail)
        gaps = np.where(is_ahead, rears - nose, tail - fronts)
        closing = np.where(is_ahead, closing, -closing)
        followers = np.where(is_ahead, speed, lane.speeds)
        needed = config.change_gap + headway * followers + np.square(np.maximum(closing, 0.0)) / (2.0 * braking)
        return bool((gaps >= needed).all())

    def _pace(self, lane: _Neighbours, change: LaneChange, window: Window, speed: float) -> float:
        """The speed that brings the ego behind the nearest one on the lane who has room behind [m/s]."""
        config, shape = self._config, self._shape
        if not lane.tracks or change.start_station - window.station > config.change_outlook:
            return math.inf
        wanted = lane.rears - config.change_gap - config.change_headway * speed  # for the nose, behind each
        has_room = np.ones(len(wanted), dtype=np.bool_)
        has_room[:-1] = wanted[:-1] - shape.length - lane.fronts[1:] >= (
            config.change_gap + config.change_headway * lane.speeds[1:]
        )
        shifts = wanted - shape.front
        ahead = max(change.start_station - window.station - shape.front, 0.0)
        is_in_reach = has_room & ((lane.speeds > config.moving_speed) | (shifts >= ahead))
        if not is_in_reach.any():
            return math.inf
        is_faster = lane.speeds > _CATCHES_UP * speed
        efforts = np.where(shifts > 0.0, np.where(is_faster, _FORWARD, 1.0) * shifts, -shifts)
        slot = int(np.where(is_in_reach, efforts, np.inf).argmin())
        shift, pace = float(shifts[slot]), float(lane.speeds[slot])
        if shift < 0.0:
            return max(pace + shift / config.change_time, _FALLING_BACK)
        return max(pace + math.sqrt(2.0 * config.change_braking * shift), _SLOWEST)


def _occupied(
    change: LaneChange, line: Polyline, here: float, objects: TrackedObjects, shape: VehicleShape
) -> list[_Neighbours]:
    """For each lane of the change, who is on it or partly so; places count from the station `here` [m]."""
    boxes, velocities = objects.boxes, objects.velocities
    stations, offsets = line.project(boxes[:, :2], between=(here - _SEEN, here + _SEEN))
    headings = line.poses(stations)[:, 2]
    angles = boxes[:, 2] - headings
    cosines, sines = np.abs(np.cos(angles)), np.abs(np.sin(angles))
    lengths = 0.5 * (boxes[:, 3] * cosines + boxes[:, 4] * sines)
    widths = 0.5 * (boxes[:, 3] * sines + boxes[:, 4] * cosines)
    speeds = velocities[:, 0] * np.cos(headings) + velocities[:, 1] * np.sin(headings)
    is_there = (objects.classes != _PERSON) & (stations < change.latest_station)
    found = []
    for centre in change.centres(stations):
        rows = np.flatnonzero(is_there & (np.abs(offsets - centre) < widths + 0.5 * shape.width))
        rows = rows[np.argsort(-stations[rows], kind="stable")]
        places, halves = stations[rows] - here, lengths[rows]
        found.append(_Neighbours(places - halves, places + halves, speeds[rows], objects.ids[rows].tolist()))
    return found
