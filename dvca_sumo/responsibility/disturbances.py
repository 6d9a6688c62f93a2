"""What the simulator does that no driver survives.

The rule: a body appears within sight without having come there (it was inserted, or teleported), or one of its ends
moves farther in one step than its speed allows (a jump; SUMO's lane changes are such jumps, and so are its turns on the
spot), and what is violated with it is so before anybody reacts; or at that moment it touches the ego, or is so close in
the ego's way that full braking after a reaction would not keep the ego off it; a person who appears need only be within
a step of the ego. Or a person walks into an ego that has stood for a second, or, after standing beside one, its front
past, at its flank, and is within a step of it: SUMO's people walk through vehicles. So it is with who jumps there, for
as long as it takes the ego to react, to brake as hard as it can, and to have stood for that second. Then, for a while
after, violations with that body are the simulator's doing.
"""

import math

import msgspec
import numpy as np

from dvca_sumo.geometry.boxes import distances
from dvca_sumo.messages import Floats, Integers, ObjectClass
from dvca_sumo.oracles import Places
from dvca_sumo.oracles.ahead import ahead
from dvca_sumo.truth import Moment, ObjectsTruth
from dvca_sumo.world.crowd import ASIDE

IN_SIGHT = 120.0  # [m] of a body that comes nearer on its own way, it was seen before
LEAP = 1.0  # [m] in one step, beyond what its speed before allows; of people `ASIDE`
REACTION = 0.5  # [s]
BRAKING = 8.0  # [m/s^2]
TOUCHING = 0.2  # [m]
STEP = 0.75  # [m] people get so far before anybody reacts
STOOD = 1.0  # [s]
BESIDE = 3.0  # [m]
AT_FLANK = math.radians(45.0)  # at most, from straight towards it
LASTING = 5.0  # [s]
_STANDING = 0.1  # [m/s]
_PERSON = int(ObjectClass.PEDESTRIAN)


class Disturbance(msgspec.Struct, frozen=True):
    """One body that came out of nowhere, too near."""

    time: float  # [s]
    object: str
    how: str  # "appeared", or was there as the ego did, "jumped", or "walked" into the standing ego, or at its flank

    def lasts(self, time: float) -> bool:
        """Whether what that body does at `time` [s] may still come from it."""
        return 0.0 <= time - self.time <= LASTING


