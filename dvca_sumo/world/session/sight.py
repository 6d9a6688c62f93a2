"""What is near the vehicles that are watched."""

import math
import sys
from collections.abc import Callable
from typing import NamedTuple

import libsumo
import numpy as np
import traci.constants as tc

from dvca_sumo.messages import ObjectClass
from dvca_sumo.roadmap.areas import Shape, Strip
from dvca_sumo.truth import SURROUNDINGS, ObjectsTruth
from dvca_sumo.world.crowd import Body, Crowd
from dvca_sumo.world.footing import Footing
from dvca_sumo.world.net import Net, edge_of, is_for_cars
from dvca_sumo.world.session.egos import Egos, FrontMotion
from dvca_sumo.world.session.vehicles import has, is_shadow
from dvca_sumo.world.ways import Ways

# What is asked of who is near tells of which kind they are: the answers for both arrive in one dictionary, by id.
_VEHICLE, _PERSON = tc.VAR_SPEED, tc.VAR_ANGLE
NOWHERE = 1e8  # [m] a teleporting vehicle's coordinates are beyond
_TWO_WHEELED = ("bicycle", "moped", "motorcycle", "scooter")


class _Seen(NamedTuple):
    """One moving body at this step, whoever watches it."""

    name: str  # a key of the bodies
    motion: FrontMotion
    lane: str  # "" on foot
    ground: str  # the edge that somebody on foot is on


class _Readings(dict[str, tuple[_Seen, ...]]):
    """What has been seen since the last step, read once however many watch it; empty for who is nowhere."""

    def __init__(self, read: Callable[[str], tuple[_Seen, ...]]) -> None:
        super().__init__()
        self._read = read

    def __missing__(self, name: str) -> tuple[_Seen, ...]:
        read = self[name] = self._read(name)
        return read


class Sight:
    """Reads what moves around vehicles, each body once a step however many see it."""

    def __init__(self, net: Net, ways: Ways, egos: Egos) -> None:
        self._net = net
        self._ways = ways
        self._egos = egos
        self._bodies: dict[str, Body] = {}  # by name, people with "person:" before it
        self._crowds: dict[str, Crowd] = {}  # by watched vehicle
        self._strays: tuple[str, ...] | None = None  # egos that SUMO has on no lane, and near nobody; None: not asked
        self._vehicles, self._people = _Readings(self._vehicle_now), _Readings(self._person_now)
        self._footing = Footing(self._walking_area)

    def watch(self, vehicle: str) -> None:
        """Have `objects` ready for a vehicle: its surroundings. To others it stays as long as now."""
        self._vehicle(vehicle)
        self._crowds[vehicle] = Crowd()
        libsumo.vehicle.subscribeContext(vehicle, tc.CMD_GET_VEHICLE_VARIABLE, SURROUNDINGS, (_VEHICLE,))
        libsumo.vehicle.subscribeContext(vehicle, tc.CMD_GET_PERSON_VARIABLE, SURROUNDINGS, (_PERSON,))

    def forget(self, vehicle: str) -> None:
        """Watch it no longer; SUMO gives up at the next step where that is removed which it is to look around."""
        del self._crowds[vehicle]
        if has(vehicle):
            for kind in (tc.CMD_GET_VEHICLE_VARIABLE, tc.CMD_GET_PERSON_VARIABLE):
                libsumo.vehicle.unsubscribeContext(vehicle, kind, 0.0)

    def step(self) -> None:
        """SUMO has made a step: everything is elsewhere."""
        self._vehicles.clear()
        self._people.clear()
        self._strays = None

    def objects(self, watched: str) -> tuple[ObjectsTruth, list[str]]:
        """Every moving body near a watched vehicle: vehicles (parked ones too), people on foot.

        With them the edges that people are on, "" of vehicles.
        """
        time, seen = libsumo.simulation.getTime(), list[_Seen]()
        for name, kinds in libsumo.vehicle.getContextSubscriptionResults(watched).items():
            if _VEHICLE in kinds and name != watched:
                seen += self._vehicles[name]
            if _PERSON in kinds:
                seen += self._people[name]
        seen += self._strays_near(watched)
        names, motions = [one.name for one in seen], [number for one in seen for number in one.motion]
        # People whose places SUMO leaves open, by row.
        edges = {
            row: one.ground
            for row, one in enumerate(seen)
            if one.ground and self._footing.concerns(one.name, one.ground)
        }
        if edges:
            people, motion = [names[row] for row in edges], np.array([motions[4 * row : 4 * row + 4] for row in edges])
            headings, speeds = np.radians(90.0 - motion[:, 2]), motion[:, 3]
            placed = self._footing.placed(time, people, list(edges.values()), motion[:, :2], headings, speeds)
            for row, place in zip(edges, placed.tolist(), strict=True):
                motions[4 * row : 4 * row + 2] = place
        found = self._crowds[watched].seen(time, names, motions, [one.lane for one in seen], self._bodies)
        return found, [one.ground for one in seen]

    def _strays_near(self, watched: str) -> list[_Seen]:
        if self._strays is None:
            self._strays = tuple(ego for ego in self._egos if not libsumo.vehicle.getLaneID(ego))
        if not self._strays:
            return []
        place = libsumo.vehicle.getPosition(watched)
        others = (one for name in self._strays if name != watched for one in self._vehicles[name])
        return [one for one in others if math.dist(one.motion[:2], place) <= SURROUNDINGS]

    def _walking_area(self, edge: str) -> tuple[Shape, list[Strip]]:
        """The outline of a walking area, and the lanes of vehicles at its junction."""
        of, lanes = libsumo.lane, self._ways.inner_lanes(edge_of(edge))
        strips = [(of.getShape(lane), of.getWidth(lane)) for lane in lanes if is_for_cars(self._net, lane)]
        return of.getShape(f"{edge}_0"), strips

    def _vehicle_now(self, name: str) -> tuple[_Seen, ...]:
        of = libsumo.vehicle
        x, y = of.getPosition(name)
        if abs(x) >= NOWHERE or is_shadow(name):
            return ()
        lane = sys.intern(of.getLaneID(name))  # met again in thousands of moments
        motion = self._egos.motion(name) or FrontMotion(x, y, of.getAngle(name), of.getSpeed(name))
        return (_Seen(self._vehicle(name), motion, lane, ""),)

    def _person_now(self, name: str) -> tuple[_Seen, ...]:
        of = libsumo.person
        if of.getVehicle(name):
            return ()
        x, y = of.getPosition(name)
        motion = FrontMotion(x, y, of.getAngle(name), of.getSpeed(name))
        return (_Seen(self._person(name), motion, "", of.getRoadID(name)),)

    def _vehicle(self, name: str) -> str:
        """The key of a vehicle among the bodies."""
        if name not in self._bodies:
            of = libsumo.vehicle
            kind = ObjectClass.BICYCLE if of.getVehicleClass(name) in _TWO_WHEELED else ObjectClass.VEHICLE
            length = of.getLength(name)
            self._bodies[name] = Body(kind, length, of.getWidth(name), length / 2.0)
        return name

    def _person(self, name: str) -> str:
        """The key of a person among the bodies."""
        key = f"person:{name}"
        if key not in self._bodies:
            of = libsumo.person
            self._bodies[key] = Body(ObjectClass.PEDESTRIAN, of.getLength(name), of.getWidth(name), 0.0)
        return key
