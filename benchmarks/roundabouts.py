"""A grid of roundabouts, which netgenerate does not draw: as nodes and edges for netconvert."""

import math
from pathlib import Path

_SIZE = 3  # roundabouts to a side
_BETWEEN = 160.0  # [m] their middles
_ARM = 150.0  # [m] from the middle to where an arm that leads out of the net ends
_RADIUS = {1: 16.0, 2: 20.0}  # [m] by lanes
_SIDES = ((1, 0), (0, 1), (-1, 0), (0, -1))  # east, north, west, south: counterclockwise
_PARTS = 8  # of a quarter circle


def written(folder: Path, lanes: int) -> list[str]:
    """Write them, with so many lanes everywhere; the arguments by which netconvert reads them."""
    nodes: list[str] = []
    edges: list[str] = []
    for place in ((column, row) for column in range(_SIZE) for row in range(_SIZE)):
        x, y = (_BETWEEN * index for index in place)
        ring = [_ring_node(place, side) for side in range(4)]
        for side, (east, north) in enumerate(_SIDES):
            nodes.append(_node(ring[side], x + _RADIUS[lanes] * east, y + _RADIUS[lanes] * north))
            edges.append(_quarter(ring, side, x, y, lanes))
            neighbour = (place[0] + east, place[1] + north)
            if all(0 <= index < _SIZE for index in neighbour):
                edges.append(_road(ring[side], _ring_node(neighbour, (side + 2) % 4), lanes))
            else:
                out = f"out{ring[side]}"
                nodes.append(_node(out, x + _ARM * east, y + _ARM * north))
                edges += [_road(ring[side], out, lanes), _road(out, ring[side], lanes)]
        names = " ".join(f"{node}.ring" for node in ring)
        edges.append(f'<roundabout nodes="{" ".join(ring)}" edges="{names}"/>')
    (folder / "net.nod.xml").write_text(f"<nodes>{''.join(nodes)}</nodes>")
    (folder / "net.edg.xml").write_text(f"<edges>{''.join(edges)}</edges>")
    return ["-n", "net.nod.xml", "-e", "net.edg.xml", "--no-turnarounds.except-deadend"]


def _ring_node(place: tuple[int, int], side: int) -> str:
    return f"r{place[0]}{place[1]}{side}"


def _node(name: str, x: float, y: float) -> str:
    return f'<node id="{name}" x="{x:.2f}" y="{y:.2f}" type="priority"/>'


def _road(begin: str, end: str, lanes: int) -> str:
    return f'<edge id="{begin}-{end}" from="{begin}" to="{end}" numLanes="{lanes}" speed="13.89" priority="3"/>'


def _quarter(ring: list[str], side: int, x: float, y: float, lanes: int) -> str:
    """From one side to the next one, counterclockwise."""
    angles = [0.5 * math.pi * (side + part / _PARTS) for part in range(_PARTS + 1)]
    radius = _RADIUS[lanes]
    shape = " ".join(f"{x + radius * math.cos(angle):.2f},{y + radius * math.sin(angle):.2f}" for angle in angles)
    return (
        f'<edge id="{ring[side]}.ring" from="{ring[side]}" to="{ring[(side + 1) % 4]}" numLanes="{lanes}" speed="8.33"'
        f' priority="9" spreadType="center" shape="{shape}"/>'
    )
