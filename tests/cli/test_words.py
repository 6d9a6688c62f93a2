"""The words of a command line: wrong ones are told in one line, and help explains the right ones."""

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from command_line import Said, assert_one_error

from dvca_sumo.cli import ExitCode, program
from dvca_sumo.interventions import fault_library, library
from dvca_sumo.stack.bugs import BUGS

Called = Callable[..., Said]

CS1 = "nets/cs1.sumocfg"  # built in: found from any folder

# What is planted -> what must be said of it.
BAD_FAULTS = {
    "perception.mis": ("unknown fault 'perception.mis'", "did you mean 'perception.miss'?"),
    "perception": ("unknown fault 'perception'", "did you mean 'perception."),
    "xyz": ("unknown fault 'xyz'", *fault_library()),
    "": ("unknown fault ''",),
    "planning.speed:eror=3": ("takes no parameter 'eror'", "did you mean 'error'?"),
    "planning.none:error=3": ("planning.none takes no parameter 'error'",),
    "planning.speed:error": ("parameter error has no value", "write error=..."),
    "planning.speed:error=fast": ("parameter error is no number: 'fast'", "allowed: -60 to 60 m/s"),
    "planning.speed:error=60.5": ("parameter error is out of range: 60.5", "allowed: -60 to 60 m/s"),
    "planning.speed:error=nan": ("parameter error", "nan", "allowed: -60 to 60 m/s"),
    "control.lateral:error=-1.01": ("parameter error is out of range: -1.01", "allowed: -1 to 1 rad"),
    "perception.miss:object=": ("parameter object is empty", "in_way", "all"),
    "planning.path:start=-1": ("parameter start is out of range: -1", "0 to inf s"),
    "planning.path:start=9,end=5": ("end=5", "before start=9"),
    "planning.path:first=9,last=5": ("last=5", "before first=9"),
    "planning.path:first=1.5": ("parameter first is no whole number: 1.5",),
    "planning.path:first=inf": ("parameter first is no whole number: inf",),
    "planning.path:": ("takes no parameter ''",),
    "perception.miss:object=pedestrain": ("no object 'pedestrain' comes near", "did you mean 'pedestrian'?", "in_way"),
    "planning.path:start=8,start=9": ("parameter start is given twice",),
    "planning.path:state=1:2": ("parameter state is no state: '1:2'", "p:v:a"),
}
BAD_USAGE = {
    "run": "Missing argument 'SUMOCFG'",
    "runn": "No such command 'runn'",
    f"run {CS1} more": "unexpected extra argument (more)",
    f"run {CS1} --nope": "No such option '--nope'",
    f"run {CS1} --fault": "'--fault' requires an argument",
    f"run {CS1} --engine magic": "'magic'",
    f"run {CS1} --jobs 0": "'--jobs': 0 is not in the range",
    f"run {CS1} --seed 1.5": "'--seed': '1.5'",
    f"run {CS1} --begin soon": "'--begin': 'soon'",
    f"run {CS1} --jitter --repeats 0": "'--repeats': 0 is not in the range",
    f"run {CS1} --repeats 2": "--repeats goes with --jitter",
    f"run {CS1} --bug": "'--bug' requires an argument",
    f"run {CS1} --bug apollo-6826 --stack mine:stack": "does not go with --stack MODULE:FACTORY",
    f"run {CS1} -o {__file__}": "is a file",
    f"run {CS1} -o /proc": "cannot write into the folder /proc",
    "bench -o /proc/self": "cannot write into the folder /proc/self",
    f"screen {CS1} -o /proc/new": "cannot write into the folder /proc/new",
    "faults more": "unexpected extra argument (more)",
}


@pytest.mark.parametrize("fault", BAD_FAULTS, ids=lambda fault: fault or "empty")
def test_a_wrong_fault_is_bad_input(called: Called, fault: str) -> None:
    assert_one_error(called("run", CS1, "--fault", fault), ExitCode.BAD_INPUT, *BAD_FAULTS[fault])


def test_a_wrong_fault_behind_a_right_one_is_bad_input(called: Called) -> None:
    said = called("run", CS1, "--fault", "planning.none", "--fault", "control.lateral:error=2")
    assert_one_error(said, ExitCode.BAD_INPUT, "control.lateral: parameter error is out of range: 2")


