import math
from pathlib import Path

import pytest

from dvca_sumo.interventions import (
    COMMON,
    EFFECTS,
    FaultError,
    FaultType,
    Parameter,
    Selection,
    State,
    fault_library,
    library,
    planted_fault,
)
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


def test_a_default_may_be_written() -> None:
    assert planted_fault("perception.miss:last=inf,end=inf") == planted_fault("perception.miss")


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


def test_a_parameter_given_twice_is_refused_even_with_one_value() -> None:
    assert "start is given twice" in refusal("planning.none:start=8,start=9")
    assert "left is given twice" in refusal("planning.path:left=1,first=3,left=1")


STEERING = """
component = "control"
effect = "offset_steering"
summary = "The steering command is off."

[parameters.error]
summary = "added to the front wheel angle"
unit = "rad"
default = -0.1
low = -1.0
high = 1.0
"""
MISSED = """
component = "perception"
effect = "drop_objects"
summary = "An object is missing."

[parameters.object]
summary = "simulator id"
kind = "object"
default = "in_way"
"""
BROKEN_FILES = {
    "no TOML": ("component = ", ("malformed",)),
    "field left out": (STEERING.replace('summary = "The', '# "The'), ("malformed", "summary")),
    "field misspelt": (STEERING.replace("summary =", "sumary =", 1), ("'sumary'", "component", "'summary'")),
    "field of a parameter misspelt": (STEERING.replace("low", "lo"), ("'error'", "'lo'", "unit", "'low'")),
    "field ill-typed": (STEERING.replace("-1.0", '"-1"'), ("malformed", "low")),
    "parameters that are none": (STEERING[: STEERING.index("[")] + "parameters = 3", ("malformed", "parameters")),
    "unknown component": (STEERING.replace('"control"', '"controls"'), ("'controls'", "planning", "'control'")),
    "unknown effect": (STEERING.replace("steering", "stering", 1), ("'offset_stering'", "shift_pose", "steering'")),
    "effect of another component": (STEERING.replace('"control"', '"planning"'), ("planning", "allowed: control")),
    "parameter that the effect does not read": (
        STEERING.replace(".error", ".eror"),
        ("'eror'", "allowed: error", "did you mean 'error'?"),
    ),
    "parameter left out": (STEERING[: STEERING.index("[")], ("offset_steering", "'error'", "no parameter")),
    "parameter of another kind": (
        STEERING.replace("default = -0.1", 'kind = "object"\ndefault = "all"'),
        ("'error'", "'object'", "allowed: number"),
    ),
    "default that is no number": (STEERING.replace("-0.1", '"fast"'), ("'error'", "'fast'", "-1 to 1 rad")),
    "default beyond the range": (STEERING.replace("-0.1", "5.0"), ("'error'", "5.0", "-1 to 1 rad")),
    "default that is not a number": (STEERING.replace("-0.1", "nan"), ("'error'", "nan", "-1 to 1 rad")),
    "range the wrong way round": (STEERING.replace("low = -1.0", "low = 2.0"), ("'error'", "-0.1", "2 to 1 rad")),
    "object that is a number": (MISSED.replace('"in_way"', "3"), ("'object'", "3.0", "in_way, all")),
}


def library_of(text: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, FaultType]:
    """The library, read from a folder that holds one file."""
    (folder / "mine.odd.toml").write_text(text, encoding="utf-8")
    monkeypatch.setattr(library, "folder", lambda _: folder)
    return fault_library.__wrapped__()


@pytest.mark.parametrize("text", [STEERING, MISSED])
def test_a_fault_file_of_ones_own_is_read(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert list(library_of(text, tmp_path, monkeypatch)) == ["mine.odd"]


@pytest.mark.parametrize("case", BROKEN_FILES)
def test_a_broken_fault_file_is_named(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text, says = BROKEN_FILES[case]
    with pytest.raises(FaultError) as caught:
        library_of(text, tmp_path, monkeypatch)
    said = str(caught.value)
    assert "\n" not in said
    assert [word for word in ("mine.odd.toml", *says) if word not in said] == []


def test_a_fault_file_that_cannot_be_decoded_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.toml").write_bytes(MISSED.encode("utf-16"))
    monkeypatch.setattr(library, "folder", lambda _: tmp_path)
    with pytest.raises(FaultError, match=r"mine\.toml is malformed"):
        fault_library.__wrapped__()
