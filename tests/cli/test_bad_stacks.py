"""A user's stack that cannot be built or fails: named, in one line, with the contract's exit code."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import assert_one_error, typed

from dvca_sumo.cli import ExitCode

STACKS = Path(__file__).with_name("users_stacks.py")

BAD_FACTORIES = {
    "nowhere:stack": ("'nowhere:stack' cannot be imported", "No module named 'nowhere'"),
    "users_stacks:nothing": ("'users_stacks:nothing' cannot be imported", "no attribute 'nothing'"),
    "half_written:stack": ("'half_written:stack' cannot be imported", "SyntaxError"),
    "a_script:stack": ("'a_script:stack' cannot be imported", "SystemExit: 0"),
    "users_stacks": ("no stack 'users_stacks'", "MODULE:FACTORY", "FILE.toml"),
    "users_stacks:NOT_CALLABLE": ("'users_stacks:NOT_CALLABLE' is not callable",),
    "users_stacks:raising": ("'users_stacks:raising' raised LookupError", "no weights for seed 5"),
    "users_stacks:exiting": ("'users_stacks:exiting' raised SystemExit: no licence",),
    "users_stacks:of_another_type": ("'users_stacks:of_another_type' returned dict, not a Stack",),
    "users_stacks:fails_in_cycle_57": ("planning raised ArithmeticError: no convergence in cycle 57",),
    "users_stacks:leaves": ("control raised SystemExit: 3 in cycle 0",),
    "users_stacks:not_a_number": ("control", "must be finite", "nan"),
}
BAD_FILES = {
    "unknown field": ("[planning]\nbravery = 2\n", ("bravery", "$.planning")),
    "unknown component": ("[brain]\nsize = 2\n", ("brain",)),
    "wrong type": ('[planning]\nacceleration = "fast"\n', ("`str`", "$.planning.acceleration")),
    "range that is none": ("[sensors]\nfar_range = -5\n", ("far_range is -5", "allowed: 0.1 to 150", "$.sensors")),
    "value that the stack cannot be built with": (
        "[localization]\nlargest_steering = inf\n",
        ("stack file 'mine.toml' raised ",),
    ),
    "no TOML": ("planning: fast\n", ("line 1",)),
}


@pytest.mark.parametrize("stack", BAD_FACTORIES)
def test_a_factory_that_does_not_work(stack: str, tmp_path: Path) -> None:
    shutil.copy(STACKS, tmp_path)
    (tmp_path / "half_written.py").write_text("def stack(", encoding="utf-8")
    (tmp_path / "a_script.py").write_text("import sys\nsys.exit(0)\n", encoding="utf-8")
    said = typed("run", "nets/cs1.sumocfg", "--seed", "5", "--stack", stack, folder=tmp_path)
    assert_one_error(said, ExitCode.BAD_INPUT, *BAD_FACTORIES[stack])


def test_screening_names_a_factory_that_is_built_into_python_and_returns_no_stack(tmp_path: Path) -> None:
    """There is no file of it to tell results of the same code by."""
    said = typed("screen", "nets/cs1.sumocfg", "--stack", "time:sleep", "-o", tmp_path / "kept")
    assert said.code == ExitCode.UNRESOLVED
    assert "not_driven: stack factory 'time:sleep' raised TypeError" in said.out


@pytest.mark.parametrize("case", BAD_FILES)
def test_a_parameter_file_that_does_not_fit(case: str, tmp_path: Path) -> None:
    text, says = BAD_FILES[case]
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    said = typed("run", "nets/cs1.sumocfg", "--stack", "mine.toml", folder=tmp_path)
    assert_one_error(said, ExitCode.BAD_INPUT, "mine.toml", *says)


def test_a_parameter_file_that_is_not_there(tmp_path: Path) -> None:
    said = typed("run", "nets/cs1.sumocfg", "--stack", "mine.toml", folder=tmp_path)
    assert_one_error(said, ExitCode.BAD_INPUT, "mine.toml", "cannot be read", "No such file")


def test_a_parameter_file_that_fits_is_used(tmp_path: Path, scenario: Callable[..., Path]) -> None:
    (tmp_path / "slow.toml").write_text("[planning]\nacceleration = 0.5\n", encoding="utf-8")
    config = scenario()
    plain = typed("run", config, "--json").result
    slow = typed("run", config, "--json", "--stack", tmp_path / "slow.toml").result
    assert plain["verdict"] == slow["verdict"] == "none"
    assert plain["digest"] != slow["digest"]
    assert (plain["stack"], slow["stack"]) == (None, str(tmp_path / "slow.toml"))


def test_what_a_module_prints_while_it_is_imported_is_no_part_of_the_result(
    tmp_path: Path, scenario: Callable[..., Path]
) -> None:
    text = "from dvca_sumo.stack.reference import reference_stack as stack\nprint('weights loaded')\n"
    (tmp_path / "talkative.py").write_text(text, encoding="utf-8")
    said = typed("run", scenario(), "--json", "--stack", "talkative:stack", folder=tmp_path)
    assert said.code == ExitCode.NO_VIOLATION, said
    assert said.result["verdict"] == "none"
    assert said.err.splitlines()[0] == "weights loaded"


def test_a_stack_that_crashes_its_process_is_an_internal_error_not_a_dead_tool(tmp_path: Path) -> None:
    shutil.copy(STACKS, tmp_path)
    said = typed("run", "nets/cs1.sumocfg", "--stack", "users_stacks:crashing", folder=tmp_path)
    assert_one_error(said, ExitCode.INTERNAL, "the run failed: the process died")


@pytest.mark.parametrize("stack", ["never_the_same", "drawn_at_the_start"])
def test_a_stack_that_never_drives_alike_is_not_reproducible(
    stack: str, tmp_path: Path, scenario: Callable[..., Path]
) -> None:
    shutil.copy(STACKS, tmp_path)
    words = ("--stack", f"users_stacks:{stack}", "--json")
    said = typed("run", scenario(), *words, folder=tmp_path)
    assert said.code == ExitCode.UNRESOLVED, said
    assert said.result["verdict"] == "not_reproducible"
    assert said.result["reproducible"] is False
    assert said.result["component"] is None
    assert "differs" in said.result["reason"]
