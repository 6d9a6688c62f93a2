"""What may have to be passed: who stands in the way or close to it, or walks along the road there."""

from collections.abc import Collection
from typing import NamedTuple

import msgspec
import numpy as np

from dvca_sumo.geometry.boxes import outlines
from dvca_sumo.messages import Flags, Floats, ObjectClass, VehicleShape
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.reference import BEHIND, Window
from dvca_sumo.stack.planning.scene import Scene

LENGTHWISE = 1.0  # [m] kept around an object before the ego moves back
SLOWEST = 3.0  # [m/s] assumed of the ego when it passes
PARALLEL = 0.95  # cosine of the smallest angle (18 degrees) to the line at which somebody stands aslant

_PERSON = int(ObjectClass.PEDESTRIAN)
_SEEN_LATE = 20.0  # [m] before the end of the window, objects are not yet decided about
_DOUBT = 1.0  # [m] that extents may be less than the body, at most: beside a bend
_LEAST_DOUBT = 0.1  # [m] and on a straight line
_PARTS = 4  # of each side of an outline


class Beside(NamedTuple):
    """Objects beside the ego's way, bends and their own angle to it counted in; all arrays (n,).

    Offsets of the rear axle at which the body, keeping its distance to the line, touches them.
    """

    low: Floats  # [m] stations from ...
    high: Floats  # [m] ... to
    right: Floats  # [m] passing on their right
    left: Floats  # [m] on their left

    def of(self, which: Flags) -> "Beside":
        """Some of them."""
        return Beside(*(column[which] for column in self))

    def clearances(self, offset: float) -> Floats:
        """Between body and each object, the ego passing at `offset` [m]; negative where they would overlap."""
        gaps: Floats = np.maximum(self.right - offset, offset - self.left)
        return gaps


_NOBODY = Beside(*np.empty((4, 0)))


class Blocker(msgspec.Struct, frozen=True, eq=False):
    """What the ego passes in or close to its way, in window coordinates: where it is while the ego passes."""

    track: int
    row: int  # in the scene
    speed: float  # [m/s]
    low: float  # [m] stations
    high: float  # [m]
    right: float  # [m] offset of the rear axle at which the body touches it, passing on its right
    left: float  # [m] on its left
    wanted: float  # [m] sideways clearance
    walks: bool  # along the road
    others: Beside  # who else stands where the ego is while it passes this one

    def clearance(self, offset: float) -> float:
        """Between body and object, the ego passing at `offset` [m]; negative where they would overlap."""
        return max(self.right - offset, offset - self.left)


def blockers(
    scene: Scene,
    window: Window,
    speed: float,
    held: Collection[int],
    shape: VehicleShape,
    config: PlanningConfig,
) -> tuple[list[Blocker], Beside]:
    """Objects that the ego, centred in its lane, would pass with less than the wanted clearance, by station.

    With them all who stand, beside the way to them and back too; nobody where there are none.

    They stand, or walk along the road; who starts to move when the ego is beside them, or too near to fall in behind
    them in comfort, is passed all the same, or passes the ego: those are among `held`, the tracks passed in the last
    cycle. `speed` is the ego's [m/s].
    """
    walks = _walks_along(scene)
    passed = scene.is_standing | walks
    if not np.count_nonzero(passed) and not held:
        return [], _NOBODY
    wanted = np.where(scene.classes == _PERSON, config.person_clearance, config.nudge_clearance)
    limits = wanted
    speeds = np.where(passed, 0.0, scene.speeds)  # all the way of who walks is taken
    if held:
        is_held = np.array([track in held for track in scene.ids], dtype=np.bool_)
        limits = wanted + config.nudge_hold * is_held
        passed |= is_held & _is_too_near(speeds, speed, scene, shape, config)
    near = passed & _is_on_way(scene, window, shape)
    if np.count_nonzero(near):
        near &= _may_be_passed_closer(limits, scene, window, shape)
    if not np.count_nonzero(near):
        return [], _NOBODY
    beside = _beside(scene, window, near | scene.is_standing)
    near &= beside.clearances(0.0) < limits
    if not near.any():
        return [], _NOBODY
    now = scene.now
    met = _met(now.stations, np.where(walks, scene.speeds * now.directions, 0.0), speed, config.acceleration)
    lows = np.minimum(now.stations, met) - now.half_lengths
    highs = met + now.half_lengths
    found = []
    for row in near.nonzero()[0].tolist():
        low, high = float(lows[row]), float(highs[row])
        found.append(
            Blocker(
                track=scene.ids[row],
                row=row,
                speed=float(speeds[row]),
                low=low,
                high=high,
                right=float(beside.right[row]),
                left=float(beside.left[row]),
                wanted=float(wanted[row]),
                walks=bool(walks[row]),
                others=beside.of(_standing_alongside(row, low, high, scene, beside, shape)),
            )
        )
    return sorted(found, key=lambda blocker: blocker.low), beside.of(scene.is_standing)