class Disturbances:
    """Those that one ego met up to now."""

    def __init__(self, places: Places) -> None:
        """The watch over one drive, `places` being its oracles'."""
        self.found: list[Disturbance] = []
        self._places = places
        self._before: ObjectsTruth | None = None
        self._rows: dict[str, int] = {}  # by name, in the moment before
        self._sudden: dict[str, list[Disturbance]] = {}  # by name, when it appeared or jumped, however far away
        self._drove = -math.inf  # [s] when the ego last moved
        self._excused: dict[str, float] = {}  # [s] by person: until when walking at the flank is the simulator's doing

    def see(self, moment: Moment) -> None:
        """Take in the next moment. To an ego that has just departed, every body has just appeared."""
        objects, before = moment.objects, self._before
        names = objects.ids
        rows = (
            self._rows if before is not None and names == before.ids else {name: row for row, name in enumerate(names)}
        )
        appeared = [row for name, row in rows.items() if name not in self._rows]
        jumped: list[int] = []
        if before is not None:
            common = [name for name in names if name in self._rows]
            now = np.array([rows[name] for name in common], dtype=np.int64)
            jumped = now[
                _leaps(objects, now, before, np.array([self._rows[name] for name in common], dtype=np.int64))
            ].tolist()
        arises = "was there as the ego appeared" if before is None else "appeared"
        for how, candidates in ((arises, appeared), ("jumped", jumped)):
            for name in (names[row] for row in candidates):
                self._sudden.setdefault(name, []).append(Disturbance(moment.time, name, how))
            for row in self._too_near(moment, candidates):
                self.found.append(Disturbance(moment.time, names[row], how))
        if abs(moment.ego.speed) >= _STANDING:
            self._drove = moment.time
        self._see_people(moment, jumped)
        self._before, self._rows = objects, rows

    def explain(self, name: str | None, time: float) -> Disturbance | None:
        """The disturbance by that body that a violation at `time` [s] comes from."""
        for sudden in reversed(self._sudden.get(name or "", [])):
            if 0.0 <= time - sudden.time <= REACTION:
                return sudden
        return next((one for one in self.found if one.object == name and one.lasts(time)), None)

    def _too_near(self, moment: Moment, rows: list[int]) -> list[int]:
        ego, objects = moment.ego, moment.objects
        chosen = np.array(
            [
                row
                for row in rows
                if math.dist((ego.x, ego.y), (objects.boxes[row, 0], objects.boxes[row, 1])) < IN_SIGHT
            ],
            dtype=np.int64,
        )
        if chosen.size == 0:
            return []
        nearest = np.where(objects.classes[chosen] == _PERSON, STEP, TOUCHING)
        box, boxes = self._places.at(moment).box, objects.boxes[chosen]
        touching = chosen[distances(box, boxes) < nearest].tolist()
        along = objects.velocities[chosen] @ np.array([math.cos(ego.heading), math.sin(ego.heading)])
        stopping = [_lengthened(box, way) for way in _way_to_stop(ego.speed, along).tolist()]
        beside = [
            row
            for row, way in zip(chosen.tolist(), stopping, strict=True)
            if distances(way, objects.boxes[[row]])[0] == 0.0
        ]
        found = ahead(self._places, moment, IN_SIGHT, rows=np.sort(chosen))
        in_way = found.rows[found.gaps < _way_to_stop(ego.speed, found.speeds)]
        return sorted({*touching, *beside, *in_way.tolist()})

    def _see_people(self, moment: Moment, jumped: list[int]) -> None:
        """Who walks into the ego while it stands, or, having stood or `jumped` beside its flank, at that."""
        ego, objects, rows = moment.ego, moment.objects, self._places.within(moment, BESIDE)
        rows = rows[objects.classes[rows] == _PERSON]
        if not rows.size:
            return
        gaps = distances(self._places.at(moment).box, objects.boxes[rows])
        cos, sin = math.cos(ego.heading), math.sin(ego.heading)
        axes, velocities = np.array([[cos, -sin], [sin, cos]]), objects.velocities[rows]
        along, left = ((objects.boxes[rows, :2] - (ego.x, ego.y)) @ axes).T
        is_beside = (along > -moment.shape.rear_overhang) & (along < moment.shape.front)
        speeds = np.hypot(velocities[:, 0], velocities[:, 1])
        towards = -np.sign(left) * (velocities @ axes)[:, 1] > math.cos(AT_FLANK) * speeds
        touches = (gaps <= 0.0) & (speeds >= abs(ego.speed))  # who is slower is crept into
        for row in rows[touches].tolist() if moment.time - self._drove >= STOOD else ():
            self.found.append(Disturbance(moment.time, objects.ids[row], "walked into the standing ego"))
        for name in (objects.ids[row] for row in rows[(gaps < STEP) & is_beside & towards].tolist()):
            if moment.time <= self._excused.get(name, -math.inf):
                self.found.append(Disturbance(moment.time, name, "walked at the ego's flank"))
        leapt, stands = is_beside & np.isin(rows, jumped), is_beside & (speeds < _STANDING)
        for which, lasting in ((leapt, REACTION + abs(ego.speed) / BRAKING + STOOD), (stands, LASTING)):
            for name in (objects.ids[row] for row in rows[which].tolist()):
                self._excused[name] = max(moment.time + lasting, self._excused.get(name, -math.inf))


def _way_to_stop(speed: float, others: Floats) -> Floats:
    """How far an ego at `speed` gets towards `others` (n,), by their speeds along its way, before it has theirs [m]."""
    closing = np.maximum(speed - np.maximum(others, 0.0), 0.0)
    way: Floats = REACTION * closing + closing * closing / (2.0 * BRAKING)
    return way


def _lengthened(box: Floats, by: float) -> Floats:
    """The `box` (5,), its front moved straight on `by` [m]."""
    longer = box.copy()
    longer[:2] += 0.5 * by * np.array([math.cos(box[2]), math.sin(box[2])])
    longer[3] += by
    return longer


def _leaps(now: ObjectsTruth, rows: Integers, before: ObjectsTruth, rows_before: Integers) -> Integers:
    """Where among `rows` bodies are that went farther than they can; (k,) each."""
    passed = now.time - before.time
    # Not its speed now: that is the one at which it was moved.
    speeds = np.hypot(before.velocities[rows_before, 0], before.velocities[rows_before, 1])
    moved = _ends(now)[:, rows] - _ends(before)[:, rows_before]
    farthest = np.hypot(moved[:, :, 0], moved[:, :, 1]).max(axis=0)
    leaps = np.where(now.classes[rows] == _PERSON, ASIDE, LEAP)
    found: Integers = np.flatnonzero(farthest > speeds * passed + leaps)
    return found


def _ends(objects: ObjectsTruth) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Where bodies begin and end: (2, n, 2). SUMO moves vehicles by their fronts, and has them turn about those."""
    boxes = objects.boxes
    half = 0.5 * boxes[:, 3] * np.array([[1.0], [-1.0]])
    return np.stack([boxes[:, 0] + half * np.cos(boxes[:, 2]), boxes[:, 1] + half * np.sin(boxes[:, 2])], axis=2)
