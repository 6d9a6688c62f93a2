"""A screening as data and as text."""

import shlex
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from pathlib import Path

import msgspec

from dvca_sumo.intervals import Rate, Share
from dvca_sumo.report.result import Json, versions, violation_json
from dvca_sumo.responsibility.judging import AtFault, Judged
from dvca_sumo.screen.anchor import UNASKED
from dvca_sumo.screen.results import TripOutcome, TripResult
from dvca_sumo.screen.screening import Screening, Setting
from dvca_sumo.screen.summary import DriverSummary, Quartiles, summary_of
from dvca_sumo.screen.trips import Draw

SCHEMA = 1
_ALONE = {True: "yes", False: "no, the command does not show it", None: "not known"}


def json_of(screening: Screening) -> Json:
    """The whole screening, of JSON types only."""
    setting, draw = screening.setting, screening.draw
    scenario = setting.scenario
    ads, sumo = _summaries(screening)
    return {
        "schema": SCHEMA,
        "scenario": {
            "config": str(scenario.configuration.path),
            "seed": scenario.seed,
            "begin": scenario.begin,
            "end": setting.window_end,
            "egos": setting.egos,
            "concurrent": setting.concurrent,
            "stack": setting.source.stack,
        },
        "draw": {"departures": draw.departures, "refused": draw.refused, "drawn": len(draw.trips)},
        "ads": msgspec.to_builtins(ads),
        "sumo_driver": msgspec.to_builtins(sumo),
        "violations": [
            _violation(trip, one, setting, driver)
            for driver, trips in (("ads", screening.ads), ("sumo_driver", screening.sumo_driver))
            for trip in trips
            for one in trip.violations
        ],
        "trips": [
            {**msgspec.to_builtins(trip), "ads": _trip(ours), "sumo_driver": _trip(theirs)}
            for trip, ours, theirs in zip(draw.trips, screening.ads, screening.sumo_driver, strict=True)
        ],
        "versions": versions(),
    }


def has_failed(screening: Screening) -> bool:
    """Whether the ADS has violated anything by its own doing."""
    return _summaries(screening)[0].at_fault_violations > 0


def has_gaps(screening: Screening) -> bool:
    """Whether a trip could not be driven, or not to its end, or an oracle could not tell."""
    untold = (TripOutcome.NOT_DRIVEN, TripOutcome.ABORTED, TripOutcome.CUT)
    return any(trip.outcome in untold or trip.unknown for trip in screening.ads)


def terminal_text(screening: Screening) -> str:
    """The tables for a terminal."""
    ads, sumo = _summaries(screening)
    parts = [
        _drawn(screening.draw, screening.setting.egos),
        _table([["", "ADS", "SUMO's driver"], *([name, say(ads), say(sumo)] for name, say in _ROWS)]),
        "Violations of the driver's own doing per 1 000 km and per 100 trips, 95 % intervals (others', simulator's);"
        " - where no trip was asked about\n"
        + _table([["oracle", "ADS", "", "", "SUMO's driver", "", ""], *_by_oracle(ads, sumo)]),
    ]
    listed = [_line(trip, one, screening.setting) for trip in screening.ads for one in trip.violations]
    if listed:
        if any(one.fault is not AtFault.DRIVER for trip in screening.ads for one in trip.violations):
            listed.append("`run` looks for a component in those that are not the driver's, too.")
        parts.append("Violations of the ADS, and how to drive each of the trips alone\n" + "\n".join(listed))
    drivers = (("ADS", screening.ads), ("SUMO's driver", screening.sumo_driver))
    lost = [
        f"{driver} {trip.ego}: {trip.outcome.value}: {trip.reason}"
        for driver, trips in drivers
        for trip in trips
        if trip.reason
    ]
    if lost:
        parts.append("Trips that were not driven, or not to their end\n" + "\n".join(lost))
    untold = [
        f"{driver}: {oracle} on {count} of {len(trips)}"
        for driver, trips in drivers
        for oracle, count in Counter(oracle for trip in trips for oracle in trip.unknown).items()
    ]
    if untold:
        parts.append("Oracles that could not tell, and on how many trips\n" + "\n".join(untold))
    return "\n\n".join(parts)


def _drawn(draw: Draw, wanted: int) -> str:
    drawn = len(draw.trips)
    said = f"{drawn} trips drawn of {draw.departures} departures"
    if drawn == wanted:
        return said
    refused = "".join(f"; {count} {reason}" for reason, count in draw.refused.items())
    return f"{said} (no more than that of {wanted} asked for{refused})"


def command(setting: Setting, ego: str) -> str:
    """What reproduces and attributes a violation of that ego, driven alone."""
    scenario = setting.scenario
    words = ["dvca-sumo", "run", str(scenario.configuration.path), "--ego", ego]
    words += ["--seed", str(scenario.seed), "--begin", f"{scenario.begin:.12g}"]
    if scenario.end is not None and scenario.end != scenario.configured_end:
        words += ["--end", f"{scenario.end:.12g}"]
    stack = setting.source.stack
    if stack is not None:
        words += ["--stack", str(Path(stack).resolve()) if setting.source.is_reference else stack]
    return shlex.join(words)


