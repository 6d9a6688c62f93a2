"""Where a plan begins: on the previous trajectory as long as the ego follows it."""

import math

import msgspec

from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.messages import LocalizationEstimate, Trajectory
from dvca_sumo.stack.planning.config import PlanningConfig

STANDING = 0.05  # [m/s]


class StartState(msgspec.Struct, frozen=True, gc=False):
    """Row 0 of the trajectory to be planned (rear axle)."""

    x: float  # [m]
    y: float  # [m]
    heading: float  # [rad]
    speed: float  # [m/s]
    acceleration: float  # [m/s^2]
    curvature: float  # [1/m]


def start_state(previous: Trajectory | None, localization: LocalizationEstimate, config: PlanningConfig) -> StartState:
    """The previous trajectory at the present time if the believed pose is near it, else the believed state.

    Continuing what was planned keeps the plan smooth: control's deviations are control's to remove. While the ego is to
    stand, control cannot: it sets off as planned from where it is.
    """
    if previous is not None:
        planned = _at(previous, localization.time)
        if planned is not None and _is_near(planned, localization, config):
            if planned.speed >= STANDING:
                return planned
            x, y, heading = localization.x, localization.y, localization.heading
            return msgspec.structs.replace(planned, x=x, y=y, heading=heading)
    comfort = (-config.hard_braking, config.acceleration)
    return StartState(
        x=localization.x,
        y=localization.y,
        heading=localization.heading,
        speed=max(localization.speed, 0.0),
        acceleration=min(max(localization.acceleration, comfort[0]), comfort[1]),
        curvature=localization.yaw_rate / localization.speed if localization.speed > 1.0 else 0.0,
    )


def _at(trajectory: Trajectory, time: float) -> StartState | None:
    """The trajectory interpolated at `time`; None outside of it."""
    row = (time - trajectory.time) / 0.1
    first = int(row)
    if row < 0.0 or first + 1 >= len(trajectory.points):
        return None
    (_, *low), (_, *high) = trajectory.points[first : first + 2].tolist()
    part = row - first
    return StartState(*[a + part * (b - a) for a, b in zip(low, high, strict=True)])


def _is_near(planned: StartState, localization: LocalizationEstimate, config: PlanningConfig) -> bool:
    east, north = localization.x - planned.x, localization.y - planned.y
    cosine, sine = math.cos(planned.heading), math.sin(planned.heading)
    return (
        abs(north * cosine - east * sine) <= config.stitch_lateral
        and abs(east * cosine + north * sine) <= config.stitch_longitudinal
        and abs(wrapped(localization.heading - planned.heading)) <= config.stitch_heading
        and abs(localization.speed - planned.speed) <= config.stitch_speed
    )
