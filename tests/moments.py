"""The truth of moments on the street, written by hand."""

import math
from collections.abc import Iterable

import numpy as np

from dvca_sumo.messages import ObjectClass, VehicleShape
from dvca_sumo.oracles import Places
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.truth import EgoTruth, Moment, ObjectsTruth

SHAPE = VehicleShape(length=4.6, width=1.8, wheelbase=2.8, rear_overhang=1.0)
LANE_Y = -4.8  # [m] of lane ab_0, the right one of two

Row = tuple[str, tuple[float, float], float]  # name, x and y of its centre [m], speed along +x [m/s]


def places(roadmap: RoadMap) -> Places:
    """Of a trip straight on over the junction."""
    return Places(roadmap.route(["ab", "bc"], "ab_0", 20.0, None, 250.0), roadmap)


def moment(time: float, front: float, speed: float, objects: Iterable[Row] = (), *, y: float = LANE_Y) -> Moment:
    """The ego along +x with its front bumper at `front`."""
    rows = list(objects)
    boxes = [(x, side, 0.0, 4.6, 1.8) for _, (x, side), _ in rows]
    return Moment(
        ego=EgoTruth(time, front - SHAPE.front, y, 0.0, speed, 0.0, 0.0, 0.0),
        shape=SHAPE,
        objects=ObjectsTruth(
            time=time,
            ids=tuple(name for name, _, _ in rows),
            classes=np.full(len(rows), int(ObjectClass.VEHICLE)),
            boxes=np.array(boxes, dtype=np.float64).reshape(-1, 5),
            velocities=np.array([(speed, 0.0) for _, _, speed in rows], dtype=np.float64).reshape(-1, 2),
        ),
        signals={},
    )


def cruise(seconds: float, speed: float, objects: Iterable[Row] = ()) -> list[Moment]:
    """An ego at constant speed among others at theirs, from the front bumper at 40 m on."""
    rows = list(objects)
    times = [0.1 * k for k in range(math.ceil(10 * seconds) + 1)]
    return [
        moment(time, 40.0 + speed * time, speed, [(name, (x + v * time, y), v) for name, (x, y), v in rows])
        for time in times
    ]
