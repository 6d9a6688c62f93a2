"""A sumocfg as SUMO reads it: option names, times, the files it names, and what cannot be run."""

import os
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import sumolib
from command_line import contents
from small_scenarios import driven, scenario_file

from dvca_sumo.scenario import ScenarioError
from dvca_sumo.scenario.configuration import OUTPUTS, SYNONYMS, content_of, read_configuration, seconds
from dvca_sumo.violations import Ending

UNREADABLE = Path("/proc/self/mem")  # by anybody: nothing lies at its beginning

# Options this tool reads or overrides, beside those that make SUMO write a file.
LOOKED_AT = {
    "net-file",
    "route-files",
    "additional-files",
    "begin",
    "end",
    "step-length",
    "seed",
    "random",
    "mesosim",
    "collision.action",
    "default.action-step-length",
    "threads",
    "device.rerouting.threads",
    "remote-port",
    "verbose",
    "xml-validation",
    "duration-log.disable",
    "gui-settings-file",
    "output-prefix",
    "save-configuration",
    "save-template",
    "save-schema",
}


@pytest.fixture
def net(tmp_path: Path) -> Path:
    """Only its being there matters here."""
    path = tmp_path / "some.net.xml"
    path.write_text("<net/>")
    return path


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory) -> ET.Element:
    """All options of the installed SUMO, as it describes them itself."""
    path = tmp_path_factory.mktemp("template") / "template.xml"
    subprocess.run(  # noqa: S603 our own command
        [sumolib.checkBinary("sumo"), "--save-template", str(path)], check=True, capture_output=True
    )
    return ET.parse(path).getroot()  # noqa: S314 written in the line above


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """One whose permissions a test may take away."""
    path = tmp_path / "folder"
    path.mkdir()
    yield path
    path.chmod(0o700)


def with_texts(config: Path) -> Path:
    """The same configuration, its values written as the texts of its elements."""
    config.write_text(re.sub(r'<([\w.-]+) value="([^"]*)"/>', r"<\1>\n  \2\n</\1>\n", config.read_text()))
    return config


def is_output(option: ET.Element) -> bool:
    return option.get("type") == "FILE" and (option.tag in OUTPUTS or option.tag.endswith("-output"))


def test_every_option_that_counts_is_known_under_all_names_that_sumo_gives_it(template: ET.Element) -> None:
    counting = [option for option in template.iter() if option.tag in LOOKED_AT or is_output(option)]
    names = {name: option.tag for option in counting for name in option.get("synonymes", "").split()}
    assert "summary" in names
    assert {name: SYNONYMS.get(name) for name in names} == names


def test_every_file_that_sumo_says_it_saves_is_an_output(template: ET.Element) -> None:
    saved = {
        option.tag
        for option in template.iter()
        if option.get("type") == "FILE"
        and option.get("help", "").startswith(("Save", "Write", "Record"))
        and not option.tag.startswith("save-")
    }
    assert "fcd-output" in saved
    assert {name for name in saved if name not in OUTPUTS and not name.endswith("-output")} == set()


def test_an_option_may_be_given_by_value_or_v_at_any_depth_and_under_a_short_name(tmp_path: Path, net: Path) -> None:
    config = tmp_path / "run.sumocfg"
    config.write_text(f'<configuration><input><n v="{net}"/></input><time><b value="0:0:10"/></time></configuration>')
    configuration = read_configuration(config)
    assert configuration.net == net.resolve()
    assert configuration.options["begin"] == "0:0:10"


def test_an_option_may_be_given_by_the_text_of_its_element(tmp_path: Path, net: Path) -> None:
    values = scenario_file(tmp_path, net, begin="0:0:10", tripinfo="t.xml", load_state="some.net.xml")
    by_value = read_configuration(values)
    assert read_configuration(with_texts(values)) == by_value


def test_text_counts_where_a_value_is_empty_and_not_where_there_is_one_or_a_child(tmp_path: Path, net: Path) -> None:
    config = tmp_path / "run.sumocfg"
    config.write_text(
        f'<configuration>all<net-file v="{net}">n</net-file><log value="">l.txt</log>'
        '<tripinfo-output>t.xml<seed value="3"/></tripinfo-output><verbose/><error-log> </error-log></configuration>'
    )
    assert read_configuration(config).options == {"net-file": str(net), "log": "l.txt", "seed": "3"}


