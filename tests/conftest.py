"""Small nets, built once a session with SUMO's own tools; interrupts that arrive."""

import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from dvca_sumo.engine.processes import INTERRUPTS
from dvca_sumo.roadmap import RoadMap

NetBuilder = Callable[..., RoadMap]

# A street of two lanes each way from a over the signal at b to c; minor streets cross it at b.
STREET_NODES = """
<node id="a" x="0" y="0"/><node id="b" x="200" y="0" type="traffic_light"/><node id="c" x="500" y="0"/>
<node id="n" x="200" y="100"/><node id="s" x="200" y="-100"/>"""
STREET_EDGES = "".join(
    f'<edge id="{start}{end}" from="{start}" to="{end}" numLanes="{lanes}" speed="13.9"/>'
    for start, end, lanes in (
        ("a", "b", 2),
        ("b", "a", 2),
        ("b", "c", 2),
        ("c", "b", 2),
        ("n", "b", 1),
        ("b", "n", 1),
        ("s", "b", 1),
        ("b", "s", 1),
    )
)


def _run(tool: str, *options: str) -> None:
    binary = Path(pytest.importorskip("sumo").SUMO_HOME) / "bin" / tool
    subprocess.run(  # noqa: S603 our own command
        [str(binary), "--no-warnings", *options], check=True, capture_output=True
    )


def _converted(folder: Path, nodes: str, edges: str, connections: str = "") -> Path:
    for name, text in (("nodes", nodes), ("edges", edges), ("connections", connections)):
        (folder / name).write_text(f"<{name}>{text}</{name}>")
    parts = [f"--{name[:-1]}-files={folder / name}" for name in ("nodes", "edges", "connections")]
    _run("netconvert", *parts, f"--output-file={folder / 'net.xml'}", "--offset.disable-normalization")
    return folder / "net.xml"


@pytest.fixture(autouse=True)
def _interruptible() -> Iterator[None]:
    """Workers of pytest-xdist and background jobs of a shell are born to ignore interrupts; `nohup` has it so, too.

    So does a command after the first one, which a test may have called in its own process.
    """
    before = {one: signal.getsignal(one) for one in INTERRUPTS}
    for one, handler in before.items():
        if handler is signal.SIG_IGN:
            signal.signal(one, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    for one, handler in before.items():
        signal.signal(one, handler)


@pytest.fixture(scope="session")
def street(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The net file of `STREET_EDGES`."""
    return _converted(tmp_path_factory.mktemp("street"), STREET_NODES, STREET_EDGES)


@pytest.fixture(scope="session")
def plain_file(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """A net file from plain-XML nodes and edges."""
    return lambda *parts: _converted(tmp_path_factory.mktemp("plain"), *parts)


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
            maps[key] = RoadMap.load(_converted(tmp_path_factory.mktemp("plain"), *key[:3]), vehicle_class)
        return maps[key]

    return load
