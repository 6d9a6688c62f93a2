"""Collision and safe distance: the ego's box against the box of every other object."""

import math

import numpy as np

from dvca_sumo.geometry.boxes import distances
from dvca_sumo.messages import Floats, ObjectClass
from dvca_sumo.oracles.findings import Findings
from dvca_sumo.oracles.place import Places
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Category, Contact, Ending, Judgement, Violation

_BEHIND = math.radians(150.0)  # an object whose centre is seen from the rear axle under a larger angle is behind

_WORDS = {
    Contact.STOPPED_EGO: "ran into the standing ego",
    Contact.HIT_FROM_BEHIND: "ran into the ego from behind",
    Contact.ACTIVE_FRONT: "hit by the ego's front",
    Contact.ACTIVE_SIDE: "touched the ego's side",
}


class Collision:
    """Kind "collision" on contact, "safe_distance" for a closest approach below the threshold without contact.

    An approach is established when the distance grows again, the object is out of reach, or the run
    ends. Approaches while the ego stands, and those from wholly behind an ego that does not reverse,
    are not the ego's. A contact always counts; `Violation.contact` says who made it (the classes
    follow nuPlan's no_ego_at_fault_collisions metric).
    """

    kind = "collision"

    def __init__(self, places: Places, thresholds: Thresholds) -> None:
        self._findings = Findings(self.kind, Category.SAFETY, places)
        self._thresholds = thresholds
        self._places = places
        self._touched: set[str] = set()
        self._approached: set[str] = set()
        self._approaches: dict[str, Violation] = {}  # by object id, the closest so far of each that is not over
        self._has_stood = True  # at the previous moment

    def observe(self, moment: Moment) -> Violation | None:
        """See `Oracle`."""
        box, boxes = self._places.at(moment).box, moment.objects.boxes
        reach = self._thresholds.safe_distance
        stands = abs(moment.ego.speed) <= self._thresholds.standing_speed
        near: dict[str, float] = {}
        rows = self._places.within(moment, reach)
        if rows.size:
            for row, distance in zip(rows.tolist(), distances(box, boxes[rows]).tolist(), strict=True):
                name = moment.objects.ids[row]
                if distance == 0.0:
                    self._contact(moment, name, row, stands=stands and self._has_stood)
                elif distance < reach and not stands and not _is_behind(moment, box, row):
                    near[name] = distance
        self._follow(moment, near)
        self._has_stood = stands
        return self._findings.next()

    def conclude(self, ended: Ending) -> Judgement:  # noqa: ARG002  the answer holds for whatever part was seen
        """See `Oracle`."""
        for approach in self._approaches.values():
            self._findings.add(approach)
        self._approaches.clear()
        return self._findings.judgement()

    def _contact(self, moment: Moment, name: str, row: int, *, stands: bool) -> None:
        self._approaches.pop(name, None)
        if name in self._touched:
            return
        self._touched.add(name)
        contact = _contact_of(moment, row, stands=stands)
        detail = f"{name} {_WORDS[contact]}"
        self._findings.add(self._findings.made(moment, detail, 0.0, 0.0, counterpart=name, contact=contact))

    def _follow(self, moment: Moment, near: dict[str, float]) -> None:
        """Keep the closest approach of each object that is near, and close those that are over."""
        for name in [name for name in self._approaches if name not in near]:
            self._close(name)
        for name, distance in near.items():
            if name in self._touched or name in self._approached:
                continue
            known = self._approaches.get(name)
            if known is not None and known.value is not None and distance > known.value:
                self._close(name)
            elif known is None or known.value != distance:
                self._approaches[name] = self._findings.made(
                    moment,
                    f"{distance:.2f} m to {name}",
                    distance,
                    self._thresholds.safe_distance,
                    kind="safe_distance",
                    counterpart=name,
                )

    def _close(self, name: str) -> None:
        self._approached.add(name)
        self._findings.add(self._approaches.pop(name))


def _contact_of(moment: Moment, row: int, *, stands: bool) -> Contact:
    """Who touched whom; what never moves runs into nobody, and who does so from behind touches the rear alone."""
    ego, shape, box = moment.ego, moment.shape, moment.objects.boxes[row]
    moves = moment.objects.classes[row] != ObjectClass.STATIC
    if stands and moves:
        return Contact.STOPPED_EGO
    is_at_front = _touches(moment, shape.front, box)
    angle = math.atan2(box[1] - ego.y, box[0] - ego.x) - ego.heading
    is_behind = abs(math.remainder(angle, math.tau)) > _BEHIND and ego.speed >= 0.0
    if is_behind and moves and not is_at_front and _touches(moment, -shape.rear_overhang, box):
        return Contact.HIT_FROM_BEHIND
    return Contact.ACTIVE_FRONT if is_at_front else Contact.ACTIVE_SIDE


def _touches(moment: Moment, ahead: float, box: Floats) -> bool:
    """Whether a box touches the bumper of the ego that is so far `ahead` of its rear axle [m]."""
    ego = moment.ego
    x, y = ego.x + ahead * math.cos(ego.heading), ego.y + ahead * math.sin(ego.heading)
    bumper = np.array([x, y, ego.heading, 0.0, moment.shape.width])
    return bool(distances(bumper, box[None])[0] == 0.0)


def _is_behind(moment: Moment, box: Floats, row: int) -> bool:
    """Whether the object lies wholly behind the rear bumper of an ego that does not reverse."""
    other = moment.objects.boxes[row]
    turn = other[2] - box[2]
    reach = 0.5 * (other[3] * abs(math.cos(turn)) + other[4] * abs(math.sin(turn)))
    along = (other[0] - box[0]) * math.cos(box[2]) + (other[1] - box[1]) * math.sin(box[2])
    return bool(moment.ego.speed >= 0.0 and along + reach < -0.5 * box[3])
