"""Small nets, built once a session with SUMO's own tools."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from dvca_sumo.roadmap import RoadMap

NetBuilder = Callable[..., RoadMap]


def _run(tool: str, *options: str) -> None:
    binary = Path(pytest.importorskip("sumo").SUMO_HOME) / "bin" / tool
    subprocess.run(  # noqa: S603 our own command
        [str(binary), "--no-warnings", *options], check=True, capture_output=True
    )


@pytest.fixture(scope="session")
def grid_file(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """A grid of 3 x 3 junctions A0 ... C2, 150 m apart, as netgenerate builds it with the options given."""
    built: dict[tuple[str, ...], Path] = {}

    def file(*options: str) -> Path:
        if options not in built:
            path = tmp_path_factory.mktemp("grid") / "grid.net.xml"
            _run("netgenerate", "--grid", "--grid.number=3", "--grid.length=150", f"--output-file={path}", *options)
            built[options] = path
        return built[options]

    return file


@pytest.fixture(scope="session")
def grid(grid_file: Callable[..., Path]) -> NetBuilder:
    maps: dict[tuple[str, ...], RoadMap] = {}

    def load(*options: str) -> RoadMap:
        if options not in maps:
            maps[options] = RoadMap.load(grid_file(*options))
        return maps[options]

    return load


@pytest.fixture(scope="session")
def plain(tmp_path_factory: pytest.TempPathFactory) -> NetBuilder:
    """A net from plain-XML nodes and edges (and connections), as netconvert builds it."""
    maps: dict[tuple[str, ...], RoadMap] = {}

    def load(nodes: str, edges: str, connections: str = "", *, vehicle_class: str = "passenger") -> RoadMap:
        key = (nodes, edges, connections, vehicle_class)
        if key not in maps:
            folder = tmp_path_factory.mktemp("plain")
            for name, text in (("nodes", nodes), ("edges", edges), ("connections", connections)):
                (folder / name).write_text(f"<{name}>{text}</{name}>")
            parts = [f"--{name[:-1]}-files={folder / name}" for name in ("nodes", "edges", "connections")]
            _run("netconvert", *parts, f"--output-file={folder / 'net.xml'}", "--offset.disable-normalization")
            maps[key] = RoadMap.load(folder / "net.xml", vehicle_class)
        return maps[key]

    return load