def _is_too_near(speeds: Floats, speed: float, scene: Scene, shape: VehicleShape, config: PlanningConfig) -> Flags:
    """Which objects (n,) at `speeds` an ego at `speed` [m/s] is beside, or cannot fall in behind in comfort."""
    closing = np.maximum(speed - speeds, 0.0)
    way = closing * closing / (2.0 * config.comfort_braking) + LENGTHWISE
    near: Flags = scene.now.stations - scene.now.half_lengths < shape.front + way
    return near


def _is_on_way(scene: Scene, window: Window, shape: VehicleShape) -> Flags:
    """Which objects (n,) are on the way ahead, or beside it."""
    now = scene.now
    is_near: Flags = now.stations + now.half_lengths > -shape.rear_overhang - LENGTHWISE
    is_near &= now.stations - now.half_lengths < window.rows.shape[1] - BEHIND - _SEEN_LATE
    return is_near


def _may_be_passed_closer(limits: Floats, scene: Scene, window: Window, shape: VehicleShape) -> Flags:
    """Which objects (n,), going by their extents, may be closer to the body than `limits` (n,) [m]."""
    now, rows = scene.now, scene.rows_now
    swept_left = np.maximum.reduce(window.swept_left.take(rows))
    swept_right = np.minimum.reduce(window.swept_right.take(rows))
    # Over its half length the line bends away from a body, over the ego's length the swept edge away from the line.
    bend = 0.5 * float(np.maximum.reduce(np.abs(window.curvatures)))
    doubt = bend * (now.half_lengths * now.half_lengths + shape.length * shape.length) + _LEAST_DOUBT
    near: Flags = now.gaps(swept_left, swept_right) < limits + np.minimum(doubt, _DOUBT)
    return near


def _standing_alongside(row: int, low: float, high: float, scene: Scene, beside: Beside, shape: VehicleShape) -> Flags:
    """Which others (n,) stand where the ego is while it passes this `row`, from station `low` to `high` [m]."""
    alongside: Flags = scene.is_standing & (beside.high > low - shape.front - LENGTHWISE)
    alongside &= beside.low < high + shape.rear_overhang + LENGTHWISE
    alongside[row] = False
    return alongside


def _beside(scene: Scene, window: Window, which: Flags) -> Beside:
    """Where those of `which` (n,) are, by their outlines: of an aslant one a corner is nearest, in one place only."""
    now = scene.now
    low, high = now.stations - now.half_lengths, now.stations + now.half_lengths
    sides = Beside(low, high, np.full(len(which), np.inf), np.full(len(which), -np.inf))
    stations, offsets, _ = window.project(outlines(scene.boxes[which], _PARTS).reshape(-1, 2))
    rows = window.index(stations)
    sides.right[which] = (offsets - window.swept_left.take(rows)).reshape(-1, 4 * _PARTS).min(axis=1)
    sides.left[which] = (offsets - window.swept_right.take(rows)).reshape(-1, 4 * _PARTS).max(axis=1)
    return sides


def _walks_along(scene: Scene) -> Flags:
    """Which people walk along the road, one way or the other."""
    people: Flags = scene.classes == _PERSON
    if np.count_nonzero(people):
        people &= ~scene.is_standing & (np.abs(scene.now.directions) > PARALLEL)
    return people


def _met(stations: Floats, speeds: Floats, speed: float, acceleration: float) -> Floats:
    """Where an ego at `speed` [m/s] meets those who go on from `stations` at `speeds` [m/s] along its way (n,) [m].

    It gets faster at `acceleration` [m/s^2] until then.
    """
    closing = speed - speeds
    times = (np.sqrt(closing * closing + 2.0 * acceleration * np.maximum(stations, 0.0)) - closing) / acceleration
    met: Floats = stations + speeds * times
    return met
