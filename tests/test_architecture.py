"""Rules of the project's shape that no single module can keep alone."""

import ast
import configparser
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from importlinter.cli import EXIT_STATUS_SUCCESS, lint_imports

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "dvca_sumo"
FOLDERS_OUTSIDE = ("faults", "nets", "routes")  # installed below the package, kept at the top
SIMULATOR_ROOM = "dvca_sumo.world.session"
TRUTH_ROOMS = {"dvca_sumo.stack.sensors", "dvca_sumo.stack.ideal"}


def _module(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {_module(path): path for path in sorted(PACKAGE.rglob("*.py"))}


def _imports(path: Path) -> Iterator[str]:
    """Full names of all that a module imports, wherever it does."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} imports relatively"
            yield from (f"{node.module}.{name.name}" for name in node.names)


def _importers(name: str) -> set[str]:
    """Modules that import `name` or something in it."""
    return {
        module
        for module, path in MODULES.items()
        if any(one == name or one.startswith(f"{name}.") for one in _imports(path))
    }


def _tracked() -> list[Path]:
    listed = subprocess.run(
        ["git", "ls-files", "-z"],  # noqa: S607
        check=False,
        capture_output=True,
        text=True,
        cwd=ROOT,
    )
    if listed.returncode != 0:
        pytest.skip("not a git clone")
    return [path for name in listed.stdout.split("\0") if name and (path := ROOT / name).is_file()]


def test_the_contracts_on_imports_are_kept() -> None:
    assert lint_imports(config_filename=str(ROOT / "setup.cfg"), no_cache=True) == EXIT_STATUS_SUCCESS


def test_every_package_is_installed() -> None:
    config = configparser.ConfigParser()
    config.read(ROOT / "setup.cfg", encoding="utf-8")
    packages = {_module(path) for path in PACKAGE.rglob("__init__.py")}
    outside = {f"dvca_sumo.{name}" for name in FOLDERS_OUTSIDE}
    assert set(config["options"]["packages"].split()) == packages | outside


def test_every_module_lies_in_a_package() -> None:
    assert [path for path in MODULES.values() if not (path.parent / "__init__.py").is_file()] == []


def test_data_files_of_every_kind_are_installed() -> None:
    config = configparser.ConfigParser()
    config.read(ROOT / "setup.cfg", encoding="utf-8")
    for package, patterns in config["options.package_data"].items():
        folder = ROOT / package.removeprefix("dvca_sumo.") if package.endswith(FOLDERS_OUTSIDE) else None
        folder = folder or ROOT / package.replace(".", "/")
        for pattern in patterns.replace(",", " ").split():
            assert list(folder.glob(pattern)), f"{package} has no {pattern}"


def test_one_room_holds_the_simulator() -> None:
    importers = _importers("libsumo") | _importers("traci")
    assert importers
    assert {module for module in importers if not f"{module}.".startswith(f"{SIMULATOR_ROOM}.")} == set()


@pytest.mark.parametrize("known", ["truth", "record", "interventions", "world", "oracles"])
def test_only_sensors_and_substitutes_of_the_stack_know_more_than_their_input(known: str) -> None:
    knowing = {module for module in _importers(f"dvca_sumo.{known}") if module.startswith("dvca_sumo.stack")}
    assert knowing <= TRUTH_ROOMS


def test_no_component_meets_the_sensors_or_the_substitutes() -> None:
    users = {module for room in TRUTH_ROOMS for module in _importers(room) if module.startswith("dvca_sumo.stack")}
    assert users == {"dvca_sumo.stack.reference"}  # which builds the sensors for the run


def test_nothing_is_left_to_be_done() -> None:
    marks = re.compile(r"\b(TO" + r"DO|FIX" + r"ME|XX" + r"X)\b")
    assert [module for module, path in MODULES.items() if marks.search(path.read_text(encoding="utf-8"))] == []


def test_no_file_names_a_place_on_somebodys_machine() -> None:
    places = re.compile(rb"(?<![\w.}~-])/(?:home|Users|root|work|tmp|opt|mnt)/\w")
    found = {
        str(path.relative_to(ROOT)): line.decode(errors="replace")
        for path in _tracked()
        for line in path.read_bytes().splitlines()
        if places.search(line)
    }
    assert found == {}
