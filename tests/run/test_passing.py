"""A healthy ego behind somebody slow, with a second lane beside, on real libsumo."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from small_scenarios import driven, scenario_file

from dvca_sumo.violations import Ending

NODES = '<node id="a" x="0" y="0"/><node id="b" x="600" y="0"/><node id="c" x="1200" y="0"/>'
EDGES = "".join(f'<edge id="{name}" from="{name[0]}" to="{name[1]}" numLanes="2" speed="20"/>' for name in ("ab", "bc"))
TYPES = '<vType id="tractor" maxSpeed="8" length="7" laneChangeModel="LC2013" lcStrategic="-1" lcSpeedGain="0"/>'
TRACTOR = (
    '<vehicle id="tractor" type="tractor" depart="0" departLane="0" departPos="60" departSpeed="max">'
    '<route edges="ab bc"/></vehicle>'
)
EGO = '<vehicle id="ego" depart="4" departLane="0" departSpeed="max" arrivalPos="500"><route edges="ab bc"/></vehicle>'


@pytest.mark.parametrize("period", ['number="0"', 'period="4"', 'period="8"'])
@pytest.mark.parametrize("seed", [1, 2])
def test_ego_passes_a_tractor_without_troubling_anybody(
    tmp_path: Path, plain_file: Callable[..., Path], period: str, seed: int
) -> None:
    flow = f'<flow id="on1" begin="0" end="120" {period} departLane="1" departSpeed="max"><route edges="ab bc"/></flow>'
    config = scenario_file(tmp_path, plain_file(NODES, EDGES), TYPES + TRACTOR + flow + EGO)
    record = driven(config, seed=seed)
    assert record.violations == []
    assert record.ending is Ending.ARRIVED
    assert record.path[-1].time - record.path[0].time < 85.0  # 1 100 m: 138 s at the tractor's speed, 55 s without it
    offsets = np.array([point.y for point in record.path])
    assert offsets.max() - offsets.min() == pytest.approx(3.2, abs=0.5)
    assert offsets[-1] == pytest.approx(offsets[0], abs=0.3)
