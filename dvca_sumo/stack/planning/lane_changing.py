"""Lane changes that the route needs: begun when there is a gap, waited for in the lane until then.

The route's line crosses over as early as it can. Until the planner accepts a gap in the next lane, the
ego keeps to the lane it is in: the line of the cycle runs along that one.
"""

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from dvca_sumo.messages import Flags, Floats, TrackedObjects, VehicleShape
from dvca_sumo.roadmap.route import LaneChange
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.lane_gaps import LAST_SPEED, Gaps, Neighbours, Urgency
from dvca_sumo.stack.planning.moves import Lateral, Move, blend_length, moved
from dvca_sumo.stack.planning.reference import BEHIND, Window
from dvca_sumo.stack.planning.speed import Stop
from dvca_sumo.stack.planning.start import StartState

ARRIVED = 0.4  # [m] from the lane's centre
_OVER = 0.2  # [m] of the body over the marking, from which on going on is safer than going back
_OVERLAP = 1.0  # [m] lengthwise, of who is abreast
_LEAST_GAP = 1.0  # [m] kept by who brakes for somebody, and at least divided by
_WAITING = "wait to change lanes"
_NEAR_END = 3.0  # [m] before the place where it has to


class Keeping(msgspec.Struct, frozen=True, eq=False):
    """What a lane that is not the route's asks of a cycle."""

    offsets: Floats  # (n,) of its centre from the window's line [m]
    begin: int  # row from which on it is there
    width: float  # [m]
    stop: Stop | None  # before the way to the route's lane is too short; places along the window's line


class LaneChoice(msgspec.Struct, frozen=True, eq=False):
    """Which lane to follow."""

    keeping: Keeping | None = None  # None: the route's line
    behind: frozenset[int] = frozenset()  # tracks in the lane the ego moves into, who let it in
    pace: float = math.inf  # [m/s] that brings the ego beside a gap


class LaneChanger:
    """Decides at each change of the route which of its lanes to be on."""

    def __init__(self, changes: Sequence[LaneChange], gaps: Gaps, shape: VehicleShape, config: PlanningConfig) -> None:
        self._changes = changes
        self._gaps = gaps
        self._shape = shape
        self._config = config
        self._next = 0  # row of the change that is to be done
        self._lane = 0  # of its lanes, the one the ego is on
        self._target = 0  # of its lanes, the one the ego is to be on

    def step(self, window: Window, offset: float, start: StartState, objects: TrackedObjects) -> LaneChoice:
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
        if nose > change.start_station and abs(offset - here[self._target]) < ARRIVED:
            self._lane = self._target
        return self._choice(change, window, offset - float(here[self._lane]), start, objects)

    def _choice(
        self, change: LaneChange, window: Window, aside: float, start: StartState, objects: TrackedObjects
    ) -> LaneChoice:
        """`aside` [m] is how far the ego is from its lane's centre."""
        last, speed = len(change.lanes) - 1, start.speed
        if self._lane == last:
            return LaneChoice()
        stop = last_stop(change, window, last - self._lane, speed, self._shape, self._config)
        has_to = is_last_chance(stop, speed)
        urgency = Urgency.HURRIED if stop.at < self._config.change_hurry * speed else Urgency.WANTED
        occupied = self._gaps.occupied(change, window.station, objects)
        target = self._lane
        # A change begun in the other direction swings out far before it turns round.
        is_going_back = self._target == self._lane and abs(aside) > ARRIVED and speed > LAST_SPEED
        is_kept = not has_to and is_at_junction(change, window, speed, self._shape, self._config)
        waits = is_going_back or is_kept
        while target < last and (target < self._target or not waits):
            present = Urgency.PRESSED if has_to or target < self._target else urgency
            if not self._gaps.is_free(occupied[target + 1], change, window, speed, present):
                break
            target += 1
        width, beside = change.widths[self._lane], occupied[self._lane + 1]
        if target < self._target and (
            goes_on(self._out(aside, window, start, stop), width, beside, self._shape)
            or is_caught(occupied[self._lane], beside, speed, self._shape, self._config)
        ):
            target = self._target
        self._target = target
        behind = letting_in(occupied[self._lane + 1 : target + 1], self._shape)
        if target == last:
            return LaneChoice(behind=behind)
        pace = self._gaps.pace(occupied[target + 1], change, window, speed)
        return LaneChoice(keeping(change, target, window, speed, stop, self._config), behind, pace)

    def _out(self, aside: float, window: Window, start: StartState, stop: Stop) -> float:
        """How far out of its lane an ego is that is to give up a change [m]: its front, where there is no way back.

        It would stop there turned, and too near to the end of the lane to begin again.
        """
        front = aside + self._shape.front * math.sin(start.heading - float(window.headings[BEHIND]))
        return front if blend_length(front, start.speed, self._config) > stop.at else aside


