"""The same trips driven by SUMO's own drivers, in one run without any ADS, before the same oracles.

Three things differ from an ego's drive. The destination is not asked of them: SUMO takes its vehicles away at speed,
where they arrive. They go on after a contact, which to SUMO may be none; but as an ego's drive, theirs is neither
judged nor measured any more, but for how far and how long it goes. And they have more patience, so that their travel
times are known. Whom SUMO sends another way is followed no farther.
"""

from collections.abc import Sequence
from functools import partial

from dvca_sumo.engine.replay import roadmap
from dvca_sumo.oracles.destination import Destination
from dvca_sumo.roadmap import RouteError
from dvca_sumo.run import Departing, free_flow, opened, patience
from dvca_sumo.scenario import Scenario
from dvca_sumo.screen.driving import Driven, Heard
from dvca_sumo.screen.neighbours import Neighbourhood
from dvca_sumo.screen.queues import Queues
from dvca_sumo.screen.results import TripOutcome, TripResult, Watch, cut_off
from dvca_sumo.screen.trips import Trip
from dvca_sumo.stack.reference import reference_stack
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Ending
from dvca_sumo.world import Entry, Native, World

UNASKED = (Destination.kind,)  # oracles
_PATIENCE = 1200.0  # [s] for one trip, at least: some scenarios jam for ever


def anchored(scenario: Scenario, trips: Sequence[Trip], hear: Heard) -> Driven:
    """Watch SUMO's drivers on `trips`, in this process.

    A trip on which SUMO teleports the vehicle is `ABORTED`, one on which it gives it another route `CUT`: it is watched
    until then.

    Raises:
        ScenarioError: SUMO refuses the scenario, or gave up.
    """
    departing = Departing(scenario, partial(roadmap, scenario.configuration.net), reference_stack)
    awaited = {trip.ego for trip in trips}
    rides: list[_Ride] = []
    results: list[TripResult] = []
    neighbourhood = Neighbourhood()
    with opened(scenario) as world:
        while (awaited or rides) and not world.is_exhausted and not _is_late(world, scenario):
            world.advance()
            neighbourhood.see(world)
            arrived = set(world.arrived()) - set(world.teleported())  # to the end of its trip, SUMO may do both
            for name in world.departed():
                if name in awaited:
                    awaited.remove(name)
                    entry = departing.entry(name, world)
                    try:
                        rides.append(_Ride(world, departing, entry))
                    except RouteError as error:  # not with the draw's: its departure is the same
                        results.append(TripResult(name, TripOutcome.NOT_DRIVEN, str(error)))
            for ride in list(rides):
                result = ride.step(world, is_gone=ride.native.name in arrived)
                if result is not None:
                    rides.remove(ride)
                    results.append(result)
            hear(world.time, len(results))
        results += [ride.cut(world.time) for ride in rides]
    results += [TripResult(name, TripOutcome.NOT_DRIVEN, "it did not depart") for name in sorted(awaited)]
    return Driven(tuple(results), neighbourhood.seen())


def _is_late(world: World, scenario: Scenario) -> bool:
    return scenario.end is not None and world.time >= scenario.end


class _Ride:
    """One trip with SUMO's own driver."""

    def __init__(self, world: World, departing: Departing, entry: Entry) -> None:
        route = departing.route(entry)
        judging = departing.judging(entry, route)
        self.native: Native = world.watch(entry, route)
        self._oracles = [oracle for oracle in judging.oracles if oracle.kind not in UNASKED]
        self._watch = Watch(entry.ego, judging, Queues(world.is_stopping))
        self._latest = entry.time + max(_PATIENCE, patience(free_flow(route)))
        self._is_judged = True

    def step(self, world: World, *, is_gone: bool) -> TripResult | None:
        """Look at it at this world step; its result when it is over."""
        if is_gone:
            return self._result(TripOutcome.ARRIVED)
        if not world.follow(self.native):
            return self._result(TripOutcome.ABORTED, f"SUMO teleported it or took it away at {world.time:g} s")
        if self.native.is_rerouted:
            return self._result(TripOutcome.CUT, f"SUMO gave it another route at {world.time:g} s")
        moment = world.observe(self.native)
        self._watch.see(moment)
        if self._is_judged and self._has_touched(moment):
            self._is_judged = False
            self._watch.touch(moment)
        return self._result(TripOutcome.TIME_OVER) if moment.time >= self._latest else None

    def cut(self, time: float) -> TripResult:
        """Its result, when the simulation ends before it."""
        return self._result(TripOutcome.CUT, cut_off(time))

    def _has_touched(self, moment: Moment) -> bool:
        found = [oracle.observe(moment) for oracle in self._oracles]
        return any(one is not None and one.contact is not None for one in found)

    def _result(self, outcome: TripOutcome, reason: str = "") -> TripResult:
        endings = {TripOutcome.ARRIVED: Ending.ARRIVED, TripOutcome.TIME_OVER: Ending.TIME_OVER}
        ending = endings.get(outcome, Ending.CUT) if self._is_judged else Ending.CUT
        return self._watch.result(outcome, tuple(oracle.conclude(ending) for oracle in self._oracles), reason)
