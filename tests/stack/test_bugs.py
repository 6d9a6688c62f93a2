"""Real bugs as switches: what a build with one differs in, and which stacks can have one."""

from pathlib import Path

import pytest
from msgspec.structs import asdict

from dvca_sumo.stack.bugs import BUGS, BugError, build_with
from dvca_sumo.stack.reference import StackConfig
from dvca_sumo.stack.sources import StackSource, stack_factory


def test_the_eight_real_bugs_are_there() -> None:
    assert set(BUGS) == {
        *("apollo-6826", "apollo-3634", "apollo-3257", "apollo-10706"),
        *("planfuzz-v1", "planfuzz-v7", "apollo-c803010", "apollo-cc890a4"),
    }


@pytest.mark.parametrize("name", BUGS)
def test_a_buggy_build_differs_from_the_fixed_one_in_one_switch(name: str) -> None:
    fixed, buggy = StackConfig(), build_with(name, StackConfig())
    component = BUGS[name].component.value
    for table in asdict(fixed):
        ours, theirs = asdict(getattr(fixed, table)), asdict(getattr(buggy, table))
        changed = {field: theirs[field] for field in ours if ours[field] != theirs[field]}
        assert changed == (BUGS[name].switches if table == component else {})
    assert len(BUGS[name].switches) == 1


def test_other_parameters_stay_as_they_were_set() -> None:
    slow = StackConfig(planning=type(StackConfig().planning)(acceleration=0.5))
    assert build_with("apollo-6826", slow).planning.acceleration == 0.5


@pytest.mark.parametrize(("name", "nearest"), [("apollo-6286", "apollo-6826"), ("cc890a4", "apollo-cc890a4")])
def test_an_unknown_bug_is_refused_with_the_names_there_are_and_the_nearest(name: str, nearest: str) -> None:
    with pytest.raises(BugError, match=rf"no bug '{name}' .*apollo-3257, .*did you mean '{nearest}'\?"):
        build_with(name, StackConfig())


def test_a_stack_of_a_users_own_cannot_have_one() -> None:
    with pytest.raises(BugError, match="'apollo-6826' is a switch of the reference stack; 'my_stack:mine' has none"):
        stack_factory(StackSource("my_stack:mine", "apollo-6826"))


def test_parameters_from_a_file_do_not_hide_an_unknown_bug(tmp_path: Path) -> None:
    path = tmp_path / "stack.toml"
    path.write_text("[planning]\nacceleration = 0.5\n")
    with pytest.raises(BugError, match="no bug 'apollo'"):
        stack_factory(StackSource(str(path), "apollo"))
