"""Egos: SUMO is told where they are, and its drivers what they have to mind of them."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import libsumo
import msgspec
import shapely

from dvca_sumo.messages import VehicleShape
from dvca_sumo.roadmap import is_inner
from dvca_sumo.truth import EgoTruth
from dvca_sumo.world.entry import Entry
from dvca_sumo.world.inset import Inset, within
from dvca_sumo.world.itinerary import Itinerary
from dvca_sumo.world.lingering import Lingering
from dvca_sumo.world.net import Net, edge_of
from dvca_sumo.world.session.vehicles import SHADOW, has, shadow_of
from dvca_sumo.world.setback import Setback
from dvca_sumo.world.straddling import SLOW, Straddling
from dvca_sumo.world.ways import End, Ways

NEVER_TELEPORTED = "dvca.ego"  # vehicle type of an adopted ego
ANY_BRAKING = 1e4  # [m/s^2] SUMO's own driver, overruled, would warn of braking for the arrival at every step

_MATCHED_WITHIN = 30.0  # [m] of a lane an ego is on the road; SUMO looks at every lane within that
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


class FrontMotion(NamedTuple):
    """Where SUMO has one body, or would have it, and how fast."""

    x: float  # [m] of its front; of somebody on foot, of the middle
    y: float  # [m]
    angle: float  # [deg] clockwise from north
    speed: float  # [m/s]


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
    motion: FrontMotion | None = None  # its own, which SUMO may be told otherwise; None until it is moved
    goes: bool = True  # means to, when it can
    shadows: tuple[str, ...] = ()  # lanes on which one stands for it


class Egos:
    """The vehicles taken out of SUMO's hands."""

    def __init__(self, net: Net, ways: Ways) -> None:
        self._net = net
        self._ways = ways
        self._straddling = Straddling(net, ways)
        self._adopted: dict[str, _Adopted] = {}  # by ego
        self._shadowed: set[str] = set()  # edges for which there is a route of a shadow
        self._has_sublanes = float(libsumo.simulation.getOption("lateral-resolution")) > 0.0

    def __contains__(self, vehicle: str) -> bool:
        return vehicle in self._adopted

    def __iter__(self) -> Iterator[str]:
        return iter(self._adopted)

    def adopt(self, entry: Entry) -> None:
        """Take an inserted vehicle out of SUMO's hands.

        A standing ego must not be teleported out of a jam, so it gets a type of its own. One that had stops of its own
        is to SUMO on its route or nowhere: its drivers do not see it on other roads.
        """
        of = libsumo.vehicle
        of.setType(entry.ego, NEVER_TELEPORTED)
        of.setLength(entry.ego, entry.length)
        of.setWidth(entry.ego, entry.width)
        of.setVehicleClass(entry.ego, entry.vehicle_class)
        of.setEmergencyDecel(entry.ego, ANY_BRAKING)
        itinerary = Itinerary(entry.edges, of.getRouteID(entry.ego))
        fastest = of.getMaxSpeed(entry.ego)
        matching = _BY_ROUTE if entry.stops else _BY_ALL_LANES
        self._adopted[entry.ego] = _Adopted(
            itinerary, Setback(), Inset(), Lingering(), entry.width, fastest, entry.length, matching
        )

    def motion(self, vehicle: str) -> FrontMotion | None:
        """How an ego moves, wherever SUMO was told that it is; None of all others."""
        adopted = self._adopted.get(vehicle)
        return adopted.motion if adopted is not None else None

    def release(self, ego: str) -> None:
        """Forget an ego that leaves the simulation, and take away what stands for it."""
        for lane in self._adopted.pop(ego).shadows:
            _take_away(shadow_of(ego, lane))

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
        cosine, sine, angle = math.cos(truth.heading), math.sin(truth.heading), 90.0 - math.degrees(truth.heading)
        adopted.motion = FrontMotion(truth.x + front * cosine, truth.y + front * sine, angle, truth.speed)
        ahead = front - adopted.setback.at(truth.x, truth.y, truth.speed, is_on_lane=bool(found))
        x, y = truth.x + ahead * cosine, truth.y + ahead * sine
        if found and truth.speed <= SLOW and not self._has_sublanes:
            lane, x, y = self._held(ego, lane, x, y, found)
        middle, width = self._net.middle(lane)
        x, y = adopted.inset.at(x, y, middle, 0.5 * (width + adopted.width), is_on_lane=bool(found))
        edge, _, index = lane.rpartition("_")
        adopted.itinerary.reach(edge)
        if found and libsumo.vehicle.getRouteID(ego) != adopted.itinerary.route:
            self._remind(ego, found)
        libsumo.vehicle.moveToXY(ego, edge, int(index), x, y, angle, adopted.matching, _MATCHED_WITHIN)
        # SUMO derives a wrong speed on junction and opposite lanes; drivers behind must react to the true one.
        libsumo.vehicle.setPreviousSpeed(ego, truth.speed, truth.acceleration)
        # SUMO's own would tell what its driver, overruled, meant to do.
        libsumo.vehicle.setSignals(ego, _INDICATORS[indicated] | (_BRAKE_LIGHT if _is_braking(truth) else 0))
        self._announce(ego, truth.speed)

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
                _take_away(shadow_of(ego, lane))
        for lane, (begin, end) in parts.items():
            self._cast(shadow_of(ego, lane), lane, begin, end)
            libsumo.vehicle.setPreviousSpeed(shadow_of(ego, lane), truth.speed, truth.acceleration)
        adopted.shadows = tuple(parts)

    def stretch(self, ego: str, length: float) -> None:
        """Tell SUMO how much lane an ego takes up [m]: its drivers stop that far behind its front."""
        adopted = self._adopted[ego]
        if abs(length - adopted.length) > _TOLD_ANEW:
            adopted.length = length
            libsumo.vehicle.setLength(ego, length)

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

    def _announce(self, ego: str, speed: float) -> None:
        """Tell SUMO whether an ego at `speed` [m/s] means to go on: nobody waits for one that does not."""
        adopted = self._adopted[ego]
        waits = abs(speed) < _STANDING and not _has_red(ego)
        goes = not adopted.lingering.is_long(libsumo.simulation.getTime(), waits=waits)
        if goes != adopted.goes:
            adopted.goes = goes
            libsumo.vehicle.setMaxSpeed(ego, adopted.fastest if goes else 0.0)

    def _remind(self, ego: str, lane: str) -> None:
        """Tell SUMO the rest of an ego's trip again, as soon as it sees it, on `lane`, on the way."""
        of, row = libsumo.vehicle, libsumo.vehicle.getRouteIndex(ego)
        is_between = is_inner(lane)
        itinerary = self._adopted[ego].itinerary
        onward = itinerary.onward(of.getRoute(ego)[row : row + 1 + is_between])
        if onward:
            of.setRoute(ego, onward)
            itinerary.route = of.getRouteID(ego)

    def _is_occupied(self, lane: str, begin: float, end: float, ego: str) -> bool:
        """Whether somebody is on that part of a lane already: who is stopped beside an ego must not stay for ever.

        `begin` and `end` are along the lane as it is drawn [m].
        """
        of, shadow = libsumo.vehicle, shadow_of(ego, lane)
        others = (name for name in libsumo.lane.getLastStepVehicleIDs(lane) if name not in (ego, shadow))
        fronts = ((of.getLanePosition(name), of.getLength(name)) for name in others)
        drawn = self._net.middle(lane)[0].length / libsumo.lane.getLength(lane)
        return any(begin < drawn * front and drawn * (front - length) < end for front, length in fronts)

    def _cast(self, shadow: str, lane: str, begin: float, end: float) -> None:
        """Have a shadow on a lane from `begin` to `end` [m]."""
        of, (edge, _, index) = libsumo.vehicle, lane.rpartition("_")
        if not has(shadow):
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


def _take_away(shadow: str) -> None:
    if has(shadow):
        libsumo.vehicle.remove(shadow)


def _has_red(vehicle: str) -> bool:
    """Whether a vehicle that stands does so at a signal that holds it."""
    ahead = libsumo.vehicle.getNextTLS(vehicle)
    return bool(ahead) and ahead[0][2] < _AT_SIGNAL and ahead[0][3] not in _GOING


def _is_braking(truth: EgoTruth) -> bool:
    """Whether brake lights are on, as of SUMO's vehicles: slower at once than by rolling."""
    return truth.speed <= _STANDING or truth.acceleration < -(0.05 + 0.005 * truth.speed) * truth.speed
