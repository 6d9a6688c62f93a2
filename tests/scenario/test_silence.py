"""Files whose detectors would write beside them are run from silent copies; all others as they are."""

import gzip
import os
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from small_scenarios import driven, scenario_file

from dvca_sumo.scenario import ScenarioError, silenced
from dvca_sumo.scenario.silence import WRITTEN
from dvca_sumo.violations import Ending


def written(folder: Path, text: str, name: str = "a.add.xml") -> Path:
    path = folder / name
    path.write_text(f"<additional>{text}</additional>")
    return path


def copied(path: Path, folder: Path) -> ET.Element:
    (copy,) = silenced((path,), folder)
    assert copy.is_relative_to(folder)
    return ET.parse(copy).getroot()  # noqa: S314 our own file


def only(root: ET.Element, name: str) -> ET.Element:
    (found,) = root.iter(name)
    return found


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    path = tmp_path / "scratch"
    path.mkdir()
    return path


@pytest.mark.parametrize(("element", "attribute"), WRITTEN.items())
def test_the_file_of_every_kind_of_detector_goes_nowhere(
    tmp_path: Path, scratch: Path, element: str, attribute: str
) -> None:
    path = written(tmp_path, f'<{element} id="d" {attribute}="out/d.xml" period="60"/>')
    root = copied(path, scratch)
    assert root[0].attrib == {"id": "d", attribute: os.devnull, "period": "60"}
    assert "out/d.xml" in path.read_text()


@pytest.mark.parametrize("element", ["edgeData", "laneData"])
def test_a_detector_of_the_edges_that_a_file_lists_is_no_hindrance(tmp_path: Path, street: Path, element: str) -> None:
    """SUMO looks for that file in its working folder, which is not the user's in a run."""
    (tmp_path / "edges.txt").write_text("edge:bc\n")
    config = scenario_file(
        tmp_path, street, additional=f'<{element} id="d" file="d.xml" edgesFile="edges.txt" period="1"/>'
    )
    assert driven(config).ending is Ending.ARRIVED


def test_what_a_copied_file_reads_stays_where_it_is(tmp_path: Path, scratch: Path) -> None:
    root = copied(
        written(
            tmp_path, '<e1Detector file="x"/><rerouter file="r.xml"/><calibrator file="c.xml"/><poly imgFile="p.png"/>'
        ),
        scratch,
    )
    assert only(root, "rerouter").get("file") == str(tmp_path / "r.xml")
    assert only(root, "calibrator").get("file") == str(tmp_path / "c.xml")
    assert only(root, "poly").get("imgFile") == str(tmp_path / "p.png")


def test_a_detector_deep_in_included_files_is_found(tmp_path: Path, scratch: Path) -> None:
    (tmp_path / "sub").mkdir()
    written(tmp_path / "sub", '<include href="c.xml"/>', "b.xml")
    written(tmp_path / "sub", '<inductionLoop id="d" file="d.xml"/>', "c.xml")
    outer = copied(written(tmp_path, '<include href="sub/b.xml"/>'), scratch)
    middle = ET.parse(only(outer, "include").attrib["href"]).getroot()  # noqa: S314
    inner = ET.parse(only(middle, "include").attrib["href"]).getroot()  # noqa: S314
    assert only(inner, "inductionLoop").get("file") == os.devnull


def test_a_gzipped_file_with_a_detector_is_silenced_too(tmp_path: Path, scratch: Path) -> None:
    path = tmp_path / "a.add.xml.gz"
    path.write_bytes(gzip.compress(b'<additional><laneData id="d" file="d.xml"/></additional>'))
    assert only(copied(path, scratch), "laneData").get("file") == os.devnull


def test_detectors_of_an_actuated_light_write_nothing(tmp_path: Path, scratch: Path) -> None:
    light = (
        '<tlLogic id="b" type="actuated"><param key="file" value="d.xml"/><param key="max-gap" value="3"/></tlLogic>'
    )
    root = copied(written(tmp_path, light), scratch)
    assert [one.get("value") for one in root.iter("param")] == [os.devnull, "3"]


def test_a_parameter_called_file_of_anything_else_stays(tmp_path: Path, scratch: Path) -> None:
    root = copied(written(tmp_path, '<poi id="p"><param key="file" value="notes.txt"/></poi>'), scratch)
    assert only(root, "param").get("value") == "notes.txt"


def test_names_survive_the_copy_in_any_encoding(tmp_path: Path, scratch: Path) -> None:
    path = tmp_path / "a.add.xml"
    detector = '<additional><e1Detector id="d" lane="Straße_0" file="x"/></additional>'
    path.write_bytes(f'<?xml version="1.0" encoding="ISO-8859-1"?>{detector}'.encode("latin-1"))
    assert only(copied(path, scratch), "e1Detector").get("lane") == "Straße_0"


def test_files_without_outputs_are_used_as_they_are_and_the_order_stays(tmp_path: Path, scratch: Path) -> None:
    plain = written(tmp_path, '<poi id="detector" file="x"/>', "plain.add.xml")
    loud = written(tmp_path, '<e1Detector file="x"/>')
    first, second, third = silenced((plain, loud, plain), scratch)
    assert (first, third) == (plain, plain)
    assert second.is_relative_to(scratch)


def test_files_of_one_name_in_different_folders_do_not_meet(tmp_path: Path, scratch: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        written(tmp_path / name, f'<e1Detector id="{name}" file="x"/>')
    copies = silenced((tmp_path / "one" / "a.add.xml", tmp_path / "two" / "a.add.xml"), scratch)
    found = [only(ET.parse(copy).getroot(), "e1Detector").get("id") for copy in copies]  # noqa: S314
    assert found == ["one", "two"]


def test_a_malformed_file_is_named(tmp_path: Path, scratch: Path) -> None:
    with pytest.raises(ScenarioError, match=r"a\.add\.xml is not well-formed XML"):
        silenced((written(tmp_path, '<e1Detector file="x">'),), scratch)


def test_devices_of_vehicles_and_types_write_nowhere(tmp_path: Path, scratch: Path) -> None:
    names = ("device.ssm.file", "device.toc.file", "device.ssm.measures")
    words = "".join(f'<param key="{name}" value="x"/>' for name in names)
    root = copied(written(tmp_path, f'<vType id="t">{words}</vType><vehicle id="v">{words}</vehicle>'), scratch)
    assert [one.get("value") for one in root.iter("param")] == [os.devnull, os.devnull, "x"] * 2
