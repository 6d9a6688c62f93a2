"""One SUMO simulation.

Rules of this file:

- It is the only one that imports libsumo; a process holds one simulation at a time.
- SUMO's conventions (front bumper, degrees clockwise from north) end here: everything returned is in
  the project's (box centre or rear axle, radians counter-clockwise from +x).
"""

import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import libsumo
import msgspec
import numpy as np
import shapely
import traci.constants as tc

from dvca_sumo.messages import ObjectClass, SignalColour, VehicleShape
from dvca_sumo.roadmap.areas import Shape, Strip
from dvca_sumo.scenario import Scenario, ScenarioError, input_words
from dvca_sumo.truth import EgoTruth, ObjectsTruth
from dvca_sumo.world.crowd import Body, Crowd
from dvca_sumo.world.entry import Entry
from dvca_sumo.world.footing import Footing
from dvca_sumo.world.inset import Inset, within
from dvca_sumo.world.itinerary import Itinerary
from dvca_sumo.world.lingering import Lingering
from dvca_sumo.world.net import Link, edge_of, is_for_cars, is_inner
from dvca_sumo.world.obstacles import Obstacles, box_of_poi, boxes_of_polygon
from dvca_sumo.world.setback import Setback
from dvca_sumo.world.signals import Signals
from dvca_sumo.world.straddling import SLOW, Straddling
from dvca_sumo.world.ways import End, Ways

OBSTACLE = "obstacle."  # POIs and polygons whose type starts so are bodies, all others are scenery
NEVER_TELEPORTED = "dvca.ego"  # vehicle type of an adopted ego
_TURNS_BACK = ("t", "T")  # SUMO's letters; the second one is for left-hand traffic
SHADOW = "dvca.shadow"  # vehicle type of what stands for an ego on a second lane

# What is asked of who is near tells of which kind they are: the answers for both arrive in one dictionary, by id.
_VEHICLE, _PERSON = tc.VAR_SPEED, tc.VAR_ANGLE
_NOWHERE = 1e8  # [m] a teleporting vehicle's coordinates are beyond
_ANY_BRAKING = 1e4  # [m/s^2] SUMO's own driver, overruled, would warn of braking for the arrival at every step
_MATCHED_WITHIN = 30.0  # [m] of a lane an ego is on the road; SUMO looks at every lane within that
_GIVES_UP = (libsumo.TraCIException, libsumo.FatalTraCIError)
_INDICATORS = {1: 0b10, 0: 0, -1: 0b1}  # by the side they tell; bits of SUMO's signals
_BRAKE_LIGHT = 0b1000
# How SUMO finds the lane of an ego, which may leave the net: among all, or those of its route. In the first way it
# replaces the route of one that it finds beside it, adds the stops of the vehicle's definition to the new one, and
# gives up where they are not on that.
_BY_ALL_LANES, _BY_ROUTE = 2, 3
_TOLD_ANEW = 0.2  # [m] of difference in length
_STANDING = 0.1  # [m/s] up to which SUMO's vehicles show their brake lights
_HELD = 0.3  # [m] within the edge of the lane that an ego is held on
_AT_SIGNAL = 10.0  # [m] before it a vehicle waits for it
_GOING = "gGoO"  # colours of signals that let go
_TWO_WHEELED = ("bicycle", "moped", "motorcycle", "scooter")


class Motion(msgspec.Struct, frozen=True):
    """How a vehicle moves that SUMO drives."""

    front_x: float  # [m]
    front_y: float  # [m]
    heading: float  # [rad]
    speed: float  # [m/s]
    acceleration: float  # [m/s^2]
    is_on_road: bool  # not while it is teleported
    edges: tuple[str, ...]  # of its present route


class _Seen(NamedTuple):
    """One moving body at this step, whoever watches it."""

    name: str  # a key of the bodies
    motion: tuple[float, float, float, float]  # SUMO's x, y [m], angle [deg], speed [m/s]
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


