"""Routes of real traffic through public nets, where a checkout has them beside it."""

import gzip
import re
from pathlib import Path

import numpy as np
import pytest
from soundness import check_sound

from dvca_sumo.roadmap import RoadMap

SCENARIOS = Path(__file__).resolve().parents[3] / "shared" / "scenarios"
SAMPLE = 30


def edge_lists(path: Path) -> list[list[str]]:
    text = gzip.decompress(path.read_bytes()).decode() if path.suffix == ".gz" else path.read_text()
    found = re.findall(r'<route [^>]*edges="([^"]+)"', text)
    return [edges.split() for edges in found[:: max(len(found) // SAMPLE, 1)]][:SAMPLE]


@pytest.mark.skipif(not SCENARIOS.is_dir(), reason="public scenarios are not beside this checkout")
@pytest.mark.parametrize(
    ("net", "routes"),
    [
        ("bologna_acosta/acosta_buslanes.net.xml", "bologna_acosta/acosta.rou.xml"),
        ("bologna_acosta_persontrips/acosta_peds.net.xml", "bologna_acosta/acosta.rou.xml"),
        ("a10_motorway/osm.net.xml", "a10_motorway/osm.passenger.rou.xml"),
        ("mantes_la_jolie/mantes.net.xml.gz", "mantes_la_jolie/mantes.rou.xml.gz"),
    ],
)
def test_every_sampled_route_is_sound_and_can_be_steered_by_a_car(net: str, routes: str) -> None:
    roadmap = RoadMap.load(SCENARIOS / net)
    curvatures = []
    for edges in edge_lists(SCENARIOS / routes):
        lanes = [lane for lane in roadmap.lanes.values() if lane.edge == edges[0] and lane.is_drivable]
        start = max(lanes, key=lambda lane: lane.index)
        route = roadmap.route(edges, start.id, min(5.0, 0.5 * start.length), None, 1e4)
        check_sound(route)
        assert np.abs(np.diff(route.line.headings)).max() < 1.5
        curvatures.append(np.abs(route.curvatures))
    assert len(curvatures) > 20
    assert np.concatenate(curvatures).max() < 0.2
