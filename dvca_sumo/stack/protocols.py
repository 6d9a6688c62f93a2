"""The five components as protocols, and what sensors hand to them.

The signature is the channel: a component knows what `step` is given and nothing else.
"""

from typing import Protocol

import msgspec

from dvca_sumo.messages import (
    ControlCommand,
    Floats,
    Integers,
    LocalizationEstimate,
    PredictedObjects,
    SignalColour,
    TrackedObjects,
    Trajectory,
)


class OdometryReading(msgspec.Struct, frozen=True, gc=False):
    """Wheel odometry and inertial unit (100 Hz)."""

    time: float  # [s]
    speed: float  # [m/s]
    acceleration: float  # [m/s^2]
    yaw_rate: float  # [rad/s]


class GnssFix(msgspec.Struct, frozen=True, gc=False):
    """Satellite position of the rear axle and heading of a two-antenna receiver (10 Hz)."""

    x: float  # [m]
    y: float  # [m]
    heading: float  # [rad]


class Detections(msgspec.Struct, frozen=True):
    """One sweep of the object sensors, in the ego frame (rear axle, x forward): no identities."""

    time: float  # [s]
    boxes: Floats  # (n, 5) x, y of the centre, heading, length, width
    classes: Integers  # (n,) ObjectClass
    radial_speeds: Floats  # (n,) [m/s] rate of change of distance over ground, as a radar sees it
    signals: dict[str, SignalColour]  # signal heads in view, by signal id


class Localization(Protocol):
    """Odometry and satellite fixes -> believed pose."""

    def step(self, odometry: OdometryReading, fix: GnssFix | None) -> LocalizationEstimate:
        """One cycle (100 Hz); `fix` is there every tenth time."""
        ...


class Perception(Protocol):
    """Detections -> tracked objects on the map."""

    def step(self, detections: Detections, localization: LocalizationEstimate) -> TrackedObjects:
        """One cycle (10 Hz)."""
        ...


class Prediction(Protocol):
    """Tracked objects -> their possible futures."""

    def step(self, tracked: TrackedObjects) -> PredictedObjects:
        """One cycle (10 Hz)."""
        ...


class Planning(Protocol):
    """Believed pose, predicted objects and signals -> trajectory."""

    def step(
        self, localization: LocalizationEstimate, predicted: PredictedObjects, signals: dict[str, SignalColour]
    ) -> Trajectory:
        """One cycle (10 Hz)."""
        ...


class Control(Protocol):
    """Believed pose and trajectory -> actuator command."""

    def step(self, localization: LocalizationEstimate, trajectory: Trajectory | None) -> ControlCommand:
        """One cycle (100 Hz); no trajectory has arrived yet when it is None."""
        ...
