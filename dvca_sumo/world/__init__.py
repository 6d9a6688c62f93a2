"""The simulated world: SUMO's traffic and the egos that move in it by their own dynamics."""

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from dvca_sumo.roadmap import Route
from dvca_sumo.scenario import AUTO, Scenario, ScenarioError
from dvca_sumo.truth import SURROUNDINGS, Moment
from dvca_sumo.world.bodies import Ego, Native, shape_of
from dvca_sumo.world.entry import Entry
from dvca_sumo.world.levels import on_level
from dvca_sumo.world.obstacles import joined
from dvca_sumo.world.session import Session
from dvca_sumo.world.vehicle import ControlCommandError, Vehicle, VehicleLimits

__all__ = ["ControlCommandError", "Ego", "Entry", "Native", "Vehicle", "VehicleLimits", "World", "shape_of"]

AUTO_DELAY = 60.0  # [s] after the begin, so that a chosen ego meets traffic
LONGEST_DELAY = 600.0  # [s] beyond its departure time an ego's road will not clear any more


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

    @property
    def is_exhausted(self) -> bool:
        """Whether no vehicle runs or waits for departure any more."""
        return self._session.is_exhausted

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
        unfit = Counter[str]()
        while (end is None or self.time < end) and not self.is_exhausted:
            self._session.step()
            if self._session.delay(wanted) > LONGEST_DELAY:
                raise ScenarioError(f"the ego {wanted!r} finds no room to depart until {self.time:g} s")
            for name in self._session.departed():
                if name == wanted:
                    return self._session.entry(name, settings)
                if wanted == AUTO and self.time < earliest:
                    unfit[f"before {earliest:g} s (auto chooses from {AUTO_DELAY:g} s after the begin on)"] += 1
                elif wanted == AUTO:
                    entry = self._session.entry(name, settings)
                    objection = entry.why_no_car
                    if not objection and is_fit(entry):
                        return entry
                    unfit[objection or "without a trip that can be driven and is long enough"] += 1
        whom = "no vehicle fit to be the ego" if wanted == AUTO else f"the ego {wanted!r} never"
        them = ", ".join(f"{count} {how}" for how, count in sorted(unfit.items())) or "none"
        others = f"; departed: {them}" if wanted == AUTO else ""
        raise ScenarioError(f"{whom} departs between {self._scenario.begin:g} s and {self.time:g} s{others}")

    def departed(self) -> tuple[str, ...]:
        """Vehicles that departed in the last step."""
        return self._session.departed()

    def arrived(self) -> tuple[str, ...]:
        """Vehicles that SUMO removed at the end of their trips in the last step."""
        return self._session.arrived()

    def is_stopping(self, vehicle: str) -> bool:
        """Whether a vehicle makes a stop of its own now, parks or waits for somebody; not one that is gone."""
        return self._session.is_stopping(vehicle)

    def teleported(self) -> tuple[str, ...]:
        """Vehicles that SUMO began to teleport in the last step."""
        return self._session.teleported()

    def waits(self) -> dict[str, float]:
        """How long each vehicle that SUMO drives has stood [s], by name; 0 while it makes a stop of its own."""
        return self._session.waits()

    def leader(self, vehicle: str, reach: float) -> str | None:
        """Who is ahead of a vehicle that SUMO drives, on its way and no farther than `reach` [m]."""
        return self._session.leader(vehicle, reach)

    def entry(self, vehicle: str, settings: Sequence[str]) -> Entry:
        """How a vehicle that has just departed stands, and its "dvca." parameters among `settings`."""
        return self._session.entry(vehicle, settings)

    def adopt(self, entry: Entry, route: Route, limits: VehicleLimits) -> Ego:
        """Take a vehicle that has just departed out of SUMO's hands, and its own stops off it."""
        self._session.skip_stops(entry.ego)
        self._session.adopt(entry)
        ego = Ego(entry, route, limits)
        self._egos.append(ego)
        return ego

    def watch(self, entry: Entry, route: Route) -> Native:
        """Look at a vehicle that has just departed and stays in SUMO's hands; like an ego it makes no stops."""
        self._session.skip_stops(entry.ego)
        self._session.watch(entry.ego)
        return Native(entry, route)

    def follow(self, native: Native) -> bool:
        """Bring a native up to this world step; False: SUMO teleports it, or it is gone."""
        if not self._session.has(native.name):
            return False
        motion = self._session.motion(native.name)
        if not motion.is_on_road:
            return False
        native.follow(self.time, motion)
        return True

    def observe(self, ego: Ego | Native) -> Moment:
        """The truth about an ego at this world step."""
        truth = ego.truth
        moving = on_level(*self._session.objects(ego.name), ego.route, ego.station())
        return Moment(
            ego=truth,
            shape=ego.shape,
            objects=joined(moving, self._obstacles, (truth.x, truth.y), SURROUNDINGS),
            signals=self._session.signals(ego.signals),
        )

    def advance(self) -> tuple[Ego, ...]:
        """Put every ego where its vehicle is, and step SUMO; the egos that it removed, which are none any more.

        Raises:
            ScenarioError: SUMO gave up.
        """
        for ego in self._egos:
            lane = ego.lane()
            self._session.egos.stretch(ego.name, ego.occupied())
            self._session.egos.place(ego.name, ego.truth, ego.shape.front, lane, ego.indicated(lane))
            self._session.egos.straddle(ego.name, ego.truth, ego.shape, ego.straddled(lane))
        self._session.step()
        lost = tuple(ego for ego in self._egos if not self._session.has(ego.name))
        for ego in lost:
            self.dismiss(ego)
        return lost

    def dismiss(self, ego: Ego) -> None:
        """Take an ego out of the simulation."""
        self._egos.remove(ego)
        self._session.remove(ego.name)

    def close(self) -> None:
        """End the simulation."""
        self._session.close()
