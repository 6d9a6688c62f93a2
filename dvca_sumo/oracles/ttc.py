"""Time to collision: how soon the ego would touch an object if both kept their velocities."""

import math

import numpy as np
import numpy.typing as npt

from dvca_sumo.geometry.boxes import contact_times
from dvca_sumo.messages import Floats, Integers
from dvca_sumo.oracles.ahead import ahead
from dvca_sumo.oracles.findings import Findings
from dvca_sumo.oracles.place import Places
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Category, Ending, Judgement, Violation

Flags = npt.NDArray[np.bool_]


class TimeToCollision:
    """Kind "ttc": a contact nearer than the threshold for the dwell time; one for each object.

    The smaller of two times counts: straight on, when the moving boxes first touch (any object, any
    direction); along the route, the gap to an object in the ego's strip over the closing speed, which
    also holds in a curve. Not judged: a slow ego, objects wholly behind one that drives forwards (the
    hazard is the follower's), and boxes that touch already (that is a collision).
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

    def observe(self, moment: Moment) -> Violation | None:
        """See `Oracle`."""
        self._places.at(moment)
        if abs(moment.ego.speed) < self._slowest:
            self._since = {}
            return self._findings.next()
        rows, times = self.times(moment)
        soon = {moment.objects.ids[row]: time for row, time in zip(rows.tolist(), times.tolist(), strict=True)}
        since = {name: self._since.get(name, moment.time) for name, time in soon.items() if 0.0 < time < self._horizon}
        for name, begun in since.items():
            if moment.time - begun >= self._dwell - 1e-9 and name not in self._reported:
                self._reported.add(name)
                detail = f"{soon[name]:.2f} s to contact with {name}"
                self._findings.add(self._findings.made(moment, detail, soon[name], self._horizon, counterpart=name))
        self._since = since
        return self._findings.next()

    def conclude(self, ended: Ending) -> Judgement:  # noqa: ARG002  the answer holds for whatever part was seen
        """See `Oracle`."""
        return self._findings.judgement()

    def times(self, moment: Moment) -> tuple[Integers, Floats]:
        """Rows of the objects in reach, and the time to contact [s] of each; inf if beyond the threshold."""
        ego, objects, box = moment.ego, moment.objects, self._places.at(moment).box
        velocity = np.array([ego.speed * math.cos(ego.heading), ego.speed * math.sin(ego.heading)])
        relative = np.hypot(objects.velocities[:, 0] - velocity[0], objects.velocities[:, 1] - velocity[1])
        # Along a bend the gap may close although the velocities are equal.
        rows = self._places.within(moment, np.maximum(relative, abs(ego.speed)) * self._horizon)
        if rows.size == 0:
            return rows, np.empty(0)
        fronts = _foremost(box, objects.boxes[rows])
        # What lies wholly behind closes in by its own doing.
        if ego.speed > 0.0:
            is_beside = fronts >= -0.5 * box[3]
            rows, fronts = rows[is_beside], fronts[is_beside]
            if rows.size == 0:
                return rows, np.empty(0)
        times = contact_times(box, velocity, objects.boxes[rows], objects.velocities[rows], self._horizon)
        is_leader = fronts > 0.5 * box[3]
        if ego.speed > 0.0 and is_leader.any():
            self._shorten_along_route(moment, rows, is_leader, times)
        return rows, times

    def _shorten_along_route(self, moment: Moment, rows: Integers, is_leader: Flags, times: Floats) -> None:
        """Put the following time where it is the smaller one."""
        speed = moment.ego.speed
        leaders = ahead(self._places, moment, speed * self._horizon, rows=rows[is_leader])
        closing = speed - leaders.speeds
        is_closing = (closing > 0.0) & (leaders.speeds >= 0.0)
        found = rows.searchsorted(leaders.rows[is_closing])
        times[found] = np.minimum(times[found], leaders.gaps[is_closing] / closing[is_closing])


def _foremost(box: Floats, boxes: Floats) -> Floats:
    """How far each of `boxes` extends along the heading of `box`, from the centre of `box` [m]."""
    turns = boxes[:, 2] - box[2]
    reaches = 0.5 * (boxes[:, 3] * np.abs(np.cos(turns)) + boxes[:, 4] * np.abs(np.sin(turns)))
    found: Floats = (boxes[:, 0] - box[0]) * math.cos(box[2]) + (boxes[:, 1] - box[1]) * math.sin(box[2]) + reaches
    return found
