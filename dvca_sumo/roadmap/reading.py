"""A SUMO net file -> lanes, movements and junctions, by way of sumolib.

sumolib's own objects refer to each other in cycles and cannot be pickled; nothing of them is kept.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import sumolib
from sumolib.net.lane import SUMO_VEHICLE_CLASSES

from dvca_sumo.geometry.polyline import Floats, Polyline
from dvca_sumo.roadmap.conflicts import drawn_foes
from dvca_sumo.roadmap.lanes import Junction, Lane, Movement, RoadMapError

_ROAD = ("", "internal")  # edge functions with traffic along them
_MOTORWAYS = ("highway.motorway", "highway.trunk")  # SUMO's types of edges imported from OpenStreetMap
_PREFIX = "dvca."  # of parameters that are this program's
_LIMIT_KEY, _MISSING = "dvca.map.speed_limit", "missing"  # parameter of an edge: a gap in the map an ADS drives on
_UNREGULATED = ("unregulated", "traffic_light_unregulated")  # types of junctions without any right of way
_STUB = 0.01  # [m] length given to a lane drawn as a single point


class NetContents(msgspec.Struct, frozen=True, eq=False):
    """All that is kept of a net."""

    lanes: dict[str, Lane]
    edges: dict[str, tuple[str, ...]]  # lane ids by index, normal edges only
    movements: dict[str, tuple[Movement, ...]]  # of vehicles, by approach lane
    junctions: dict[str, Junction]


def read_net(path: Path, vehicle_class: str) -> NetContents:
    """Read `path` (.net.xml, also gzipped) as a driver of `vehicle_class` sees it.

    Raises RoadMapError when the file is missing or no net, the class is unknown to SUMO, or an edge has a "dvca."
    parameter that there is not, or with a value that is none, or a lane any.
    """
    if vehicle_class not in SUMO_VEHICLE_CLASSES:
        raise RoadMapError(f"unknown vehicle class {vehicle_class!r}; SUMO knows passenger, bus, truck, taxi, ...")
    net = _parsed(path)
    edges = [edge for edge in net.getEdges() if edge.getFunction() in (*_ROAD, "crossing")]
    for edge in net.getEdges():
        _refuse_wrong_parameters(edge)
    is_left_hand = _is_left_hand(edges)
    lanes = {lane.id: lane for edge in edges for lane in _lanes(edge, vehicle_class, is_left_hand=is_left_hand)}
    vias, groups = _vias(edges), _signal_groups(net)
    walking = _walking_areas(net)
    junctions = {
        node.getID(): _junction(node, lanes, vias, groups, walking[node.getID()], vehicle_class)
        for node in net.getNodes()
    }
    return NetContents(
        lanes=lanes,
        edges={edge.getID(): tuple(_lane_ids(edge)) for edge in edges if not edge.getFunction()},
        movements=_by_approach(junctions.values()),
        junctions=junctions,
    )


def _parsed(path: Path) -> Any:
    if not path.is_file():
        raise RoadMapError(f"net file not found: {path}")
    try:
        net = sumolib.net.readNet(str(path), withInternal=True, withPrograms=True, maxcache=0)
    except Exception as error:  # a broken file breaks sumolib in many ways
        raise RoadMapError(f"not a SUMO net: {path} ({type(error).__name__}: {error})") from error
    if not net.getEdges(withInternal=False):
        raise RoadMapError(f"not a SUMO net: {path} (no edges)")
    return net


def _refuse_wrong_parameters(edge: Any) -> None:
    for key, text in edge.getParams().items():
        if key.startswith(_PREFIX) and key != _LIMIT_KEY:
            raise RoadMapError(f"no parameter {key} of the edge {edge.getID()!r} (allowed: {_LIMIT_KEY})")
        if key == _LIMIT_KEY and text != _MISSING:
            raise RoadMapError(f"parameter {key} of the edge {edge.getID()!r} is {text!r} (allowed: {_MISSING})")
    for lane in edge.getLanes():
        for key in lane.getParams():
            if key.startswith(_PREFIX):
                raise RoadMapError(f"parameter {key} of the lane {lane.getID()!r} (allowed: {_LIMIT_KEY}, of an edge)")


def _lane_ids(edge: Any) -> Iterator[str]:
    return (f"{edge.getID()}_{index}" for index in range(edge.getLaneNumber()))


def _allows(lane_or_connection: Any, vehicle_class: str) -> bool:
    if lane_or_connection.allows(vehicle_class):
        return True
    return isinstance(lane_or_connection, sumolib.net.lane.Lane) and "all" in lane_or_connection.getPermissions()


def _is_left_hand(edges: Iterable[Any]) -> bool:
    """Whether lane 1 lies to the right of lane 0 on most edges: sumolib does not tell left-hand nets."""
    votes = 0.0
    for edge in edges:
        if edge.getLaneNumber() > 1 and not edge.getFunction():
            (x0, y0), (x1, y1) = edge.getLane(0).getShape()[:2]
            x, y = edge.getLane(1).getShape()[0]
            votes += np.sign((x1 - x0) * (y - y0) - (y1 - y0) * (x - x0))
    return votes < 0.0


def _lanes(edge: Any, vehicle_class: str, *, is_left_hand: bool) -> Iterator[Lane]:
    ids = list(_lane_ids(edge))
    drivable = [_allows(lane, vehicle_class) for lane in edge.getLanes()]
    open_ids = [None, *(lane_id if is_open else None for lane_id, is_open in zip(ids, drivable, strict=True)), None]
    for index, lane in enumerate(edge.getLanes()):
        lower, upper = open_ids[index], open_ids[index + 2]
        yield Lane(
            id=ids[index],
            edge=edge.getID(),
            index=index,
            line=_line(lane),
            length=lane.getLength(),
            width=lane.getWidth(),
            speed_limit=lane.getSpeed(),
            is_limit_mapped=edge.getParam(_LIMIT_KEY) != _MISSING,
            is_motorway=(edge.getType() or "").startswith(_MOTORWAYS),
            is_internal=edge.getFunction() == "internal",
            is_crossing=edge.getFunction() == "crossing",
            is_pavement=not edge.getFunction() and set(lane.getPermissions()) == {"pedestrian"},
            is_drivable=drivable[index],
            is_for_buses=_allows(lane, "bus"),
            is_for_bicycles=_allows(lane, "bicycle"),
            left=lower if is_left_hand else upper,
            right=upper if is_left_hand else lower,
            successors=tuple(_successors(lane)),
        )


def _line(lane: Any) -> Polyline:
    """The lane's drawn line; a lane drawn as one point gets a stub in its predecessor's direction."""
    shape = lane.getShape()
    try:
        return Polyline(shape)
    except ValueError:
        end = np.array(shape[0] if shape else lane.getEdge().getToNode().getCoord())
        return Polyline([end, end + _STUB * _approach_direction(lane)])


def _approach_direction(lane: Any) -> Floats:
    for connections in lane.getEdge().getIncoming().values():
        for connection in connections:
            steps = np.diff(np.array(connection.getFromLane().getShape()), axis=0)
            lengths = np.hypot(steps[:, 0], steps[:, 1])
            if lengths.any():
                last = np.flatnonzero(lengths)[-1]
                return np.asarray(steps[last] / lengths[last])
    return np.array([1.0, 0.0])


def _successors(lane: Any) -> Iterator[str]:
    for connection in lane.getOutgoing():
        to_edge = connection.getTo()
        if to_edge.getFunction() in _ROAD and lane.getEdge().getFunction() in _ROAD:
            yield connection.getViaLaneID() or f"{to_edge.getID()}_{connection.getToLane().getIndex()}"


def _vias(edges: Iterable[Any]) -> dict[str, str]:
    """From each internal lane to the internal lane that continues it, "" where none does."""
    return {
        lane_id: next((connection.getViaLaneID() for connection in lane.getOutgoing()), "")
        for edge in edges
        if edge.getFunction() == "internal"
        for lane_id, lane in zip(_lane_ids(edge), edge.getLanes(), strict=True)
    }


def _signal_groups(net: Any) -> dict[str, str]:
    """By signal: what it shows in every phase of every program of its traffic light."""
    found: dict[str, str] = {}
    for light in net.getTrafficLights():
        states = [phase.state for program in light.getPrograms().values() for phase in program.getPhases()]
        shown = ("".join(letters) for letters in zip(*states, strict=False))
        found |= {f"{light.getID()}/{index}": f"{light.getID()} {letters}" for index, letters in enumerate(shown)}
    return found


def _walking_areas(net: Any) -> dict[str, dict[str, Any]]:
    """Their outlines, by junction: their edges are called ":junction_wN"."""
    found: dict[str, dict[str, Any]] = defaultdict(dict)
    for edge in net.getEdges():
        if edge.getFunction() == "walkingarea":
            lane = edge.getLane(0)
            found[edge.getID()[1:].rpartition("_w")[0]][lane.getID()] = lane.getShape()
    return found


def _junction(
    node: Any,
    lanes: dict[str, Lane],
    vias: dict[str, str],
    groups: dict[str, str],
    walking: dict[str, Any],
    vehicle_class: str,
) -> Junction:
    crossings = (edge for edge in node.getIncoming() if edge.getFunction() == "crossing")
    movements = tuple(
        _movement(connection, index, vias, groups, vehicle_class) for index, connection in enumerate(_links(node))
    )
    foes, responses = dict(node._foes), dict(node._prohibits)  # noqa: SLF001 no accessor
    if node.getType() in _UNREGULATED:  # nobody has to wait there, so nobody may count on it
        foes = responses = drawn_foes(movements, lanes)
    return Junction(
        id=node.getID(),
        movements=movements,
        foes=foes,
        responses=responses,
        crossings=tuple(lane_id for edge in crossings for lane_id in _lane_ids(edge)),
        outline=tuple((x, y) for x, y, *_ in node.getShape()),
        walking={lane: tuple((x, y) for x, y, *_ in shape) for lane, shape in walking.items()},
    )


def _links(node: Any) -> Iterator[Any]:
    """The connections that count, in the order of SUMO's link index: by incoming lane, then as in the file."""
    incoming = {edge.getID(): edge for edge in node.getIncoming()}
    for lane_id in node._incLanes or ():  # noqa: SLF001 no accessor
        edge_id, _, index = lane_id.rpartition("_")
        if edge_id not in incoming:
            continue
        edge = incoming[edge_id]
        for connection in edge.getLane(int(index)).getOutgoing():
            target = connection.getTo().getFunction()
            if target == "crossing" or (target != "walkingarea" and edge.getFunction() != "walkingarea"):
                yield connection


