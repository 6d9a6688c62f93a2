"""A small planner of somebody else's: keeps its lane at constant speed, blind to all else.

`--stack foreign_planner:stack` finds it where this file lies.
"""

import math
from dataclasses import replace

import numpy as np

from dvca_sumo.messages import (
    TRAJECTORY_TIMES,
    Floats,
    LocalizationEstimate,
    PredictedObjects,
    SignalColour,
    Trajectory,
)
from dvca_sumo.stack.reference import Stack, StackContext, reference_stack

CRUISE = 11.0  # [m/s]
GENTLE = 1.5  # [m/s^2]
STEP = 0.1  # [s] between two rows of a trajectory


class LaneFollower:
    def __init__(self, context: StackContext) -> None:
        self._line = context.route.line
        self._curvatures = context.route.curvatures
        self._goal = context.route.destination - context.shape.front  # [m] station of the rear axle at rest

    def step(
        self,
        localization: LocalizationEstimate,
        predicted: PredictedObjects,  # noqa: ARG002
        signals: dict[str, SignalColour],  # noqa: ARG002
    ) -> Trajectory:
        (start,), _ = self._line.project(np.array([[localization.x, localization.y]]))
        speeds = self._speeds(float(start), localization.speed)
        stations = start + np.concatenate([[0.0], np.cumsum(0.5 * STEP * (speeds[1:] + speeds[:-1]))])
        poses = self._line.poses(stations, 0.0)
        curvatures = np.interp(stations, self._line.stations, self._curvatures)
        accelerations = np.gradient(speeds, STEP)
        points = np.column_stack([TRAJECTORY_TIMES, poses, speeds, accelerations, curvatures])
        return Trajectory(localization.time, points, "straight on")

    def _speeds(self, station: float, speed: float) -> Floats:
        """Towards the cruising speed, and to rest at the destination."""
        speeds = [speed]
        for _ in TRAJECTORY_TIMES[1:]:
            station += speeds[-1] * STEP
            braking = math.sqrt(2.0 * GENTLE * max(0.0, self._goal - station))
            speeds.append(min(speeds[-1] + GENTLE * STEP, CRUISE, braking))
        return np.array(speeds)


def stack(context: StackContext) -> Stack:
    return replace(reference_stack(context), planning=LaneFollower(context))
