"""Small screenings on the street."""

from collections.abc import Iterable
from functools import partial
from pathlib import Path

from small_scenarios import in_child, scenario_file

from dvca_sumo.scenario import AUTO, Scenario, load_scenario
from dvca_sumo.screen.driving import Driven, driven
from dvca_sumo.screen.trips import Draw, drawn
from dvca_sumo.stack.sources import StackSource

# Two cars that go the same way one after the other, two that cross, and some that are none.
TRAFFIC = """
<vType id="bus" vClass="bus"/>
<trip id="first" from="ab" to="bc" depart="1"/>
<trip id="bus" type="bus" from="ab" to="bc" depart="2"/>
<trip id="second" from="ab" to="bc" depart="8"/>
<trip id="north" from="cb" to="bn" depart="9"/>
<trip id="east" from="cb" to="ba" depart="11"/>
<trip id="short" from="nb" to="bs" depart="12"/>
<trip id="stopping" from="ab" to="bc" depart="13"><stop lane="bc_0" endPos="90" duration="9"/></trip>
"""
HEAR = lambda time, done: None  # noqa: E731, ARG005


def traffic(folder: Path, street: Path, routes: str = TRAFFIC, **options: str) -> Scenario:
    """The scenario of some trips on the street."""
    return load_scenario(scenario_file(folder, street, routes, **options), AUTO)


def draw(scenario: Scenario, count: int) -> Draw:
    """Trips of it."""
    return in_child(partial(drawn, scenario, count))


def drive(scenario: Scenario, egos: Iterable[str], concurrent: int = 10, stack: str | None = None) -> Driven:
    """Those egos' trips, in one simulation."""
    trips = [trip for trip in draw(scenario, 10).trips if trip.ego in set(egos)]
    return in_child(partial(driven, scenario, StackSource(stack), trips, concurrent, HEAR))
