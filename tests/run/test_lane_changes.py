"""A healthy ego that has to change lanes for its route in dense traffic, on real libsumo."""

from collections.abc import Callable
from pathlib import Path

import pytest
from small_scenarios import driven, scenario_file

from dvca_sumo.violations import Ending

# Three lanes, of which the leftmost alone turns left.
NODES = "".join(
    f'<node id="{name}" x="{x}" y="{y}"/>'
    for name, x, y in (("a", 0, 0), ("b", 500, 0), ("c", 900, 0), ("d", 500, 300))
)
EDGES = "".join(
    f'<edge id="{name}" from="{name[0]}" to="{name[1]}" numLanes="{lanes}" speed="13.9"/>'
    for name, lanes in (("ab", 3), ("bc", 2), ("bd", 1))
)
CONNECTIONS = "".join(
    f'<connection from="ab" to="{to}" fromLane="{lane}" toLane="{onto}"/>'
    for to, lane, onto in (("bc", 0, 0), ("bc", 1, 1), ("bd", 2, 0))
)
EGO = '<vehicle id="ego" depart="40" departLane="0" departSpeed="max"><route edges="ab bd"/></vehicle>'


def flow(lane: int, period: float) -> str:
    edges = "ab bd" if lane == 2 else "ab bc"
    return (
        f'<flow id="on{lane}" begin="{lane}" end="160" period="{period}" departLane="{lane}" departSpeed="max">'
        f'<route edges="{edges}"/></flow>'
    )


def parked(edges: str, lane: str, front: int, spacing: int, count: int) -> str:
    """Cars that stand on a lane for the whole run, the first with its front at `front` [m]."""
    return "".join(
        f'<vehicle id="q{row}" depart="0" departLane="{lane[-1]}" departPos="{place}"><route edges="{edges}"/>'
        f'<stop lane="{lane}" startPos="{place - 7}" endPos="{place}" duration="500"/></vehicle>'
        for row, place in enumerate(range(front, front - spacing * count, -spacing))
    )


@pytest.mark.parametrize("period", [3.0, 5.0])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_ego_gets_over_two_lanes_to_its_turn_without_troubling_anybody(
    tmp_path: Path, plain_file: Callable[..., Path], period: float, seed: int
) -> None:
    traffic = flow(0, period) + flow(1, period) + flow(2, period)
    config = scenario_file(tmp_path, plain_file(NODES, EDGES, CONNECTIONS), traffic + EGO)
    record = driven(config, seed=seed)
    assert record.violations == []
    assert record.ending is Ending.ARRIVED
    assert [len(change.lanes) for change in record.route.lane_changes] == [3]


def test_ego_waits_in_its_lane_when_nobody_leaves_a_gap(tmp_path: Path, plain_file: Callable[..., Path]) -> None:
    standing = parked("ab bd", "ab_2", 495, 7, 60)
    config = scenario_file(tmp_path, plain_file(NODES, EDGES, CONNECTIONS), standing + EGO, end="110")
    record = driven(config)
    assert record.path[-1].speed == 0.0
    assert not any(one.kind == "collision" for one in record.violations)
    assert 400.0 < record.path[-1].x < 500.0


def test_ego_that_finds_no_gap_before_a_junction_changes_lanes_behind_it(
    tmp_path: Path, plain_file: Callable[..., Path]
) -> None:
    edges = EDGES.replace('id="ab" from="a"', 'id="eb" from="e"')
    before = '<edge id="ae" from="a" to="e" numLanes="3" speed="13.9"/>'
    connections = CONNECTIONS.replace('from="ab"', 'from="eb"')
    net = plain_file(NODES + '<node id="e" x="200" y="0"/>', edges + before, connections)
    standing = parked("ae eb bd", "ae_2", 195, 8, 24)
    ego = '<vehicle id="ego" depart="20" departLane="1" departSpeed="max"><route edges="ae eb bd"/></vehicle>'
    record = driven(scenario_file(tmp_path, net, standing + ego))
    assert record.violations == []
    assert record.ending is Ending.ARRIVED


def test_ego_passes_a_queue_that_turns_off_and_goes_on_past_the_signals(
    tmp_path: Path, plain_file: Callable[..., Path]
) -> None:
    nodes = "".join(
        f'<node id="{name}" x="{x}" y="{y}"{kind}/>'
        for name, x, y, kind in (
            ("a", 0, 0, ""),
            ("b", 600, 0, ' type="traffic_light"'),
            ("c", 1000, 0, ""),
            ("d", 600, -300, ""),
        )
    )
    edges = "".join(
        f'<edge id="{name}" from="{name[0]}" to="{name[1]}" numLanes="{lanes}" speed="13.9"/>'
        for name, lanes in (("ab", 2), ("bc", 2), ("bd", 1), ("db", 1))
    )
    connections = "".join(
        f'<connection from="{one}" to="{to}" fromLane="{lane}" toLane="{onto}"/>'
        for one, to, lane, onto in (("ab", "bd", 0, 0), ("ab", "bc", 0, 0), ("ab", "bc", 1, 1), ("db", "bc", 0, 0))
    )
    standing = parked("ab bd", "ab_0", 588, 8, 40)
    ego = '<vehicle id="ego" depart="20" departLane="0" departSpeed="max"><route edges="ab bc"/></vehicle>'
    record = driven(scenario_file(tmp_path, plain_file(nodes, edges, connections), standing + ego))
    assert record.violations == []
    assert record.ending is Ending.ARRIVED
