"""Time to collision: how soon the ego would touch an object if both kept their velocities, and their turning too.

Constant velocity, and constant turn rate and velocity: R. Schubert et al., Comparison and evaluation of advanced motion
models for vehicle tracking (2008).
"""

import math

import numpy as np

from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.geometry.boxes import box_of, contact_times, distances
from dvca_sumo.messages import Flags, Floats, Integers
from dvca_sumo.oracles.ahead import ahead
from dvca_sumo.oracles.findings import Findings
from dvca_sumo.oracles.lane_courses import Motion, lane_courses
from dvca_sumo.oracles.place import Places
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import Moment, ObjectsTruth
from dvca_sumo.violations import Category, Ending, Judgement, Violation

_STEP = 0.05  # [s] between the places where two are compared


class TimeToCollision:
    """Kind "ttc": a contact nearer than the threshold for the dwell time; one for each object.

    The smaller of two times counts: straight on, when the moving boxes first touch (any object, any
    direction); along the route, the gap to an object in the ego's strip over the closing speed, which
    also holds in a curve. Not judged: a slow ego, objects wholly behind one that drives forwards (the
    hazard is the follower's), and boxes that touch already (that is a collision). Nor is a contact that
    does not come about when both go on turning as they do, or when the other goes on along the lane it
    drives along, wherever that leads: two cars that pass each other in a bend, or where lanes of straight
    pieces have a corner.
    """

    kind = "ttc"

    def __init__(self, places: Places, thresholds: Thresholds) -> None:
        self._findings = Findings(self.kind, Category.SAFETY, places)
        self._places = places
        self._horizon = thresholds.ttc
        self._slowest = thresholds.ttc_speed
        self._dwell = thresholds.ttc_dwell
        self._since: dict[str, float] = {}  # [s] by object id, of each contact that is near now
        self._reported: set[str] = set()
        self._before: ObjectsTruth | None = None

    def observe(self, moment: Moment) -> Violation | None:
        """See `Oracle`."""
        self._places.at(moment)
        before, self._before = self._before, moment.objects
        if abs(moment.ego.speed) < self._slowest:
            self._since = {}
            return self._findings.next()
        rows, straight, along = self._times(moment)
        names, horizon = moment.objects.ids, self._horizon
        soon = {
            names[row]: min(ahead_on, following)
            for row, ahead_on, following in zip(rows.tolist(), straight.tolist(), along.tolist(), strict=True)
            if min(ahead_on, following) > 0.0
            and (following < horizon or (ahead_on < horizon and self._meet(moment, row, before)))
        }
        since = {name: self._since.get(name, moment.time) for name in soon}
        for name, begun in since.items():
            if moment.time - begun >= self._dwell - 1e-9 and name not in self._reported:
                self._reported.add(name)
                detail = f"{soon[name]:.2f} s to contact with {name}"
                self._findings.add(self._findings.made(moment, detail, soon[name], self._horizon, counterpart=name))
        self._since = since
        return self._findings.next()

    def _meet(self, moment: Moment, row: int, before: ObjectsTruth | None) -> bool:
        """Whether they touch however the object is taken to go on."""
        objects, horizon = moment.objects, self._horizon
        size = objects.boxes[row, 3:]
        if not _is_touched(moment, size, _turning(objects, row, before), horizon):
            return False
        lane = objects.lanes[row] if objects.lanes else ""
        speed = math.hypot(*objects.velocities[row].tolist())
        courses = lane_courses(self._places.roadmap, lane, objects.boxes[row], speed, horizon)
        return not courses or any(_is_touched(moment, size, course, horizon) for course in courses)

    def conclude(self, ended: Ending) -> Judgement:  # noqa: ARG002  the answer holds for whatever part was seen
        """See `Oracle`."""
        return self._findings.judgement()

    def times(self, moment: Moment) -> tuple[Integers, Floats]:
        """Rows of the objects in reach, and the time to contact [s] of each; inf if beyond the threshold."""
        rows, straight, along = self._times(moment)
        return rows, np.minimum(straight, along)

    def _times(self, moment: Moment) -> tuple[Integers, Floats, Floats]:
        """Rows of the objects in reach, and the times to contact of each straight on and along the route [s]."""
        ego, objects, box = moment.ego, moment.objects, self._places.at(moment).box
        velocity = np.array([ego.speed * math.cos(ego.heading), ego.speed * math.sin(ego.heading)])
        relative = np.hypot(objects.velocities[:, 0] - velocity[0], objects.velocities[:, 1] - velocity[1])
        # Along a bend the gap may close although the velocities are equal.
        rows = self._places.within(moment, np.maximum(relative, abs(ego.speed)) * self._horizon)
        fronts = _foremost(box, objects.boxes[rows])
        # What lies wholly behind closes in by its own doing.
        if ego.speed > 0.0:
            is_beside = fronts >= -0.5 * box[3]
            rows, fronts = rows[is_beside], fronts[is_beside]
        along = np.full(len(rows), math.inf)
        if rows.size == 0:
            return rows, along, along
        is_leader = fronts > 0.5 * box[3]
        if ego.speed > 0.0 and is_leader.any():
            self._follow_route(moment, rows, is_leader, along)
        return rows, contact_times(box, velocity, objects.boxes[rows], objects.velocities[rows], self._horizon), along

    def _follow_route(self, moment: Moment, rows: Integers, is_leader: Flags, times: Floats) -> None:
        """Put the following times of leaders where they are."""
        speed = moment.ego.speed
        leaders = ahead(self._places, moment, speed * self._horizon, rows=rows[is_leader])
        closing = speed - leaders.speeds
        is_closing = (closing > 0.0) & (leaders.speeds >= 0.0)
        times[rows.searchsorted(leaders.rows[is_closing])] = leaders.gaps[is_closing] / closing[is_closing]


