"""A straight road, an ego on it, things around it, and messages about them. All arrays are read-only: a write fails."""

import math
from collections.abc import Iterable, Sequence

import msgspec
import numpy as np

from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.interventions import Futures, Occasion, State
from dvca_sumo.messages import (
    HEADING,
    PREDICTION_TIMES,
    SPEED,
    TRAJECTORY_TIMES,
    Component,
    ControlCommand,
    Floats,
    LocalizationEstimate,
    MessageId,
    ObjectClass,
    PredictedObjects,
    SignalColour,
    T,
    TrackedObjects,
    Trajectory,
    VehicleShape,
    X,
    Y,
)
from dvca_sumo.roadmap import Route
from dvca_sumo.truth import EgoTruth, Moment, ObjectsTruth

SHAPE = VehicleShape(length=4.6, width=1.8, wheelbase=2.8, rear_overhang=1.0)  # front bumper 3.6 m ahead
RED = {"tls/0": SignalColour.RED}
AT_REST = State(0, 0, 0)
NO_FUTURES = Futures()


class Thing(msgspec.Struct, frozen=True):
    """A traffic object."""

    name: str
    x: float
    y: float
    speed: tuple[float, float] = (0.0, 0.0)
    kind: ObjectClass = ObjectClass.VEHICLE
    size: tuple[float, float] = (4.6, 1.8)
    heading: float = 0.0

    def after(self, elapsed: float) -> "Thing":
        """The same thing, having kept its velocity."""
        return msgspec.structs.replace(self, x=self.x + elapsed * self.speed[0], y=self.y + elapsed * self.speed[1])


def walker(name: str, x: float, y: float, across: float = 0.0) -> Thing:
    return Thing(name, x, y, (0.0, across), ObjectClass.PEDESTRIAN, (0.4, 0.6))


def frozen(values: object, shape: tuple[int, ...] | None = None) -> Floats:
    array = np.array(values, dtype=np.float64)
    array = array if shape is None else array.reshape(shape)
    array.setflags(write=False)
    return array


def road(length: float = 300.0, destination: float = 250.0) -> Route:
    """From (0, 0) along +x, one lane 3.2 m wide: stations are x."""
    stations = np.arange(0.0, length + 0.5, 1.0)
    line = Polyline(np.column_stack([stations, np.zeros_like(stations)]))
    edge = np.full(len(stations), 1.6)
    return Route(
        line=line,
        lane_ids=("in_0",) * len(stations),
        along_lanes=line.stations,
        speed_limits=np.full(len(stations), 13.9),
        curvatures=line.curvatures,
        lane_left=edge,
        lane_right=-edge,
        road_left=edge,
        road_right=-edge,
        start=10.0,
        destination=destination,
        stop_lines=(),
        crossings=(),
    )


def ego(time: float = 0.0, x: float = 20.0, y: float = 0.0, heading: float = 0.0, speed: float = 10.0) -> EgoTruth:
    return EgoTruth(time, x, y, heading, speed, acceleration=0.0, yaw_rate=0.0, steering=0.0)


def truth(things: Sequence[Thing], time: float = 0.0) -> ObjectsTruth:
    return ObjectsTruth(
        time=time,
        ids=tuple(thing.name for thing in things),
        classes=np.array([int(thing.kind) for thing in things], dtype=np.int64),
        boxes=frozen([(thing.x, thing.y, thing.heading, *thing.size) for thing in things], (-1, 5)),
        velocities=frozen([thing.speed for thing in things], (-1, 2)),
        lanes=("in_0",) * len(things),
    )


def moment(things: Sequence[Thing] = (), who: EgoTruth | None = None) -> Moment:
    who = ego() if who is None else who
    return Moment(who, SHAPE, truth(things, who.time), dict(RED))


def estimate(who: EgoTruth | None = None) -> LocalizationEstimate:
    """An ego that knows exactly where it is."""
    who = ego() if who is None else who
    return LocalizationEstimate(who.time, who.x, who.y, who.heading, who.speed, who.acceleration, who.yaw_rate)


def tracked(things: Iterable[Thing], time: float = 0.0) -> TrackedObjects:
    """What a perfect perception says of them; track numbers are rows from 100 on."""
    seen = truth(list(things), time)
    return TrackedObjects(time, np.arange(len(seen.ids)) + 100, seen.classes, seen.boxes, seen.velocities, dict(RED))


def predicted(things: Sequence[Thing], time: float = 0.0, hypotheses: int = 1) -> PredictedObjects:
    """Each keeps its velocity, so many times over."""
    owners = np.repeat(np.arange(len(things)), hypotheses)
    poses = np.empty((len(owners), len(PREDICTION_TIMES), 3))
    for row, owner in enumerate(owners.tolist()):
        thing = things[owner]
        poses[row, :, 0] = thing.x + PREDICTION_TIMES * thing.speed[0]
        poses[row, :, 1] = thing.y + PREDICTION_TIMES * thing.speed[1]
        poses[row, :, 2] = thing.heading
    return PredictedObjects(
        tracked(things, time),
        owners,
        frozen(np.full(len(owners), 1.0 / max(hypotheses, 1))),
        frozen(poses),
        tuple(("in_0",) for _ in owners),
    )


def trajectory(who: EgoTruth | None = None, speed: float | None = None, decision: str = "cruise") -> Trajectory:
    """Straight on from where the ego is, at its speed or another one."""
    who = ego() if who is None else who
    pace = who.speed if speed is None else speed
    points = np.zeros((len(TRAJECTORY_TIMES), 7))
    points[:, T] = TRAJECTORY_TIMES
    points[:, X] = who.x + TRAJECTORY_TIMES * pace * math.cos(who.heading)
    points[:, Y] = who.y + TRAJECTORY_TIMES * pace * math.sin(who.heading)
    points[:, HEADING] = who.heading
    points[:, SPEED] = pace
    return Trajectory(who.time, frozen(points), decision)


def command(acceleration: float = 0.5, steering: float = 0.01) -> ControlCommand:
    return ControlCommand(0.0, acceleration, steering)


def occasion(
    things: Sequence[Thing] = (),
    *,
    who: EgoTruth | None = None,
    believed: LocalizationEstimate | None = None,
    index: int = 0,
    elapsed: float = 0.0,
    state: State = AT_REST,
    route: Route | None = None,
    futures: Futures = NO_FUTURES,
    component: Component = Component.PERCEPTION,
) -> Occasion:
    now = moment(things, who)
    return Occasion(
        message=MessageId(component, index),
        elapsed=elapsed,
        state=state,
        moment=now,
        believed=estimate(now.ego) if believed is None else believed,
        trajectory=trajectory(now.ego),
        route=road() if route is None else route,
        sensor_range=80.0,
        futures=futures,
    )