class _Net:
    """The road net of the simulation."""

    def __init__(self) -> None:
        self._middles: dict[str, tuple[shapely.LineString, float]] = {}

    def lanes(self) -> tuple[str, ...]:
        return tuple(libsumo.lane.getIDList())

    def links(self, lane: str) -> list[Link]:
        return [Link(to, via, way in _TURNS_BACK) for to, _, _, _, via, _, way, _ in libsumo.lane.getLinks(lane)]

    def foes(self, lane: str) -> tuple[str, ...]:
        return tuple(libsumo.lane.getInternalFoes(lane))

    def adjacent(self, lane: str) -> list[str]:
        edge, _, index = lane.rpartition("_")
        count = libsumo.edge.getLaneNumber(edge)
        return [f"{edge}_{next_to}" for next_to in (int(index) - 1, int(index) + 1) if 0 <= next_to < count]

    def allowed(self, lane: str) -> tuple[str, ...]:
        return tuple(libsumo.lane.getAllowed(lane))

    def middle(self, lane: str) -> tuple[shapely.LineString, float]:
        if lane not in self._middles:
            shape = libsumo.lane.getShape(lane)
            line = shapely.LineString([shape[0], *shape])  # of two points at least, however short the lane
            self._middles[lane] = line, libsumo.lane.getWidth(lane)
        return self._middles[lane]

    def lanes_of(self, road: str) -> list[str]:
        return [f"{road}_{index}" for index in range(libsumo.edge.getLaneNumber(road))]

    def junctions_of(self, road: str) -> tuple[str, str]:
        return libsumo.edge.getFromJunction(road), libsumo.edge.getToJunction(road)


class _Adopted(msgspec.Struct):
    """What SUMO is told of an ego, and why."""

    itinerary: Itinerary
    setback: Setback
    inset: Inset
    lingering: Lingering
    width: float  # [m]
    fastest: float  # [m/s] that it can drive
    length: float  # [m] of lane that it takes up
    matching: int  # how SUMO finds its lane
    goes: bool = True  # means to, when it can
    shadows: tuple[str, ...] = ()  # lanes on which one stands for it


