"""Trips driven by the ADS, several at once in one simulation."""

from collections.abc import Callable, Sequence
from functools import partial

import msgspec

from dvca_sumo.engine.replay import roadmap
from dvca_sumo.run import Departing, Drive, Over, Simulation, Task, built_here, opened
from dvca_sumo.scenario import Scenario, ScenarioError
from dvca_sumo.screen.neighbours import Neighbourhood, Neighbours
from dvca_sumo.screen.queues import Queues
from dvca_sumo.screen.results import TripOutcome, TripResult, Watch, cut_off
from dvca_sumo.screen.trips import SLOWER, Trip
from dvca_sumo.stack.reference import StackError
from dvca_sumo.stack.sources import StackSource, stack_factory
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Ending
from dvca_sumo.world import LONGEST_DELAY, World

Heard = Callable[[float, int], None]  # the time it is [s], and how many trips are over

_SLACK = 30.0  # [s] beyond `SLOWER`, a trip is expected to be under way when simulations are planned


class Driven(msgspec.Struct, frozen=True):
    """What one simulation brought."""

    results: tuple[TripResult, ...]
    neighbours: Neighbours
    crowded_out: tuple[str, ...] = ()  # egos that departed when as many as are allowed were under way


def planned(trips: Sequence[Trip], concurrent: int) -> list[list[Trip]]:
    """Trips shared out among simulations so that never more than `concurrent` are expected to be under way."""
    shared: list[list[Trip]] = []
    for trip in sorted(trips, key=lambda one: (one.departs, one.ego)):
        overlaps = [sum(one.departs + SLOWER * one.expected + _SLACK > trip.departs for one in some) for some in shared]
        if overlaps and min(overlaps) < concurrent:
            shared[overlaps.index(min(overlaps))].append(trip)
        else:
            shared.append([trip])
    return shared


def driven(scenario: Scenario, source: StackSource, trips: Sequence[Trip], concurrent: int, hear: Heard) -> Driven:
    """Drive trips in one simulation, in this process; alone, a trip is driven as `rtest` drives it.

    A trip that cannot be driven, and one whose stack fails, has a result that says why. One that the scenario's end
    cuts off before the ego's patience is over did not fail to arrive in time, as it has for `rtest`: nobody knows.

    Raises:
        ScenarioError: SUMO refuses the scenario, or gave up.
    """
    factory = built_here(stack_factory(source))
    endless = msgspec.structs.replace(scenario, end=None)  # its end leaves an ego's patience as long as it is
    departing = Departing(endless, partial(roadmap, scenario.configuration.net), factory)
    with opened(scenario) as world:
        return _Fleet(scenario, departing, world, trips, concurrent).proceed(hear)


class _Fleet:
    """The egos of one simulation: those to come, those under way, those that are over."""

    def __init__(
        self, scenario: Scenario, departing: Departing, world: World, trips: Sequence[Trip], concurrent: int
    ) -> None:
        self._scenario = scenario
        self._departing = departing
        self._world = world
        self._simulation = Simulation(world, scenario.begin)
        self._awaited = {trip.ego: trip for trip in trips}
        self._concurrent = concurrent
        self._watches: dict[str, Watch] = {}  # by ego
        self._results: list[TripResult] = []
        self._crowded_out: list[str] = []
        self._neighbourhood = Neighbourhood()
        self._queues = Queues(world.is_stopping)

    def proceed(self, hear: Heard) -> Driven:
        while self._awaited or self._simulation.drives:
            self._finish(self._simulation.cycle(self._see))
            if not self._awaited and not self._simulation.drives:
                break
            self._finish(self._simulation.advance())
            self._neighbourhood.see(self._world)
            self._admit()
            self._give_up()
            hear(self._world.time, len(self._results))
        return Driven(tuple(self._results), self._neighbourhood.seen(), tuple(self._crowded_out))

    def _see(self, drive: Drive, moment: Moment) -> None:
        self._watches[drive.ego.name].see(moment)

    def _admit(self) -> None:
        for name in self._world.departed():
            if self._awaited.pop(name, None) is None:
                continue
            if len(self._simulation.drives) == self._concurrent:
                self._crowded_out.append(name)
                continue
            entry = self._departing.entry(name, self._world)
            task = Task(msgspec.structs.replace(self._scenario, ego=name))
            try:
                drive = self._departing.drive(entry, task, self._world, is_whole=False)
            except (ScenarioError, StackError) as error:
                self._results.append(TripResult(name, TripOutcome.NOT_DRIVEN, str(error)))
                continue
            self._simulation.drives.append(drive)
            self._watches[name] = Watch(name, drive.judging, self._queues)

    def _give_up(self) -> None:
        """On those that will not depart any more."""
        time, end = self._world.time, self._scenario.end
        for name, trip in list(self._awaited.items()):
            if time > trip.departs + LONGEST_DELAY or (end is not None and time >= end) or self._world.is_exhausted:
                del self._awaited[name]
                reason = f"it did not depart until {time:g} s; in the plain traffic it departs at {trip.departs:g} s"
                self._results.append(TripResult(name, TripOutcome.NOT_DRIVEN, reason))

    def _finish(self, over: Sequence[Over]) -> None:
        for drive, error in over:
            outcome = drive.outcome
            watch = self._watches.pop(drive.ego.name)
            how, reason = TripOutcome(outcome.ending.value), ""
            if error is not None:
                how, reason = TripOutcome.ABORTED, str(error)
            elif any(violation.contact is not None for violation in outcome.violations):
                how = TripOutcome.CONTACT
            elif outcome.ending is Ending.CUT:
                reason = cut_off(self._world.time)
            jam = next((name for name in watch.holding() if not self._world.is_stopping(name)), None)
            self._results.append(watch.result(how, outcome.judgements, reason, outcome.digest, jam))
