import math
import tomllib
from pathlib import Path

import pytest

from dvca_sumo.installation import folder
from dvca_sumo.interventions import (
    COMMON,
    EFFECTS,
    FaultError,
    Selection,
    State,
    fault_library,
    library,
    planted_fault,
)
from dvca_sumo.interventions.library import FaultType, Parameter
from dvca_sumo.messages import Component

# The 13 types of injected errors of the paper's table of faults.
TYPES = {
    "perception.miss": Component.PERCEPTION,
    "perception.box": Component.PERCEPTION,
    "perception.longitudinal": Component.PERCEPTION,
    "perception.lateral": Component.PERCEPTION,
    "perception.velocity": Component.PERCEPTION,
    "prediction.none": Component.PREDICTION,
    "prediction.wrong": Component.PREDICTION,
    "planning.path": Component.PLANNING,
    "planning.speed": Component.PLANNING,
    "planning.none": Component.PLANNING,
    "control.longitudinal": Component.CONTROL,
    "control.lateral": Component.CONTROL,
    "localization.lateral": Component.LOCALIZATION,
}
PARAMETERS = [
    (name, key, parameter) for name, entry in fault_library().items() for key, parameter in entry.parameters.items()
]


def refusal(text: str) -> str:
    with pytest.raises(FaultError) as caught:
        planted_fault(text)
    said = str(caught.value)
    assert "\n" not in said
    return said


@pytest.mark.parametrize(("name", "component"), TYPES.items())
def test_each_type_of_the_paper_can_be_planted_without_further_words(name: str, component: Component) -> None:
    fault = planted_fault(name)
    assert (fault.name, fault.component) == (name, component)
    assert fault.effect in EFFECTS
    assert fault.selection == Selection()
    assert fault.parameters == {key: one.default for key, one in fault_library()[name].parameters.items()}


def test_the_library_is_in_alphabetical_order() -> None:
    assert list(fault_library()) == sorted(fault_library())


@pytest.mark.parametrize("path", sorted(folder("faults").glob("*.toml")), ids=lambda path: path.stem)
def test_a_fault_file_holds_nothing_that_would_be_ignored(path: Path) -> None:
    written = tomllib.loads(path.read_text())
    assert set(written) <= set(FaultType.__struct_fields__)
    for parameter in written.get("parameters", {}).values():
        assert set(parameter) <= set(Parameter.__struct_fields__)


@pytest.mark.parametrize(("name", "key", "parameter"), PARAMETERS, ids=lambda one: one if isinstance(one, str) else "")
def test_a_parameter_is_documented_with_unit_range_and_a_default_within(
    name: str, key: str, parameter: Parameter
) -> None:
    assert parameter.summary
    assert key not in COMMON
    if parameter.kind == "object":
        assert parameter.default == "in_way"
        return
    assert parameter.kind == "number"
    assert parameter.unit
    assert isinstance(parameter.default, float)
    assert -math.inf < parameter.low <= parameter.default <= parameter.high < math.inf
    for bound in (parameter.low, parameter.high):
        assert planted_fault(f"{name}:{key}={bound!r}").parameters[key] == bound


@pytest.mark.parametrize("name", TYPES)
def test_a_fault_with_its_defaults_distorts_something(name: str) -> None:
    numbers = [one.default for one in fault_library()[name].parameters.values() if one.kind == "number"]
    assert not numbers or any(numbers)


def test_parameters_and_selection_are_read_from_one_line() -> None:
    fault = planted_fault(
        "perception.longitudinal:object=person:ped,ahead=-3.5,start=2,end=7.5,first=10,last=20,state=4:-1:-2"
    )
    assert fault.parameters == {"object": "person:ped", "ahead": -3.5, "left": 0.0}
    assert fault.selection == Selection(start=2.0, end=7.5, first=10, last=20, state=State(4, -1, -2))


def test_an_unknown_fault_suggests_the_nearest() -> None:
    said = refusal("perception.mis")
    assert "'perception.mis'" in said
    assert "'perception.miss'" in said


def test_a_name_like_no_other_is_answered_with_all_there_are() -> None:
    said = refusal("qqq")
    assert all(name in said for name in TYPES)


def test_an_unknown_parameter_suggests_the_nearest() -> None:
    said = refusal("perception.miss:objct=ped")
    assert "'objct'" in said
    assert "'object'" in said


def test_a_parameter_of_another_fault_is_unknown() -> None:
    assert "'error'" in refusal("perception.miss:error=1")


def test_a_parameter_without_a_value_is_told_to_have_one() -> None:
    said = refusal("perception.miss:object")
    assert "object" in said
    assert "has no value" in said
    assert "object" in refusal("perception.miss:object=")


@pytest.mark.parametrize("value", ["-1.1", "1.1", "inf", "nan", "1e400"])
def test_a_number_out_of_range_is_answered_with_range_and_unit(value: str) -> None:
    said = refusal(f"control.lateral:error={value}")
    assert value in said
    assert "-1 to 1 rad" in said


@pytest.mark.parametrize("value", ["strong", "", "0.1 rad", "0x1"])
def test_what_is_no_number_is_answered_with_range_and_unit(value: str) -> None:
    said = refusal(f"control.lateral:error={value}")
    assert "error" in said
    assert "-1 to 1 rad" in said


@pytest.mark.parametrize("word", ["first=1.5", "last=2.5", "first=-1", "first=inf", "first=nan", "last=many"])
def test_an_index_is_a_whole_number_from_zero_on(word: str) -> None:
    assert word.partition("=")[2] in refusal(f"planning.none:{word}")


@pytest.mark.parametrize("state", ["1:2", "1:2:3:4", "1:2:x", "1:2:1.5", "1:2:", "1:2:--3", "1:2:\u00b2"])
def test_a_state_is_three_whole_numbers(state: str) -> None:
    assert "p:v:a" in refusal(f"planning.none:state={state}")


@pytest.mark.parametrize("window", ["start=5,end=4.5", "first=8,last=7"])
def test_a_window_that_ends_before_it_begins_is_refused(window: str) -> None:
    assert "lies before" in refusal(f"planning.none:{window}")


def test_a_window_may_be_one_message() -> None:
    assert planted_fault("planning.none:first=8,last=8").selection == Selection(first=8, last=8)


def test_a_time_before_the_departure_is_out_of_range() -> None:
    assert "-1" in refusal("planning.none:start=-1")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("component = 'perception'", "malformed"),
        ("component = ", "malformed"),
        ("component = 'sensing'\neffect = 'drop_objects'\nsummary = ''", "malformed"),
        ("component = 'perception'\neffect = 'drop_object'\nsummary = ''", "'drop_objects'"),
    ],
)
def test_a_broken_fault_file_is_named(text: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "perception.odd.toml").write_text(text)
    monkeypatch.setattr(library, "folder", lambda _: tmp_path)
    with pytest.raises(FaultError, match=r"perception\.odd\.toml") as caught:
        fault_library.__wrapped__()
    assert reason in str(caught.value)
