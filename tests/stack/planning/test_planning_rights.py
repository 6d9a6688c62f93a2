"""Who goes first on a junction of one-lane roads, where one lane leads both before the ego and behind it."""

from collections.abc import Callable

import pytest
from planned_drives import SHAPE, predicted

from dvca_sumo.roadmap import RoadMap
from dvca_sumo.stack.planning import PlanningConfig
from dvca_sumo.stack.planning.junctions import Junctions, has_priority

ARMS = {"w": (-100, 0), "e": (100, 0), "n": (0, 100), "s": (0, -100)}


@pytest.fixture(scope="module")
def cross(plain: Callable[..., RoadMap]) -> RoadMap:
    nodes = "".join(f'<node id="{arm}" x="{x}" y="{y}"/>' for arm, (x, y) in ARMS.items())
    edges = "".join(f'<edge id="{arm}c" from="{arm}" to="c"/><edge id="c{arm}" from="c" to="{arm}"/>' for arm in ARMS)
    return plain(nodes + '<node id="c" x="0" y="0" type="right_before_left"/>', edges)


@pytest.mark.parametrize(
    ("way", "expected"),
    [("ec cw", True), ("ec cn", True), ("ec cs", False), ("sc cn", True), ("nc cs", False), ("ec", True)],
    ids=["oncoming", "merging", "oncoming that turns left, too", "from the right", "from the left", "not on it yet"],
)
def test_a_left_turn_gives_way_to_whose_own_way_goes_first(cross: RoadMap, way: str, expected: bool) -> None:  # noqa: FBT001
    route = cross.route(["wc", "cn"], "wc_0", 10.0, None, 50.0)
    line = route.stop_lines[0]
    views = Junctions(route, SHAPE, PlanningConfig()).step(
        0.0, line.station - 10.0, line.station - 15.0, 8.0, {}, predicted([], 0.0).objects
    )
    edges = way.split()
    lanes: tuple[str, ...] = ("ec_0",)
    if len(edges) > 1:
        theirs = cross.route(edges, f"{edges[0]}_0", 10.0, None, 50.0)
        lanes = tuple(dict.fromkeys(theirs.lane_ids))
    assert has_priority(views, line.station, line.exit_station, lanes) is expected
