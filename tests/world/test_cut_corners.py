"""Where an ego cuts a corner that the lanes drive out, who is behind stops behind its rear, not behind a length."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from small_scenarios import in_child, scenario_file
from watched_world import STEP

from dvca_sumo.geometry.boxes import box_of, distances
from dvca_sumo.messages import ControlCommand, PoseStep
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.scenario import load_scenario
from dvca_sumo.world import VehicleLimits, World

NODES = '<node id="a" x="0" y="0"/><node id="b" x="100" y="0" radius="0.5"/><node id="c" x="{}" y="{}"/>'
EDGES = '<edge id="ab" from="a" to="b" speed="13.9"/><edge id="bc" from="b" to="c" speed="13.9"/>'
TRAFFIC = """
<trip id="ego" from="ab" to="bc" depart="0" departPos="80" departSpeed="0"/>
<trip id="other" from="ab" to="bc" depart="2" departPos="0" departSpeed="max"/>
"""


@pytest.mark.parametrize("end", [(100, -100), (40, -80), (30, -30)])
@pytest.mark.parametrize("beyond", [0.5, 2.0, 4.0])
def test_who_is_behind_an_ego_in_a_cut_corner_stops_behind_it(
    tmp_path: Path, plain_file: Callable[..., Path], end: tuple[int, int], beyond: float
) -> None:
    """Its front stands `beyond` [m] the begin of the second road."""
    net = plain_file(NODES.format(*end), EDGES)
    scenario = load_scenario(scenario_file(tmp_path, net, TRAFFIC), "ego")

    def job() -> list[float]:
        world = World(scenario, tmp_path)
        entry = world.await_ego((), lambda _: True)
        route = RoadMap.load(net).route(entry.edges, entry.lane, entry.position, None, 60.0)
        ego = world.adopt(entry, route, VehicleLimits())
        second = route.lane_ids.index("bc_0")
        stop = float(route.line.stations[second]) + beyond - ego.shape.front
        begin, gaps = ego.station(), []
        for step in range(250):
            goal = route.line.poses([min(begin + 0.3 * step, stop)])[0]
            truth = ego.truth
            dx, dy, cos, sin = goal[0] - truth.x, goal[1] - truth.y, np.cos(truth.heading), np.sin(truth.heading)
            move = PoseStep(cos * dx + sin * dy, cos * dy - sin * dx, float(goal[2] - truth.heading), 0.0)
            ego.vehicle.advance(ControlCommand(world.time, 0.0, 0.0, move), STEP)
            world.advance()
            moment = world.observe(ego)
            own = box_of(ego.truth.x, ego.truth.y, ego.truth.heading, ego.shape)
            gaps.append(float(distances(own, moment.objects.boxes).min(initial=100.0)))
        return gaps

    gaps = in_child(job)
    assert gaps[-1] < 10.0
    assert min(gaps) > 0.5
