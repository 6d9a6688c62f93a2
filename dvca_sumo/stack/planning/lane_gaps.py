"""Gaps between those who drive on a lane beside the ego's.

They are told by what has to brake how hard (as in MOBIL: Kesting, Treiber, Helbing, General lane-changing
model, 2007).
"""

import enum
import math
from typing import NamedTuple

import msgspec
import numpy as np

from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.messages import Flags, Floats, ObjectClass, TrackedObjects, VehicleShape
from dvca_sumo.roadmap.route import LaneChange
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.moves import blend_length
from dvca_sumo.stack.planning.reference import Window
from dvca_sumo.stack.planning.scene import ALONG, IN_LANE

_PERSON, _STATIC = int(ObjectClass.PEDESTRIAN), int(ObjectClass.STATIC)
LAST_SPEED = 3.0  # [m/s] at which a change in the last moment is done
_SLOWEST = 2.0  # [m/s] beside a gap ...
_FALLING_BACK = 5.0  # [m/s] ... and for one that is yet to come, which the ego does not wait for before it has to
_WITHIN = 0.3  # of its way to the next lane, the ego's body stays in its own
_SEEN = 120.0  # [m] before and behind the ego
_BEYOND = 1.0  # [m] farther the line is searched: its ends are the nearest place to everybody beyond them
_CROSSING = 2.0  # [s] at least, from the beginning of a change until the ego is on the next lane
_SOON = 1.0  # [s] until who drifts towards a lane is taken to be on it: one may come from its other side
_FOLLOWED = 1.0  # [s] after somebody the next one may come
_PAST = 3.5  # times the distance to who is behind, the next lane is in view past them: by the width of cars on lanes
_NEAR = 30.0  # [m] of effort, beyond which another place is looked for
_CATCHES_UP = 0.8  # of the ego's speed: slower ones are come up to ...
_FORWARD = 3.0  # ... while a gap beside faster ones is that much harder to get to than one farther back


class Urgency(enum.IntEnum):
    """How much there is to a change of lanes now."""

    CAN_WAIT = enum.auto()  # later does as well
    WANTED = enum.auto()
    HURRIED = enum.auto()  # the last place for it is near
    PRESSED = enum.auto()  # it is under way, or the ego has all but stopped for it


class Neighbours(msgspec.Struct, frozen=True, eq=False):
    """Who drives or stands on one lane, from front to back."""

    rears: Floats  # (m,) [m] stations
    fronts: Floats  # (m,) [m]
    speeds: Floats  # (m,) [m/s]
    is_traffic: Flags  # (m,) heading its way: not parked beside it or across, nor just standing about
    tracks: list[int]  # (m,)


class _Slot(NamedTuple):
    """A place behind somebody on the next lane."""

    effort: float  # [m] how hard it is to get to
    shift: float  # [m] how much farther ahead it is than the ego's nose
    pace: float  # [m/s] of who is before it


