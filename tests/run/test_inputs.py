"""Any SUMO scenario in: the ego drives to its destination, and the scenario's folder is as it was."""

import gzip
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
import sumolib
from small_scenarios import EGO, driven, scenario_file

from dvca_sumo.record import Record
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.run import StopRule
from dvca_sumo.scenario import ScenarioError
from dvca_sumo.violations import Ending

PARKED = (
    '<vehicle id="parked" depart="0" departPos="120"><route edges="bc"/>'
    '<stop lane="bc_0" endPos="121" duration="1000" parking="true"/></vehicle>'
)
DAWDLING = '<flow id="many" begin="0" period="2" number="20" from="cb" to="ba" departLane="random" departPos="random"/>'
DETECTORS = (
    '<inductionLoop id="d1" lane="bc_0" pos="30" period="1" file="d1.xml"/>'
    '<laneAreaDetector id="d2" lane="bc_0" pos="40" endPos="60" period="1" file="d2.xml"/>'
    '<entryExitDetector id="d3" period="1" file="d3.xml"><detEntry lane="bc_0" pos="30"/>'
    '<detExit lane="bc_0" pos="60"/></entryExitDetector>'
    '<edgeData id="d4" file="d4.xml" period="1"/><laneData id="d5" file="d5.xml" period="1"/>'
    '<instantInductionLoop id="d6" lane="bc_0" pos="35" file="d6.xml"/>'
    '<routeProbe id="d7" edge="bc" period="1" file="d7.xml"/><vTypeProbe id="d8" period="1" file="d8.xml"/>'
    '<timedEvent type="SaveTLSStates" source="b" dest="d9.xml"/>'
)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def arrived_leaving_all_as_it_was(config: Path, folder: Path) -> Record:
    before = contents(folder)
    record = driven(config)
    assert contents(folder) == before
    assert (record.ending, record.violations) == (Ending.ARRIVED, [])
    return record


def gzipped(path: Path) -> None:
    path.with_name(path.name + ".gz").write_bytes(gzip.compress(path.read_bytes()))
    path.unlink()


def test_a_plain_scenario(tmp_path: Path, street: Path) -> None:
    record = arrived_leaving_all_as_it_was(scenario_file(tmp_path, street), tmp_path)
    assert record.ego == "ego"
    assert record.path[-1].speed == 0.0
    assert record.simulated == pytest.approx(record.moments[-1].time)


def test_every_output_that_sumo_knows_goes_nowhere(tmp_path: Path, street: Path) -> None:
    template = tmp_path / "template.xml"
    subprocess.run(  # noqa: S603 our own command
        [sumolib.checkBinary("sumo"), "--save-template", str(template)], check=True, capture_output=True
    )
    outputs = {
        option.tag: f"{option.tag}.xml"
        for option in ET.parse(template).iter()  # noqa: S314 written in the line above
        if option.get("type") == "FILE" and re.match("Save|Write|Record|The filename", option.get("help", ""))
        if not option.tag.startswith(("save-", "gui-", "pedestrian.jupedsim"))
    }
    assert len(outputs) > 30
    states = {"save-state.times": "1,2", "save-state.prefix": "state", "output-prefix": "TIME"}
    folder = tmp_path / "scenario"
    config = scenario_file(folder, street, EGO + PARKED, **outputs, **states)
    shutil.copy(config, tmp_path / "copy")
    arrived_leaving_all_as_it_was(config, folder)
    assert not [path for path in Path("/dev").glob("null*") if path.name.endswith((".vtp", ".xml"))]


def test_detectors_in_additional_and_included_files_write_nowhere(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path, street, additional=f'{DETECTORS}<include href="sub/more.add.xml"/>')
    (tmp_path / "sub").mkdir()
    more = DETECTORS.replace('id="d', 'id="e').replace('file="d', 'file="e')
    cone = '<include href="cone.add.xml"/>'
    (tmp_path / "sub" / "more.add.xml").write_text(f"<additional>{more}{cone}</additional>")
    (tmp_path / "sub" / "cone.add.xml").write_text(
        '<additional><poi id="cone" type="obstacle.cone" x="240" y="9"/></additional>'
    )
    record = arrived_leaving_all_as_it_was(config, tmp_path)
    assert record.moments[0].objects.ids == ("poi:cone",)  # what the copies include is there


def test_detectors_of_actuated_lights_in_the_net_write_nowhere(tmp_path: Path, street: Path) -> None:
    text = street.read_text()
    actuated = re.sub(
        r'(<tlLogic id="b") type="static"([^>]*>)', r'\1 type="actuated"\2<param key="file" value="d.xml"/>', text
    )
    assert actuated != text
    (tmp_path / "actuated.net.xml").write_text(actuated)
    arrived_leaving_all_as_it_was(scenario_file(tmp_path, tmp_path / "actuated.net.xml"), tmp_path)


def test_devices_that_vehicles_themselves_ask_for_write_nowhere(
    tmp_path: Path, street: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    named = '<param key="has.ssm.device" value="true"/><param key="device.ssm.file" value="ssm.xml"/>'
    unnamed = '<vType id="t"><param key="has.ssm.device" value="true"/></vType>'
    ego = EGO.replace("/>", f">{named}</trip>")
    other = PARKED.replace('id="parked"', 'id="parked" type="t"')
    config = scenario_file(tmp_path, street, unnamed + ego + other)
    arrived_leaving_all_as_it_was(config, tmp_path)


def test_gzipped_inputs_in_a_folder_with_blanks_and_umlauts(tmp_path: Path, street: Path) -> None:
    folder = tmp_path / "Große Straße zu Öhringen"
    folder.mkdir()
    shutil.copy(street, folder / "Netz Ö.net.xml")
    config = scenario_file(
        folder,
        folder / "Netz Ö.net.xml",
        EGO + PARKED,
        DETECTORS,
        net_file="Netz Ö.net.xml.gz",
        route_files="routes.rou.xml.gz",
        additional_files="extra.add.xml.gz",
    )
    for file in ("Netz Ö.net.xml", "routes.rou.xml", "extra.add.xml"):
        gzipped(folder / file)
    assert arrived_leaving_all_as_it_was(config, folder).moments[-1].objects.ids == ("parked",)


def test_several_route_and_additional_files_with_blanks_between(tmp_path: Path, street: Path) -> None:
    cone = '<poi id="cone" type="obstacle.cone" x="260" y="9"/>'
    config = scenario_file(
        tmp_path,
        street,
        additional=cone,
        route_files="routes.rou.xml, more routes.rou.xml ,../third.rou.xml",
        additional_files="extra.add.xml, more.add.xml",
    )
    (tmp_path / "more routes.rou.xml").write_text(f"<routes>{PARKED}</routes>")
    (tmp_path.parent / "third.rou.xml").write_text(
        f"<routes>{PARKED.replace('parked', 'other').replace('12', '14')}</routes>"
    )
    (tmp_path / "more.add.xml").write_text(f"<additional>{cone.replace('cone', 'pole')}</additional>")
    record = arrived_leaving_all_as_it_was(config, tmp_path)
    assert set(record.moments[-1].objects.ids) == {"parked", "other", "poi:cone", "poi:pole"}


@pytest.mark.parametrize("step", ["1", "0.5", "0.1", "0.05"])
def test_any_step_length(tmp_path: Path, street: Path, step: str) -> None:
    record = arrived_leaving_all_as_it_was(scenario_file(tmp_path, street, EGO + PARKED, step_length=step), tmp_path)
    times = [moment.time for moment in record.moments]
    assert times == pytest.approx([times[0] + 0.1 * number for number in range(len(times))])


@pytest.mark.parametrize("begin", ["10", "0:0:10"])
def test_a_begin_later_than_zero(tmp_path: Path, street: Path, begin: str) -> None:
    config = scenario_file(tmp_path, street, EGO.replace('"0"', '"12"'), begin=begin)
    record = arrived_leaving_all_as_it_was(config, tmp_path)
    assert record.start == pytest.approx(12.1)
    assert record.simulated == pytest.approx(record.moments[-1].time - 10.0)


@pytest.mark.parametrize(
    "options", [{"remote_port": "8813"}, {"gui_settings_file": "missing.xml"}, {"random": "true"}, {"threads": "4"}]
)
def test_options_that_would_stop_or_blur_a_run(tmp_path: Path, street: Path, options: dict[str, str]) -> None:
    config = scenario_file(tmp_path, street, EGO + DAWDLING, **options)
    assert arrived_leaving_all_as_it_was(config, tmp_path).digest == driven(config).digest


@pytest.mark.parametrize(
    ("element", "within", "name"),
    [
        ("vehicle", '<route edges="bc"/>', "ego"),
        ("flow", '<param key="dvca.ego" value="true"/>', "ego.0"),
        ("trip", "", "ego"),
    ],
)
def test_vehicles_flows_and_trips_as_egos(tmp_path: Path, street: Path, element: str, within: str, name: str) -> None:
    when = {
        "vehicle": 'depart="0"',
        "trip": 'depart="0" from="bc" to="bc"',
        "flow": 'begin="0" number="1" from="bc" to="bc"',
    }
    start = f'<{element} id="ego" {when[element]} departPos="20" departSpeed="10" arrivalPos="60">'
    record = arrived_leaving_all_as_it_was(scenario_file(tmp_path, street, f"{start}{within}</{element}>"), tmp_path)
    assert record.ego == name


def test_auto_tells_a_parameter_that_there_is_not(tmp_path: Path, street: Path) -> None:
    routes = (
        '<vehicle id="car" depart="70"><route edges="ab bc cb ba"/><param key="dvca.safe_distanc" value="1"/></vehicle>'
    )
    with pytest.raises(ScenarioError, match=r"no parameter dvca\.safe_distanc .*did you mean dvca\.safe_distance"):
        driven(scenario_file(tmp_path, street, routes), ego="auto")


def test_auto_takes_a_trip_that_is_long_enough_to_an_end_that_is_known(tmp_path: Path, street: Path) -> None:
    def flow(name: str, edges: str, arrival: str = "") -> str:
        return f'<flow id="{name}" begin="0" period="5" number="20" {arrival}><route edges="{edges}"/></flow>'

    unknown = flow("unknown", "cb ba ab bc", 'arrivalEdge="random"')
    config = scenario_file(tmp_path, street, unknown + flow("short", "nb bs") + flow("long", "ab bc cb ba"))
    record = driven(config, ego="auto", stop=StopRule(at=70.0))
    assert record.ego.startswith("long.")
    assert record.start >= 60.0
    assert record.route.destination - record.route.start > 500.0


@pytest.fixture
def ending_nowhere(tmp_path: Path, street: Path) -> Path:
    """Two that depart for long trips; the first one shall arrive on an edge that is there for SUMO's router alone."""
    text = street.read_text().replace('<edge id="bn" ', '<edge id="bn" function="connector" ')
    assert text != street.read_text()
    (tmp_path / "connector.net.xml").write_text(text)
    routes = "".join(
        f'<vehicle id="{name}" depart="{depart}" arrivalEdge="{row}"><route edges="{edges}"/></vehicle>'
        for name, depart, row, edges in (("nowhere", 60, 3, "ab bc cb bn nb bs"), ("long", 65, 3, "ab bc cb ba"))
    )
    return scenario_file(tmp_path, tmp_path / "connector.net.xml", routes)


def test_an_ego_that_shall_arrive_on_no_road_is_refused(ending_nowhere: Path) -> None:
    with pytest.raises(ScenarioError) as raised:
        driven(ending_nowhere, ego="nowhere")
    words = "the ego 'nowhere' has no drivable route: edge 'bn', its last one, is not on the road map"
    assert str(raised.value) == words


def test_auto_passes_over_a_trip_that_ends_on_no_road(ending_nowhere: Path) -> None:
    assert driven(ending_nowhere, ego="auto", stop=StopRule(at=67.0)).ego == "long"


def test_whether_a_variable_signs_limit_was_kept_is_not_known(tmp_path: Path, street: Path) -> None:
    sign = '<variableSpeedSign id="v" lanes="bc_0 bc_1"><step time="0" speed="5"/></variableSpeedSign>'
    record = driven(scenario_file(tmp_path, street, additional=sign))
    unknown = {judgement.kind: judgement.reason for judgement in record.judgements if judgement.answer == "unknown"}
    assert unknown == {"speed_limit": "the ego was on lane bc_0, whose limit a variable sign sets, at 0.1 s"}


def test_auto_does_not_take_a_short_trip(tmp_path: Path, street: Path) -> None:
    flow = '<flow id="short" begin="0" period="5" number="20"><route edges="nb bs"/></flow>'
    with pytest.raises(ScenarioError, match="no vehicle fit to be the ego departs between 0 s and"):
        driven(scenario_file(tmp_path, street, flow), ego="auto")


def test_the_end_of_a_scenario_ends_the_drive(tmp_path: Path, street: Path) -> None:
    record = driven(scenario_file(tmp_path, street, end="3"))
    assert record.ending is Ending.TIME_OVER
    assert record.moments[-1].time == pytest.approx(3.0)
    assert [violation.kind for violation in record.violations] == ["destination_not_reached"]


@pytest.mark.parametrize(("arrival", "expected"), [("60", 60.0), ("-200", -200.0), ("max", 0.0), ("9999", 0.0)])
def test_the_destination_is_the_arrival_position(tmp_path: Path, street: Path, arrival: str, expected: float) -> None:
    lane = RoadMap.load(street).lanes["bc_0"]
    wanted = expected if expected > 0.0 else lane.length + expected
    ego = EGO.replace('"60"', f'"{arrival}"').replace('"20"', f'"{wanted - 40.0}"')
    record = arrived_leaving_all_as_it_was(scenario_file(tmp_path, street, ego), tmp_path)
    front = record.path[-1].x + record.moments[-1].shape.front
    assert front - lane.line.points[0, 0] == pytest.approx(wanted, abs=3.0)


def test_positions_are_sumos_metres_where_a_lane_is_drawn_shorter(tmp_path: Path, street: Path) -> None:
    lane = RoadMap.load(street).lanes["bc_0"]
    text = street.read_text().replace(f'length="{lane.length:.2f}"', f'length="{2 * lane.length:.2f}"')
    (tmp_path / "stretched.net.xml").write_text(text)
    ego = EGO.replace('"60"', '"-300"').replace('"20"', f'"{2 * lane.length - 400.0}"')
    record = driven(scenario_file(tmp_path, tmp_path / "stretched.net.xml", ego))
    assert record.ending is Ending.ARRIVED
    front = record.path[-1].x + record.moments[-1].shape.front
    assert front - lane.line.points[-1, 0] == pytest.approx(-150.0, abs=3.0)


def parametrised(folder: Path, street: Path, **parameters: str) -> Path:
    words = "".join(f'<param key="dvca.{name}" value="{value}"/>' for name, value in parameters.items())
    return scenario_file(folder, street, EGO.replace("/>", f">{words}</trip>"))


def test_thresholds_are_parameters_of_the_ego(tmp_path: Path, street: Path) -> None:
    record = driven(parametrised(tmp_path, street, speed_tolerance="0.5", no_progress_time="inf", speed_dwell="0"))
    assert (record.thresholds.speed_tolerance, record.thresholds.speed_dwell) == (0.5, 0.0)
    assert record.thresholds.safe_distance == type(record.thresholds)().safe_distance


def test_a_threshold_of_the_ego_decides_what_is_a_violation(tmp_path: Path, street: Path) -> None:
    cone = '<poi id="cone" type="obstacle.cone" x="250" y="-8" width="0.4" height="0.4"/>'
    config = parametrised(tmp_path, street, safe_distance="2.6")
    text = config.read_text().replace("</configuration>", '<additional-files value="cone.add.xml"/></configuration>')
    config.write_text(text)
    (tmp_path / "cone.add.xml").write_text(f"<additional>{cone}</additional>")
    (violation,) = driven(config).violations
    assert (violation.kind, violation.object, violation.threshold) == ("safe_distance", "poi:cone", 2.6)
    (tmp_path / "routes.rou.xml").write_text(f"<routes>{EGO}</routes>")
    assert driven(config).violations == []


@pytest.mark.parametrize("value", ["near", "", "-1", "nan", "1,5"])
def test_an_ill_typed_threshold_is_refused(tmp_path: Path, street: Path, value: str) -> None:
    config = parametrised(tmp_path, street, safe_distance=value)
    with pytest.raises(
        ScenarioError, match=rf"dvca\.safe_distance of the ego 'ego' is '{value}' \(allowed: 0 or more\)"
    ):
        driven(config)


def test_an_ego_whose_route_no_car_may_drive_is_refused(tmp_path: Path, street: Path) -> None:
    text = re.sub(r'(<lane id="cb_\d")', r'\1 allow="bus"', street.read_text())
    (tmp_path / "buses.net.xml").write_text(text)
    ego = '<vehicle id="ego" depart="0"><route edges="bc cb"/></vehicle>'
    with pytest.raises(ScenarioError, match="'ego'"):
        driven(scenario_file(tmp_path, tmp_path / "buses.net.xml", ego, ignore_route_errors="true"))
