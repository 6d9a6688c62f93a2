"""Where lanes lead on, among edges so short that there are more ways than can be looked at."""

import subprocess
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
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


def net(folder: Path, *options: str) -> RoadMap:
    command = [sumolib.checkBinary("netgenerate"), "--grid", *options, "-o", "net.xml"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)  # noqa: S603 - SUMO's own program
    return RoadMap.load(folder / "net.xml")


def test_a_turn_is_one_though_its_way_across_the_junction_has_a_place_to_wait_at(tmp_path: Path) -> None:
    signals = ("--default-junction-type", "traffic_light", "--default.junctions.radius", "15", "--no-turnarounds")
    roadmap = net(tmp_path, "--grid.number=3", "--grid.length=150", *signals)
    found = Continuations(roadmap, 3).of("B0B1_0", 200.0, Traffic.CARS)
    probabilities = {lanes[-1]: probability for probability, lanes in found}
    assert probabilities == pytest.approx({"B1A1_0": 0.2, "B1B2_0": 0.6, "B1C1_0": 0.2})
    assert [len(lanes) for _, lanes in found if lanes[-1] == "B1A1_0"] == [4]


def test_among_short_edges_the_search_ends_and_reaches_as_far(tmp_path: Path) -> None:
    roadmap = net(tmp_path, "--grid.number=14", "--grid.length=13")
    found = Counted(roadmap, 3).of("A6B6_0", 280.0, Traffic.CARS)
    assert len(found) >= 3
    assert sum(probability for probability, _ in found) <= 1.0 + 1e-9
    for probability, lanes in found:
        assert probability > 0.0
        assert lanes[0] == "A6B6_0"
        assert all(after in roadmap.lanes[lane].successors for lane, after in pairwise(lanes))
        assert sum(roadmap.lanes[lane].line.length for lane in lanes) >= 280.0
