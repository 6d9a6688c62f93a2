"""Whose doing a violation is, by written rules.

1. The simulator's: see `disturbances`.
2. The other one's: it ran into the standing ego, unless it stood, too, and the ego crept; it ran into the rear of the
   ego while that was in its lane, or while the ego was on its way out of the other one's lane; it moved, and touched
   the flank of an ego that was in its lane and not on a junction. Then time to collision and distance to that same
   object just before are its doing, too. And a destination is not reached for the others' sake when SUMO's own driver
   on the same trip had not arrived after the same time either, when it ends in a jam (see `jams`), or when the ego, the
   time in queues apart that no ego heads (see `queues`), was not too slow compared with that driver; jams apart, not
   when the ego stood for no reason.
3. Everything else is the driver's: the ego's own. Traffic rules are always the driver's.

The ego, or its rear, is in its lane when no corner is more than 0.3 m beyond the edges of the lane under its middle,
and that leads the way that it drives. In sharp turns the front sweeps out further. The ego is on its way out of a lane,
off the junctions, when its rear is partly on it and its heading leads away from the middle. SUMO's drivers follow who
is on their lane with its middle.
"""

import enum
import math
from collections.abc import Sequence

import msgspec
import numpy as np

from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.geometry.boxes import box_of, corners
from dvca_sumo.messages import Floats
from dvca_sumo.oracles.destination import Destination
from dvca_sumo.responsibility.disturbances import Disturbance, Disturbances
from dvca_sumo.roadmap import Lane, RoadMap
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Contact, Judgement, Violation

_TOLERANCE = 0.3  # [m] as of the oracle of the lane
_NEAR = 3.0  # [m] from its middle a lane is under the ego
_REAR = slice(1, 3)  # of the corners of a box
_AWAY = 0.05  # [rad] of heading from the middle of a lane, at least
_STANDING = 0.1  # [m/s]
_BEFORE = 5.0  # [s] before a contact what is about the same object belongs to it


class AtFault(enum.StrEnum):
    """Whose doing a violation is."""

    DRIVER = "driver"
    OTHER = "other"
    SIMULATOR = "simulator"


class Judged(msgspec.Struct, frozen=True):
    """One violation of one trip."""

    oracle: str
    violation: Violation
    fault: AtFault
    reason: str  # why it is not the driver's; empty if it is
    is_alone: bool | None = None  # whether it also occurs with no other ego in the simulation; None: not known


def judged(
    judgements: Sequence[Judgement],
    disturbances: Disturbances,
    end: Moment,
    roadmap: RoadMap,
    jam: str | None = None,
) -> tuple[Judged, ...]:
    """All violations of a drive by time, `end` being its last moment that was judged: its contact, if it has one.

    `jam` is who holds up the ego in a jam at that time.
    """
    violations = [(judgement.kind, violation) for judgement in judgements for violation in judgement.violations]
    violations.sort(key=lambda one: one[1].time)
    contact = next((one for _, one in violations if one.contact is not None), None)
    excuse = "" if contact is None else _excuse(contact, end, roadmap)
    found = []
    begun: dict[str | None, Disturbance] = {}  # by the body that violations came from
    for oracle, violation in violations:
        disturbance = disturbances.explain(violation.object, violation.time) or begun.get(violation.object)
        if violation.object is not None and disturbance is not None and disturbance.lasts(violation.time):
            begun[violation.object] = disturbance
            reason = f"{disturbance.object} {disturbance.how} at {disturbance.time:.1f} s"
            found.append(Judged(oracle, violation, AtFault.SIMULATOR, reason))
        elif excuse and contact is not None and _belongs(violation, contact):
            found.append(Judged(oracle, violation, AtFault.OTHER, excuse))
        elif violation.kind == Destination.not_reached and jam is not None:
            found.append(Judged(oracle, violation, AtFault.OTHER, f"held up in a jam behind {jam}"))
        else:
            found.append(Judged(oracle, violation, AtFault.DRIVER, ""))
    return tuple(found)


def _belongs(violation: Violation, contact: Violation) -> bool:
    return violation.whom == contact.whom and contact.time - violation.time <= _BEFORE


def _excuse(contact: Violation, moment: Moment, roadmap: RoadMap) -> str:
    """Why a contact is the other one's doing; empty if it is not."""
    if contact.contact is Contact.ACTIVE_FRONT:
        return ""
    ego = moment.ego
    row = moment.objects.ids.index(contact.object or "")
    speed = math.hypot(*moment.objects.velocities[row].tolist())
    if contact.contact is Contact.STOPPED_EGO:
        creeps = speed < abs(ego.speed) < _STANDING  # up to who stands
        return "" if creeps else "ran into the standing ego"
    box = box_of(ego.x, ego.y, ego.heading, moment.shape)
    spots = corners(box[None])[0]
    if contact.contact is Contact.HIT_FROM_BEHIND:
        other = moment.objects.boxes[row]
        is_clear = _lane_kept(spots[_REAR], box, roadmap) is not None or _leaves(spots[_REAR], box, other, roadmap)
        return "ran into the ego from behind" if is_clear else ""
    if speed < _STANDING:
        return ""
    lane = _lane_kept(spots, box, roadmap)
    return "touched the ego in its lane" if lane is not None and not lane.is_internal else ""


def _lane_kept(spots: Floats, box: Floats, roadmap: RoadMap) -> Lane | None:
    """The lane under the middle of the ego's `box` (5,) that leads its way, if all `spots` (n, 2) are in it."""
    near = roadmap.lanes_near(box[None, :2], _NEAR)[0]
    for name in near:
        lane = roadmap.lanes[name]
        stations, offsets = lane.line.project(spots)
        is_along = abs(wrapped(box[2] - float(lane.line.headings_at(stations[:1])[0]))) < 0.5 * math.pi
        if is_along and float(np.abs(offsets).max()) <= 0.5 * lane.width + _TOLERANCE:
            return lane
    return None


def _leaves(rear: Floats, box: Floats, other: Floats, roadmap: RoadMap) -> bool:
    """Whether the ego's `box` (5,), its `rear` corners (2, 2), is on its way out of the lane under the `other` (5,)."""
    near = roadmap.lanes_near(other[None, :2], _NEAR)[0]
    if not near or roadmap.lanes[near[0]].is_internal:
        return False
    lane = roadmap.lanes[near[0]]
    stations, offsets = lane.line.project(rear)
    away = math.copysign(1.0, offsets.sum()) * wrapped(box[2] - float(lane.line.poses(stations)[0, 2]))
    return bool(np.abs(offsets).min() < 0.5 * lane.width and _AWAY < away < 0.5 * math.pi)
