"""Stacks: the reference one, one with parameters from a file, and those of users."""

from pathlib import Path

import pytest

from dvca_sumo.messages import VehicleShape
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.stack.reference import (
    Stack,
    StackConfig,
    StackContext,
    StackError,
    reference_stack,
)
from dvca_sumo.stack.sensors import SensorConfig
from dvca_sumo.stack.sources import StackSource, built_checked, stack_factory


@pytest.fixture
def context(street: Path) -> StackContext:
    roadmap = RoadMap.load(street)
    route = roadmap.route(["ab", "bc"], "ab_0", 20.0, None, 100.0)
    return StackContext(roadmap, route, VehicleShape(4.5, 1.8, 2.7, 0.8), 1)


def written(folder: Path, text: str) -> str:
    path = folder / "stack.toml"
    path.write_text(text)
    return str(path)


def test_without_a_word_it_is_the_reference_stack(context: StackContext) -> None:
    stack = stack_factory(StackSource())(context)
    assert isinstance(stack, Stack)
    assert stack.sensor_range == SensorConfig().far_range


def test_every_trip_gets_components_of_its_own(context: StackContext) -> None:
    one, other = reference_stack(context), reference_stack(context)
    for component in ("sensors", "localization", "perception", "prediction", "planning", "control"):
        assert getattr(one, component) is not getattr(other, component)


def test_a_file_sets_any_parameter_and_leaves_the_others(tmp_path: Path, context: StackContext) -> None:
    stack = stack_factory(StackSource(written(tmp_path, "[sensors]\nfar_range = 45.0\n")))(context)
    assert stack.sensor_range == 45.0
    assert type(stack.planning) is type(reference_stack(context).planning)


def test_an_empty_file_is_the_reference_stack(tmp_path: Path, context: StackContext) -> None:
    assert stack_factory(StackSource(written(tmp_path, "")))(context).sensor_range == StackConfig().sensors.far_range


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[sensors]\nfar_rang = 45.0", "unknown field `far_rang` - at `\\$.sensors`"),
        ("[wheels]", "unknown field `wheels`"),
        ('[sensors]\nfar_range = "far"', "Expected `float`, got `str` - at `\\$.sensors.far_range`"),
        ("[sensors\nfar_range", "stack.toml: "),
    ],
)
def test_a_file_that_holds_something_else_is_refused_with_file_and_field(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(StackError, match=rf"stack file .*stack\.toml: .*{words.removeprefix('stack.toml: ')}"):
        stack_factory(StackSource(written(tmp_path, text)))


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StackError, match=r"stack file .*none\.toml cannot be read: No such file"):
        stack_factory(StackSource(str(tmp_path / "none.toml")))


@pytest.mark.parametrize(
    ("word", "words"),
    [
        ("fast", r"no stack 'fast' \(allowed: MODULE:FACTORY or FILE\.toml\)"),
        ("no_such_module:stack", r"'no_such_module:stack' cannot be imported: ModuleNotFoundError: .*no_such_module"),
        ("small_stacks:no_such_factory", r"cannot be imported: AttributeError: .*no_such_factory"),
        ("small_stacks:", "cannot be imported"),
        (":stack", "cannot be imported"),
        ("small_stacks:NOT_CALLABLE", r"'small_stacks:NOT_CALLABLE' is not callable: 5"),
    ],
)
def test_a_factory_that_cannot_be_had_is_named_with_the_reason(word: str, words: str) -> None:
    with pytest.raises(StackError, match=words):
        stack_factory(StackSource(word))


def test_a_module_that_breaks_while_it_is_imported_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "broken_stack.py").write_text("1 / 0\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(StackError, match="'broken_stack:stack' cannot be imported: ZeroDivisionError"):
        stack_factory(StackSource("broken_stack:stack"))


def test_a_users_module_is_found_where_the_command_is_typed(
    tmp_path: Path, context: StackContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "my_stack.py").write_text(
        "from dvca_sumo.stack.reference import reference_stack\nmine = lambda context: reference_stack(context)\n"
    )
    monkeypatch.chdir(tmp_path)
    assert isinstance(stack_factory(StackSource("my_stack:mine"))(context), Stack)


def test_a_factory_that_raises_is_named(context: StackContext) -> None:
    def refusing(_: StackContext) -> Stack:
        raise LookupError("no weights here")

    with pytest.raises(StackError, match="stack factory 'mine:refusing' raised LookupError: no weights here"):
        built_checked("mine:refusing", refusing)(context)


def test_a_factory_that_returns_something_else_is_named(context: StackContext) -> None:
    with pytest.raises(StackError, match="stack factory 'mine:it' returned str, not a Stack"):
        built_checked("mine:it", lambda _: "stack")(context)  # type: ignore[arg-type,return-value]
