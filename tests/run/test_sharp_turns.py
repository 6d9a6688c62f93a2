"""A healthy ego in turns that the net draws sharper than a car can steer, on real libsumo."""

from collections.abc import Callable
from pathlib import Path

import pytest
from small_scenarios import driven, scenario_file

from dvca_sumo.violations import Ending


@pytest.mark.parametrize("options", [(), ("--default.lanenumber=2",), ("--no-internal-links",)])
@pytest.mark.parametrize(
    "edges",
    ["A1B1 B1A1 A1A0 A0B0 B0A0", "B0A0 A0A1 A1A0 A0B0", "A1A2 A2B2 B2A2 A2A1"],
    ids=["turns back", "right and left corner", "left and right corner"],
)
def test_ego_keeps_to_the_road(
    tmp_path: Path, grid_file: Callable[..., Path], edges: str, options: tuple[str, ...]
) -> None:
    ego = f'<vehicle id="ego" depart="0" departSpeed="10" departLane="best"><route edges="{edges}"/></vehicle>'
    record = driven(scenario_file(tmp_path, grid_file(*options), ego))
    assert record.ending is Ending.ARRIVED
    assert record.violations == []


@pytest.mark.parametrize("depart", [20.0, 21.0, 22.0, 23.0])
def test_ego_that_swings_out_to_turn_back_lets_others_pass_on_the_next_lane(
    tmp_path: Path, grid_file: Callable[..., Path], depart: float
) -> None:
    net = grid_file("--default.lanenumber=2")
    others = (
        '<flow id="on" begin="0" end="60" period="4" departLane="0" departSpeed="max"><route edges="A1B1 B1C1"/></flow>'
    )
    ego = f'<vehicle id="ego" depart="{depart}" departLane="1" departSpeed="max"><route edges="A1B1 B1A1"/></vehicle>'
    record = driven(scenario_file(tmp_path, net, others + ego))
    assert record.ending is Ending.ARRIVED
    assert record.violations == []
