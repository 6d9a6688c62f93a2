"""Who must wait for the ego does not do so for ever when it stands."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from small_scenarios import scenario_file
from watched_world import asked, objects_of, watched

from dvca_sumo.world.lingering import Lingering

NODES = (
    '<node id="a" x="0" y="0"/><node id="b" x="200" y="0" type="{kind}"/><node id="c" x="400" y="0"/>'
    '<node id="s" x="200" y="-200"/>'
)
EDGES = "".join(
    f'<edge id="{way}" from="{way[0]}" to="{way[1]}" priority="{1 if "s" in way else 3}" numLanes="1" speed="13.9"/>'
    for way in ("ab", "ba", "bc", "cb", "sb", "bs")
)
EGO = '<trip id="ego" from="ab" to="bc" depart="0" departPos="180" departSpeed="0"/>'
FOE = '<trip id="foe" from="sb" to="ba" depart="0" departPos="150" departSpeed="5"/>'


def test_who_stands_lets_others_go_after_twenty_seconds_unless_it_sets_off_between() -> None:
    lingering = Lingering()
    moves = {0.0, 5.0, 26.0}
    long = [time for time in np.arange(0.0, 40.0) if lingering.is_long(float(time), waits=time not in moves)]
    assert long == []
    assert lingering.is_long(47.0, waits=True)
    assert not lingering.is_long(48.0, waits=False)


def test_a_driver_who_has_to_wait_for_a_standing_ego_goes_after_a_while(
    tmp_path: Path, plain_file: Callable[..., Path]
) -> None:
    net = plain_file(NODES.format(kind="priority"), EDGES)
    moments = watched(scenario_file(tmp_path, net, EGO + FOE), 400)
    waits = [bool(moment.objects.boxes[objects_of(moment)["foe"], 1] < -5.0) for moment in moments[:350]]
    assert all(waits[:180])
    assert not waits[-1]


@pytest.mark.parametrize(("colour", "is_held"), [("r", True), ("G", False)])
def test_at_a_red_signal_an_ego_still_means_to_go(
    tmp_path: Path,
    plain_file: Callable[..., Path],
    colour: str,
    is_held: bool,  # noqa: FBT001
) -> None:
    net = plain_file(NODES.format(kind="traffic_light"), EDGES)
    light = f'<tlLogic id="b" programID="all" type="static"><phase duration="100" state="{colour * 20}"/></tlLogic>'
    config = scenario_file(tmp_path, net, EGO.replace("180", "190"), light)
    assert (asked(config, 250, lambda sumo: sumo.vehicle.getMaxSpeed("ego")) > 0.0) is is_held
