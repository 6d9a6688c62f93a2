"""Planning messages, judged one by one against the specification (Algorithm 1, violationTest).

A trajectory contains all that is needed to judge it: it is driven, on paper, against the recorded
truth, and the run's own oracles look on. Two more rules need no driving: there must be a trajectory,
and it must begin where, and as fast as, the ego is.
"""

import math
from bisect import bisect_left

import msgspec

from dvca_sumo.analysis.at_fault import places_of
from dvca_sumo.analysis.violating import is_same_family
from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.geometry.frames import relative, transferred
from dvca_sumo.messages import ACCELERATION, CURVATURE, HEADING, SPEED, Component, MessageId, Trajectory, X, Y
from dvca_sumo.oracles import judge, judges
from dvca_sumo.oracles.destination import Destination
from dvca_sumo.oracles.no_progress import NoProgress
from dvca_sumo.record import Execution, MessageMark, Record
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import EgoTruth, Moment
from dvca_sumo.violations import Category, Ending, Violation

FORESIGHT = 3.0  # [s] of a trajectory that must keep the rules: farther ahead, a sound plan may rest on a guess
_FORESEEN = round(FORESIGHT * 10.0) + 1  # moments
BESIDE = 1.0  # [m] sideways a trajectory may begin from where the ego believes to be
SPEED_GAP = 3.0  # [m/s] likewise of the speed
_STANDING = 0.2  # [m/s]


class PlanningFinding(msgspec.Struct, frozen=True):
    """The first planning message that breaks the specification, and how."""

    mark: MessageMark
    reason: str


def first_violating_plan(
    record: Record, roadmap: RoadMap, thresholds: Thresholds, violation: Violation
) -> PlanningFinding | None:
    """The first planning message that itself leads to `violation`, or None when none does.

    For safety, traffic rules and a destination that is driven past: it is missing, does not begin where
    the ego is, or breaks a rule of the violation's family when driven for `FORESIGHT`. For other missions:
    it is missing, does not begin where the ego is, or plans to stand without a reason.
    """
    executions = record.executions[Component.PLANNING]
    waiting = NoProgress(places_of(record, roadmap), thresholds)
    for index, execution in enumerate(executions):
        mark = record.mark(MessageId(Component.PLANNING, index))
        if mark.time > violation.time:
            return None
        reason = _unusable(record, execution)
        if not isinstance(execution.message, Trajectory):
            return PlanningFinding(mark, reason)
        if not reason and violation.category is Category.MISSION and violation.kind != Destination.overrun:
            moment = record.moment_at(execution.tick)
            waiting.observe(moment)  # it follows the ego along its route
            begun = violation.time - thresholds.no_progress_time if violation.kind == NoProgress.kind else -math.inf
            if mark.time >= begun and not waiting.has_reason(moment):
                reason = _standstill(execution.message)
        elif not reason:
            reason = _breach(record, roadmap, thresholds, execution.message, execution.tick, violation)
        if reason:
            return PlanningFinding(mark, reason)
    return None


def first_unusable_plan(record: Record, since: float, until: float) -> PlanningFinding | None:
    """The first planning message of a row that nobody can follow: none, or one that begins elsewhere.

    Of the first row that reaches in between two times [s]; it may have begun before.
    """
    for index in range(record.first_at(Component.PLANNING, since), len(record.executions[Component.PLANNING])):
        found = _unusable_at(record, index)
        if found is not None:
            if found.mark.time > until:
                return None
            while found.mark.index > 0 and (before := _unusable_at(record, found.mark.index - 1)) is not None:
                found = before
            return found
    return None


def _unusable_at(record: Record, index: int) -> PlanningFinding | None:
    reason = _unusable(record, record.executions[Component.PLANNING][index])
    return PlanningFinding(record.mark(MessageId(Component.PLANNING, index)), reason) if reason else None


def _unusable(record: Record, execution: Execution) -> str:
    if not isinstance(execution.message, Trajectory):
        return "no trajectory was published"
    return _discontinuity(record, execution.message, execution.tick)


def _discontinuity(record: Record, trajectory: Trajectory, tick: int) -> str:
    believed, first = record.believed_at(tick), trajectory.points[0]
    _ahead, left, _ = relative((float(first[X]), float(first[Y]), 0.0), (believed.x, believed.y, believed.heading))
    if abs(left) > BESIDE:
        side = "left" if left > 0.0 else "right"
        return f"the trajectory begins {abs(left):.1f} m to the {side} of where the ego believes to be"
    gap = float(first[SPEED]) - believed.speed
    if abs(gap) > SPEED_GAP:
        return f"the trajectory begins {gap:+.1f} m/s off the ego's speed of {believed.speed:.1f} m/s"
    return ""


def _standstill(trajectory: Trajectory) -> str:
    if float(trajectory.points[:, SPEED].max()) < _STANDING:
        return f"the trajectory stands still without a reason ({trajectory.decision})"
    return ""


def _breach(
    record: Record, roadmap: RoadMap, thresholds: Thresholds, trajectory: Trajectory, tick: int, violation: Violation
) -> str:
    moments = _driven(record, trajectory, tick)
    for judgement in judge(moments, judges(places_of(record, roadmap, tick), thresholds), Ending.CUT):
        for found in judgement.violations:
            if is_same_family(found.kind, violation) and found.whom == violation.whom:
                return f"driven as planned it leads to {found.kind} in {found.time - moments[0].time:.1f} s"
    return ""


def _driven(record: Record, trajectory: Trajectory, tick: int) -> list[Moment]:
    """The recorded truth with the ego where the trajectory, read from its true place, takes it."""
    believed, ego = record.believed_at(tick), record.path[tick]
    origin = (ego.x, ego.y, ego.heading)
    poses = transferred(trajectory.points[:, [X, Y, HEADING]], (believed.x, believed.y, believed.heading), origin)
    moments: list[Moment] = []
    first = bisect_left(record.moments, trajectory.time - 1e-6, key=lambda moment: moment.time)
    for moment in record.moments[first : first + _FORESEEN]:
        elapsed = moment.time - trajectory.time
        row = min(round(elapsed * 10.0), len(poses) - 1)
        point = trajectory.points[row]
        truth = EgoTruth(
            time=moment.time,
            x=float(poses[row, 0]),
            y=float(poses[row, 1]),
            heading=wrapped(float(poses[row, 2])),
            speed=float(point[SPEED]),
            acceleration=float(point[ACCELERATION]),
            yaw_rate=float(point[SPEED] * point[CURVATURE]),
            steering=math.atan(moment.shape.wheelbase * float(point[CURVATURE])),
        )
        moments.append(msgspec.structs.replace(moment, ego=truth))
    return moments
