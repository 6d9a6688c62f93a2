"""Which trips are driven: a stratified, seeded draw from the scenario's own departures."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence

import msgspec

from dvca_sumo.engine.replay import roadmap
from dvca_sumo.geometry.randomness import key_of, uniforms
from dvca_sumo.roadmap import RoadMapError, RouteError
from dvca_sumo.run import Departing, free_flow, opened, patience
from dvca_sumo.scenario import Scenario, ScenarioError
from dvca_sumo.stack.reference import reference_stack
from dvca_sumo.world import Entry, World

USUAL, SHORTEST = 300.0, 100.0  # [m] of a trip, and where there are too few so long
FREE_FLOW, MARGIN = 1.5, 60.0  # so many times its free-flow time and so many seconds, and a trip must be over
SLOWER = 1.5  # times what SUMO's driver takes, an ego may take
LONGEST_WINDOW = 7200.0  # [s] of departures that are looked at where nothing says when the scenario ends

_STREAM = 201
_WINDOWS = 10  # of departure time
_CELLS = 4  # by so many the area is divided


class Trip(msgspec.Struct, frozen=True):
    """One vehicle's trip, as SUMO's own traffic makes it."""

    ego: str
    departs: float  # [s]
    length: float  # [m]
    free_flow: float  # [s] at the speed limits
    expected: float  # [s] that SUMO's driver took in the plain traffic; from free flow for one with stops of its own


class Draw(msgspec.Struct, frozen=True):
    """The trips drawn, by departure, and what the others were."""

    trips: tuple[Trip, ...]
    departures: int
    refused: dict[str, int]  # reason -> departures, of those that were looked at


class _Departure(msgspec.Struct, frozen=True):
    entry: Entry
    cells: tuple[tuple[int, int], tuple[int, int]]  # where it begins and ends
    window: int
    draw: float  # from 0 to 1


def drawn(scenario: Scenario, count: int) -> Draw:
    """Draw `count` trips, or as many as there are, in this process: one run of SUMO without any ADS.

    A trip is drivable when the vehicle is of a car's class and size, `--ego` accepts its name, its route is at least
    `SHORTEST` long and can be driven on the map, and it would be over before the scenario's end, and before an ego's
    patience is: where traffic stands for ever, no driver's way leads anywhere. SUMO's own driver says how long it takes
    (but for one with stops of its own). The draw goes round the time windows; in each the trip is taken that begins
    and ends where fewest of those taken before do, among equals the first by a draw keyed by the vehicle's name. Trips
    that are not `USUAL` in length are drawn likewise where the others are too few: of one junction, say.

    Raises:
        ScenarioError: SUMO refuses the scenario, or no trip is drivable.
    """
    departing = Departing(scenario, lambda name: roadmap(scenario.configuration.net, name), reference_stack)
    with opened(scenario) as world:
        entries, durations, refused = _departures(scenario, world, departing)
    trips: list[Trip] = []
    end = math.inf if scenario.end is None else scenario.end

    def taken(entries: Sequence[Entry], wanted: int, shortest: float) -> list[Entry]:
        """Draw so many trips; those that were passed over for nothing but their length."""
        shorter: list[Entry] = []

        def is_taken(entry: Entry) -> bool:
            trip = _trip(entry, departing, durations, end)
            if isinstance(trip, str):
                refused[trip] += 1
                return False
            if trip.length < shortest:
                shorter.append(entry)
                return False
            trips.append(trip)
            return True

        _spread(_placed(scenario, departing, entries), wanted, is_taken)
        return shorter

    departures = sum(refused.values()) + len(entries)
    shorter, usual = taken(entries, count, USUAL), len(trips)
    taken(shorter, count - usual, SHORTEST)
    left = len(shorter) - (len(trips) - usual)
    if left:
        refused[f"shorter than {USUAL:g} m"] += left
    if not trips:
        reasons = ", ".join(f"{number} {reason}" for reason, number in refused.most_common())
        raise ScenarioError(
            f"no trip to drive among {departures} departures from {scenario.begin:g} s on ({reasons or 'none at all'})"
        )
    trips.sort(key=lambda trip: (trip.departs, trip.ego))
    return Draw(tuple(trips), departures, dict(refused))


def _departures(
    scenario: Scenario, world: World, departing: Departing
) -> tuple[list[Entry], dict[str, float], Counter[str]]:
    entries: dict[str, Entry] = {}
    durations: dict[str, float] = {}
    refused: Counter[str] = Counter()
    end = scenario.begin + LONGEST_WINDOW if scenario.end is None else scenario.end
    while world.time < end and not world.is_exhausted:
        world.advance()
        for name in world.departed():
            entry = departing.entry(name, world)
            objection = _objection(entry, departing)
            if objection:
                refused[objection] += 1
            else:
                entries[name] = entry
        for name in world.arrived():
            if name in entries and not entries[name].stops:  # which its trip goes without
                durations[name] = world.time - entries[name].time
    return list(entries.values()), durations, refused


def _objection(entry: Entry, departing: Departing) -> str:
    """Why a departure is not looked at any further; empty if it is."""
    if entry.why_no_car:
        return entry.why_no_car
    if not departing.definitions.has(entry.ego):
        return "not named in the scenario's files"
    try:
        departing.edges(entry)
    except ScenarioError:
        return "without a known destination"
    return ""


def _trip(entry: Entry, departing: Departing, durations: Mapping[str, float], end: float) -> Trip | str:
    """The trip, or why it is none."""
    try:
        route = departing.route(entry)
    except ScenarioError:
        return "without a known destination"
    except (RouteError, RoadMapError):
        return "without a drivable route"
    length = route.destination - route.start
    if length < SHORTEST:
        return f"shorter than {SHORTEST:g} m"
    freely = free_flow(route)
    usual = FREE_FLOW * freely
    expected = durations.get(entry.ego, usual if entry.stops else math.inf)
    if math.isinf(expected) or entry.time + max(expected, usual) + MARGIN > end:
        return "not over before the end"
    if SLOWER * expected > patience(freely):
        return "held up for longer than an ego's patience"
    return Trip(entry.ego, entry.time, length, freely, expected)


def _placed(scenario: Scenario, departing: Departing, entries: Sequence[Entry]) -> list[_Departure]:
    """Each departure with its stratum; edges are where their first lane has its middle."""
    if not entries:
        return []
    lanes = roadmap(scenario.configuration.net, "passenger").lanes

    def middle(edge: str) -> tuple[float, float]:
        points = lanes[f"{edge}_0"].line.points
        return float(points[:, 0].mean()), float(points[:, 1].mean())

    places = [(middle(edges[0]), middle(edges[-1])) for edges in map(departing.edges, entries)]
    xs, ys = ([place[axis] for pair in places for place in pair] for axis in (0, 1))
    times = [entry.time for entry in entries]

    def cell(place: tuple[float, float]) -> tuple[int, int]:
        return _part(place[0], xs, _CELLS), _part(place[1], ys, _CELLS)

    draws = uniforms(scenario.seed, _STREAM, 0, [key_of(entry.ego) for entry in entries], 1)[:, 0].tolist()
    return [
        _Departure(entry, (cell(start), cell(end)), _part(entry.time, times, _WINDOWS), draw)
        for entry, (start, end), draw in zip(entries, places, draws, strict=True)
    ]


def _part(value: float, values: Sequence[float], parts: int) -> int:
    """Which of so many equal parts of the range of `values` it is in."""
    low, high = min(values), max(values)
    return min(int(parts * (value - low) / (high - low)), parts - 1) if high > low else 0


def _spread(departures: Sequence[_Departure], count: int, is_taken: Callable[[Entry], bool]) -> None:
    """Offer departures, evenly spread over time and space, until so many are taken."""
    windows = [[one for one in departures if one.window == window] for window in range(_WINDOWS)]
    used: list[Counter[tuple[int, int]]] = [Counter(), Counter()]

    def crowding(one: _Departure) -> tuple[int, float, str]:
        return sum(counter[cell] for counter, cell in zip(used, one.cells, strict=True)), one.draw, one.entry.ego

    left = count
    while left and any(windows):
        for window in windows:
            while left and window:
                best = min(window, key=crowding)
                window.remove(best)
                if is_taken(best.entry):
                    left -= 1
                    for counter, cell in zip(used, best.cells, strict=True):
                        counter[cell] += 1
                    break
