"""A scenario that cannot be run: one line that says what to mend, exit code 3, nothing written."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from command_line import assert_one_error, contents, typed
from small_scenarios import EGO, scenario_file

from dvca_sumo.cli import ExitCode

Spoil = Callable[[Path], object]  # of the scenario's folder

LONG = "n" * 300  # more than a name of a file can have
MARKED = '<vehicle id="{0}" depart="0"><route edges="bc"/><param key="dvca.ego" value="true"/></vehicle>'


def _removed(name: str) -> Spoil:
    return lambda folder: (folder / name).unlink()


def _truncated(name: str) -> Spoil:
    def cut(folder: Path) -> None:
        text = (folder / name).read_text(encoding="utf-8")
        (folder / name).write_text(text[: len(text) * 2 // 3], encoding="utf-8")

    return cut


def _replaced(name: str, text: str) -> Spoil:
    return lambda folder: (folder / name).write_text(text, encoding="utf-8")


def _add_to_edge(folder: Path, text: str) -> None:
    net = (folder / "net.net.xml").read_text(encoding="utf-8")
    head, edge, tail = net.partition('<edge id="bc"')
    (folder / "net.net.xml").write_text(head + edge + tail.replace("</edge>", f"{text}</edge>", 1), encoding="utf-8")


def _add_to_lane(folder: Path, text: str) -> None:
    net = (folder / "net.net.xml").read_text(encoding="utf-8")
    head, lane, tail = net.partition('<lane id="bc_0"')
    (folder / "net.net.xml").write_text(head + lane + tail.replace("/>", f">{text}</lane>", 1), encoding="utf-8")


class Broken(NamedTuple):
    """A scenario with one defect, and what must be said of it."""

    says: tuple[str, ...]
    spoil: Spoil = contents  # only looks
    routes: str = EGO
    additional: str = ""
    options: tuple[tuple[str, str], ...] = ()
    words: tuple[str, ...] = ()


BROKEN = {
    "no sumocfg, one of a similar name": Broken(
        ("no such SUMO configuration", "did you mean runs.sumocfg?"),
        lambda folder: (folder / "run.sumocfg").rename(folder / "runs.sumocfg"),
    ),
    "sumocfg cut off": Broken(("run.sumocfg is not well-formed XML", "line 1"), _truncated("run.sumocfg")),
    "sumocfg empty": Broken(("run.sumocfg is not well-formed XML",), _replaced("run.sumocfg", "")),
    "sumocfg without a net": Broken(("option net-file is not set",), _replaced("run.sumocfg", "<configuration/>")),
    "option misspelt": Broken(("No option with the name 'rout-files' exists",), options=(("rout_files", "x"),)),
    "option ill-typed": Broken(("option step-length is no time: 'abc'", "allowed"), options=(("step_length", "abc"),)),
    "option ill-typed that only SUMO reads": Broken(("abc",), options=(("time_to_teleport", "abc"),)),
    "mesoscopic model": Broken(("mesosim",), options=(("mesosim", "true"),)),
    "end before begin": Broken(("ends at 10 s", "begin at 20 s"), words=("--begin", "20", "--end", "10")),
    "no net": Broken(("net-file", "net.net.xml", "does not exist"), _removed("net.net.xml")),
    "net cut off": Broken(("not a SUMO net", "net.net.xml"), _truncated("net.net.xml")),
    "net that is none": Broken(("not a SUMO net", "net.net.xml"), _replaced("net.net.xml", "<routes/>")),
    "net of too long a name": Broken((LONG, "net-file", "run.sumocfg"), options=(("net_file", LONG),)),
    "included file of too long a name": Broken(
        (LONG,), additional=f'<include href="{LONG}"/><inductionLoop id="d" lane="bc_0" pos="3" period="9" file="o"/>'
    ),
    "no route file": Broken(("route-files", "routes.rou.xml", "does not exist"), _removed("routes.rou.xml")),
    "route file cut off": Broken(("routes.rou.xml", "At line/column"), _truncated("routes.rou.xml")),
    "route file cut off within a vehicle": Broken(
        ("routes.rou.xml", "At line/column"),
        lambda folder: (folder / "routes.rou.xml").write_text(f"<routes>{EGO[: EGO.index('from=')]}", encoding="utf-8"),
    ),
    "route over an unknown edge": Broken(("'zz'", "not known"), routes=EGO.replace('to="bc"', 'to="zz"')),
    "route with a gap": Broken(
        ("'ego' has no valid route",), routes='<vehicle id="ego" depart="0"><route edges="ab nb"/></vehicle>'
    ),
    "departure ill-typed": Broken(("Invalid departure time",), routes=EGO.replace('depart="0"', 'depart="soon"')),
    "additional file cut off": Broken(("extra.add.xml is not",), additional='<inductionLoop id="d" file="o.xml">'),
    "detector on an unknown lane": Broken(
        ("'zz_0' is not known",), additional='<inductionLoop id="d" lane="zz_0" pos="3" period="9" file="o.xml"/>'
    ),
    "no ego": Broken(("names no ego", "--ego auto", "candidates: car"), routes=EGO.replace('"ego"', '"car"')),
    "no vehicle at all": Broken(("names no ego", "has no vehicles"), routes=""),
    "unknown ego": Broken(("no vehicle 'eggo'", "did you mean ego?"), words=("--ego", "eggo")),
    "two egos": Broken(("several vehicles are marked", "a, b"), routes=MARKED.format("a") + MARKED.format("b")),
    "nobody fit to be the ego": Broken(("no vehicle fit to be the ego",), words=("--ego", "auto")),
    "ego that departs after the end": Broken(
        ("'ego' never departs between 0 s and 20 s",),
        routes=EGO.replace('depart="0"', 'depart="50"'),
        words=("--end", "20"),
    ),
    "ego that finds no room to depart": Broken(
        ("'ego' never departs",),
        routes='<vehicle id="broken_down" depart="0" departPos="20"><route edges="bc"/>'
        '<stop lane="bc_0" endPos="20" duration="90"/></vehicle>'
        + EGO.replace("<trip", '<trip departLane="0"').replace('departPos="20"', 'departPos="18"'),
        words=("--end", "9"),
    ),
    "ego that SUMO removes": Broken(
        ("SUMO removed the ego 'ego' at ",),
        routes=EGO.replace('from="bc"', 'from="ab"'),
        additional='<vaporizer id="bc" begin="0" end="900"/>',
    ),
    "ego on rails": Broken(
        ("'ego' is of class rail", "road vehicles"),
        routes='<vType id="train" vClass="rail"/>' + EGO.replace("<trip", '<trip type="train"'),
    ),
    "ego of a class that there is no map for": Broken(
        ("unknown vehicle class 'ignoring'",),
        routes='<vType id="any" vClass="ignoring"/>' + EGO.replace("<trip", '<trip type="any"'),
    ),
    "threshold ill-typed": Broken(
        ("dvca.ttc", "'ego'", "'soon'", "allowed"),
        routes=EGO.replace("/>", '><param key="dvca.ttc" value="soon"/></trip>'),
    ),
    "threshold empty": Broken(
        ("dvca.ttc", "'ego'", "''", "allowed"),
        routes=EGO.replace("/>", '><param key="dvca.ttc" value=""/></trip>'),
    ),
    "threshold misspelt": Broken(
        ("no parameter dvca.safe_distence of the ego 'ego' (did you mean dvca.safe_distance?)",),
        routes=EGO.replace("/>", '><param key="dvca.safe_distence" value="0.5"/></trip>'),
    ),
    "mark misspelt, on a vehicle that is not the ego": Broken(
        ("no parameter dvca.Ego of the vehicle 'car' (did you mean dvca.ego?)",),
        routes=EGO + '<vehicle id="car" depart="9"><route edges="bc"/><param key="dvca.Ego" value="true"/></vehicle>',
    ),
    "mark that is neither true nor false": Broken(
        ("parameter dvca.ego of 'ego' is 'maybe'", "allowed: true, 1, yes, on"),
        routes=EGO.replace("/>", '><param key="dvca.ego" value="maybe"/></trip>'),
    ),
    "parameter of a type of vehicles": Broken(
        ("parameter dvca.ttc of vType 'fast' in ", "routes.rou.xml (allowed: of a vehicle, a trip or a flow)"),
        routes='<vType id="fast"><param key="dvca.ttc" value="1"/></vType>' + EGO,
    ),
    "parameter of a route within a vehicle": Broken(
        ("parameter dvca.ttc of route '' in ",),
        routes=EGO
        + '<vehicle id="car" depart="9"><route edges="bc"><param key="dvca.ttc" value="1"/></route></vehicle>',
    ),
    "parameter that is all of a file": Broken(
        ("parameter dvca.ego of nothing in ", "extra.add.xml (allowed: of a vehicle, a trip or a flow)"),
        _replaced("extra.add.xml", '<param key="dvca.ego" value="true"/>'),
        additional="<poi/>",
    ),
    "parameter of a lane": Broken(
        ("parameter dvca.map.speed_limit of the lane 'bc_0' (allowed: dvca.map.speed_limit, of an edge)",),
        lambda folder: _add_to_lane(folder, '<param key="dvca.map.speed_limit" value="missing"/>'),
    ),
    "parameter of an edge misspelt": Broken(
        ("no parameter dvca.map.speedlimit of the edge 'bc' (allowed: dvca.map.speed_limit)",),
        lambda folder: _add_to_edge(folder, '<param key="dvca.map.speedlimit" value="missing"/>'),
    ),
}


@pytest.mark.parametrize("case", BROKEN.values(), ids=BROKEN)
def test_it_is_told_in_one_line(case: Broken, scenario: Callable[..., Path]) -> None:
    config = scenario(case.routes, case.additional, **dict(case.options))
    case.spoil(config.parent)
    before = contents(config.parent)
    said = typed("run", config, *case.words)
    assert_one_error(said, ExitCode.BAD_INPUT, *case.says)
    assert contents(config.parent) == before


@pytest.mark.parametrize(
    ("command", "says"), [("run", ("'ego' is not allowed to depart",)), ("screen", ("no lane for cars", "rails"))]
)
def test_a_net_of_rails_only(
    tmp_path: Path, plain_file: Callable[..., Path], command: str, says: tuple[str, ...]
) -> None:
    nodes = '<node id="a" x="0" y="0"/><node id="b" x="300" y="0"/><node id="c" x="600" y="0"/>'
    edges = '<edge id="ab" from="a" to="b" allow="rail"/><edge id="bc" from="b" to="c" allow="rail"/>'
    config = scenario_file(tmp_path, plain_file(nodes, edges), '<trip id="ego" depart="0" from="ab" to="bc"/>')
    assert_one_error(typed(command, config), ExitCode.BAD_INPUT, *says)


@pytest.mark.parametrize("folder", ["", "nets/"])
def test_a_name_too_long_for_a_file_is_no_scenario(folder: str) -> None:
    assert_one_error(typed("run", f"{folder}{LONG}.sumocfg"), ExitCode.BAD_INPUT, f"{folder}{LONG}.sumocfg")


def test_a_folder_is_no_scenario(tmp_path: Path) -> None:
    assert_one_error(typed("run", tmp_path), ExitCode.BAD_INPUT, "is a folder")
