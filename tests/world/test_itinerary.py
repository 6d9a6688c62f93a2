"""SUMO is told where an ego goes: it announces it at junctions, so that others yield, wherever its body has been."""

from collections.abc import Callable
from pathlib import Path

import pytest
from small_scenarios import in_child, scenario_file
from watched_world import STEP

from dvca_sumo.messages import ControlCommand, PoseStep
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.scenario import load_scenario
from dvca_sumo.world import VehicleLimits, World
from dvca_sumo.world.itinerary import Itinerary

LOOP = ("ab", "bc", "ca", "ab", "bd")
NODES = (
    '<node id="a" x="0" y="0"/><node id="b" x="200" y="0" type="priority"/><node id="c" x="400" y="0"/>'
    '<node id="s" x="200" y="-200"/>'
)
EDGES = "".join(
    f'<edge id="{way}" from="{way[0]}" to="{way[1]}" priority="{1 if "s" in way else 3}" numLanes="1" speed="13.9"/>'
    for way in ("ab", "ba", "bc", "cb", "sb", "bs")
)
DRIVERS = (
    '<trip id="ego" from="ab" to="bc" depart="0" departPos="20" departSpeed="0"/>'
    '<trip id="foe" from="sb" to="bc" depart="0" departPos="17" departSpeed="10"/>'
)


@pytest.mark.parametrize("swing", [[], [0.4] * 10 + [0.0] * 20 + [-0.4] * 10])
def test_who_must_wait_for_the_ego_does_so_also_after_it_has_been_off_its_lane(
    tmp_path: Path, plain_file: Callable[..., Path], swing: list[float]
) -> None:
    net = plain_file(NODES, EDGES)
    scenario = load_scenario(scenario_file(tmp_path, net, DRIVERS))

    def job() -> tuple[float, float]:
        world = World(scenario, tmp_path)
        entry = world.await_ego((), lambda _: True)
        roadmap = RoadMap.load(net)
        ego = world.adopt(entry, roadmap.route(entry.edges, entry.lane, entry.position, None, 150.0), VehicleLimits())
        crossed = {"ego": 0.0, "foe": 0.0}  # [s]
        for left in swing + [0.0] * 300:
            ego.vehicle.advance(ControlCommand(world.time, 0.0, 0.0, PoseStep(10.0 * STEP, left, 0.0, 0.0)), STEP)
            world.advance()
            objects = world.observe(ego).objects
            places = {"ego": ego.truth.x}
            if "foe" in objects.ids:
                places["foe"] = float(objects.boxes[objects.ids.index("foe"), 0])
            for name, x in places.items():
                if x > 205.0 and not crossed[name]:
                    crossed[name] = world.time
        return crossed["ego"], crossed["foe"]

    first, second = in_child(job)
    assert 0.0 < first < second - 1.0


def test_a_trip_goes_on_from_where_it_is_taken_to_be() -> None:
    itinerary = Itinerary(LOOP, "r")
    assert itinerary.onward(("bc",)) == ("bc", "ca", "ab", "bd")
    assert itinerary.onward(("xb", "bc")) == ("xb", "bc", "ca", "ab", "bd")
    assert itinerary.onward(("ab", "bc")) == LOOP
    assert itinerary.onward(("ca", "xx")) == ()
    assert itinerary.onward(("xb",)) == ()


def test_a_trip_that_comes_by_an_edge_again_is_not_begun_anew() -> None:
    itinerary = Itinerary(LOOP, "r")
    for edge in ("ab", ":b_0", "bc", ":c_0", "ca", "ab"):
        itinerary.reach(edge)
    assert itinerary.onward(("ab",)) == ("ab", "bd")
    assert itinerary.onward(("bc",)) == ()
