"""Where random faults are planted: drives that are clean as long as nothing is wrong."""

import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import msgspec
import numpy as np

from dvca_sumo import api
from dvca_sumo.bench.runs import TIMEOUT, Setting, driven
from dvca_sumo.engine.processes import Failure, isolated
from dvca_sumo.installation import scenario_path
from dvca_sumo.record import Record
from dvca_sumo.report.result import versions
from dvca_sumo.scenario import AUTO, NoEgoError, Scenario, ScenarioError, last_departure, read_configuration
from dvca_sumo.store import Store, key_of
from dvca_sumo.violations import Answer, Ending

_BEGINS = 12  # of a scenario that names no ego
_NEAR = 30.0  # [m] an object that comes so near to the ego may matter to it
_MOST = 10  # such objects, the nearest


class Place(msgspec.Struct, frozen=True):
    """Which drive."""

    scenario: str
    ego: str | None = None
    begin: float | None = None  # [s]

    def __str__(self) -> str:
        words = [self.scenario, *(["--ego", self.ego] if self.ego else [])]
        return " ".join(words if self.begin is None else [*words, "--begin", f"{self.begin:.12g}"])


class HealthyDrive(msgspec.Struct, frozen=True):
    """A drive without any fault."""

    place: Place
    complaint: str  # what was wrong all the same; empty: clean
    duration: float  # [s]
    objects: tuple[str, ...]  # that came near


BUILT_IN = tuple(Place(f"nets/cs{number}.sumocfg") for number in range(1, 6))


def places_of(sumocfg: Path, ego: str | None, begin: float | None) -> tuple[Place, ...]:
    """The drives of a user's scenario.

    The one that `ego` and `begin` [s] ask for, or that of the scenario's own ego. Where the choice of the
    ego is left open, and that of the time too, several: one at each of `_BEGINS` times spread over the traffic.

    Raises:
        ScenarioError: The scenario cannot be run as given.
    """
    if ego is None:
        try:
            api.load_scenario(sumocfg, begin=begin)
        except NoEgoError:
            ego = AUTO
    scenario = api.load_scenario(sumocfg, ego, begin=begin)
    if ego != AUTO or begin is not None:
        return (Place(str(sumocfg), ego, begin),)
    return tuple(Place(str(sumocfg), AUTO, time) for time in _spread(scenario))


def contents_of(scenario: str) -> tuple[str, ...]:
    """Digests of the files that a drive in `scenario` is read from; none of what cannot be read: its run says why."""
    try:
        return read_configuration(scenario_path(Path(scenario))).contents
    except ScenarioError:
        return ()


def healthy_drives(
    places: Sequence[Place], setting: Setting, jobs: int, store: Store[HealthyDrive] | None
) -> list[HealthyDrive]:
    """The drives without a fault, in the order of their places; `jobs` at once.

    Raises:
        ScenarioError: None of them is clean; the first one's complaint is told.
    """
    keys = [key_of([place, contents_of(place.scenario), setting.seed, setting.repeats, versions()]) for place in places]
    known = {row: kept for row, key in enumerate(keys) if store and (kept := store.find(key))}
    rows = [row for row in range(len(places)) if row not in known]
    for number, answer in isolated([partial(_healthy, places[row], setting) for row in rows], jobs, TIMEOUT):
        row = rows[number]
        if isinstance(answer, Failure):
            known[row] = HealthyDrive(places[row], str(answer.error or answer.reason), 0.0, ())
            continue
        known[row] = answer
        if store is not None:
            store.add(keys[row], answer)
    drives = [known[row] for row in range(len(places))]
    if all(drive.complaint for drive in drives):
        raise ScenarioError(f"no drive is clean without a fault: {drives[0].place}: {drives[0].complaint}")
    return drives


def _spread(scenario: Scenario) -> list[float]:
    latest = scenario.end if scenario.end is not None else last_departure(scenario.configuration)
    length = max(latest - scenario.begin, 0.0) / _BEGINS
    return sorted({float(round(scenario.begin + (row + 0.5) * length)) for row in range(_BEGINS)})


def _healthy(place: Place, setting: Setting) -> HealthyDrive:
    drive = driven(place.scenario, place.ego, place.begin, setting)
    drive.engine.close()
    record = drive.record
    return HealthyDrive(place, _complaint(record), record.moments[-1].time - record.start, _near(record))


def _complaint(record: Record) -> str:
    found = [f"{one.kind} at {one.time:.1f} s" for one in record.violations]
    found += [f"{one.kind} could not be told" for one in record.judgements if one.answer is Answer.UNKNOWN]
    if not found and record.ending is not Ending.ARRIVED:
        found.append("it does not arrive")
    return "; ".join(found)


def _near(record: Record) -> tuple[str, ...]:
    """Ids of the objects that came nearest, by id; only those that a word of `--fault` can hold."""
    closest: dict[str, float] = {}
    for moment in record.moments:
        gaps = np.hypot(moment.objects.boxes[:, 0] - moment.ego.x, moment.objects.boxes[:, 1] - moment.ego.y)
        for row in np.flatnonzero(gaps < _NEAR):
            name = moment.objects.ids[row]
            closest[name] = min(float(gaps[row]), closest.get(name, _NEAR))
    usable = [name for name in closest if not re.search(r"[,\s]", name)]
    return tuple(sorted(sorted(usable, key=lambda name: (closest[name], name))[:_MOST]))
