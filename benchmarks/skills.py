"""How the reference ADS does what networks ask for, one skill at a time, each on a small net of its own.

    python benchmarks/skills.py FOLDER [--nets ramps,bus_lane] [--egos 20] [--seed 1] [--jobs 1]

Each net is built in FOLDER/NAME and screened as `dvca-sumo screen` does it. Prints a line for each; which violations
there were and how to see them stands in FOLDER/NAME/out/screening.txt.
"""

from pathlib import Path
from typing import NamedTuple

import rows
import sumolib

UNTIL = 600  # [s] of departures
END = 900  # [s]


class Skill(NamedTuple):
    """One net and its traffic."""

    nodes: dict[str, tuple[float, float]]  # by letter [m]
    edges: dict[str, str]  # further attributes by name: from the node of its first letter to that of its second
    demand: str
    junction: str = "priority"  # type of the node c
    joined: str = ""  # connections, as "ab_0>bc_1", of those edges whose lanes are not joined as netconvert would do it
    reserved: tuple[str, ...] = ()  # edges whose rightmost lane is for buses
    additional: str = ""


def flow(begin: str, end: str, period: float) -> str:
    """Cars from edge to edge."""
    trip = f'from="{begin}" to="{end}" departLane="best" departSpeed="max"'
    return f'<flow id="{begin}.{end}" begin="0" end="{UNTIL}" period="{period}" {trip}/>'