def _summaries(screening: Screening) -> tuple[DriverSummary, DriverSummary]:
    anchor = screening.sumo_driver
    return (
        summary_of(screening.ads, anchor, screening.ads_neighbours),
        summary_of(anchor, anchor, screening.sumo_neighbours, UNASKED),
    )


def _violation(trip: TripResult, one: Judged, setting: Setting, driver: str) -> Json:
    is_ads = driver == "ads"
    return {
        "driver": driver,
        "ego": trip.ego,
        "oracle": one.oracle,
        **violation_json(one.violation),
        "fault": one.fault.value,
        "reason": one.reason,
        "alone": one.is_alone,
        "command": command(setting, trip.ego) if is_ads else None,
    }


def _trip(result: TripResult) -> Json:
    return {name: value for name, value in msgspec.to_builtins(result).items() if name not in ("ego", "violations")}


def _line(trip: TripResult, one: Judged, setting: Setting) -> str:
    by = one.fault.value + (f": {one.reason}" if one.reason else "")
    violation = one.violation
    return (
        f"{violation.kind} of {trip.ego} at {violation.time:.1f} s: {violation.detail} "
        f"(by the {by}; alone: {_ALONE[one.is_alone]})\n    {command(setting, trip.ego)}"
    )


def _by_oracle(ads: DriverSummary, sumo: DriverSummary) -> list[list[str]]:
    rows = []
    for kind in ads.by_oracle:
        row = [_named(kind, ads.by_oracle[kind].kinds.keys() | sumo.by_oracle[kind].kinds.keys())]
        for one in (ads.by_oracle[kind], sumo.by_oracle[kind]):
            is_asked = one.per_100_trips.value is not None
            apart = f"({one.by_fault['other']}, {one.by_fault['simulator']})" if is_asked else "-"
            row += [_rate(one.per_1000_km, 0), _rate(one.per_100_trips, 1), apart]
        rows.append(row)
    return rows


def _named(oracle: str, kinds: Collection[str]) -> str:
    """An oracle with those of its kinds that have other names."""
    others = sorted(set(kinds) - {oracle})
    return f"{oracle} (with {', '.join(others)})" if others else oracle


def _share(share: Share) -> str:
    return f"{share.count}/{share.total} = {share.value:.1%} [{share.low:.1%}, {share.high:.1%}]"


def _rate(rate: Rate, digits: int) -> str:
    if rate.value is None:
        return "-"
    return f"{rate.value:.{digits}f} [{rate.low:.{digits}f}, {rate.high:.{digits}f}]"


def _range(values: Quartiles) -> str:
    if values.median is None:
        return "-"
    return f"{values.median:.2f} [{values.low:.2f}, {values.high:.2f}] of {values.count}"


_ROWS: Sequence[tuple[str, Callable[[DriverSummary], str]]] = (
    ("trips driven", lambda one: str(one.trips)),
    ("ended by the simulator", lambda one: str(one.ended_by_simulator)),
    ("cut by the scenario's end or another route", lambda one: str(one.cut)),
    ("completed without a contact, of the others", lambda one: _share(one.completed)),
    ("km, up to a contact", lambda one: f"{one.km:.1f}"),
    ("at-fault collisions", lambda one: str(one.at_fault_collisions)),
    ("at-fault violations (of SUMO's driver, without destination)", lambda one: str(one.at_fault_violations)),
    ("per 1 000 km", lambda one: _rate(one.violations_per_1000_km, 0)),
    ("per 100 trips", lambda one: _rate(one.violations_per_100_trips, 1)),
    ("by others", lambda one: str(one.others_fault_violations)),
    ("by the simulator", lambda one: str(one.simulator_violations)),
    ("travel time / SUMO's driver, median [quartiles]", lambda one: _range(one.travel_time_ratio)),
    ("hard braking per 100 km", lambda one: _rate(one.hard_brakings_per_100_km, 1)),
    ("least time to collision [s], median [quartiles]", lambda one: _range(one.least_ttc)),
    ("trips with one below 1 s", lambda one: _share(one.ttc_below["1"])),
    ("below 2 s", lambda one: _share(one.ttc_below["2"])),
    ("below 3 s", lambda one: _share(one.ttc_below["3"])),
    (
        "SUMO's vehicles that stood for 2 min, per 100 h of theirs",
        lambda one: _rate(one.neighbours.stood_per_100_hours, 1),
    ),
    ("queues in which those stood, per 100 h", lambda one: _rate(one.neighbours.queues_per_100_hours, 1)),
    ("teleports of theirs, per 100 h", lambda one: _rate(one.neighbours.teleports_per_100_hours, 1)),
)


def _table(rows: Sequence[Sequence[str]]) -> str:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )
