"""Trips as users' files have them, however odd: driven to their ends without a violation, or refused in a line."""

from collections.abc import Callable
from pathlib import Path

import pytest
from small_scenarios import driven, scenario_file

from dvca_sumo.record import Record
from dvca_sumo.scenario import ScenarioError
from dvca_sumo.violations import Answer, Ending

LEFT = ("--lefthand",)
ROUND_THE_BLOCK = "A0A1 A1B1 B1B0 B0A0 A0A1 A1B1"
ROUND_THE_OTHER_WAY = "A0B0 B0B1 B1A1 A1A0 A0B0 B0B1"

# Two edges as short as a net can have them, in the middle of the road and at its end.
SHORT_NODES = "".join(
    f'<node id="{name}" x="{x}" y="0"/>' for name, x in zip("abcde", (0, 200, 203, 400, 404), strict=True)
)
SHORT_EDGES = "".join(f'<edge id="{name}" from="{name[0]}" to="{name[1]}"/>' for name in ("ab", "bc", "cd", "de"))


def ego(edges: str, **attributes: object) -> str:
    written = "".join(f' {name}="{value}"' for name, value in attributes.items())
    return f'<vehicle id="ego" depart="0"{written}><route edges="{edges}"/></vehicle>'


def assert_driven(config: Path) -> Record:
    record = driven(config)
    assert (record.violations, record.ending) == ([], Ending.ARRIVED)
    assert {judgement.answer for judgement in record.judgements} == {Answer.KEPT}
    assert record.stations[-1] - record.stations[0] == pytest.approx(
        record.route.destination - record.route.start, abs=3.0
    )
    return record


@pytest.mark.parametrize("edges", [ROUND_THE_BLOCK, ROUND_THE_OTHER_WAY], ids=["right turns", "left turns"])
@pytest.mark.parametrize("options", [(), LEFT], ids=["right-hand", "left-hand"])
def test_a_route_that_passes_the_same_edges_twice_is_driven_as_often(
    tmp_path: Path, grid_file: Callable[..., Path], options: tuple[str, ...], edges: str
) -> None:
    assert_driven(scenario_file(tmp_path, grid_file(*options), ego(edges, departSpeed="max")))


@pytest.mark.parametrize(
    "options",
    [
        {"lateral_resolution": "0.4"},
        {"lanechange__duration": "3"},
        {"no_internal_links": "true"},
        {"step_method__ballistic": "true"},
    ],
    ids=lambda options: next(iter(options)),
)
def test_whatever_model_sumo_is_set_to_the_ego_drives_beside_its_traffic(
    tmp_path: Path, street: Path, options: dict[str, str]
) -> None:
    others = '<flow id="o" from="ab" to="bc" begin="0" end="20" period="4"/>'
    config = scenario_file(tmp_path, street, ego("ab bc", departSpeed="max") + others, **options)
    assert_driven(config)


@pytest.mark.parametrize(
    ("edges", "attributes"),
    [
        ("ab bc cd", {"departSpeed": "max"}),
        ("ab bc cd de", {}),
        ("ab bc cd de", {"arrivalPos": 0}),
        ("bc cd de", {"departSpeed": "max"}),
    ],
    ids=["on the way", "at the end", "at the end's beginning", "at the start"],
)
def test_edges_shorter_than_the_ego(
    tmp_path: Path, plain_file: Callable[..., Path], edges: str, attributes: dict[str, object]
) -> None:
    assert_driven(scenario_file(tmp_path, plain_file(SHORT_NODES, SHORT_EDGES), ego(edges, **attributes)))


@pytest.mark.parametrize(
    "attributes",
    [
        {"departPos": 0},
        {"departPos": -1, "departSpeed": 0},
        {"departPos": "last"},
        {"departEdge": 1, "departPos": 20},
        {"departPos": 20, "arrivalPos": "-1000"},
        {"departPos": 20, "arrivalPos": "center"},
    ],
    ids=str,
)
def test_a_trip_may_begin_and_end_anywhere_on_its_edges(
    tmp_path: Path, street: Path, attributes: dict[str, object]
) -> None:
    assert_driven(scenario_file(tmp_path, street, ego("ab bc", **attributes)))


@pytest.mark.parametrize(
    ("attributes", "end"),
    [
        ({"arrivalEdge": 1}, (500.0, -1.6)),
        ({"arrivalEdge": 1, "departEdge": 1, "arrivalPos": 100}, (308.0, -4.8)),
        ({"arrivalEdge": 0, "departEdge": 1}, (500.0, -1.6)),
    ],
    ids=str,
)
def test_a_trip_ends_on_the_edge_of_its_route_where_it_shall_arrive(
    tmp_path: Path, street: Path, attributes: dict[str, object], end: tuple[float, float]
) -> None:
    record = assert_driven(scenario_file(tmp_path, street, ego("ab bc cb ba", departPos=20, **attributes)))
    assert (record.path[-1].x, record.path[-1].y) == pytest.approx(end, abs=6.0)


def test_a_trip_of_five_metres_from_rest_is_driven(tmp_path: Path, street: Path) -> None:
    assert_driven(scenario_file(tmp_path, street, ego("bc", departPos=20, departSpeed=0, arrivalPos=25)))


@pytest.mark.parametrize(("speed", "arrival"), [(0, 20), (0, 22), (10, 25), (13.9, 27)])
def test_a_trip_without_room_to_stop_at_its_destination_is_refused(
    tmp_path: Path, street: Path, speed: float, arrival: float
) -> None:
    config = scenario_file(tmp_path, street, ego("bc", departPos=20, departSpeed=speed, arrivalPos=arrival))
    with pytest.raises(ScenarioError, match=r"'ego' departs \d.\d m before its destination at .* too near to drive"):
        driven(config)


def test_an_ego_departs_within_the_law_however_fast_its_driver_was(tmp_path: Path, street: Path) -> None:
    hasty = '<vType id="hasty" speedFactor="1.6"/>'
    config = scenario_file(tmp_path, street, hasty + ego("ab bc", type="hasty", departPos=80, departSpeed="max"))
    assert driven(config).path[0].speed == pytest.approx(13.9)
    assert_driven(config)
