"""One SUMO simulation.

Rules of this room:

- It is the only one that imports libsumo; a process holds one simulation at a time.
- SUMO's conventions (front bumper, degrees clockwise from north) end here: everything returned is in
  the project's (box centre or rear axle, radians counter-clockwise from +x).
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import libsumo
import msgspec

from dvca_sumo.messages import SignalColour
from dvca_sumo.scenario import Scenario, ScenarioError, input_words
from dvca_sumo.truth import ObjectsTruth
from dvca_sumo.world.entry import Entry
from dvca_sumo.world.net import is_left_of
from dvca_sumo.world.obstacles import Obstacles
from dvca_sumo.world.session.egos import ANY_BRAKING, NEVER_TELEPORTED, Egos
from dvca_sumo.world.session.net import SumoNet
from dvca_sumo.world.session.scenery import obstacles
from dvca_sumo.world.session.sight import NOWHERE, Sight
from dvca_sumo.world.session.vehicles import SHADOW, has, is_shadow
from dvca_sumo.world.signals import Signals
from dvca_sumo.world.ways import Ways

_GIVES_UP = (libsumo.TraCIException, libsumo.FatalTraCIError)


class Motion(msgspec.Struct, frozen=True):
    """How a vehicle moves that SUMO drives."""

    front_x: float  # [m]
    front_y: float  # [m]
    heading: float  # [rad]
    speed: float  # [m/s]
    acceleration: float  # [m/s^2]
    is_on_road: bool  # not while it is teleported
    edges: tuple[str, ...]  # of its present route


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
            f'<vType id="{SHADOW}" vClass="ignoring" timeToTeleport="-1" emergencyDecel="{ANY_BRAKING:g}">'
            '<param key="has.ssm.device" value="false"/></vType>'
            "</additional>",
            encoding="utf-8",
        )
        files = input_words(scenario.configuration, folder, types)
        try:
            libsumo.start(["sumo", *scenario.arguments, *files])
        except _GIVES_UP as error:
            libsumo.close()  # else what it had loaded would stay
            raise ScenarioError(f"SUMO cannot start {scenario.configuration.path}: {_in_one_line(error)}") from None
        self._net = SumoNet()
        ways = Ways(self._net)
        self.egos = Egos(self._net, ways)
        self._sight = Sight(self._net, ways, self.egos)
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
        self._sight.step()

    def departed(self) -> tuple[str, ...]:
        """Vehicles inserted in the last step."""
        return tuple(name for name in libsumo.simulation.getDepartedIDList() if not is_shadow(name))

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
        """Whether the vehicle is in the simulation (loaded, inserted or not yet, and not removed)."""
        return has(vehicle)

    def entry(self, vehicle: str, settings: Sequence[str]) -> Entry:
        """How an inserted vehicle stands, and its "dvca." parameters among `settings`; changes nothing."""
        of = libsumo.vehicle
        x, y = of.getPosition(vehicle)
        row = of.getRouteIndex(vehicle)
        lane, aside = of.getLaneID(vehicle), abs(of.getLateralLanePosition(vehicle))
        middle, _ = self._net.middle(lane)  # SUMO counts to the other side where traffic keeps left
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
            lane=lane,
            position=of.getLanePosition(vehicle),
            beside=aside if is_left_of(middle, x, y) else -aside,
            stops=tuple(map(_named, of.getStops(vehicle))),
            parameters={name: text for name, text in texts.items() if text},
        )

    def is_stopping(self, vehicle: str) -> bool:
        """Whether a vehicle makes a stop of its own; one that is not in the simulation (any more) does not."""
        return has(vehicle) and bool(libsumo.vehicle.isStopped(vehicle))

    def teleported(self) -> tuple[str, ...]:
        """Vehicles that SUMO began to teleport in the last step."""
        return tuple(libsumo.simulation.getStartingTeleportIDList())

    def waits(self) -> dict[str, float]:
        """How long each vehicle that SUMO drives has stood [s]; 0 while it makes a stop of its own."""
        of = libsumo.vehicle
        names = (name for name in of.getIDList() if name not in self.egos and not is_shadow(name))
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
            is_on_road=abs(x) < NOWHERE,
            edges=tuple(of.getRoute(vehicle)),
        )

    def skip_stops(self, vehicle: str) -> None:
        """Take its own stops off a vehicle that has just departed; its route stays.

        SUMO would take an ego that passes a parking stop of its own for parked there, to the end of its trip.
        """
        for _ in libsumo.vehicle.getStops(vehicle):
            libsumo.vehicle.replaceStop(vehicle, 0, "")

    def adopt(self, entry: Entry) -> None:
        """Take an inserted vehicle out of SUMO's hands, and watch its surroundings."""
        self.egos.adopt(entry)
        self.watch(entry.ego)

    def watch(self, vehicle: str) -> None:
        """Have `objects` ready for a vehicle: its surroundings."""
        self._sight.watch(vehicle)

    def remove(self, ego: str) -> None:
        """Take an ego out of the simulation, if SUMO has not done so."""
        self.egos.release(ego)
        self._sight.forget(ego)
        if has(ego):
            libsumo.vehicle.remove(ego)

    def objects(self, watched: str) -> tuple[ObjectsTruth, list[str]]:
        """Every moving body near a watched vehicle, and the edge that each one on foot is on; see `Sight`."""
        return self._sight.objects(watched)

    def signals(self, signal_ids: tuple[str, ...]) -> dict[str, SignalColour]:
        """Colours of signal heads, given as "traffic light/link index"; not to be written to."""
        known = self._signals.get(signal_ids)
        if known is None:
            known = self._signals[signal_ids] = Signals(signal_ids)
        state_of = libsumo.trafficlight.getRedYellowGreenState
        return known.showing({light: state_of(light) for light in known.lights})

    def obstacles(self) -> Obstacles:
        """The scenario's POIs and polygons that are bodies."""
        return obstacles()

    def close(self) -> None:
        """End the simulation; the process may start another."""
        libsumo.close()


def _named(stop: Any) -> str:
    """A stop of a vehicle's own: its place, or where on its lane; of one on any lane of an edge SUMO tells neither."""
    return stop.stoppingPlaceID or f"{stop.lane or 'an edge'} at {stop.endPos:g} m"


def _in_one_line(error: Exception) -> str:
    return " ".join(str(error).split())