def test_nothing_is_written_beside_a_configuration_that_asks_for_it_by_texts(tmp_path: Path, street: Path) -> None:
    config = with_texts(scenario_file(tmp_path, street, tripinfo_output="trips.xml", fcd_output="fcd.xml"))
    before = contents(tmp_path)
    assert driven(config).ending is Ending.ARRIVED
    assert contents(tmp_path) == before


def test_a_configuration_that_sumo_saved_names_the_files_that_it_was_saved_for(tmp_path: Path, street: Path) -> None:
    """Blanks and % signs of their names are encoded in it."""
    config = scenario_file(tmp_path, street)
    net = Path(shutil.copy(street, tmp_path / "my 100%25.net.xml"))
    routes = (tmp_path / "routes.rou.xml").rename(tmp_path / "two; words.rou.xml")
    subprocess.run(  # noqa: S603 our own command
        [sumolib.checkBinary("sumo"), "-n", net, "-r", routes, "--save-configuration", config],
        check=True,
        capture_output=True,
    )
    assert "my%20100%2525.net.xml" in config.read_text()
    configuration = read_configuration(config)
    assert (configuration.net, configuration.routes) == (net, (routes,))
    assert driven(config).ending is Ending.ARRIVED


@pytest.mark.parametrize(("given", "meant"), [("p%41q", "pAq"), ("p%2541q", "p%41q"), ("100%", "100%")])
def test_a_percent_sign_is_one_of_the_name_only_where_it_encodes_nothing(
    tmp_path: Path, street: Path, given: str, meant: str
) -> None:
    """As it is to SUMO."""
    net = Path(shutil.copy(street, tmp_path / f"{meant}.net.xml"))
    config = scenario_file(tmp_path, Path(f"{given}.net.xml"))
    subprocess.run(  # noqa: S603 our own command
        [sumolib.checkBinary("sumo"), "-c", config], check=True, capture_output=True
    )
    assert read_configuration(config).net == net


def test_contents_are_those_of_files_with_encoded_names_too(tmp_path: Path, net: Path) -> None:
    state = tmp_path / "my state.xml"
    state.write_text("<snapshot/>")
    configuration = read_configuration(scenario_file(tmp_path, net, load_state="my%20state.xml"))
    before = configuration.contents
    state.write_text("<snapshot />")
    assert configuration.contents != before


