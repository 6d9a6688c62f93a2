"""The whole screening: trips drawn, driven by the ADS and by SUMO's drivers, violations tried again alone."""

from collections.abc import Callable, Sequence
from functools import partial

import msgspec

from dvca_sumo.engine.processes import Failure, isolated
from dvca_sumo.engine.replay import raised, roadmap
from dvca_sumo.oracles.destination import Destination
from dvca_sumo.oracles.no_progress import NoProgress
from dvca_sumo.report.result import versions
from dvca_sumo.responsibility.judging import AtFault, Judged
from dvca_sumo.scenario import Scenario, ScenarioError, content_of
from dvca_sumo.screen.anchor import anchored
from dvca_sumo.screen.driving import Driven, Heard, driven, planned
from dvca_sumo.screen.neighbours import Neighbours, together
from dvca_sumo.screen.results import TripOutcome, TripResult
from dvca_sumo.screen.trips import SLOWER, Draw, Trip, drawn
from dvca_sumo.stack.sources import StackSource, files_of, stack_factory
from dvca_sumo.store import Store, key_of

_TIMEOUT = 6 * 3600.0  # [s] of wall time for one simulation: only a hang takes so long
_SAME = 10.0  # [s] between two violations of one kind that are the same one


class Setting(msgspec.Struct, frozen=True):
    """What is asked."""

    scenario: Scenario  # as `run` would load it for each ego
    window_end: float | None  # [s] trips are to be over by then; None: no end is known
    egos: int
    concurrent: int
    source: StackSource

    @classmethod
    def of_window(cls, window: Scenario, egos: int, concurrent: int, source: StackSource) -> "Setting":
        """Trips that are over by the end of `window`; one that is held up goes on to the configuration's end, if later.

        Without an end in the configuration, it goes on for as long as an ego's patience is.
        """
        configured = window.configured_end
        end = None if configured is None or window.end is None else max(configured, window.end)
        return cls(msgspec.structs.replace(window, end=end), window.end, egos, concurrent, source)


class Screening(msgspec.Struct, frozen=True):
    """What came of it."""

    setting: Setting
    draw: Draw
    ads: tuple[TripResult, ...]  # in the order of the trips
    sumo_driver: tuple[TripResult, ...]  # likewise
    ads_neighbours: Neighbours  # where trips of the draw were driven first; not where some were driven again, alone
    sumo_neighbours: Neighbours


class Progress:
    """What a screening says on its way; nothing, unless overridden."""

    def stage(self, what: str, simulations: int) -> None:
        """So many simulations begin."""

    def over(self, left: int) -> None:
        """One simulation is over, so many of the stage are left."""

    def inside(self, number: int, begin: float, end: float, trips: int) -> Heard:  # noqa: ARG002
        """For simulation `number` of so many trips, likely to last from `begin` to `end` [s]; in its own process."""
        return lambda time, done: None  # noqa: ARG005


def screened(setting: Setting, jobs: int, stores: "Stores", progress: Progress) -> Screening:
    """Screen a scenario.

    Raises:
        ScenarioError: It cannot be run, or has no trip to drive.
        StackError, BugError, RoadMapError: As for a run.
        RunFailedError: SUMO crashed or hung without any ADS.
    """
    roads = roadmap(setting.scenario.configuration.net, "passenger")  # before any process starts: it is shared
    if not any(lane.is_drivable and not lane.is_internal for lane in roads.lanes.values()):
        raise ScenarioError(f"{setting.scenario.configuration.net} has no lane for cars (rails, water or paths only)")
    stack_factory(setting.source)
    return _Work(setting, jobs, stores, progress).screening()


class Stores(msgspec.Struct, frozen=True):
    """What was found before; None: nothing is kept."""

    draws: Store[Draw] | None = None
    simulations: Store[Driven] | None = None