def test_an_unknown_bug_is_bad_input(called: Called) -> None:
    said = called("run", CS1, "--bug", "apollo-6286")
    assert_one_error(said, ExitCode.BAD_INPUT, "no bug 'apollo-6286'", *BUGS, "did you mean 'apollo-6826'?")


@pytest.mark.parametrize("line", BAD_USAGE)
def test_wrong_usage(called: Called, line: str) -> None:
    assert_one_error(called(*line.split()), ExitCode.USAGE, BAD_USAGE[line])


@pytest.mark.parametrize("command", [("run", CS1), ("screen", CS1), ("bench",)])
def test_a_folder_without_a_name_is_not_the_one_the_command_is_typed_in(called: Called, command: Sequence[str]) -> None:
    assert_one_error(called(*command, "-o", ""), ExitCode.USAGE, "'-o'", "the folder's name is empty")


def test_no_words_at_all_show_the_help(called: Called) -> None:
    said = called()
    assert said.code == ExitCode.USAGE
    assert said.out == ""
    assert "Usage: dvca-sumo" in said.err


@pytest.mark.parametrize(
    ("line", "explained"),
    [
        ("--help", ("run", "faults")),
        ("faults --help", ("library",)),
        (
            "run --help",
            (
                *("SUMOCFG", "--fault", "--bug", "--ego", "--seed", "--stack", "--engine", "--jobs", "--jitter"),
                *("--repeats", "--begin", "--end", "-o", "--json"),
                *("--ego auto it is the first car that departs 60 s after the begin", "500 m"),
                *("0 no violation", "1 violation", "2 usage", "3 bad input", "4 violation", "70", "130"),
            ),
        ),
    ],
)
def test_help_explains(called: Called, line: str, explained: tuple[str, ...]) -> None:
    said = called(*line.split())
    assert said.code == ExitCode.NO_VIOLATION
    assert said.err == ""
    unwrapped = " ".join(said.out.split())
    assert [word for word in explained if word not in unwrapped] == []


@pytest.mark.parametrize("command", sorted(program.commands))
def test_help_shows_no_marks_of_its_layout(called: Called, command: str) -> None:
    assert "\\" not in called(command, "--help").out


def test_faults_lists_all_thirteen_with_component_parameters_and_units(called: Called) -> None:
    said = called("faults")
    assert said.code == ExitCode.NO_VIOLATION
    assert said.err == ""
    library = fault_library()
    assert len(library) == 13
    sections = {lines[0]: lines[1:] for lines in _sections(said.out)}
    headings = [f"{name}  ({fault.component.value})" for name, fault in library.items()] + ["every fault"]
    assert list(sections)[: len(headings)] == headings
    for fault, lines in zip(library.values(), sections.values(), strict=False):
        assert lines[0] == fault.summary
        for (key, parameter), line in zip(fault.parameters.items(), lines[1:], strict=True):
            assert line.split()[0] == key
            allowed = f"[{parameter.unit}, {parameter.low:g} to {parameter.high:g}]"
            assert allowed in line if parameter.kind == "number" else "simulator id" in line
            assert f"default {parameter.default}" in line
    common = "\n".join(sections["every fault"])
    assert [word for word in ("start", "end", "first", "last", "state", "[s", "[message]") if word not in common] == []


def test_faults_tells_of_a_fault_file_that_is_wrong(
    called: Called, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.toml").write_text('component = "control"\neffect = "offset_steering"\nsummary = ""\n')
    monkeypatch.setattr(library, "folder", lambda _: tmp_path)
    fault_library.cache_clear()
    try:
        assert_one_error(called("faults"), ExitCode.BAD_INPUT, "mine.toml", "offset_steering reads 'error'")
    finally:
        fault_library.cache_clear()


def test_faults_lists_the_real_bugs_with_component_and_source(called: Called) -> None:
    sections = {lines[0]: lines[1:] for lines in _sections(called("faults").out)}
    bugs = {f"{name}  ({bug.component.value})": [bug.summary, bug.source] for name, bug in BUGS.items()}
    assert {heading: sections[heading] for heading in list(sections)[-len(bugs) :]} == bugs


def _sections(text: str) -> list[list[str]]:
    """A heading and its indented lines, each."""
    found: list[list[str]] = []
    for line in text.splitlines():
        if line.startswith(" "):
            found[-1].append(line.strip())
        else:
            found.append([line])
    return found