def test_contents_change_with_a_variable_of_the_environment_that_an_option_is_told_by(
    tmp_path: Path, net: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = scenario_file(tmp_path, net, scale="${SCALE_OF_TODAY}")
    found = set()
    for scale in ("1", "1", "2"):
        monkeypatch.setenv("SCALE_OF_TODAY", scale)
        found.add(read_configuration(config).contents)
    assert len(found) == 2


def test_lists_of_files_are_taken_apart_and_relative_to_the_configuration(tmp_path: Path, net: Path) -> None:
    (tmp_path / "a").mkdir()
    for name in ("one.rou.xml", "two words.rou.xml"):
        (tmp_path / name).write_text("<routes/>")
    config = scenario_file(tmp_path / "a", net, route_files="../one.rou.xml, ../two words.rou.xml ,routes.rou.xml")
    routes = read_configuration(config).routes
    assert [path.name for path in routes] == ["one.rou.xml", "two words.rou.xml", "routes.rou.xml"]
    assert all(path.is_absolute() for path in routes)


def test_contents_are_those_of_a_copy_and_change_with_any_file_that_sumo_reads(tmp_path: Path, net: Path) -> None:
    """By an option, by what a file includes, and again by that one; but not with what a run of SUMO's own left."""
    named = {
        "weight_files": "weights.xml",
        "load_state": "state.xml",
        "summary": "left.xml",
        "save_state.files": "end.xml",
    }
    read = ["more.rou.xml", "most.rou.xml", "closed.xml", "signs.xml", "flows.xml", "weights.xml", "state.xml"]
    triggers = (
        '<rerouter id="r" file="closed.xml"/><variableSpeedSign id="v" lanes="x" file="signs.xml"/>'
        '<calibrator id="c" file="flows.xml"/><include href="nowhere.xml"/>'
    )
    config = scenario_file(tmp_path / "a", net, '<include href="more.rou.xml"/>', triggers, **named)
    for name in [*read, "left.xml", "end.xml"]:
        (tmp_path / "a" / name).write_text("<routes/>")
    (tmp_path / "a" / "more.rou.xml").write_text('<routes><include href="most.rou.xml"/></routes>')
    (tmp_path / "a" / "most.rou.xml").write_text('<routes><include href="more.rou.xml"/></routes>')
    contents = read_configuration(config).contents
    copy = Path(shutil.copytree(tmp_path / "a", tmp_path / "b")) / config.name
    os.utime(copy, (0.0, 0.0))
    assert read_configuration(copy).contents == contents
    for name in ["run.sumocfg", "routes.rou.xml", "extra.add.xml", "../some.net.xml", *read, "left.xml", "end.xml"]:
        path = tmp_path / "b" / name
        before = path.read_text()
        path.write_text(before + "<!-- -->")
        assert (read_configuration(copy).contents != contents) == (name not in ("left.xml", "end.xml")), name
        path.write_text(before)
    assert read_configuration(copy).contents == contents


def test_outputs_are_found_under_every_name(tmp_path: Path, net: Path) -> None:
    config = scenario_file(
        tmp_path, net, tripinfo="t.xml", log_file="l.txt", device__rerouting__output="w.xml", seed="3"
    )
    assert set(read_configuration(config).outputs) == {"tripinfo-output", "log", "device.rerouting.output"}


@pytest.mark.parametrize(
    ("text", "expected"),
    [("3600", 3600.0), ("12.5", 12.5), ("1:00:10", 3610.0), ("00:00:00", 0.0), ("1:3:30:0.5", 99000.5), ("-1", -1.0)],
)
def test_times_are_read_in_all_formats_of_sumo(text: str, expected: float) -> None:
    assert seconds(text, "begin") == expected


@pytest.mark.parametrize("text", ["soon", "", "1:2", "1:2:3:4:5", "1::2", "nan", "inf"])
def test_a_text_that_is_no_time_is_refused_by_its_option(text: str) -> None:
    with pytest.raises(ScenarioError, match=r"option begin is no time: .*allowed"):
        seconds(text, "begin")


def test_a_missing_configuration_suggests_the_nearest_name(tmp_path: Path, net: Path) -> None:
    scenario_file(tmp_path, net)
    with pytest.raises(
        ScenarioError, match=r"no such SUMO configuration: .*run\.sumcfg \(did you mean run\.sumocfg\?\)"
    ):
        read_configuration(tmp_path / "run.sumcfg")


def test_a_configuration_in_a_missing_folder_names_the_folder(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"no such folder: .*/nowhere"):
        read_configuration(tmp_path / "nowhere" / "run.sumocfg")


@pytest.mark.parametrize(
    "text", ["<configuration><net-file", "", "net-file=x", '<?xml version="1.0" encoding="klingon"?><configuration/>']
)
def test_a_configuration_that_is_not_xml_is_refused(tmp_path: Path, text: str) -> None:
    config = tmp_path / "run.sumocfg"
    config.write_text(text)
    with pytest.raises(ScenarioError, match=r"run\.sumocfg is not well-formed XML"):
        read_configuration(config)


@pytest.mark.skipif(not UNREADABLE.exists(), reason="no file that nobody can read")
@pytest.mark.parametrize("read", [read_configuration, content_of])
def test_a_file_that_cannot_be_read_is_named_with_the_reason(read: Callable[[Path], object]) -> None:
    with pytest.raises(ScenarioError, match=r"^/proc/\S+/mem cannot be read: Input/output error$"):
        read(UNREADABLE)


def test_contents_of_a_file_that_is_gone_are_refused(tmp_path: Path, net: Path) -> None:
    configuration = read_configuration(scenario_file(tmp_path, net))
    net.unlink()
    with pytest.raises(ScenarioError, match=r"some\.net\.xml cannot be read: No such file or directory"):
        _ = configuration.contents


def test_another_kind_of_xml_is_refused(tmp_path: Path, net: Path) -> None:
    with pytest.raises(ScenarioError, match="not a SUMO configuration with a net"):
        read_configuration(net)
    (tmp_path / "run.sumocfg").write_text("<configuration><route-files value='x'/></configuration>")
    with pytest.raises(ScenarioError, match="option net-file is not set"):
        read_configuration(tmp_path / "run.sumocfg")


@pytest.mark.parametrize("option", ["net-file", "route-files", "additional-files"])
def test_a_missing_input_is_named_with_its_option(tmp_path: Path, net: Path, option: str) -> None:
    config = scenario_file(tmp_path, net, **{option: "some.net.xm"})
    with pytest.raises(ScenarioError, match=rf"does not exist \({option}\): .*did you mean some\.net\.xml\?"):
        read_configuration(config)


@pytest.mark.parametrize("name", ["n" * 300, "circle", "%00"])
def test_a_name_that_cannot_be_that_of_a_file_is_told_with_its_option(tmp_path: Path, net: Path, name: str) -> None:
    (tmp_path / "circle").symlink_to("circle")
    config = scenario_file(tmp_path, net, route_files=name)
    with pytest.raises(ScenarioError) as refused:
        read_configuration(config)
    for word in (str(config), "route-files", name.removesuffix("%00")):
        assert word in str(refused.value)


def test_a_configuration_in_a_circle_of_links_is_named(tmp_path: Path) -> None:
    (tmp_path / "run.sumocfg").symlink_to("run.sumocfg")
    with pytest.raises(ScenarioError, match=r"run\.sumocfg"):
        read_configuration(tmp_path / "run.sumocfg")


def test_a_file_in_a_folder_that_must_not_be_entered_is_named(tmp_path: Path, folder: Path) -> None:
    net = folder / "some.net.xml"
    net.write_text("<net/>")
    inside, outside = scenario_file(folder, net), scenario_file(tmp_path, net)
    folder.chmod(0o600)
    if os.access(net, os.F_OK):
        pytest.skip("for this user there is no such folder")
    with pytest.raises(ScenarioError, match=r"run\.sumocfg"):
        read_configuration(inside)
    with pytest.raises(ScenarioError, match=r"some\.net\.xml.*net-file|net-file.*some\.net\.xml"):
        read_configuration(outside)


def test_a_folder_that_must_not_be_listed_suggests_nothing(folder: Path, net: Path) -> None:
    scenario_file(folder, net)
    folder.chmod(0o300)
    if os.access(folder, os.R_OK):
        pytest.skip("for this user there is no such folder")
    with pytest.raises(ScenarioError, match=r"^no such SUMO configuration: \S+/run\.sumcfg$"):
        read_configuration(folder / "run.sumcfg")


@pytest.mark.parametrize("value", ["true", "1", "yes"])
def test_the_mesoscopic_model_is_refused(tmp_path: Path, net: Path, value: str) -> None:
    with pytest.raises(ScenarioError, match="mesosim"):
        read_configuration(scenario_file(tmp_path, net, mesosim=value))


def test_refused_options_are_refused_as_texts_too(tmp_path: Path, net: Path) -> None:
    for option, value in (("mesosim", "true"), ("save-configuration", "out.xml")):
        with pytest.raises(ScenarioError, match=option):
            read_configuration(with_texts(scenario_file(tmp_path, net, **{option: value})))


def test_mesosim_switched_off_is_not_refused(tmp_path: Path, net: Path) -> None:
    assert read_configuration(scenario_file(tmp_path, net, mesosim="false")).net == net.resolve()


@pytest.mark.parametrize("option", ["save-configuration", "C", "save-template", "save-schema"])
def test_a_configuration_that_only_saves_options_is_refused(tmp_path: Path, net: Path, option: str) -> None:
    with pytest.raises(ScenarioError, match="leave without a simulation"):
        read_configuration(scenario_file(tmp_path, net, **{option: "out.xml"}))


def test_environment_variables_stand_for_what_they_are_to_sumo(
    tmp_path: Path, net: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROUTES_OF_TODAY", str(tmp_path))
    monkeypatch.delenv("NOBODY_SETS_THIS", raising=False)
    config = scenario_file(tmp_path / "elsewhere", net, route_files="${ROUTES_OF_TODAY}/${NOBODY_SETS_THIS}some.xml")
    (tmp_path / "some.xml").write_text("<routes/>")
    assert read_configuration(config).routes == (tmp_path / "some.xml",)
