"""How the reference ADS drives networks that nobody drew: those of netgenerate, and roundabouts, with random trips.

    python benchmarks/generated.py FOLDER [--nets all_way_stop,left_hand] [--egos 60] [--seed 1] [--jobs 1]

Each net is built in FOLDER/NAME with its traffic (`randomTrips.py` of SUMO, turns back at dead ends included; people
on foot where there are pavements; lorries, buses and motorcycles among the cars where it is mixed), and screened as
`dvca-sumo screen` does it, between 100 s and 1100 s. Prints a line for each; which violations there were and how to
see them stands in FOLDER/NAME/out/screening.txt.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import roundabouts
import rows
import sumo
import sumolib

TYPE, LANES = "--default.junctions.type", "--default.lanenumber=2"
SIGNALS, WALKS = "--default-junction-type=traffic_light", ["--sidewalks.guess.from-permissions", "--crossings.guess"]
SPIDER = ["--spider", "--spider.arm-number=7", "--spider.circle-number=5", "--spider.space-radius=120"]
SMALL_SPIDER = ["--spider", "--spider.arm-number=5", "--spider.circle-number=3", "--spider.space-radius=130"]
RANDOM = ["--rand", "--rand.iterations=120"]
RANDOM_SIGNALS = [*RANDOM, "--rand.random-lanenumber", "--rand.random-priority", SIGNALS, "--turn-lanes=1"]
GRID = ["--grid", "--grid.number=5", "--grid.length=150"]
BLOCKS = ["--grid", "--grid.number=4", "--grid.length=200"]


class Net(NamedTuple):
    """One net and its traffic."""

    period: float  # [s] from one departure to the next
    options: list[str]  # of netgenerate
    is_mixed: bool = False
    is_sublane: bool = False
    round_lanes: int = 0  # of roundabouts; 0: none


NETS = {
    "all_way_stop": Net(1.5, [*GRID, f"{TYPE}=allway_stop"]),
    "left_hand": Net(1.2, ["--grid", "--grid.number=5", "--grid.length=180", "--lefthand", LANES, "--turn-lanes=1"]),
    "right_before_left": Net(1.2, [*SPIDER, f"{TYPE}=right_before_left"]),
    "right_before_left_grid": Net(1.2, [*GRID, f"{TYPE}=right_before_left"]),
    "right_before_left_random": Net(1.2, [*RANDOM, f"{TYPE}=right_before_left"]),
    "priority_random": Net(0.8, [*RANDOM, LANES, f"{TYPE}=priority", "--rand.random-priority=true"]),
    "signals": Net(0.8, [*RANDOM, LANES, SIGNALS]),
    "spider_signals": Net(1.0, [*SMALL_SPIDER, "--spider.omit-center", LANES, SIGNALS]),
    "three_lanes": Net(1.0, [*BLOCKS, "--default.lanenumber=3", "--turn-lanes=1", f"{TYPE}=traffic_light"]),
    "turn_lanes": Net(0.8, [*BLOCKS, "--turn-lanes=1", "--turn-lanes.length=40", LANES, SIGNALS]),
    "right_on_red": Net(0.7, [*BLOCKS, LANES, f"{SIGNALS}_right_on_red"]),
    "stop_signs": Net(1.0, ["--grid", "--grid.number=5", "--grid.length=120", LANES, f"{TYPE}=priority_stop"]),
    "people": Net(1.5, [*GRID, SIGNALS, *WALKS]),
    "people_priority": Net(1.5, [*GRID, f"{TYPE}=priority", *WALKS]),
    "people_left_hand": Net(1.5, [*SMALL_SPIDER, "--spider.omit-center", "--lefthand", SIGNALS, *WALKS]),
    "mixed_random": Net(0.9, RANDOM_SIGNALS, is_mixed=True),
    "mixed_sublane": Net(
        0.9, ["--grid", "--grid.number=5", "--grid.length=160", LANES, SIGNALS], is_mixed=True, is_sublane=True
    ),
    "mixed_left_hand": Net(0.9, [*RANDOM_SIGNALS, "--lefthand"], is_mixed=True),
    "mixed_priority": Net(
        0.9, ["--grid", "--grid.number=5", "--grid.length=140", LANES, f"{TYPE}=priority"], is_mixed=True
    ),
    "mixed_sublane_random": Net(
        0.9, [*RANDOM, LANES, f"{TYPE}=priority", "--rand.random-priority=true"], is_mixed=True, is_sublane=True
    ),
    "roundabouts": Net(1.2, [], round_lanes=1),
    "wide_roundabouts": Net(0.8, [], round_lanes=2),
}
MIX = """<additional><vTypeDistribution id="mix">
<vType id="car" vClass="passenger" probability="0.6"/><vType id="van" vClass="delivery" probability="0.15"/>
<vType id="lorry" vClass="truck" probability="0.1"/><vType id="bus" vClass="bus" probability="0.05"/>
<vType id="motorcycle" vClass="motorcycle" probability="0.1"/>
</vTypeDistribution></additional>"""
SUBLANE = '<processing><lateral-resolution value="0.8"/></processing>'
BEGIN, END = "100", "1100"  # [s]


def built(folder: Path, net: Net) -> Path:
    """A configuration of the net and its traffic."""
    folder.mkdir(parents=True, exist_ok=True)
    program, options = "netgenerate", [*net.options, "--seed=5"]
    if net.round_lanes:
        program, options = "netconvert", roundabouts.written(folder, net.round_lanes)
    generate = [sumolib.checkBinary(program), *options, "-o", "net.net.xml"]
    trips = [sys.executable, str(Path(sumo.SUMO_HOME, "tools", "randomTrips.py")), "-n", "net.net.xml", "-e", "1200"]
    cars = ["-o", "trips.xml", "-r", "routes.rou.xml", "-p", str(net.period), "--seed=7", "--validate"]
    if net.is_mixed:
        (folder / "mix.add.xml").write_text(MIX)
        cars += ["--additional-file", "mix.add.xml", "--trip-attributes", 'type="mix" departLane="best"']
    commands = [generate, [*trips, *cars, "--fringe-factor=3", "--min-distance=300"]]
    routes = "routes.rou.xml"
    if WALKS[0] in net.options:
        people = ["-o", "people.xml", "-r", "people.rou.xml", "-p", "1", "--seed=8", "--pedestrians", "--prefix=p"]
        commands.append([*trips, *people, "--max-distance=600"])
        routes += ",people.rou.xml"
    for program, *words in commands:
        rows.run(program, words, folder)
    step = '<time><step-length value="0.1"/></time>'
    return rows.configured(folder, step + (SUBLANE if net.is_sublane else ""), route=routes)


if __name__ == "__main__":
    rows.table(NETS, built, 60, "--begin", BEGIN, "--end", END)
