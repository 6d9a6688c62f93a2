"""Made-up roads, scripted objects and an ego that moves exactly as planned."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import msgspec
import numpy as np

from dvca_sumo.geometry.boxes import box_of, distances, outlines
from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.messages import (
    PREDICTION_TIMES,
    Floats,
    LocalizationEstimate,
    ObjectClass,
    PredictedObjects,
    SignalColour,
    TrackedObjects,
    Trajectory,
    VehicleShape,
)
from dvca_sumo.roadmap.route import Control, Crossing, Overpass, Route, StopLine, UnmappedLimit
from dvca_sumo.stack.planning import Planner, PlanningConfig

SHAPE = VehicleShape(length=4.6, width=1.8, wheelbase=2.7, rear_overhang=0.9)
LIMIT = 13.9


def straight_points(length: float = 600.0) -> Floats:
    return np.column_stack([np.arange(0.0, length + 0.5), np.zeros(int(length) + 1)])


def curve_points(radius: float, before: float = 100.0, after: float = 150.0) -> Floats:
    """Straight on, a quarter circle to the left with 10 m of easing at either end, straight on."""
    turning = math.pi / 2.0 * radius
    stations = np.arange(0.0, before + turning + 10.0 + after + 0.5)
    curvature = np.interp(stations, [before, before + 10.0, before + turning, before + turning + 10.0], [0, 1, 1, 0])
    return bent_points(curvature / radius)


def bent_points(curvatures: Floats) -> Floats:
    """A line from the origin along x, 1 m between points, as curved [1/m] at each."""
    headings = np.concatenate(([0.0], np.cumsum(0.5 * (curvatures[1:] + curvatures[:-1]))))
    middle = 0.5 * (headings[1:] + headings[:-1])
    return np.column_stack([np.cumsum(np.append(0.0, np.cos(middle))), np.cumsum(np.append(0.0, np.sin(middle)))])


def road(
    points: Floats | None = None,
    *,
    destination: float | None = None,
    limit: float = LIMIT,
    lanes_left: int = 0,
    stop_lines: Sequence[StopLine] = (),
    crossings: Sequence[Crossing] = (),
    unmapped_limits: Sequence[UnmappedLimit] = (),
    overpasses: Sequence[Overpass] = (),
) -> Route:
    """One lane 3.2 m wide along `points`, `lanes_left` more of the same direction to its left."""
    line = Polyline(straight_points() if points is None else points)
    ones = np.ones(len(line))
    return Route(
        line=line,
        lane_ids=("ego_0",) * len(line),
        along_lanes=line.stations,
        speed_limits=limit * ones,
        curvatures=line.curvatures,
        lane_left=1.6 * ones,
        lane_right=-1.6 * ones,
        road_left=(1.6 + 3.2 * lanes_left) * ones,
        road_right=-1.6 * ones,
        start=5.0,
        destination=line.length - 5.0 if destination is None else destination,
        stop_lines=tuple(stop_lines),
        crossings=tuple(crossings),
        unmapped_limits=tuple(unmapped_limits),
        overpasses=tuple(overpasses),
    )


def stop_line(station: float, control: Control, **changes: Any) -> StopLine:
    """A junction 12 m wide behind the line, met by "major_0" (which has priority where the rules say so)."""
    line = StopLine(
        station=station,
        lane="ego_0",
        control=control,
        signal_id="J/2" if control is Control.SIGNAL else None,
        position=(station, 0.0),
        yields_to=frozenset({"major_0"}),
        crosses=frozenset({"major_0", "minor_0"}),
        exit_station=station + 12.0,
    )
    return msgspec.structs.replace(line, **changes)


class Actor(msgspec.Struct, frozen=True):
    """Somebody who waits at a place until `leaves` and then moves straight on at constant speed, or braking."""

    track: int
    kind: ObjectClass
    x: float
    y: float
    heading: float = 0.0
    speed: float = 0.0
    leaves: float = 0.0
    stays_from: float = math.inf
    size: tuple[float, float] = (4.5, 1.8)
    lanes: tuple[str, ...] = ()
    braking: float = 0.0  # [m/s^2]

    def speed_at(self, time: float) -> float:
        return (
            max(self.speed - self.braking * (time - self.leaves), 0.0) if self.leaves <= time < self.stays_from else 0.0
        )

    def box_at(self, time: float) -> list[float]:
        moves_until = self.leaves + self.speed / self.braking if self.braking else self.stays_from
        moved = min(max(time, self.leaves), max(moves_until, self.leaves)) - self.leaves
        way = (self.speed - 0.5 * self.braking * moved) * moved
        x = self.x + way * math.cos(self.heading)
        return [x, self.y + way * math.sin(self.heading), self.heading, *self.size]


class Winding(Actor, frozen=True, kw_only=True):
    """Somebody who drives along a line of their own, at its beginning until `leaves`."""

    line: Polyline

    def box_at(self, time: float) -> list[float]:
        way = min(self.speed * max(time - self.leaves, 0.0), self.line.length)
        pose: list[float] = self.line.poses(np.array([way]))[0].tolist()
        return [*pose, *self.size]


def person(track: int, x: float, y: float, **changes: Any) -> Actor:
    return Actor(track, ObjectClass.PEDESTRIAN, x, y, size=(0.5, 0.6), **changes)


def cone(track: int, x: float, y: float = 0.0) -> Actor:
    return Actor(track, ObjectClass.STATIC, x, y, size=(0.4, 0.4))


def car(track: int, x: float, y: float = 0.0, **changes: Any) -> Actor:
    return Actor(track, ObjectClass.VEHICLE, x, y, **changes)


def predicted(actors: Sequence[Actor], time: float) -> PredictedObjects:
    """Each actor with one hypothesis: constant velocity, or braking or along its line, as it does."""
    count = len(actors)
    boxes = np.array([actor.box_at(time) for actor in actors]).reshape(count, 5)
    speeds = np.array([actor.speed_at(time) for actor in actors])
    headings = boxes[:, 2]
    velocities = np.column_stack([speeds * np.cos(headings), speeds * np.sin(headings)])
    poses = np.repeat(boxes[:, None, :3], len(PREDICTION_TIMES), axis=1)
    poses[:, :, :2] += velocities[:, None, :] * PREDICTION_TIMES[None, :, None]
    for row, actor in enumerate(actors):
        if actor.braking or isinstance(actor, Winding):
            poses[row] = [actor.box_at(time + ahead)[:3] for ahead in PREDICTION_TIMES.tolist()]
    objects = TrackedObjects(
        time=time,
        ids=np.array([actor.track for actor in actors], dtype=np.int64),
        classes=np.array([int(actor.kind) for actor in actors], dtype=np.int64),
        boxes=boxes,
        velocities=velocities,
        signals={},
    )
    lanes = tuple(actor.lanes for actor in actors)
    return PredictedObjects(objects, np.arange(count), np.ones(count), poses, lanes)


def believed(x: float, y: float = 0.0, heading: float = 0.0, speed: float = 0.0, time: float = 0.0) -> Any:
    return LocalizationEstimate(time, x, y, heading, speed, 0.0, 0.0)


class Drive(msgspec.Struct):
    """What happened, one row or entry every 0.1 s."""

    states: Floats  # (n, 7) as in Trajectory.points, time absolute
    trajectories: list[Trajectory]
    clearances: Floats  # (n,) [m] to the nearest actor

    @property
    def speeds(self) -> Floats:
        return self.states[:, 4]

    @property
    def decisions(self) -> list[str]:
        return [trajectory.decision for trajectory in self.trajectories]

    @property
    def fronts(self) -> Floats:
        """[m] x of the front bumper, on a straight road along x."""
        return self.states[:, 1] + SHAPE.front


def drive(
    route: Route,
    seconds: float,
    *,
    speed: float = 0.0,
    station: float = 5.0,
    aside: float = 0.0,
    actors: Sequence[Actor] = (),
    signals: Callable[[float], dict[str, SignalColour]] = lambda _: {},
    config: PlanningConfig | None = None,
) -> Drive:
    """Drive from `station` (rear axle), so far `aside` of the line, at `speed`, following every trajectory exactly."""
    planner = Planner(config or PlanningConfig(), route, SHAPE)
    x, y, heading = route.line.poses(np.array([station]))[0].tolist()
    x, y = x - aside * math.sin(heading), y + aside * math.cos(heading)
    estimate = LocalizationEstimate(0.0, x, y, heading, speed, 0.0, 0.0)
    states, trajectories, clearances = [], [], []
    for index in range(round(seconds * 10)):
        time = 0.1 * index
        trajectory = planner.step(estimate, predicted(actors, time), signals(time))
        trajectories.append(trajectory)
        states.append([time, *trajectory.points[0, 1:]])
        boxes = np.array([actor.box_at(time) for actor in actors]).reshape(-1, 5)
        ego = box_of(estimate.x, estimate.y, estimate.heading, SHAPE)
        clearances.append(float(distances(ego, boxes).min()) if len(boxes) else math.inf)
        _, x, y, heading, speed, acceleration, curvature = trajectory.points[1].tolist()
        estimate = LocalizationEstimate(0.1 * (index + 1), x, y, heading, speed, acceleration, speed * curvature)
    return Drive(np.array(states), trajectories, np.array(clearances))


def sweeps(driven: Drive, route: Route) -> Floats:
    """Offsets from the line of the body's outline, over the whole drive."""
    bodies = np.array([box_of(x, y, heading, SHAPE) for x, y, heading in driven.states[:, 1:4].tolist()])
    _, across = route.line.project(outlines(bodies, 6).reshape(-1, 2))
    return across


def assert_drivable(driven: Drive, config: PlanningConfig | None = None) -> None:
    """Every trajectory is within hard limits and consistent, and goes on from the one before."""
    limits = config or PlanningConfig()
    previous: Trajectory | None = None
    for trajectory in driven.trajectories:
        points = trajectory.points
        assert points.shape == (81, 7)
        assert np.isfinite(points).all()
        assert (points[:, 4] >= 0.0).all()
        assert points[:, 5].min() >= -limits.hard_braking - 1e-6
        assert points[:, 5].max() <= limits.acceleration + 1e-6
        assert np.abs(points[:, 6]).max() < 0.25
        steps = np.hypot(np.diff(points[:, 1]), np.diff(points[:, 2]))
        means = 0.5 * (points[1:, 4] + points[:-1, 4])
        assert np.abs(steps - 0.1 * means).max() < 0.06
        if previous is not None:
            assert np.hypot(*(points[0, 1:3] - previous.points[1, 1:3])) < 0.02
            assert abs(math.remainder(points[0, 3] - previous.points[1, 3], 2.0 * math.pi)) < 0.01
            assert abs(points[0, 4] - previous.points[1, 4]) < 1e-9
        previous = trajectory
