"""What the trips of one driver come to.

Rates are events over exposure with the exact Poisson interval, shares have Wilson's; see `intervals`.
"""

import statistics
from collections import Counter
from collections.abc import Collection, Sequence

import msgspec

from dvca_sumo.intervals import Rate, Share, rate_of, share_of
from dvca_sumo.oracles import ORACLES
from dvca_sumo.responsibility.judging import AtFault, Judged
from dvca_sumo.screen.neighbours import Neighbours
from dvca_sumo.screen.results import TripOutcome, TripResult

NEAR = (1, 2, 3)  # [s] of time to collision


class OracleSummary(msgspec.Struct, frozen=True):
    """What one oracle found on all trips; rates and shares are of nothing where it was not asked."""

    violations: int
    kinds: dict[str, int]
    by_fault: dict[str, int]  # driver, other, simulator
    per_1000_km: Rate  # the driver's own
    per_100_trips: Rate  # likewise
    trips: Share  # with at least one violation of the driver's own
    unknown: int  # trips on which it could not tell, or was not asked


class Quartiles(msgspec.Struct, frozen=True):
    """Of one figure over trips; all None of none."""

    count: int
    low: float | None
    median: float | None
    high: float | None


class NeighboursSummary(msgspec.Struct, frozen=True):
    """How SUMO's own vehicles fared in the simulations of one driver."""

    hours: float  # [h] that they were under way, all together
    stood_per_100_hours: Rate  # of them, for two minutes or longer without a stop of their own
    queues_per_100_hours: Rate  # in which those stood
    teleports_per_100_hours: Rate


class DriverSummary(msgspec.Struct, frozen=True):
    """All trips of one driver."""

    trips: int  # that were driven
    not_driven: int
    ended_by_simulator: int  # by a contact of its doing: counted apart
    cut: int  # by the scenario's end before their patience was over, or by SUMO with another route: likewise
    completed: Share  # of the others: arrived without a contact
    km: float  # up to a contact
    hours: float  # likewise
    outcomes: dict[str, int]
    at_fault_collisions: int
    at_fault_violations: int
    others_fault_violations: int
    simulator_violations: int
    violations_per_1000_km: Rate  # the driver's own
    violations_per_100_trips: Rate  # likewise
    by_oracle: dict[str, OracleSummary]
    travel_time_ratio: Quartiles  # to SUMO's driver on the same trip, where both arrived
    hard_brakings_per_100_km: Rate
    least_ttc: Quartiles  # [s] of the trips with one below the horizon
    ttc_below: dict[str, Share]  # by seconds: trips with a shorter one
    neighbours: NeighboursSummary


def summary_of(
    results: Sequence[TripResult], like: Sequence[TripResult], neighbours: Neighbours, unasked: Collection[str] = ()
) -> DriverSummary:
    """Sum up one driver's trips among `neighbours`; travel times are relative to those of `like`.

    Oracles that are `unasked` have judged none of the trips.
    """
    trips = [result for result in results if result.outcome is not TripOutcome.NOT_DRIVEN]
    km = sum(trip.distance - trip.distance_after for trip in trips) / 1000.0
    faults = Counter(one.fault for trip in trips for one in trip.violations)
    own = faults[AtFault.DRIVER]
    reference = {trip.ego: trip.duration for trip in like if trip.outcome is TripOutcome.ARRIVED}
    ratios = [
        trip.duration / reference[trip.ego]
        for trip in trips
        if trip.outcome is TripOutcome.ARRIVED and reference.get(trip.ego, 0.0) > 0.0
    ]
    ended = sum(_is_ended_by_simulator(trip) for trip in trips)
    cut = sum(trip.outcome is TripOutcome.CUT and not _contacts(trip) for trip in trips)
    arrived = sum(trip.outcome is TripOutcome.ARRIVED and not _contacts(trip) for trip in trips)
    nearest = [trip.least_ttc for trip in trips if trip.least_ttc is not None]
    return DriverSummary(
        trips=len(trips),
        not_driven=len(results) - len(trips),
        ended_by_simulator=ended,
        cut=cut,
        completed=share_of(arrived, len(trips) - ended - cut),
        km=km,
        hours=sum(trip.duration - trip.duration_after for trip in trips) / 3600.0,
        outcomes=dict(Counter(trip.outcome.value for trip in results)),
        at_fault_collisions=sum(one.fault is AtFault.DRIVER for trip in trips for one in _contacts(trip)),
        at_fault_violations=own,
        others_fault_violations=faults[AtFault.OTHER],
        simulator_violations=faults[AtFault.SIMULATOR],
        violations_per_1000_km=rate_of(own, km / 1000.0),
        violations_per_100_trips=rate_of(own, len(trips) / 100.0),
        by_oracle={
            oracle.kind: _oracle(oracle.kind, trips, km, is_asked=oracle.kind not in unasked) for oracle in ORACLES
        },
        travel_time_ratio=_quartiles(ratios),
        hard_brakings_per_100_km=rate_of(sum(trip.hard_brakings for trip in trips), km / 100.0),
        least_ttc=_quartiles(nearest),
        ttc_below={str(limit): share_of(sum(ttc < limit for ttc in nearest), len(trips)) for limit in NEAR},
        neighbours=NeighboursSummary(
            hours=neighbours.hours,
            stood_per_100_hours=rate_of(neighbours.stood, neighbours.hours / 100.0),
            queues_per_100_hours=rate_of(neighbours.queues, neighbours.hours / 100.0),
            teleports_per_100_hours=rate_of(neighbours.teleports, neighbours.hours / 100.0),
        ),
    )


def _contacts(trip: TripResult) -> list[Judged]:
    return [one for one in trip.violations if one.violation.contact is not None]


def _is_ended_by_simulator(trip: TripResult) -> bool:
    return any(one.fault is AtFault.SIMULATOR for one in _contacts(trip))


def _oracle(kind: str, trips: Sequence[TripResult], km: float, *, is_asked: bool) -> OracleSummary:
    if not is_asked:
        nothing = rate_of(0, 0.0)
        by_fault = dict.fromkeys((fault.value for fault in AtFault), 0)
        return OracleSummary(0, {}, by_fault, nothing, nothing, share_of(0, 0), unknown=len(trips))
    found = [[one for one in trip.violations if one.oracle == kind] for trip in trips]
    own = [sum(one.fault is AtFault.DRIVER for one in some) for some in found]
    faults = Counter(one.fault for some in found for one in some)
    return OracleSummary(
        violations=sum(map(len, found)),
        kinds=dict(Counter(one.violation.kind for some in found for one in some)),
        by_fault={fault.value: faults[fault] for fault in AtFault},
        per_1000_km=rate_of(sum(own), km / 1000.0),
        per_100_trips=rate_of(sum(own), len(trips) / 100.0),
        trips=share_of(sum(number > 0 for number in own), len(trips)),
        unknown=sum(kind in trip.unknown for trip in trips),
    )


def _quartiles(values: Sequence[float]) -> Quartiles:
    if len(values) < 2:
        only = values[0] if values else None
        return Quartiles(len(values), only, only, only)
    low, median, high = statistics.quantiles(values, n=4, method="inclusive")
    return Quartiles(len(values), low, median, high)