class _Work:
    def __init__(self, setting: Setting, jobs: int, stores: Stores, progress: Progress) -> None:
        self._setting = setting
        self._jobs = jobs
        self._stores = stores
        self._progress = progress
        # Once: what is imported later does not make it another question.
        stack = sorted((name, content_of(path)) for name, path in files_of(setting.source).items())
        scenario = setting.scenario
        asked = (scenario.seed, scenario.begin, scenario.end, setting.source, versions())
        self._asked = [scenario.configuration.contents, scenario.overrides, stack, asked]

    def screening(self) -> Screening:
        draw = self._draw()
        self._trips = {trip.ego: trip for trip in draw.trips}
        batches = planned(draw.trips, self._setting.concurrent)
        self._progress.stage(f"{len(draw.trips)} trips, by SUMO's drivers and by the ADS", 1 + len(batches))
        anchor, *answers = self._simulated(
            ["sumo", *["ads"] * len(batches)], [list(draw.trips), *batches], self._setting.concurrent
        )
        if isinstance(anchor, Failure):
            raise raised(anchor)
        results, neighbours = self._whole(batches, answers)
        alone = self._alone(batches, results)
        natives = {result.ego: result for result in anchor.results}
        return Screening(
            self._setting,
            draw,
            tuple(_marked(excused(results[ego], natives[ego]), alone.get(ego)) for ego in self._trips),
            tuple(natives[ego] for ego in self._trips),
            neighbours,
            anchor.neighbours,
        )

    def _draw(self) -> Draw:
        setting = self._setting
        window = msgspec.structs.replace(setting.scenario, end=setting.window_end)
        key = key_of([self._asked, "draw", setting.egos, window.end])
        known = self._stores.draws and self._stores.draws.find(key)
        if known:
            return known
        self._progress.stage("one run of SUMO alone, to draw trips", 1)
        ((_, answer),) = isolated([partial(drawn, window, setting.egos)], 1, _TIMEOUT)
        if isinstance(answer, Failure):
            raise raised(answer)
        self._progress.over(0)
        if self._stores.draws is not None:
            self._stores.draws.add(key, answer)
        return answer

    def _whole(
        self, batches: list[list[Trip]], answers: list[Driven | Failure]
    ) -> tuple[dict[str, TripResult], Neighbours]:
        """The results of all trips: those that were crowded out, or went down with others, are driven again."""
        results: dict[str, TripResult] = {}
        neighbours: list[Neighbours] = []
        while batches:
            again: list[list[Trip]] = []
            crowded_out: list[Trip] = []
            failures: list[str] = []
            for batch, answer in zip(batches, answers, strict=True):
                if isinstance(answer, Driven):
                    results |= {result.ego: result for result in answer.results}
                    crowded_out += [self._trips[ego] for ego in answer.crowded_out]
                    neighbours.append(answer.neighbours)
                elif len(batch) > 1:
                    again += [[trip] for trip in batch]
                    failures.append(answer.reason)
                else:
                    results[batch[0].ego] = TripResult(batch[0].ego, TripOutcome.NOT_DRIVEN, answer.reason)
            batches = again + planned(crowded_out, self._setting.concurrent)
            if batches:
                why = [f"trips driven again, each alone, for a simulation failed: {reason}" for reason in failures]
                why += ["trips that found no place beside the others"] if crowded_out else []
                self._progress.stage("; ".join(dict.fromkeys(why)), len(batches))
                answers = self._simulated(["ads"] * len(batches), batches, self._setting.concurrent)
        return results, together(neighbours)

    def _alone(self, batches: list[list[Trip]], results: dict[str, TripResult]) -> dict[str, TripResult]:
        """Trips with violations, driven with no other ego in the simulation."""
        single = {batch[0].ego for batch in batches if len(batch) == 1}
        found = {ego: result for ego, result in results.items() if result.violations}
        asked = [self._trips[ego] for ego in self._trips if ego in found and ego not in single]
        if not asked:
            return found
        self._progress.stage("trips with violations, each alone", len(asked))
        answers = self._simulated(["ads"] * len(asked), [[trip] for trip in asked], 1)
        alone = {
            trip.ego: answer.results[0]
            for trip, answer in zip(asked, answers, strict=True)
            if isinstance(answer, Driven)
        }
        return {ego: result for ego, result in found.items() if ego in single} | alone

    def _simulated(
        self, drivers: Sequence[str], batches: Sequence[Sequence[Trip]], concurrent: int
    ) -> list[Driven | Failure]:
        """Simulate each batch by its driver, or find what came of it before."""
        keys = [
            key_of([self._asked, driver, [trip.ego for trip in batch], concurrent])
            for driver, batch in zip(drivers, batches, strict=True)
        ]
        store = self._stores.simulations
        known: dict[int, Driven | Failure] = {
            row: found for row, key in enumerate(keys) if store is not None and (found := store.find(key)) is not None
        }
        rows = [row for row in range(len(keys)) if row not in known]
        work = [self._job(row, drivers[row], batches[row], concurrent) for row in rows]
        for number, answer in isolated(work, self._jobs, _TIMEOUT):
            row = rows[number]
            known[row] = answer
            if store is not None and isinstance(answer, Driven):
                store.add(keys[row], answer)
            self._progress.over(len(keys) - len(known))
        return [known[row] for row in range(len(keys))]

    def _job(self, row: int, driver: str, batch: Sequence[Trip], concurrent: int) -> Callable[[], Driven]:
        setting = self._setting
        end = max(trip.departs + 1.2 * trip.expected for trip in batch)
        hear = self._progress.inside(row + 1, setting.scenario.begin, end, len(batch))
        if driver == "sumo":
            return partial(anchored, setting.scenario, batch, hear)
        return partial(driven, setting.scenario, setting.source, batch, concurrent, hear)


def excused(result: TripResult, native: TripResult) -> TripResult:
    """The result, being late excused where SUMO's driver was held up as long, or the ego by queues.

    Not where the ego stood for no reason.
    """
    if result.outcome is not TripOutcome.TIME_OVER:
        return result
    if any(one.oracle == NoProgress.kind for one in result.violations):
        return result
    if native.duration > result.duration:
        reason = f"SUMO's driver had not arrived after {result.duration:.0f} s either"
    elif _is_late_by_queues(result, native):
        reason = f"held up for {result.held:.0f} s in queues, SUMO's driver for {native.held:.0f} s"
    else:
        return result
    violations = tuple(
        msgspec.structs.replace(one, fault=AtFault.OTHER, reason=reason)
        if one.violation.kind == Destination.not_reached
        else one
        for one in result.violations
    )
    return msgspec.structs.replace(result, violations=violations)


def _is_late_by_queues(result: TripResult, native: TripResult) -> bool:
    """Whether, all queues apart, the ego was no slower than it may be compared with SUMO's driver.

    For the rest of its way it is taken to need as long as that one did, on average.
    """
    if native.outcome is not TripOutcome.ARRIVED or result.held <= native.held:
        return False
    moving = native.duration - native.held
    rest = max(1.0 - result.distance / native.distance, 0.0) * moving
    return result.duration - result.held + rest <= SLOWER * moving


def _marked(result: TripResult, alone: TripResult | None) -> TripResult:
    """The result, each violation marked by whether it also came about alone."""

    def is_alone(one: Judged) -> bool | None:
        if alone is None:
            return None
        return any(
            (one.violation.kind, one.violation.object) == (other.violation.kind, other.violation.object)
            and abs(one.violation.time - other.violation.time) <= _SAME
            for other in alone.violations
        )

    violations = tuple(msgspec.structs.replace(one, is_alone=is_alone(one)) for one in result.violations)
    return msgspec.structs.replace(result, violations=violations)