class Session:
    """A running SUMO simulation; `close` ends it."""

    def __init__(self, scenario: Scenario, folder: Path) -> None:
        """Start SUMO on `scenario`; copies of silenced inputs go to `folder`.

        Raises:
            ScenarioError: SUMO refuses the configuration; its own words are on standard error.
        """
        if libsumo.isLoaded():
            raise ScenarioError("a simulation is already loaded in this process")
        types = folder / "ego.add.xml"
        types.write_text(
            f'<additional><vType id="{NEVER_TELEPORTED}" timeToTeleport="-1"/>'
            f'<vType id="{SHADOW}" vClass="ignoring" timeToTeleport="-1" emergencyDecel="{_ANY_BRAKING:g}"/>'
            "</additional>"
        )
        files = input_words(scenario.configuration, folder, types)
        try:
            libsumo.start(["sumo", *scenario.arguments, *files])
        except _GIVES_UP as error:
            libsumo.close()  # else what it had loaded would stay
            raise ScenarioError(f"SUMO cannot start {scenario.configuration.path}: {_in_one_line(error)}") from None
        self._bodies: dict[str, Body] = {}  # by name, people with "person:" before it
        self._crowds: dict[str, Crowd] = {}  # by watched vehicle
        self._vehicles, self._people = _Readings(self._vehicle_now), _Readings(self._person_now)
        self._footing = Footing(self._walking_area)
        self._adopted: dict[str, _Adopted] = {}  # by ego
        self._shadowed: set[str] = set()  # edges for which there is a route of a shadow
        self._net = _Net()
        self._ways = Ways(self._net)
        self._straddling = Straddling(self._net, self._ways)
        self._has_sublanes = float(libsumo.simulation.getOption("lateral-resolution")) > 0.0
        self._signals: dict[tuple[str, ...], Signals] = {}  # by the heads asked for

    @property
    def time(self) -> float:
        """In seconds, SUMO's clock."""
        return float(libsumo.simulation.getTime())

    @property
    def is_exhausted(self) -> bool:
        """Whether no vehicle runs or waits for departure any more."""
        return bool(libsumo.simulation.getMinExpectedNumber() <= 0)

    def step(self) -> None:
        """Advance by one world step.

        Raises:
            ScenarioError: SUMO gives up (malformed routes surface only when they are read).
        """
        try:
            libsumo.simulationStep()
        except _GIVES_UP as error:
            raise ScenarioError(f"SUMO stopped at {self.time:g} s: {_in_one_line(error)}") from None
        self._vehicles.clear()
        self._people.clear()

    def departed(self) -> tuple[str, ...]:
        """Vehicles inserted in the last step."""
        return tuple(name for name in libsumo.simulation.getDepartedIDList() if not _is_shadow(name))

    def arrived(self) -> tuple[str, ...]:
        """Vehicles that came to the end of their trips in the last step."""
        return tuple(libsumo.simulation.getArrivedIDList())

    def delay(self, vehicle: str) -> float:
        """How long a vehicle has been waiting for room to depart [s]; 0 before its time and while it is not known."""
        try:
            return max(0.0, float(libsumo.vehicle.getDepartDelay(vehicle)))
        except libsumo.TraCIException:
            return 0.0

    def has(self, vehicle: str) -> bool:
        """Whether the vehicle is in the simulation (inserted and not removed)."""
        try:
            libsumo.vehicle.getRoadID(vehicle)
        except libsumo.TraCIException:
            return False
        return True

    def entry(self, vehicle: str, settings: Sequence[str]) -> Entry:
        """How an inserted vehicle stands, and its "dvca." parameters among `settings`; changes nothing."""
        of = libsumo.vehicle
        x, y = of.getPosition(vehicle)
        row = of.getRouteIndex(vehicle)
        texts = {name: of.getParameter(vehicle, f"dvca.{name}") for name in settings}
        return Entry(
            ego=vehicle,
            time=self.time,
            front_x=x,
            front_y=y,
            heading=math.radians(90.0 - of.getAngle(vehicle)),
            speed=max(0.0, of.getSpeed(vehicle)),
            length=of.getLength(vehicle),
            width=of.getWidth(vehicle),
            vehicle_class=of.getVehicleClass(vehicle),
            edges=tuple(of.getRoute(vehicle)[row:]),
            skipped=row,
            lane=of.getLaneID(vehicle),
            position=of.getLanePosition(vehicle),
            beside=of.getLateralLanePosition(vehicle),
            stops=tuple(stop.stoppingPlaceID or f"{stop.lane} at {stop.endPos:g} m" for stop in of.getStops(vehicle)),
            parameters={name: text for name, text in texts.items() if text},
        )

    def is_stopping(self, vehicle: str) -> bool:
        """Whether a vehicle makes a stop of its own; one that is not in the simulation (any more) does not."""
        return self.has(vehicle) and bool(libsumo.vehicle.isStopped(vehicle))

    def teleported(self) -> tuple[str, ...]:
        """Vehicles that SUMO began to teleport in the last step."""
        return tuple(libsumo.simulation.getStartingTeleportIDList())

    def waits(self) -> dict[str, float]:
        """How long each vehicle that SUMO drives has stood [s]; 0 while it makes a stop of its own."""
        of = libsumo.vehicle
        names = (name for name in of.getIDList() if name not in self._adopted and not _is_shadow(name))
        return {name: 0.0 if of.isStopped(name) else float(of.getWaitingTime(name)) for name in names}

    def leader(self, vehicle: str, reach: float) -> str | None:
        """Who is ahead of a vehicle that SUMO drives, on its way and no farther than `reach` [m]."""
        found = libsumo.vehicle.getLeader(vehicle, reach)  # on the same lane however far
        return found[0] if found and found[0] and found[1] <= reach else None

    def motion(self, vehicle: str) -> Motion:
        """How a vehicle moves that SUMO drives."""
        of = libsumo.vehicle
        x, y = of.getPosition(vehicle)
        return Motion(
            front_x=x,
            front_y=y,
            heading=math.radians(90.0 - of.getAngle(vehicle)),
            speed=max(0.0, of.getSpeed(vehicle)),
            acceleration=of.getAcceleration(vehicle),
            is_on_road=abs(x) < _NOWHERE,
            edges=tuple(of.getRoute(vehicle)),
        )

    def adopt(self, entry: Entry, radius: float) -> None:
        """Take an inserted vehicle out of SUMO's hands; watch what is within `radius` [m] of it.

        A standing ego must not be teleported out of a jam, so it gets a type of its own. One that had stops of its own
        is to SUMO on its route or nowhere: its drivers do not see it on other roads.
        """
        of = libsumo.vehicle
        of.setType(entry.ego, NEVER_TELEPORTED)
        of.setLength(entry.ego, entry.length)
        of.setWidth(entry.ego, entry.width)
        of.setVehicleClass(entry.ego, entry.vehicle_class)
        of.setEmergencyDecel(entry.ego, _ANY_BRAKING)
        itinerary = Itinerary(entry.edges, of.getRouteID(entry.ego))
        fastest = of.getMaxSpeed(entry.ego)
        matching = _BY_ROUTE if entry.stops else _BY_ALL_LANES
        self._adopted[entry.ego] = _Adopted(
            itinerary, Setback(), Inset(), Lingering(), entry.width, fastest, entry.length, matching
        )
        self._vehicle(entry.ego)  # the length it has, before SUMO is told what it takes up
        self.watch(entry.ego, radius)

    def skip_stops(self, vehicle: str) -> None:
        """Take its own stops off a vehicle that has just departed; its route stays.

        SUMO would take an ego that passes a parking stop of its own for parked there, to the end of its trip.
        """
        for _ in libsumo.vehicle.getStops(vehicle):
            libsumo.vehicle.replaceStop(vehicle, 0, "")

    def watch(self, vehicle: str, radius: float) -> None:
        """Have `objects` ready for a vehicle: what is within `radius` [m] of it."""
        of = libsumo.vehicle
        self._crowds[vehicle] = Crowd()
        of.subscribeContext(vehicle, tc.CMD_GET_VEHICLE_VARIABLE, radius, (_VEHICLE,))
        of.subscribeContext(vehicle, tc.CMD_GET_PERSON_VARIABLE, radius, (_PERSON,))

    def remove(self, ego: str) -> None:
        """Take an ego out of the simulation, if SUMO has not done so."""
        of = libsumo.vehicle
        for lane in self._adopted[ego].shadows:
            self._take_away(_shadow(ego, lane))
        del self._crowds[ego], self._adopted[ego]
        if self.has(ego):
            for kind in (tc.CMD_GET_VEHICLE_VARIABLE, tc.CMD_GET_PERSON_VARIABLE):
                of.unsubscribeContext(ego, kind, 0.0)  # else SUMO gives up at the next step
            of.remove(ego)

    def place(self, ego: str, truth: EgoTruth, front: float, lane: str, indicated: int) -> None:
        """Put the ego where its own dynamics say; effective with the next step.

        Args:
            ego: The vehicle.
            truth: How it moves now.
            front: From its rear axle to its front bumper [m].
            lane: Of the route, that it is on: without it SUMO may pick a crossing junction lane.
            indicated: Which way it indicates: 1 left, -1 right, 0 not at all.
        """
        found = libsumo.vehicle.getLaneID(ego)
        adopted = self._adopted[ego]
        ahead = front - adopted.setback.at(truth.x, truth.y, truth.speed, is_on_lane=bool(found))
        x = truth.x + ahead * math.cos(truth.heading)
        y = truth.y + ahead * math.sin(truth.heading)
        if found and truth.speed <= SLOW and not self._has_sublanes:
            lane, x, y = self._held(ego, lane, x, y, found)
        middle, width = self._net.middle(lane)
        x, y = adopted.inset.at(x, y, middle, 0.5 * (width + adopted.width), is_on_lane=bool(found))
        edge, _, index = lane.rpartition("_")
        angle = 90.0 - math.degrees(truth.heading)
        adopted.itinerary.reach(edge)
        if found and libsumo.vehicle.getRouteID(ego) != adopted.itinerary.route:
            self._remind(ego, found)
        libsumo.vehicle.moveToXY(ego, edge, int(index), x, y, angle, adopted.matching, _MATCHED_WITHIN)
        # SUMO derives a wrong speed on junction and opposite lanes; drivers behind must react to the true one.
        libsumo.vehicle.setPreviousSpeed(ego, truth.speed, truth.acceleration)
        # SUMO's own would tell what its driver, overruled, meant to do.
        libsumo.vehicle.setSignals(ego, _INDICATORS[indicated] | (_BRAKE_LIGHT if _is_braking(truth) else 0))
        self._announce(ego, truth.speed)

    def _held(self, ego: str, lane: str, x: float, y: float, found: str) -> tuple[str, float, float]:
        """The lane and place to tell SUMO of an ego with its front at (x, y), on its way to `lane`.

        They are those where SUMO has found it, while somebody is beside it on the next lane of the road: on the same
        lane as the ego, that one would take it for a leader and stop dead, in the way of both.
        """
        adopted, point, (middle, width) = self._adopted[ego], shapely.Point(x, y), self._net.middle(found)
        most = 0.5 * width - _HELD
        is_on_its_way = lane != found or middle.distance(point) > most
        if is_on_its_way and edge_of(lane) == edge_of(found):
            for next_to in self._net.adjacent(found):
                line, reach = self._net.middle(next_to)
                front = line.project(point)
                is_there = line.distance(point) < 0.5 * (reach + adopted.width)
                if is_there and self._is_occupied(next_to, front - adopted.length, front, ego):
                    return found, *within(x, y, middle, most)
        return lane, x, y

    def straddle(self, ego: str, truth: EgoTruth, shape: VehicleShape, ends: Sequence[End]) -> None:
        """Tell SUMO which lanes an ego is on beside the one where SUMO has it; effective with the next step.

        There a shadow stands for it, a vehicle that nobody sees but SUMO's drivers. The sub-lane model needs none.

        Args:
            ego: The vehicle.
            truth: How it moves now.
            shape: Its body.
            ends: Where its front and its rear axle are on its route; none: it is on no second lane.
        """
        adopted = self._adopted[ego]
        parts = {}
        if not self._has_sublanes:
            found = libsumo.vehicle.getLaneID(ego)
            taken = self._straddling.parts(truth, shape, ends, found, goes=adopted.goes)
            parts = {lane: part for lane, part in taken.items() if not self._is_occupied(lane, *part, ego)}
        for lane in adopted.shadows:
            if lane not in parts:
                self._take_away(_shadow(ego, lane))
        for lane, (begin, end) in parts.items():
            self._cast(_shadow(ego, lane), lane, begin, end)
            libsumo.vehicle.setPreviousSpeed(_shadow(ego, lane), truth.speed, truth.acceleration)
        adopted.shadows = tuple(parts)

    def _cast(self, shadow: str, lane: str, begin: float, end: float) -> None:
        """Have a shadow on a lane from `begin` to `end` [m]."""
        of, (edge, _, index) = libsumo.vehicle, lane.rpartition("_")
        if not self.has(shadow):
            if edge not in self._shadowed:
                self._shadowed.add(edge)
                road = edge_of(self._ways.lane_after(lane)) if is_inner(lane) else edge
                libsumo.route.add(f"{SHADOW}.{edge}", [road])
            of.add(shadow, f"{SHADOW}.{edge}", SHADOW)
        middle, _ = self._net.middle(lane)
        front, behind = middle.interpolate(end), middle.interpolate(max(begin, 0.0))
        angle = math.degrees(math.atan2(front.x - behind.x, front.y - behind.y))
        of.setLength(shadow, end - begin)
        of.moveToXY(shadow, edge, int(index), front.x, front.y, angle, keepRoute=2, matchThreshold=_MATCHED_WITHIN)

    def _take_away(self, shadow: str) -> None:
        if self.has(shadow):
            libsumo.vehicle.remove(shadow)

    def _is_occupied(self, lane: str, begin: float, end: float, ego: str) -> bool:
        """Whether somebody is on that part of a lane already: who is stopped beside an ego must not stay for ever."""
        of, shadow = libsumo.vehicle, _shadow(ego, lane)
        others = (name for name in libsumo.lane.getLastStepVehicleIDs(lane) if name not in (ego, shadow))
        fronts = ((of.getLanePosition(name), of.getLength(name)) for name in others)
        return any(begin < front and front - length < end for front, length in fronts)

    def _announce(self, ego: str, speed: float) -> None:
        """Tell SUMO whether an ego at `speed` [m/s] means to go on: nobody waits for one that does not."""
        adopted = self._adopted[ego]
        waits = abs(speed) < _STANDING and not _has_red(ego)
        goes = not adopted.lingering.is_long(self.time, waits=waits)
        if goes != adopted.goes:
            adopted.goes = goes
            libsumo.vehicle.setMaxSpeed(ego, adopted.fastest if goes else 0.0)

    def stretch(self, ego: str, length: float) -> None:
        """Tell SUMO how much lane an ego takes up [m]: its drivers stop that far behind its front."""
        adopted = self._adopted[ego]
        if abs(length - adopted.length) > _TOLD_ANEW:
            adopted.length = length
            libsumo.vehicle.setLength(ego, length)

    def objects(self, ego: str) -> ObjectsTruth:
        """Every moving body near a watched vehicle: vehicles (parked ones too), people on foot."""
        seen: list[_Seen] = []
        for name, kinds in libsumo.vehicle.getContextSubscriptionResults(ego).items():
            if _VEHICLE in kinds and name != ego:
                seen += self._vehicles[name]
            if _PERSON in kinds:
                seen += self._people[name]
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
            placed = self._footing.placed(self.time, people, list(edges.values()), motion[:, :2], headings, speeds)
            for row, place in zip(edges, placed.tolist(), strict=True):
                motions[4 * row : 4 * row + 2] = place
        return self._crowds[ego].seen(self.time, names, motions, [one.lane for one in seen], self._bodies)

    def signals(self, signal_ids: tuple[str, ...]) -> dict[str, SignalColour]:
        """Colours of signal heads, given as "traffic light/link index"; not to be written to."""
        known = self._signals.get(signal_ids)
        if known is None:
            known = self._signals[signal_ids] = Signals(signal_ids)
        state_of = libsumo.trafficlight.getRedYellowGreenState
        return known.showing({light: state_of(light) for light in known.lights})

    def obstacles(self) -> Obstacles:
        """The scenario's POIs and polygons that are bodies."""
        names: list[str] = []
        rows: list[tuple[float, float, float, float, float]] = []
        for name in libsumo.poi.getIDList():
            of = libsumo.poi
            if of.getType(name).startswith(OBSTACLE):
                names.append(f"poi:{name}")
                angle = math.radians(90.0 - of.getAngle(name))
                rows.append(box_of_poi(of.getPosition(name), angle, of.getWidth(name), of.getHeight(name)))
        for name in libsumo.polygon.getIDList():
            shape_of = libsumo.polygon
            if shape_of.getType(name).startswith(OBSTACLE):
                boxes = boxes_of_polygon(shape_of.getShape(name), shape_of.getFilled(name), shape_of.getLineWidth(name))
                names += [
                    f"polygon:{name}" if len(boxes) == 1 else f"polygon:{name}#{part}" for part in range(len(boxes))
                ]
                rows += boxes
        return Obstacles(tuple(names), np.array(rows, dtype=np.float64).reshape(-1, 5))

    def close(self) -> None:
        """End the simulation; the process may start another."""
        libsumo.close()

    def _walking_area(self, edge: str) -> tuple[Shape, list[Strip]]:
        """The outline of a walking area, and the lanes of vehicles at its junction."""
        of, lanes = libsumo.lane, self._ways.inner_lanes(edge_of(edge))
        strips = [(of.getShape(lane), of.getWidth(lane)) for lane in lanes if is_for_cars(self._net, lane)]
        return of.getShape(f"{edge}_0"), strips

    def _remind(self, ego: str, lane: str) -> None:
        """Tell SUMO the rest of an ego's trip again, as soon as it sees it, on `lane`, on the way."""
        of, row = libsumo.vehicle, libsumo.vehicle.getRouteIndex(ego)
        is_between = is_inner(lane)
        itinerary = self._adopted[ego].itinerary
        onward = itinerary.onward(of.getRoute(ego)[row : row + 1 + is_between])
        if onward:
            of.setRoute(ego, onward)
            itinerary.route = of.getRouteID(ego)

    def _vehicle_now(self, name: str) -> tuple[_Seen, ...]:
        of = libsumo.vehicle
        x, y = of.getPosition(name)
        if abs(x) >= _NOWHERE or _is_shadow(name):
            return ()
        lane = sys.intern(of.getLaneID(name))  # met again in thousands of moments
        return (_Seen(self._vehicle(name), (x, y, of.getAngle(name), of.getSpeed(name)), lane, ""),)

    def _person_now(self, name: str) -> tuple[_Seen, ...]:
        of = libsumo.person
        if of.getVehicle(name):
            return ()
        x, y = of.getPosition(name)
        return (_Seen(self._person(name), (x, y, of.getAngle(name), of.getSpeed(name)), "", of.getRoadID(name)),)

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


def _shadow(ego: str, lane: str) -> str:
    """The name of an ego's shadow on a lane."""
    return f"{SHADOW}.{lane}.{ego}"


def _is_shadow(name: str) -> bool:
    return name.startswith(f"{SHADOW}.")


def _has_red(vehicle: str) -> bool:
    """Whether a vehicle that stands does so at a signal that holds it."""
    ahead = libsumo.vehicle.getNextTLS(vehicle)
    return bool(ahead) and ahead[0][2] < _AT_SIGNAL and ahead[0][3] not in _GOING


def _is_braking(truth: EgoTruth) -> bool:
    """Whether brake lights are on, as of SUMO's vehicles: slower at once than by rolling."""
    return truth.speed <= _STANDING or truth.acceleration < -(0.05 + 0.005 * truth.speed) * truth.speed


def _in_one_line(error: Exception) -> str:
    return " ".join(str(error).split())
