"""A small scenario that tests may break, and the command without the cost of a process."""

import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import Said
from small_scenarios import EGO, scenario_file

from dvca_sumo.cli import main


@pytest.fixture
def scenario(tmp_path: Path, street: Path) -> Callable[..., Path]:
    """Writes a scenario of a 4 s drive, net and all, into a folder of its own, and returns its sumocfg."""

    def write(routes: str = EGO, additional: str = "", **options: str) -> Path:
        folder = tmp_path / "scenario"
        folder.mkdir()
        shutil.copy(street, folder / "net.net.xml")
        return scenario_file(folder, Path("net.net.xml"), routes, additional, **options)

    return write


@pytest.fixture
def called(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Callable[..., Said]:
    """`dvca-sumo WORDS` in the tests' own process: for commands that end before any simulation."""

    def call(*words: str) -> Said:
        monkeypatch.setattr(sys, "argv", ["dvca-sumo", *words])
        with pytest.raises(SystemExit) as left:
            main()
        assert isinstance(left.value.code, int)
        return Said(left.value.code, *capfd.readouterr())

    return call
