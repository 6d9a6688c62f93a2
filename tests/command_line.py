"""The command as a user types it: in a process of its own, from a folder of its own."""

import importlib.resources
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import jsonschema  # type: ignore[import-untyped]

import dvca_sumo

Result = dict[str, Any]  # what --json prints

# -P: as with the installed command, Python itself does not look into the working folder.
COMMAND = (sys.executable, "-P", "-m", "dvca_sumo")
_TIMEOUT = 300.0  # [s] only ever reached by a defect


class Said(NamedTuple):
    """What a command answered."""

    code: int
    out: str
    err: str

    @property
    def result(self) -> Result:
        """Of a command with --json."""
        return loaded(self.out)


def environment() -> dict[str, str]:
    """The environment in which a command finds the package under test from any folder."""
    packages = [str(Path(dvca_sumo.__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
    return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, packages))}


def typed(*words: str | Path, folder: Path | None = None) -> Said:
    """`dvca-sumo WORDS`, typed in `folder`, or in an empty one; it must leave either as it was."""
    with tempfile.TemporaryDirectory() as empty:
        where = folder or Path(empty)
        before = contents(where)
        done = subprocess.run(  # noqa: S603 our own command
            [*COMMAND, *map(str, words)],
            check=False,
            capture_output=True,
            text=True,
            encoding="utf-8",
            cwd=where,
            env=environment(),
            timeout=_TIMEOUT,
        )
        assert contents(where) == before
    return Said(done.returncode, done.stdout, done.stderr)


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below a folder; what Python itself caches of a module does not count."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def assert_one_error(said: Said, code: int, *words: str) -> None:
    """Nothing but one line on standard error that holds all of `words`, and the exit code."""
    assert said.out == "", said
    assert said.err.startswith("error: "), said
    assert said.err.index("\n") == len(said.err) - 1, said
    assert [word for word in words if word not in said.err] == [], said
    assert said.code == code


def loaded(text: str) -> Result:
    """A result as strict JSON (no NaN, no infinity), valid by the project's schema."""

    def refused(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    result: Result = json.loads(text, parse_constant=refused)
    schema = importlib.resources.files("dvca_sumo.report").joinpath("result.schema.json")
    jsonschema.validate(result, json.loads(schema.read_text(encoding="utf-8")))
    return result


def without_costs(value: Any) -> Any:
    """A result without what may differ between two equal analyses: seconds of wall time."""
    if isinstance(value, dict):
        return {key: without_costs(one) for key, one in value.items() if key not in ("timing", "wall_s")}
    return [without_costs(one) for one in value] if isinstance(value, list) else value
