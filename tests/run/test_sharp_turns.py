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
