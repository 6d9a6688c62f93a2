"""The cases of the benchmark: a scenario, the defect in it, and the component that holds the defect."""

import re
import shlex
import tomllib
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import msgspec

from dvca_sumo.api import REPEATS
from dvca_sumo.messages import Component

Suite = Literal["injected", "real-bugs", "random"]

JITTER_MARGIN = 0.7  # [s] how much earlier or later the same comes in a drive with other phases and noise
_WINDOW = re.compile(r"(start|end)=([0-9.]+)")

_FOLDER = Path(__file__).resolve().parent
INJECTED = _FOLDER / "injected.toml"
REAL_BUGS = _FOLDER / "real_bugs.toml"


class CasesError(ValueError):
    """A file of cases cannot be read, or a case in it is not whole."""


class Case(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A drive with one defect, and where the same defect does no harm."""

    suite: Suite
    name: str  # "perception.miss/cs1"
    scenario: str  # "nets/cs1.sumocfg"
    component: Component  # to be found
    fault: str = ""  # words of `--fault`; empty for a bug
    harmless: str = ""  # words of `--fault`: the same fault in a harmless moment; empty for a bug
    bug: str = ""  # name of a bug; empty for a fault
    harmless_scenario: str = ""  # that the bug does nothing to; empty for a fault
    ego: str | None = None  # None: the scenario's own
    begin: float | None = None  # [s] of the simulation; None: the scenario's own

    def loosened(self) -> "Case":
        """The same for jitter mode: a fault's window is longer at either end by what phases and noise shift a drive."""
        return msgspec.structs.replace(self, fault=_loosened(self.fault))

    def command(self, seed: int | None, repeats: int | None) -> str:
        """What to type to see this case alone; `seed` None: the scenario's own; `repeats` None: exact mode."""
        words = ["dvca-sumo", "run", self.scenario, *([] if seed is None else ["--seed", str(seed)])]
        for option, value in (("--fault", self.fault), ("--bug", self.bug), ("--ego", self.ego)):
            words += [option, value] if value else []
        words += ["--begin", f"{self.begin:.12g}"] if self.begin is not None else []
        words += ["--jitter"] if repeats is not None else []
        words += ["--repeats", str(repeats)] if repeats not in (None, REPEATS) else []
        return shlex.join(words)


def injected_cases() -> tuple[Case, ...]:
    """The injected faults, by name.

    Raises:
        CasesError: Their file is malformed; file, case and reason are named.
    """
    return cases_in(INJECTED, "injected")


def real_bug_cases() -> tuple[Case, ...]:
    """The real bugs, by name.

    Raises:
        CasesError: As for `injected_cases`.
    """
    return cases_in(REAL_BUGS, "real-bugs")


WRITTEN: dict[str, Callable[[], tuple[Case, ...]]] = {"injected": injected_cases, "real-bugs": real_bug_cases}


def cases_in(path: Path, suite: Suite) -> tuple[Case, ...]:
    """The cases of a file of `[[case]]` tables, sorted by name.

    Raises:
        CasesError: The file cannot be read, or one of its cases is not whole.
    """
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise CasesError(f"the cases in {path} cannot be read: {error}") from None
    strange = [key for key in tables if key != "case"]
    if strange or not isinstance(tables.get("case", []), list):
        raise CasesError(f"{path} holds {(strange or ['case'])[0]!r} (allowed: [[case]] tables)")
    cases = [_case(table, suite, f"case {row + 1} of {path}") for row, table in enumerate(tables.get("case", []))]
    name, count = Counter(case.name for case in cases).most_common(1)[0] if cases else ("", 0)
    if count > 1:
        raise CasesError(f"{path} has {count} cases {name!r}")
    return tuple(sorted(cases, key=lambda case: case.name))


def _loosened(fault: str) -> str:
    def moved(found: re.Match[str]) -> str:
        by = -JITTER_MARGIN if found[1] == "start" else JITTER_MARGIN
        return f"{found[1]}={max(float(found[2]) + by, 0.0):g}"

    return _WINDOW.sub(moved, fault)


def _case(table: object, suite: Suite, where: str) -> Case:
    try:
        case = msgspec.convert({"suite": suite, **table} if isinstance(table, dict) else table, Case)
    except msgspec.ValidationError as error:
        raise CasesError(f"{where}: {error}") from None
    needed, foreign = ("fault", "harmless"), ("bug", "harmless_scenario")
    if suite == "real-bugs":
        needed, foreign = foreign, needed
    for key in needed:
        if not getattr(case, key):
            raise CasesError(f"{where} ({case.name}) lacks {key!r}, which every case of {suite} has")
    for key in foreign:
        if getattr(case, key):
            raise CasesError(f"{where} ({case.name}) has {key!r}, which no case of {suite} has")
    return case
