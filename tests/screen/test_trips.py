"""Which trips are drawn, and how they are shared out among simulations."""

from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest
from screen_scenes import TRAFFIC, draw, traffic

from dvca_sumo.scenario import ScenarioError
from dvca_sumo.screen import trips
from dvca_sumo.screen.driving import planned
from dvca_sumo.screen.trips import MARGIN, SLOWER, Trip

FLOWS = "".join(
    f'<flow id="{start}{end}" from="{start}b" to="b{end}" begin="{begin}" period="10" number="12"/>'
    for start, end, begin in (("a", "c", 0), ("c", "a", 3), ("c", "n", 5))
)


def trip(ego: str, departs: float, expected: float = 60.0) -> Trip:
    return Trip(ego, departs, 500.0, 40.0, expected)


def test_cars_with_a_way_to_go_are_drawn_and_the_others_counted_by_reason(tmp_path: Path, street: Path) -> None:
    found = draw(traffic(tmp_path, street), 5)
    assert [one.ego for one in found.trips] == ["first", "second", "north", "east", "stopping"]
    assert [one.departs for one in found.trips] == sorted(one.departs for one in found.trips)
    assert found.departures == 7
    assert found.refused == {"of class bus": 1, "shorter than 300 m": 1}
    assert all(one.length > 300.0 and one.expected > 15.0 and one.free_flow > 15.0 for one in found.trips)


def test_trips_of_a_hundred_metres_are_drawn_where_longer_ones_are_too_few(tmp_path: Path, street: Path) -> None:
    found = draw(traffic(tmp_path, street), 6)
    assert [one.ego for one in found.trips] == ["first", "second", "north", "east", "short", "stopping"]
    assert found.refused == {"of class bus": 1}


@pytest.mark.parametrize("arrival", ["arrivalEdge", "arrivalPos"])
def test_a_trip_that_ends_where_sumo_alone_knows_is_not_drawn_and_the_others_are(
    tmp_path: Path, street: Path, arrival: str
) -> None:
    found = draw(traffic(tmp_path, street, TRAFFIC.replace('id="second"', f'id="second" {arrival}="random"')), 10)
    assert [one.ego for one in found.trips] == ["first", "north", "east", "short", "stopping"]
    assert found.refused == {"of class bus": 1, "without a known destination": 1}


def test_the_same_seed_draws_the_same_trips_and_another_seed_others(tmp_path: Path, street: Path) -> None:
    scenario = traffic(tmp_path, street, FLOWS)
    draws = [draw(msgspec.structs.replace(scenario, seed=seed), 6) for seed in (1, 1, 2)]
    names = [[one.ego for one in found.trips] for found in draws]
    assert names[0] == names[1] != names[2]
    assert len(names[0]) == 6


def test_trips_are_spread_over_time_and_space(tmp_path: Path, street: Path) -> None:
    found = draw(traffic(tmp_path, street, FLOWS.replace('"10"', '"6"')), 9)
    assert {one.ego.partition(".")[0] for one in found.trips} == {"ac", "ca", "cn"}
    times = [one.departs for one in found.trips]
    assert max(times) - min(times) > 45.0
    assert min(later - sooner for sooner, later in zip(times, times[2:], strict=False)) > 3.0


def test_a_trip_that_the_end_would_cut_is_not_drawn(tmp_path: Path, street: Path) -> None:
    found = draw(traffic(tmp_path, street, end="120"), 10)
    assert 0 < len(found.trips) < 6
    assert found.refused["not over before the end"] == 6 - len(found.trips)


def test_an_egos_patience_may_go_on_past_the_end_that_its_trip_is_over_before(
    tmp_path: Path, plain_file: Callable[..., Path]
) -> None:
    nodes = '<node id="w" x="0" y="0"/><node id="e" x="600" y="0"/>'
    lane = plain_file(nodes, '<edge id="we" from="w" to="e" speed="13.9"/>')
    slow = '<vType id="slow" maxSpeed="4.5"/><trip id="ego" type="slow" from="we" to="we" depart="1"/>'
    (endless,) = draw(traffic(tmp_path, lane, slow), 1).trips
    end = endless.departs + endless.expected + MARGIN + 1.0
    assert end < endless.departs + SLOWER * endless.expected
    assert draw(traffic(tmp_path, lane, slow, end=f"{end:g}"), 1).trips == (endless,)


@pytest.mark.parametrize(
    ("speed", "reason"),
    [("2", "held up for longer than an ego's patience"), ("0.01", "not over before the end")],
    ids=["late", "never"],
)
def test_a_trip_that_sumos_driver_takes_too_long_for_is_told_from_one_that_it_never_finishes(
    tmp_path: Path, street: Path, monkeypatch: pytest.MonkeyPatch, speed: str, reason: str
) -> None:
    monkeypatch.setattr(trips, "LONGEST_WINDOW", 400.0)
    slow = f'<vType id="slow" maxSpeed="{speed}"/><trip id="ego" type="slow" from="ab" to="bc" depart="1"/>'
    with pytest.raises(ScenarioError, match=f"no trip to drive .*1 {reason}"):
        draw(traffic(tmp_path, street, slow), 1)


@pytest.mark.parametrize(
    ("routes", "words"),
    [
        ('<trip id="b" type="t" from="ab" to="bc" depart="0"/>', "1 of class bus"),
        ('<trip id="b" type="l" from="ab" to="bc" depart="0"/>', "1 longer than 7 m"),
        ('<trip id="b" from="nb" to="bs" depart="0" departPos="last" arrivalPos="40"/>', "1 shorter than 100 m"),
        ("", "0 departures .*none at all"),
    ],
)
def test_a_scenario_without_a_trip_to_drive_says_why(tmp_path: Path, street: Path, routes: str, words: str) -> None:
    scenario = traffic(tmp_path, street, '<vType id="t" vClass="bus"/><vType id="l" length="12"/>' + routes, end="30")
    with pytest.raises(ScenarioError, match=f"no trip to drive .*{words}"):
        draw(scenario, 3)


def test_never_more_than_allowed_are_expected_to_overlap() -> None:
    trips = [trip(f"t{number}", 20.0 * number) for number in range(12)]
    for concurrent in (1, 2, 3):
        shared = planned(trips, concurrent)
        assert sorted(one.ego for some in shared for one in some) == sorted(one.ego for one in trips)
        for some in shared:
            for one in some:
                under_way = [other for other in some if other.departs <= one.departs < other.departs + 120.0]
                assert len(under_way) <= concurrent
    assert len(planned(trips, 12)) == 1
