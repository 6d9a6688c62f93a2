"""What the five components say to each other: frozen types, SI units, map frame.

`heading` is in rad, counter-clockwise from +x. The ego's pose is that of its rear axle centre.
Boxes are rows of x, y (centre) [m], heading [rad], length [m], width [m].
Arrays inside a message are never written to after it is made: a run makes those of a component's answer read-only.
"""

import enum

import msgspec
import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


class Component(enum.StrEnum):
    """The five components, in the order of the data flow."""

    LOCALIZATION = "localization"
    PERCEPTION = "perception"
    PREDICTION = "prediction"
    PLANNING = "planning"
    CONTROL = "control"


COMPONENTS = tuple(Component)


class MessageId(msgspec.Struct, frozen=True, gc=False):
    """The index-th output of a component in one run, counted from 0."""

    component: Component
    index: int


class ObjectClass(enum.IntEnum):
    """What a traffic object is, as far as an ADS tells objects apart."""

    VEHICLE = 0
    BICYCLE = 1
    PEDESTRIAN = 2
    STATIC = 3


class SignalColour(enum.StrEnum):
    """What a signal head shows for one movement."""

    RED = "red"
    YELLOW = "yellow"
    GREEN = "green"
    PERMISSIVE = "permissive"  # green, but conflicting movements have priority
    OFF = "off"  # dark or blinking: right of way by signs


class VehicleShape(msgspec.Struct, frozen=True):
    """The ego's body. The front bumper lies `length - rear_overhang` ahead of the rear axle."""

    length: float  # [m]
    width: float  # [m]
    wheelbase: float  # [m]
    rear_overhang: float  # [m] rear axle to rear bumper

    @property
    def front(self) -> float:
        """Distance from the rear axle to the front bumper [m]."""
        return self.length - self.rear_overhang

    @property
    def centre(self) -> float:
        """Distance from the rear axle to the box centre [m]."""
        return self.length / 2.0 - self.rear_overhang


class LocalizationEstimate(msgspec.Struct, frozen=True, gc=False):
    """Where the ego believes it is (100 Hz)."""

    time: float  # [s]
    x: float  # [m] rear axle
    y: float  # [m]
    heading: float  # [rad]
    speed: float  # [m/s]
    acceleration: float  # [m/s^2] along the heading
    yaw_rate: float  # [rad/s]


class TrackedObjects(msgspec.Struct, frozen=True):
    """The objects around the ego, placed on the map through the localization estimate (10 Hz)."""

    time: float  # [s]
    ids: Integers  # (n,) track numbers, stable over an object's life
    classes: Integers  # (n,) ObjectClass
    boxes: Floats  # (n, 5) x, y, heading, length, width
    velocities: Floats  # (n, 2) [m/s]
    signals: dict[str, SignalColour]  # by signal id of the route's stop lines, those in view only


class PredictedObjects(msgspec.Struct, frozen=True):
    """Tracked objects with futures (10 Hz).

    Hypothesis h belongs to object `owners[h]` (a row of `objects`). An object may own no hypothesis
    (nothing is known of its future: a planner takes it to stay where it is).
    """

    objects: TrackedObjects
    owners: Integers  # (h,) row in `objects`
    probabilities: Floats  # (h,) sum to 1 for each object that owns any
    poses: Floats  # (h, len(PREDICTION_TIMES), 3) x, y, heading of the box centre
    lanes: tuple[tuple[str, ...], ...]  # (h,) lane ids followed, empty off the road

    @property
    def time(self) -> float:
        """When the message was made [s]."""
        return self.objects.time


PREDICTION_STEP = 0.25  # [s]
PREDICTION_TIMES: Floats = np.arange(25, dtype=np.float64) * PREDICTION_STEP  # [s] 0 ... 6 s after the message
TRAJECTORY_TIMES: Floats = np.arange(81, dtype=np.float64) * 0.1  # [s] 0 ... 8 s after the message

# Columns of Trajectory.points.
T, X, Y, HEADING, SPEED, ACCELERATION, CURVATURE = range(7)


class Trajectory(msgspec.Struct, frozen=True):
    """Where the rear axle shall be over the next 8 s (10 Hz)."""

    time: float  # [s] of row 0
    points: Floats  # (81, 7) t [s, relative], x, y [m], heading [rad], speed, acceleration, curvature [1/m]
    decision: str  # why this trajectory: "cruise", "follow 12", "stop red tls/3", "nudge left 7", ...


class PoseStep(msgspec.Struct, frozen=True, gc=False):
    """A motion the vehicle makes exactly, expressed in its own frame before the motion."""

    forward: float  # [m]
    left: float  # [m]
    turn: float  # [rad]
    acceleration: float  # [m/s^2] of the trajectory; speed and yaw rate follow from the motion


class ControlCommand(msgspec.Struct, frozen=True, gc=False):
    """What the actuators shall do (100 Hz)."""

    time: float  # [s]
    acceleration: float  # [m/s^2]
    steering: float  # [rad] front wheel angle, positive to the left
    exact: PoseStep | None = None  # set by ideal control only: moved exactly so, actuators bypassed


Message = LocalizationEstimate | TrackedObjects | PredictedObjects | Trajectory | ControlCommand