def _is_touched(moment: Moment, size: Floats, motion: Motion, horizon: float) -> bool:
    """Whether the ego, turning as it does, touches a body of `size` (2,) within `horizon` [s]."""
    ego = moment.ego
    box = np.empty((1, 5))
    box[0, 3:] = size
    for time in np.arange(_STEP, horizon + _STEP, _STEP).tolist():
        place = _moved(ego.x, ego.y, ego.speed, ego.heading, ego.yaw_rate, time)
        box[0, :3] = motion(time)
        if distances(box_of(*place, ego.heading + ego.yaw_rate * time, moment.shape), box)[0] <= 0.0:
            return True
    return False


def _turning(objects: ObjectsTruth, row: int, before: ObjectsTruth | None) -> Motion:
    """On, as fast as now and turning as since `before`."""
    x, y, heading, *_ = objects.boxes[row].tolist()
    rate = 0.0
    if before is not None and objects.time > before.time and objects.ids[row] in before.ids:
        known = before.boxes[before.ids.index(objects.ids[row]), 2]
        rate = wrapped(heading - float(known)) / (objects.time - before.time)
    east, north = objects.velocities[row].tolist()
    speed, course = math.hypot(east, north), math.atan2(north, east)
    return lambda time: (*_moved(x, y, speed, course, rate, time), heading + rate * time)


def _moved(x: float, y: float, speed: float, course: float, rate: float, time: float) -> tuple[float, float]:
    """Where a point is after `time` [s] on its arc: at the end of a chord."""
    half = 0.5 * rate * time
    chord = speed * time * (math.sin(half) / half if half else 1.0)
    return x + chord * math.cos(course + half), y + chord * math.sin(course + half)


def _foremost(box: Floats, boxes: Floats) -> Floats:
    """How far each of `boxes` extends along the heading of `box`, from the centre of `box` [m]."""
    turns = boxes[:, 2] - box[2]
    reaches = 0.5 * (boxes[:, 3] * np.abs(np.cos(turns)) + boxes[:, 4] * np.abs(np.sin(turns)))
    found: Floats = (boxes[:, 0] - box[0]) * math.cos(box[2]) + (boxes[:, 1] - box[1]) * math.sin(box[2]) + reaches
    return found