def keeping(
    change: LaneChange, lane: int, window: Window, speed: float, stop: Stop | None, config: PlanningConfig
) -> Keeping:
    """Keeping to one of the lanes of `change`, by its place in them.

    An ego that comes to them along the line is not there yet: out of a tight turn, not even on the first one.
    """
    stations = window.station + np.arange(window.rows.shape[1]) - BEHIND
    offsets, begin = np.interp(stations, change.stations, change.offsets[lane]), 0
    if window.station < change.start_station:
        begin = int(stations.searchsorted(change.start_station))
        way = blend_length(max(change.widths), max(speed, LAST_SPEED), config)
        onto = Move(Lateral(0.0, 0.0, 0.0), 1.0, change.start_station, way)
        (shares, _), _ = moved(onto, np.clip(stations - onto.begin, 0.0, way))
        offsets *= shares
    return Keeping(offsets, begin, change.widths[lane], stop)


def letting_in(lanes: Sequence[Neighbours], shape: VehicleShape) -> frozenset[int]:
    """The tracks on `lanes` that are not ahead of the front bumper."""
    return frozenset(
        track
        for lane in lanes
        for track, front in zip(lane.tracks, lane.fronts.tolist(), strict=True)
        if front < shape.front
    )


def last_stop(
    change: LaneChange, window: Window, lanes: int, speed: float, shape: VehicleShape, config: PlanningConfig
) -> Stop:
    """The last place from which the `lanes` that are left can be crossed at low speed; past it, the lane's end."""
    here = window.station + shape.front
    way = lanes * blend_length(max(change.widths), LAST_SPEED, config)
    at = max(change.latest_station - way, change.start_station) - here
    if at + 0.5 * way < speed * speed / (2.0 * config.comfort_braking):
        return Stop(change.latest_station - config.stop_line_gap - here, config.stop_line_gap, _WAITING)
    return Stop(at, 0.5 * way, _WAITING)


def is_at_junction(
    change: LaneChange, window: Window, speed: float, shape: VehicleShape, config: PlanningConfig
) -> bool:
    """Whether a change begun now would be made on one of the junctions on its way."""
    way = blend_length(max(change.widths), max(speed, LAST_SPEED), config)
    low, high = window.station - shape.rear_overhang, window.station + shape.front + way
    return any(begin < high and end > low for begin, end in change.junctions)


def goes_on(aside: float, width: float, lane: Neighbours, shape: VehicleShape) -> bool:
    """Whether an ego `aside` of the centre of its lane [m] finishes the change to `lane` that it has begun.

    It does once it is over the marking, unless somebody has come abreast of it there, and once half of it is over.
    """
    over = abs(aside) - 0.5 * (width - shape.width)
    return over > 0.5 * shape.width or (over > _OVER and not _is_abreast(lane, shape))


def is_caught(own: Neighbours, lane: Neighbours, speed: float, shape: VehicleShape, config: PlanningConfig) -> bool:
    """Whether an ego at `speed` [m/s] on its way to `lane` cannot stay behind who is ahead on its `own` any more.

    To do so it would brake harder than in comfort, and harder than going on asks for: of it, behind who is ahead on
    `lane`, and of who is behind there. Where somebody is abreast of it there, it does not go on.
    """
    if _is_abreast(lane, shape):
        return False
    closing, gaps, is_ahead = speed - lane.speeds, lane.rears - shape.front, lane.fronts > shape.front
    staying = _braking(speed - own.speeds, own.rears - shape.front, own.rears > shape.front)
    going = _braking(closing, gaps, is_ahead)
    asked = _braking(-closing, -shape.rear_overhang - lane.fronts, ~is_ahead)
    return staying > max(config.comfort_braking, going, asked)


def _is_abreast(lane: Neighbours, shape: VehicleShape) -> bool:
    """Whether somebody on the lane is beside the ego."""
    beside = (lane.rears < shape.front - _OVERLAP) & (lane.fronts > _OVERLAP - shape.rear_overhang)
    return bool(beside.any())


def _braking(closing: Floats, gaps: Floats, which: Flags) -> float:
    """The braking that takes off speeds `closing` (m,) [m/s] within `gaps` (m,) [m], the most of those `which` (m,)."""
    closing, gaps = np.maximum(closing[which], 0.0), np.maximum(gaps[which] - _LEAST_GAP, _LEAST_GAP)
    return float((closing * closing / (2.0 * gaps)).max(initial=0.0))


def is_last_chance(stop: Stop, speed: float) -> bool:
    """Whether the ego has all but stopped where it has to change lanes."""
    return stop.at < _NEAR_END and speed < LAST_SPEED
