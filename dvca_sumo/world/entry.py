"""How an ego enters the simulation: as SUMO set the vehicle down, and as its drive begins."""

import math

import msgspec
import numpy as np

from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.messages import VehicleShape
from dvca_sumo.roadmap import Route
from dvca_sumo.truth import EgoTruth

_SIDEWAYS, _BRAKING = 2.0, 2.0  # [m/s^2] in curves and before them, of careful drivers
_STRAIGHT = 1e-4  # [1/m]
_CARS = ("passenger", "private", "taxi", "evehicle")  # vehicle classes that are driven like a car
_LONGEST_CAR = 7.0  # [m]; a type without a class, of a bus say, is of the class of cars


class Entry(msgspec.Struct, frozen=True):
    """How the ego enters the simulation."""

    ego: str
    time: float  # [s]
    front_x: float  # [m]
    front_y: float  # [m]
    heading: float  # [rad]
    speed: float  # [m/s]
    length: float  # [m]
    width: float  # [m]
    vehicle_class: str
    edges: tuple[str, ...]  # of its route, from the one it stands on
    skipped: int  # edges of its route before that one
    lane: str
    position: float  # [m] of the front bumper along the lane
    beside: float  # [m] and to the left of its centre
    stops: tuple[str, ...]  # its own, by stopping place or lane and position; as an ego it does not make them
    parameters: dict[str, str]  # the vehicle's own "dvca." parameters, without that prefix

    @property
    def why_no_car(self) -> str:
        """Why the vehicle is none that is driven like a car; empty if it is."""
        if self.vehicle_class not in _CARS:
            return f"of class {self.vehicle_class}"
        return f"longer than {_LONGEST_CAR:g} m" if self.length > _LONGEST_CAR else ""


def departure(entry: Entry, route: Route, shape: VehicleShape) -> EgoTruth:
    """An ego on its way along the route, as far beside it as SUMO set it down beside its lane.

    SUMO turns who departs at the begin of a lane towards a lane before it, whichever that is, and a route does not
    always keep to the middle of a lane: an ego at speed would have to swerve.
    """
    axle = route.start - shape.front
    x, y, heading = route.line.poses([axle], entry.beside)[0].tolist()
    speed = min(entry.speed, _fastest(route, shape))
    curvature = float(np.interp(axle, route.line.stations, route.curvatures))
    return EgoTruth(
        entry.time, x, y, wrapped(heading), speed, 0.0, speed * curvature, math.atan(shape.wheelbase * curvature)
    )


def _fastest(route: Route, shape: VehicleShape) -> float:
    """How fast a careful driver would come to where the route begins [m/s].

    SUMO's drivers may depart faster than the law allows, or than the next curve: that would not be the ADS's doing.
    """
    squares = []
    bounds = (
        (route.start, route.speed_limits**2),
        (max(route.start - shape.front, 0.0), _SIDEWAYS / np.maximum(np.abs(route.curvatures), _STRAIGHT)),
    )
    for begin, bound in bounds:
        ahead = slice(route.row_at(begin), None)
        way = np.maximum(route.line.stations[ahead] - begin, 0.0)
        squares.append(float((bound[ahead] + 2.0 * _BRAKING * way).min()))
    return math.sqrt(min(squares))
