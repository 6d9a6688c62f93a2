"""Where lanes lead on, among edges so short that there are more ways than can be looked at."""

import subprocess
from itertools import pairwise
from pathlib import Path
from typing import Any

import sumolib

from dvca_sumo.roadmap import RoadMap
from dvca_sumo.stack.continuations import Continuations, Traffic

MOST = 20_000  # steps of a search


class Counted(Continuations):
    steps = 0

    def _onward(self, end: Any) -> Any:
        self.steps += 1
        assert self.steps < MOST
        return super()._onward(end)


def test_among_short_edges_the_search_ends_and_reaches_as_far(tmp_path: Path) -> None:
    command = [sumolib.checkBinary("netgenerate"), "--grid", "--grid.number=14", "--grid.length=13", "-o", "net.xml"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)  # noqa: S603 - SUMO's own program
    roadmap = RoadMap.load(tmp_path / "net.xml")
    found = Counted(roadmap, 3).of("A6B6_0", 280.0, Traffic.CARS)
    assert len(found) >= 3
    assert sum(probability for probability, _ in found) <= 1.0 + 1e-9
    for probability, lanes in found:
        assert probability > 0.0
        assert lanes[0] == "A6B6_0"
        assert all(after in roadmap.lanes[lane].successors for lane, after in pairwise(lanes))
        assert sum(roadmap.lanes[lane].line.length for lane in lanes) >= 280.0