class Gaps:
    """What lanes beside the route's line look like to an ego that may change to them."""

    def __init__(self, line: Polyline, destination: float, shape: VehicleShape, config: PlanningConfig) -> None:
        """The ego stops at the station `destination` [m]."""
        self._line = line
        self._begin: Floats = line.poses([0.0])[0]
        self._destination = destination
        self._shape = shape
        self._config = config

    def occupied(self, change: LaneChange, here: float, objects: TrackedObjects) -> list[Neighbours]:
        """For each lane of the change, who is on it or partly so, or soon; places count from the station `here` [m]."""
        boxes, velocities = objects.boxes, objects.velocities
        reach = _SEEN + _BEYOND
        stations, offsets = self._located(boxes[:, :2], here - reach, here + reach)
        headings = self._line.headings_at(stations)
        angles = boxes[:, 2] - headings
        directions = np.cos(angles)
        cosines, sines = np.abs(directions), np.abs(np.sin(angles))
        lengths = 0.5 * (boxes[:, 3] * cosines + boxes[:, 4] * sines)
        widths = 0.5 * (boxes[:, 3] * sines + boxes[:, 4] * cosines)
        east, north = np.cos(headings), np.sin(headings)
        speeds = velocities[:, 0] * east + velocities[:, 1] * north
        drifted = offsets + _SOON * (velocities[:, 1] * east - velocities[:, 0] * north)
        is_there = (objects.classes != _PERSON) & (stations < change.latest_station) & (np.abs(stations - here) < _SEEN)
        heads_along = (directions > ALONG) & (objects.classes != _STATIC)
        centres = change.centres(stations)
        slopes = change.centres(stations + 1.0) - centres  # who keeps to a lane drifts so from a line that does not
        found = []
        for centre, soon in zip(centres, centres + _SOON * speeds * slopes, strict=True):
            aside = np.minimum(np.abs(offsets - centre), np.abs(drifted - soon))
            rows = (is_there & (aside < widths + 0.5 * self._shape.width)).nonzero()[0]
            rows = rows[(-stations[rows]).argsort(kind="stable")]
            places, halves = stations[rows] - here, lengths[rows]
            is_traffic = heads_along[rows] & (aside[rows] < IN_LANE)
            tracks = objects.ids[rows].tolist()
            found.append(Neighbours(places - halves, places + halves, speeds[rows], is_traffic, tracks))
        return found

    def _located(self, points: Floats, low: float, high: float) -> tuple[Floats, Floats]:
        """Stations and offsets of `points` (m, 2), looked for from `low` to `high`.

        The line begins where the ego came from shortly before: behind that it goes on straight.
        """
        stations, offsets = self._line.project(points, between=(low, high))
        behind = (stations <= 0.0).nonzero()[0]
        if behind.size:
            x, y, heading = self._begin
            east, north = (points[behind] - (x, y)).T
            stations[behind] = east * math.cos(heading) + north * math.sin(heading)
            offsets[behind] = north * math.cos(heading) - east * math.sin(heading)
        return stations, offsets

    def is_free(self, lane: Neighbours, change: LaneChange, window: Window, speed: float, urgency: Urgency) -> bool:
        """Whether nobody on the lane has to brake more than a little when the ego is there; hurried, at once.

        That is where the change can begin, those on the lane keeping their speeds until then; pressed, where
        the body gets over the marking. Thus it takes up what those who stop for it offer. But who passes before that
        hides others who follow close behind. Headways need not be there before the change is over: who is faster than
        who follows gets away until then; but who closes in does so at least until it brakes, and all the faster where
        the ego is about to stop at its destination. Where the change can wait, who closes in goes first, but with a
        headway as the ego itself keeps.
        """
        if not lane.tracks:
            return True
        config, shape = self._config, self._shape
        headway, braking = 0.0 if urgency >= Urgency.HURRIED else config.change_headway, config.change_braking
        ahead = max(change.start_station - window.station - shape.front, 0.0)
        wait = ahead / max(speed, LAST_SPEED)
        if urgency == Urgency.PRESSED:
            braking = config.comfort_braking
            within = _WITHIN * blend_length(max(change.widths), LAST_SPEED, config)
            faster = math.sqrt(speed * speed + 2.0 * config.acceleration * within)
            ahead += within
            wait += (faster - speed) / config.acceleration
            speed = faster
        rears, fronts = lane.rears + lane.speeds * wait, lane.fronts + lane.speeds * wait
        nose, tail = ahead + shape.front, ahead - shape.rear_overhang
        is_ahead = 0.5 * (rears + fronts) > 0.5 * (nose + tail)
        gaps, speeds = np.where(is_ahead, rears - nose, tail - fronts), lane.speeds
        if urgency == Urgency.PRESSED and is_ahead.all() and lane.fronts[-1] < 0.0:
            gaps = np.append(gaps, tail - rears[-1] + _FOLLOWED * speeds[-1])
            is_ahead, speeds = np.append(is_ahead, False), np.append(speeds, speeds[-1])
        closing = np.where(is_ahead, speed - speeds, speeds - self._slowed(window, speed))
        opened = _CROSSING * np.maximum(-closing, 0.0)
        behind = np.where(closing > 0.0, config.headway, headway) if urgency == Urgency.CAN_WAIT else headway
        kept = np.where(
            is_ahead,
            headway * speed - opened,
            np.maximum(behind * speeds - opened, config.expected_reaction * closing),
        )
        needed = config.change_gap + np.maximum(kept, 0.0) + _braked(closing, braking)
        return bool((gaps >= needed).all())

    def _slowed(self, window: Window, speed: float) -> float:
        """The speed that an ego at `speed` has when it is on the next lane, if only its destination has it brake."""
        left = self._destination - window.station - self._shape.front - _CROSSING * speed
        return min(speed, math.sqrt(2.0 * self._config.comfort_braking * max(left, 0.0)))

    def is_in_sight(self, own: Neighbours, lane: Neighbours, wanted: float, speed: float) -> bool:
        """Whether the ego sees far enough back on `lane`, past who is behind it on its `own`.

        Somebody there who is not seen yet, as fast as who is seen or, where nobody is, as the speed `wanted` [m/s],
        must not have to brake more than a little.
        """
        config, shape = self._config, self._shape
        pace = float(lane.speeds[lane.is_traffic].max()) if lane.is_traffic.any() else wanted
        needed = config.change_gap + config.change_headway * pace + _braked(pace - speed, config.change_braking)
        nearest = float(own.fronts[own.fronts < 0.0].max(initial=-_SEEN))
        sight = min(_PAST * (shape.centre - nearest), _SEEN) - 0.5 * shape.length
        return bool(pace <= speed or sight >= needed)

    def pace(self, lane: Neighbours, change: LaneChange, window: Window, speed: float) -> float:
        """The speed that brings the ego behind the nearest one on the lane who has room behind [m/s].

        Where nobody near has, that is one who has room but for headways: in the end those are not asked for.
        """
        config = self._config
        if not lane.tracks or change.start_station - window.station > config.change_outlook:
            return math.inf
        ahead = max(change.start_station - window.station - self._shape.front, 0.0)
        slot = self._slot(lane, ahead, speed, config.change_headway)
        if slot is None or slot.effort > _NEAR:
            slot = min((one for one in (self._slot(lane, ahead, speed, 0.0), slot) if one), default=None)
        if slot is None:
            return math.inf
        if slot.shift < 0.0:
            return max(slot.pace + slot.shift / config.change_time, _FALLING_BACK)
        return max(slot.pace + math.sqrt(2.0 * config.change_braking * slot.shift), _SLOWEST)

    def _slot(self, lane: Neighbours, ahead: float, speed: float, headway: float) -> _Slot | None:
        """The place behind somebody on the lane that is the easiest to get to, if there is one."""
        config, shape = self._config, self._shape
        wanted = lane.rears - config.change_gap - headway * speed  # for the nose, behind each
        spare = np.full(len(wanted), math.inf)  # behind the last one
        spare[:-1] = wanted[:-1] - shape.length - lane.fronts[1:] - config.change_gap - headway * lane.speeds[1:]
        has_room = spare >= 0.0
        shifts = wanted - shape.front - 0.5 * np.minimum(spare, config.change_gap)
        is_in_reach = has_room & ((lane.speeds > config.moving_speed) | (shifts >= ahead))
        if not is_in_reach.any():
            return None
        is_faster = lane.speeds > _CATCHES_UP * speed
        efforts = np.where(shifts > 0.0, np.where(is_faster, _FORWARD, 1.0) * shifts, -shifts)
        row = int(np.where(is_in_reach, efforts, np.inf).argmin())
        return _Slot(float(efforts[row]), float(shifts[row]), float(lane.speeds[row]))


def _braked(closing: Floats | float, braking: float) -> Floats:
    """The way on which `braking` takes off a speed, if there is one to take off [m]."""
    way: Floats = np.square(np.maximum(closing, 0.0)) / (2.0 * braking)
    return way
