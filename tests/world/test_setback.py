"""An ego that creeps over the joint of two lanes is on one of them to SUMO, on the outer side of the angle, too."""

from collections.abc import Callable
from itertools import groupby
from pathlib import Path

import pytest
from small_scenarios import in_child, scenario_file
from watched_world import STEP

from dvca_sumo.messages import ControlCommand, PoseStep
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.scenario import load_scenario
from dvca_sumo.world import VehicleLimits, World
from dvca_sumo.world.setback import Setback

NODES = '<node id="a" x="0" y="0"/><node id="b" x="200" y="0"/><node id="c" x="300" y="{}"/>'
EDGES = '<edge id="ab" from="a" to="b" speed="13.9"/><edge id="bc" from="b" to="c" speed="13.9"/>'
EGO = '<trip id="ego" from="ab" to="bc" depart="0" departPos="190" departSpeed="0"/>'


@pytest.mark.parametrize("rise", [60, 100, 200])
def test_an_ego_that_creeps_over_a_joint_is_lost_for_a_moment_at_most(
    tmp_path: Path, plain_file: Callable[..., Path], rise: int
) -> None:
    net = plain_file(NODES.format(rise), EDGES)
    scenario = load_scenario(scenario_file(tmp_path, net, EGO))

    def job() -> list[str]:
        import libsumo  # noqa: PLC0415

        world = World(scenario, tmp_path)
        entry = world.await_ego((), lambda _: True)
        roadmap = RoadMap.load(net)
        ego = world.adopt(entry, roadmap.route(entry.edges, entry.lane, entry.position, None, 80.0), VehicleLimits())
        lanes = []
        for left in [-0.05] * 24 + [0.0] * 246:
            ego.vehicle.advance(ControlCommand(world.time, 0.0, 0.0, PoseStep(0.05, left, 0.0, 0.0)), STEP)
            world.advance()
            lanes.append(libsumo.vehicle.getLaneID("ego"))
        return lanes

    lanes = in_child(job)
    assert max((len(list(run)) for lane, run in groupby(lanes) if not lane), default=0) <= 4


def test_a_place_is_told_further_behind_until_a_lane_is_found_and_kept_there() -> None:
    setback = Setback()
    assert setback.at(0.0, 0.0, 0.0, is_on_lane=True) == 0.0
    assert setback.at(0.0, 0.0, 0.0, is_on_lane=False) == 0.5
    assert setback.at(0.0, 0.0, 0.0, is_on_lane=False) == 1.0
    assert setback.at(0.3, 0.0, 1.0, is_on_lane=True) == 1.0
    assert setback.at(1.1, 0.0, 1.0, is_on_lane=True) == 0.0


def test_who_is_beside_the_road_is_where_it_is() -> None:
    setback = Setback()
    told = [setback.at(0.0, 0.0, 0.0, is_on_lane=False) for _ in range(8)]
    assert told[:5] == [0.5, 1.0, 1.5, 2.0, 0.0]
    assert set(told[5:]) == {0.0}
    assert Setback().at(0.0, 0.0, 5.0, is_on_lane=False) == 0.0
