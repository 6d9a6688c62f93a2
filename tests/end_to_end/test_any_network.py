"""Networks that nobody prepared: an answer, or an honest "could not tell", and nothing written."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import contents, typed

from dvca_sumo.cli import ExitCode

PUBLIC = Path(__file__).parents[3] / "shared" / "scenarios"
ANSWERS = {
    ExitCode.NO_VIOLATION: {"none"},
    ExitCode.ATTRIBUTED: {"component", "planning"},
    ExitCode.UNRESOLVED: {"unresolved", "not_reproducible"},
}
FAULTS = ((), ("--fault", "perception.miss"))


@pytest.fixture(scope="module")
def random_trips(tmp_path_factory: pytest.TempPathFactory, grid_file: Callable[..., Path]) -> Path:
    """The sumocfg of a grid with traffic from SUMO's own tool."""
    home = Path(pytest.importorskip("sumo").SUMO_HOME)
    folder = tmp_path_factory.mktemp("random trips")
    net = grid_file("--default.lanenumber=2", "--tls.guess")
    options = [f"--net-file={net}", "--output-trip-file=trips.xml", "--end=100", "--period=2", "--seed=4"]
    subprocess.run(  # noqa: S603 SUMO's own tool
        [sys.executable, str(home / "tools" / "randomTrips.py"), *options, "--min-distance=300"],
        check=True,
        capture_output=True,
        cwd=folder,
        env=os.environ | {"SUMO_HOME": str(home)},
    )
    config = folder / "grid.sumocfg"
    inputs = f'<net-file value="{net}"/><route-files value="trips.xml"/>'
    config.write_text(f"<configuration>{inputs}</configuration>", encoding="utf-8")
    return config


def _assert_answered(config: Path, *words: str) -> None:
    before = contents(config.parent)
    said = typed("run", config, "--ego", "auto", "--json", *words)
    assert contents(config.parent) == before
    assert said.code in ANSWERS, said
    result = said.result
    assert result["verdict"] in ANSWERS[ExitCode(said.code)]
    assert result["scenario"]["ego"] not in ("auto", "")
    assert bool(result["violations"]) == (result["violation"] is not None)
    if said.code == ExitCode.UNRESOLVED:
        assert result["reason"]


@pytest.mark.parametrize("fault", FAULTS, ids=["healthy", "blind"])
def test_a_fresh_grid_with_random_trips(random_trips: Path, fault: tuple[str, ...]) -> None:
    _assert_answered(random_trips, *fault)


@pytest.mark.skipif(not PUBLIC.is_dir(), reason="public scenarios are not part of the project")
@pytest.mark.parametrize("fault", FAULTS, ids=["healthy", "blind"])
def test_a_town(fault: tuple[str, ...]) -> None:
    _assert_answered(PUBLIC / "bologna_acosta" / "run.sumocfg", "--begin", "1800", *fault)