def _movement(
    connection: Any, index: int, vias: dict[str, str], groups: dict[str, str], vehicle_class: str
) -> Movement:
    to_lane = f"{connection.getTo().getID()}_{connection.getToLane().getIndex()}"
    from_lane = f"{connection.getFrom().getID()}_{connection.getFromLane().getIndex()}"
    if connection.getTo().getFunction() == "crossing":
        from_lane = to_lane
    internal = []
    via = connection.getViaLaneID()
    while via:
        internal.append(via)
        via = vias.get(via, "")
    light = connection.getTLSID()
    signal = f"{light}/{connection.getTLLinkIndex()}" if light else None
    return Movement(
        junction=connection.getJunction().getID(),
        index=index,
        from_lane=from_lane,
        to_lane=to_lane,
        internal=tuple(internal),
        direction=connection.getDirection(),
        state=connection.getState(),
        signal_id=signal,
        signal_group=groups.get(signal, signal) if signal else None,
        is_drivable=all(_allows(part, vehicle_class) for part in (connection.getToLane(), connection)),
    )


def _by_approach(junctions: Iterable[Junction]) -> dict[str, tuple[Movement, ...]]:
    found: dict[str, list[Movement]] = {}
    for junction in junctions:
        for movement in junction.movements:
            if movement.to_lane != movement.from_lane:
                found.setdefault(movement.from_lane, []).append(movement)
    return {lane: tuple(movements) for lane, movements in found.items()}
