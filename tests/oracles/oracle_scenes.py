"""A straight road along +x and the truth of moments on it."""

import math
from collections.abc import Callable, Iterable
from typing import Any, ClassVar, cast

import msgspec
import numpy as np

from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.messages import ObjectClass, SignalColour, VehicleShape
from dvca_sumo.oracles.place import Places
from dvca_sumo.oracles.protocol import Oracle
from dvca_sumo.roadmap import Control, RoadMap, Route, StopLine
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import EgoTruth, Moment, ObjectsTruth
from dvca_sumo.violations import Ending, Judgement

SHAPE = VehicleShape(length=4.6, width=1.8, wheelbase=2.8, rear_overhang=1.0)
FRONT = SHAPE.front

Row = tuple[str, tuple[float, float, float, float, float], tuple[float, float]]


class BareMap:
    """A map without lanes beside the route."""

    lanes: ClassVar[dict[str, Any]] = {}

    def lanes_near(self, points: np.ndarray, radius: float) -> list[tuple[str, ...]]:  # noqa: ARG002
        return [() for _ in points]


def straight_road(
    *,
    length: float = 300.0,
    limits: Callable[[float], float] = lambda _: 13.9,
    lane: Callable[[float], str] = lambda _: "in_0",
    stop_lines: tuple[StopLine, ...] = (),
    edges: tuple[float, float] = (1.6, -1.6),
) -> Route:
    """A road from (0, 0) along +x, its lane 3.2 m wide around y = 0: stations are x."""
    stations = np.arange(0.0, length + 0.5, 1.0)
    road = road_along(Polyline(np.column_stack([stations, 0.0 * stations])))
    return msgspec.structs.replace(
        road,
        lane_ids=tuple(lane(station) for station in stations),
        speed_limits=np.array([limits(station) for station in stations]),
        road_left=np.full_like(stations, edges[0]),
        road_right=np.full_like(stations, edges[1]),
        stop_lines=stop_lines,
    )


def road_along(line: Polyline) -> Route:
    """One lane, 3.2 m wide."""
    edge = np.full(len(line), 1.6)
    return Route(
        line=line,
        lane_ids=("in_0",) * len(line),
        along_lanes=line.stations,
        speed_limits=np.full(len(line), 13.9),
        curvatures=line.curvatures,
        lane_left=edge,
        lane_right=-edge,
        road_left=edge,
        road_right=-edge,
        start=10.0,
        destination=250.0,
        stop_lines=(),
        crossings=(),
    )


def stop_line(station: float, control: Control, signal_id: str | None = None) -> StopLine:
    return StopLine(
        station=station,
        lane="in_0",
        control=control,
        signal_id=signal_id,
        position=(station, 0.0),
        yields_to=frozenset(),
        crosses=frozenset(),
        exit_station=station + 15.0,
    )


def moment(
    time: float,
    station: float,
    speed: float,
    *,
    offset: float = 0.0,
    heading: float = 0.0,
    objects: Iterable[Row] = (),
    signals: dict[str, SignalColour] | None = None,
) -> Moment:
    """The ego with the middle of its front bumper at `station`, `offset`."""
    x, y = station - FRONT * math.cos(heading), offset - FRONT * math.sin(heading)
    return moment_at(time, x, y, heading, speed=speed, objects=objects, signals=signals)


def moment_at(
    time: float,
    x: float,
    y: float,
    heading: float,
    *,
    speed: float = 5.0,
    objects: Iterable[Row] = (),
    signals: dict[str, SignalColour] | None = None,
) -> Moment:
    """The ego with its rear axle at `x`, `y`."""
    rows = list(objects)
    ego = EgoTruth(time=time, x=x, y=y, heading=heading, speed=speed, acceleration=0.0, yaw_rate=0.0, steering=0.0)
    truth = ObjectsTruth(
        time=time,
        ids=tuple(row[0] for row in rows),
        classes=np.full(len(rows), int(ObjectClass.VEHICLE)),
        boxes=np.array([row[1] for row in rows], dtype=np.float64).reshape(-1, 5),
        velocities=np.array([row[2] for row in rows], dtype=np.float64).reshape(-1, 2),
    )
    return Moment(ego=ego, shape=SHAPE, objects=truth, signals=signals or {})


def car(name: str, rear: float, y: float = 0.0, speed: float = 0.0) -> Row:
    """A car along +x whose rear bumper is at `rear`."""
    return name, (rear + 2.3, y, 0.0, 4.6, 1.8), (speed, 0.0)


def judged(
    oracle: type[Oracle],
    moments: Iterable[Moment],
    route: Route | None = None,
    ended: Ending = Ending.TIME_OVER,
    thresholds: Thresholds | None = None,
    signed_lanes: frozenset[str] = frozenset(),
) -> Judgement:
    """The answer of one oracle for a whole run."""
    places = Places(straight_road() if route is None else route, cast("RoadMap", BareMap()), signed_lanes)
    fold = oracle(places, Thresholds() if thresholds is None else thresholds)
    for each in moments:
        fold.observe(each)
    return fold.conclude(ended)


def drive(
    begin: float,
    end: float,
    speed: float,
    dt: float = 0.1,
    **more: object,
) -> list[Moment]:
    """A run at constant speed from station `begin` to `end`."""
    count = round((end - begin) / (speed * dt)) + 1
    return [moment(k * dt, begin + k * dt * speed, speed, **more) for k in range(count)]  # type: ignore[arg-type]
