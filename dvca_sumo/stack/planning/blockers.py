"""What may have to be passed: who stands in the way or close to it, or walks along the road there."""

from collections.abc import Collection

import msgspec
import numpy as np

from dvca_sumo.messages import Floats, ObjectClass, VehicleShape
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.reference import BEHIND, Window
from dvca_sumo.stack.planning.scene import Flags, Scene

LENGTHWISE = 1.0  # [m] kept around an object before the ego moves back
SLOWEST = 3.0  # [m/s] assumed of the ego when it passes
PARALLEL = 0.95  # cosine of the smallest angle (18 degrees) to the line at which somebody stands aslant

_PERSON = int(ObjectClass.PEDESTRIAN)
_SEEN_LATE = 20.0  # [m] before the end of the window, objects are not yet decided about


class Blocker(msgspec.Struct, frozen=True):
    """What the ego passes in or close to its way, in window coordinates: where it is while the ego passes."""

    track: int
    row: int  # in the scene
    speed: float  # [m/s]
    low: float  # [m] stations
    high: float  # [m]
    right: float  # [m] offsets
    left: float  # [m]
    swept_right: float  # [m] of the body where it passes the object, its rear axle on the line: negative
    swept_left: float  # [m]
    wanted: float  # [m] sideways clearance
    walks: bool  # along the road

    def clearance(self, offset: float) -> float:
        """Between body and object, the ego passing at `offset` [m]; negative where they would overlap."""
        return max(self.right - self.swept_left - offset, offset + self.swept_right - self.left)


def blockers(
    scene: Scene,
    window: Window,
    speed: float,
    held: Collection[int],
    shape: VehicleShape,
    config: PlanningConfig,
) -> list[Blocker]:
    """Objects that the ego, centred in its lane, would pass with less than the wanted clearance, by station.

    They stand, or walk along the road; who starts to move when the ego is beside them, or too near to fall in behind
    them in comfort, is passed all the same, or passes the ego: those are among `held`, the tracks passed in the last
    cycle. `speed` is the ego's [m/s].
    """
    walks = _walks_along(scene)
    if not (walks | scene.is_standing).any() and not held:
        return []
    now = scene.now
    wanted = np.where(scene.classes == _PERSON, config.person_clearance, config.nudge_clearance)
    is_held = np.array([track in held for track in scene.ids], dtype=np.bool_)
    speeds = np.where(scene.is_standing | walks, 0.0, scene.speeds)  # all the way of who walks is taken
    closing = np.maximum(speed - speeds, 0.0)
    way = closing * closing / (2.0 * config.comfort_braking) + LENGTHWISE
    is_beside = is_held & (now.stations - now.half_lengths < shape.front + way)
    rows = now.rows(window)
    swept_left, swept_right = window.swept_left[rows].max(axis=0), window.swept_right[rows].min(axis=0)
    near = now.gaps(swept_left, swept_right) < wanted + config.nudge_hold * is_held
    near &= scene.is_standing | is_beside | walks
    near &= now.stations + now.half_lengths > -shape.rear_overhang - LENGTHWISE
    near &= now.stations - now.half_lengths < window.rows.shape[1] - BEHIND - _SEEN_LATE
    if not near.any():
        return []
    met = _met(now.stations, np.where(walks, scene.speeds * now.directions, 0.0), speed, config.acceleration)
    lows = np.minimum(now.stations, met) - now.half_lengths
    highs = met + now.half_lengths
    found = [
        Blocker(
            scene.ids[row],
            row,
            float(speeds[row]),
            float(lows[row]),
            float(highs[row]),
            float(now.offsets[row] - now.half_widths[row]),
            float(now.offsets[row] + now.half_widths[row]),
            float(swept_right[row]),
            float(swept_left[row]),
            float(wanted[row]),
            bool(walks[row]),
        )
        for row in near.nonzero()[0].tolist()
    ]
    return sorted(found, key=lambda blocker: blocker.low)


def _walks_along(scene: Scene) -> Flags:
    """Which people walk along the road, one way or the other."""
    along: Flags = ~scene.is_standing & (scene.classes == _PERSON) & (np.abs(scene.now.directions) > PARALLEL)
    return along


def _met(stations: Floats, speeds: Floats, speed: float, acceleration: float) -> Floats:
    """Where an ego at `speed` [m/s] meets those who go on from `stations` at `speeds` [m/s] along its way (n,) [m].

    It gets faster at `acceleration` [m/s^2] until then.
    """
    closing = speed - speeds
    times = (np.sqrt(closing * closing + 2.0 * acceleration * np.maximum(stations, 0.0)) - closing) / acceleration
    met: Floats = stations + speeds * times
    return met
