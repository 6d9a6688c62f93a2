"""Who swings out beyond the edge of its lane, to turn back, is still in the way of the traffic behind."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import shapely
from small_scenarios import scenario_file
from watched_world import STEP, asked

from dvca_sumo.world.inset import Inset

NODES = '<node id="b" x="0" y="0"/><node id="c" x="300" y="0"/>'
EDGES = '<edge id="bc" from="b" to="c" speed="13.9"/>'
TRAFFIC = """<trip id="ego" from="bc" to="bc" depart="0" departPos="100" departSpeed="5"/>
             <trip id="behind" from="bc" to="bc" depart="0" departPos="60" departSpeed="5"/>"""
MIDDLE = shapely.LineString([(0.0, 0.0), (100.0, 0.0)])


@pytest.mark.parametrize(("aside", "leader"), [(2.0, "ego"), (3.0, "ego"), (4.5, "ego"), (7.0, "")])
def test_who_is_behind_follows_an_ego_that_swings_out_but_not_one_that_has_left_the_road(
    tmp_path: Path, plain_file: Callable[..., Path], aside: float, leader: str
) -> None:
    config = scenario_file(tmp_path, plain_file(NODES, EDGES), TRAFFIC)

    def followed(libsumo: Any) -> str:
        found: tuple[str, float] | None = libsumo.vehicle.getLeader("behind", 100.0)
        return found[0] if found else ""

    steps = round(aside / 0.5 / STEP)
    assert asked(config, steps, followed, speed=2.0, left=-0.5) == leader


def test_a_place_beside_the_lane_is_told_where_body_and_lane_overlap_until_they_do() -> None:
    inset = Inset()
    assert inset.at(50.0, -3.0, MIDDLE, 2.5, is_on_lane=True) == (50.0, -3.0)  # SUMO has another lane for it
    assert inset.at(50.0, -3.0, MIDDLE, 2.5, is_on_lane=False) == pytest.approx((50.0, -2.3))
    assert inset.at(51.0, 3.0, MIDDLE, 2.5, is_on_lane=True) == pytest.approx((51.0, 2.3))
    assert inset.at(52.0, 2.2, MIDDLE, 2.5, is_on_lane=True) == (52.0, 2.2)
    assert inset.at(53.0, 3.0, MIDDLE, 2.5, is_on_lane=True) == (53.0, 3.0)
