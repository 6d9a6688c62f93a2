"""The simulated world: SUMO's traffic and the egos that move in it by their own dynamics."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from dvca_sumo.messages import VehicleShape
from dvca_sumo.roadmap import Route
from dvca_sumo.scenario import AUTO, Scenario, ScenarioError
from dvca_sumo.truth import EgoTruth, Moment
from dvca_sumo.world.obstacles import joined
from dvca_sumo.world.session import Entry, Session
from dvca_sumo.world.vehicle import ControlCommandError, Vehicle, VehicleLimits

__all__ = ["ControlCommandError", "Ego", "Entry", "Vehicle", "VehicleLimits", "World", "shape_of"]

RADIUS = 150.0  # [m] around an ego within which other bodies are observed; beyond every sensor's range
AUTO_DELAY = 60.0  # [s] after the begin, so that a chosen ego meets traffic
LONGEST_DELAY = 600.0  # [s] beyond its departure time an ego's road will not clear any more
_AUTO_CLASSES = ("passenger", "private", "taxi", "evehicle")


def shape_of(entry: Entry) -> VehicleShape:
    """The body of an ego of which SUMO knows length and width only: axles at 18 % and 78 % of its length."""
    return VehicleShape(entry.length, entry.width, 0.6 * entry.length, 0.18 * entry.length)


class Ego:
    """One ego's body in the world; between two world steps its `vehicle` is advanced by its own stack."""

    def __init__(self, entry: Entry, route: Route, limits: VehicleLimits) -> None:
        self.name = entry.ego
        self.route = route
        self.shape = shape_of(entry)
        axle = np.array([entry.front_x, entry.front_y]) - self.shape.front * np.array(
            [np.cos(entry.heading), np.sin(entry.heading)]
        )
        start = EgoTruth(entry.time, float(axle[0]), float(axle[1]), entry.heading, entry.speed, 0.0, 0.0, 0.0)
        self.vehicle = Vehicle(self.shape, limits, start)
        self._station, self._station_time = route.start - self.shape.front, -1.0
        self._signals = tuple(line.signal_id for line in route.stop_lines if line.signal_id is not None)

    @property
    def signals(self) -> tuple[str, ...]:
        """Ids of the signal heads on its route."""
        return self._signals

    def station(self) -> float:
        """Where its rear axle is along the route [m]; asked for once a world step at least."""
        truth = self.vehicle.truth
        if truth.time != self._station_time:
            window = (self._station - 20.0, self._station + 30.0)
            self._station = self.route.line.station(truth.x, truth.y, between=window)
            self._station_time = truth.time
        return self._station

    def lane(self) -> str:
        """The route's lane under its front bumper, for SUMO's map matching."""
        line = self.route.line
        front = min(self.station() + self.shape.front, line.length)
        return self.route.lane_ids[int(line.stations.searchsorted(front, side="right")) - 1]


class World:
    """One simulation with any number of egos: it steps once, for all of them."""

    def __init__(self, scenario: Scenario, folder: Path) -> None:
        """Start SUMO; `folder` takes scratch files.

        Raises:
            ScenarioError: SUMO refuses the scenario.
        """
        self._scenario = scenario
        self._session = Session(scenario, folder)
        self._obstacles = self._session.obstacles()
        self._egos: list[Ego] = []

    @property
    def time(self) -> float:
        """In seconds, SUMO's clock."""
        return self._session.time

    def await_ego(self, settings: Sequence[str], is_fit: Callable[[Entry], bool]) -> Entry:
        """Step until the scenario's ego departs; nothing is changed about it yet.

        Args:
            settings: Names of the "dvca." parameters to read of it.
            is_fit: Of a vehicle that `auto` may choose: whether its trip can be driven.

        Raises:
            ScenarioError: It never departs before the scenario ends, or finds no room to.
        """
        wanted, end = self._scenario.ego, self._scenario.end
        earliest = self._scenario.begin + AUTO_DELAY
        while (end is None or self.time < end) and not self._session.is_exhausted:
            self._session.step()
            if self._session.delay(wanted) > LONGEST_DELAY:
                raise ScenarioError(f"the ego {wanted!r} finds no room to depart until {self.time:g} s")
            for name in self._session.departed():
                if name == wanted:
                    return self._session.entry(name, settings)
                if wanted == AUTO and self.time >= earliest:
                    entry = self._session.entry(name, settings)
                    if entry.vehicle_class in _AUTO_CLASSES and is_fit(entry):
                        return entry
        whom = "no vehicle fit to be the ego" if wanted == AUTO else f"the ego {wanted!r} never"
        raise ScenarioError(f"{whom} departs between {self._scenario.begin:g} s and {self.time:g} s")

    def adopt(self, entry: Entry, route: Route, limits: VehicleLimits) -> Ego:
        """Take a departed vehicle out of SUMO's hands."""
        self._session.adopt(entry, RADIUS)
        ego = Ego(entry, route, limits)
        self._egos.append(ego)
        return ego

    def observe(self, ego: Ego) -> Moment:
        """The truth about an ego at this world step."""
        truth = ego.vehicle.truth
        moving = self._session.objects(ego.name)
        return Moment(
            ego=truth,
            shape=ego.shape,
            objects=joined(moving, self._obstacles, (truth.x, truth.y), RADIUS),
            signals=self._session.signals(ego.signals),
        )

    def advance(self) -> None:
        """Put every ego where its vehicle is, and step SUMO.

        Raises:
            ScenarioError: SUMO removed an ego or gave up.
        """
        for ego in self._egos:
            self._session.place(ego.name, ego.vehicle.truth, ego.shape.front, ego.lane())
        self._session.step()
        for ego in self._egos:
            if not self._session.has(ego.name):
                raise ScenarioError(f"SUMO removed the ego {ego.name!r} at {self.time:g} s")

    def close(self) -> None:
        """End the simulation."""
        self._session.close()
