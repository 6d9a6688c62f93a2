"""What the README shows is what the program prints."""

import re
from pathlib import Path

import pytest
from command_line import typed

from dvca_sumo.cli import ExitCode

README = Path(__file__).parents[1] / "README.md"
COMMAND = "dvca-sumo run nets/cs1.sumocfg --fault perception.miss"

# Seconds of wall time, and how many runs were made side by side, are the machine's.
_MACHINE = (
    (re.compile(r"\d+(\.\d+)? s with \d+ jobs?"), "? s with ? jobs"),
    (re.compile(r"(certified|wall|took)(\D*)\d+(\.\d+)? s\b"), r"\1\2? s"),
)


def _blocks() -> list[str]:
    """The fenced blocks of the README, in order."""
    return re.findall(r"^```\w*\n(.*?)^```$", README.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def _masked(text: str) -> str:
    for pattern, mark in _MACHINE:
        text = pattern.sub(mark, text)
    return text


def test_the_example_output_is_what_the_command_prints() -> None:
    blocks = _blocks()
    shown = blocks[blocks.index(f"{COMMAND}\n") + 1]
    said = typed(*COMMAND.split()[1:])
    assert said.code == ExitCode.ATTRIBUTED
    assert _masked(said.out) == _masked(shown)


def test_two_commands_are_enough_for_a_fresh_machine() -> None:
    lines = [line for block in _blocks() for line in block.splitlines() if line.startswith("pip install")]
    assert lines == [f"pip install . && {COMMAND}", "pip install '.[test]' && pytest"]


@pytest.mark.parametrize("code", ExitCode)
def test_every_exit_code_is_in_its_table(code: ExitCode) -> None:
    assert re.search(rf"^\| {int(code)} \| \w", README.read_text(encoding="utf-8"), re.MULTILINE)