def cars(route: str, period: int, stops: dict[int, str] | None = None) -> str:
    """Cars on one route; those whose number leaves such a remainder, divided by 7, make that one of the `stops`."""
    kinds = stops or {}
    return "".join(
        f'<vehicle id="car.{number:02d}" depart="{number * period}" departSpeed="max"><route edges="{route}"/>'
        f"{kinds.get(number % 7, '')}</vehicle>"
        for number in range(UNTIL // period)
    )


ARMS = {"n": (0.0, 300.0), "e": (300.0, 0.0), "s": (0.0, -300.0), "w": (-300.0, 0.0)}


def cross(junction: str, period: float, arms: dict[str, tuple[float, float]] = ARMS) -> Skill:
    """From each of the arms to each other one; those to the east and west are the major road."""
    roads = [(arm, f'speed="13.9" priority="{2 if arm in "ew" else 1}"') for arm in arms]
    edges = {name: road for arm, road in roads for name in (f"{arm}c", f"c{arm}")}
    demand = "".join(flow(f"{begin}c", f"c{end}", period) for begin in arms for end in arms if begin != end)
    return Skill({"c": (0.0, 0.0), **arms}, edges, demand, junction)


def straight(*places: float) -> dict[str, tuple[float, float]]:
    """Nodes a, b, c ... along a line [m]."""
    return {chr(ord("a") + index): (place, 0.0) for index, place in enumerate(places)}


CITY, BUSES = 'speed="13.9"', '<lane index="0" allow="bus"/>'
MOTORWAY, WITH_RAMP = 'speed="33.3" numLanes="2"', 'speed="33.3" numLanes="3"'
TWO, THREE = f'{CITY} numLanes="2"', f'{CITY} numLanes="3"'
NARROW = f'{CITY} numLanes="2" width="2.4"'
BEND = "300,0 340,2 380,10 415,25 445,47 475,80"
SHORT = [200.0 + 4.0 * index for index in range(9)]
SKILLS = {
    "ramps": Skill(
        {**straight(0.0, 600.0, 850.0, 1400.0, 1600.0, 2200.0), "r": (300.0, -150.0), "q": (1900.0, -150.0)},
        {
            **dict.fromkeys(("ab", "cd", "ef"), MOTORWAY),
            **dict.fromkeys(("bc", "de"), WITH_RAMP),
            **dict.fromkeys(("rb", "eq"), 'speed="22.2"'),
        },
        flow("ab", "ef", 3.0) + flow("ab", "eq", 9.0) + flow("rb", "ef", 8.0) + flow("rb", "eq", 20.0),
        joined="ab_0>bc_1 ab_1>bc_2 rb_0>bc_0 bc_1>cd_0 bc_2>cd_1 cd_0>de_0 cd_0>de_1 cd_1>de_2 de_0>eq_0 de_1>ef_0 "
        "de_2>ef_1",
    ),
    "short_ramp": Skill(
        {**straight(0.0, 700.0, 800.0, 1600.0), "r": (400.0, -150.0)},
        {
            **dict.fromkeys(("ab", "cd"), 'speed="36.1" numLanes="3"'),
            "bc": 'speed="36.1" numLanes="4"',
            "rb": 'speed="22.2"',
        },
        flow("ab", "cd", 1.5) + flow("rb", "cd", 7.0),
        joined="ab_0>bc_1 ab_1>bc_2 ab_2>bc_3 rb_0>bc_0 bc_1>cd_0 bc_2>cd_1 bc_3>cd_2",
    ),
    "lane_ends": Skill(
        straight(0.0, 400.0, 800.0, 1200.0),
        {"ab": THREE, "bc": TWO, "cd": CITY},
        flow("ab", "cd", 3.2),
        junction="zipper",
        joined="ab_0>bc_0 ab_1>bc_0 ab_2>bc_1 bc_1>cd_0",
    ),
    "all_way_stop": cross("allway_stop", 40.0),
    "stop_signs": cross("priority_stop", 60.0),
    "right_before_left": cross("right_before_left", 50.0),
    "permissive_green": cross("traffic_light", 45.0),
    "narrow_lanes": Skill(
        {"a": (0.0, 0.0), "b": (300.0, 0.0), "c": (475.0, 80.0), "d": (800.0, 480.0)},
        {
            **dict.fromkeys(("ab", "ba", "cd", "dc"), NARROW),
            "bc": f'{NARROW} shape="{BEND}"',
            "cb": f'{NARROW} shape="{" ".join(reversed(BEND.split()))}"',
        },
        flow("ab", "cd", 5.0) + flow("dc", "ba", 5.0),
    ),
    "bus_lane": Skill(
        {**straight(0.0, 400.0, 800.0), "s": (400.0, -300.0)},
        {"ab": THREE, "bc": THREE, "bs": CITY},
        '<vType id="bus" vClass="bus"/><flow id="bus" type="bus" begin="0" end="600" period="40" from="ab" to="bc" '
        f'departLane="0"/>{flow("ab", "bc", 4.0)}{flow("ab", "bs", 12.0)}',
        reserved=("ab", "bc"),
    ),
    "short_edges": Skill(
        straight(0.0, *SHORT, 260.0, 264.0, 268.0, 500.0),
        {f"{chr(first)}{chr(first + 1)}": CITY for first in range(ord("a"), ord("a") + len(SHORT) + 4)},
        flow("ab", "mn", 6.0),
    ),
    "loops": Skill(
        {**straight(-200.0, 0.0, 150.0), "d": (150.0, 150.0), "e": (0.0, 150.0), "z": (0.0, -200.0)},
        dict.fromkeys(("ab", "bc", "cd", "de", "eb", "bz"), CITY),
        cars("ab bc cd de eb bc cd de eb bz", 15),
    ),
    "stops_on_the_way": Skill(
        straight(0.0, 500.0, 900.0),
        {"ab": TWO, "bc": TWO},
        cars(
            "ab bc",
            6,
            {0: '<stop lane="ab_0" endPos="250" duration="40"/>', 3: '<stop parkingArea="park" duration="60"/>'},
        ),
        additional='<parkingArea id="park" lane="ab_0" startPos="100" endPos="140" roadsideCapacity="6"/>',
    ),
    "u_turns": Skill(
        {"a": (0.0, 0.0), "c": (400.0, 0.0), "d": (800.0, 0.0)},
        {
            **{name: f'{TWO} shape="{west},-4 {east},-4"' for name, west, east in (("ac", 0, 390), ("cd", 410, 800))},
            **{name: f'{TWO} shape="{east},4 {west},4"' for name, west, east in (("ca", 0, 390), ("dc", 410, 800))},
        },
        flow("ac", "ca", 15.0) + flow("ac", "cd", 8.0) + flow("dc", "ca", 8.0),
        joined="ac_0>cd_0 ac_1>cd_1 ac_1>ca_0 dc_0>ca_0 dc_1>ca_1",
    ),
    "sharp_turns": cross("priority", 40.0, {"n": (-212.0, 212.0), "e": (300.0, 0.0), "w": (-300.0, 0.0)}),
    "sudden_stops": Skill(
        straight(0.0, 1200.0),
        {"ab": 'speed="22.2"'},
        '<vType id="DEFAULT_VEHTYPE" decel="9" emergencyDecel="9"/>'
        + cars(
            "ab", 4, {number: f'<stop lane="ab_0" endPos="{400 + 200 * number}" duration="8"/>' for number in (1, 3)}
        ),
    ),
}


def built(folder: Path, skill: Skill) -> Path:
    """A configuration of the net and its traffic."""
    folder.mkdir(parents=True, exist_ok=True)
    nodes = (
        f'<node id="{name}" x="{x}" y="{y}" type="{skill.junction if name == "c" else "priority"}"/>'
        for name, (x, y) in skill.nodes.items()
    )
    edges = (
        f'<edge id="{name}" from="{name[0]}" to="{name[1]}" {road}>{BUSES if name in skill.reserved else ""}</edge>'
        for name, road in skill.edges.items()
    )
    joined = (
        f'<connection from="{begin[:2]}" to="{end[:2]}" fromLane="{begin[3:]}" toLane="{end[3:]}"/>'
        for begin, end in (each.split(">") for each in skill.joined.split())
    )
    parts = {"nodes": nodes, "edges": edges, "connections": joined}
    options = ["--no-turnarounds", "-o", "net.net.xml"]
    for (kind, elements), option in zip(parts.items(), ("-n", "-e", "-x"), strict=True):
        (folder / f"{kind}.xml").write_text(f"<{kind}>{''.join(elements)}</{kind}>")
        options += [option, f"{kind}.xml"]
    rows.run(sumolib.checkBinary("netconvert"), options, folder)
    (folder / "routes.rou.xml").write_text(f"<routes>{skill.demand}</routes>")
    (folder / "more.add.xml").write_text(f"<additional>{skill.additional}</additional>")
    end = f'<time><end value="{END}"/></time>'
    return rows.configured(folder, end, route="routes.rou.xml", additional="more.add.xml")


if __name__ == "__main__":
    rows.table(SKILLS, built, 20)
