"""From a list of edges to a Route: choose lanes, draw them, smooth the line, note what lies along it."""

from collections.abc import Iterator, Sequence

import msgspec
import numpy as np

from dvca_sumo.geometry.polyline import Floats, Polyline
from dvca_sumo.roadmap.areas import area_of, widened
from dvca_sumo.roadmap.bounds import Bounds, bounds, lane_change
from dvca_sumo.roadmap.corners import off_corners
from dvca_sumo.roadmap.drawing import Change, Drawing, Stretch
from dvca_sumo.roadmap.extending import extended
from dvca_sumo.roadmap.lane_sequence import Leg, change_length, lane_sequence
from dvca_sumo.roadmap.lanes import TURNS_BACK, Lane, Movement
from dvca_sumo.roadmap.passing import Way, passing_lanes
from dvca_sumo.roadmap.reading import NetContents
from dvca_sumo.roadmap.right_of_way import crossings, stop_line
from dvca_sumo.roadmap.route import Route, RouteError, UnmappedLimit
from dvca_sumo.roadmap.runs import runs
from dvca_sumo.roadmap.smoothing import smoothed, stepped
from dvca_sumo.roadmap.steering import PART, WHOLE, steered, straying, unsteerable

_BEFORE = 20.0  # [m] of lane shown behind the start, as far as there is any
_RUN_UP = 10.0  # [m] of line behind the start in any case: the rear axle needs a line under it
_BEYOND = 100.0  # [m] shown behind the destination, as far as the net goes on
_SETTLED = 10.0  # [m] at most is waited before a lane change, after a junction or the start


class _Passage(msgspec.Struct, frozen=True, eq=False):
    """A movement the line takes, between two stations [m]."""

    movement: Movement
    begin: float
    end: float


class _Plan(msgspec.Struct, frozen=True, eq=False):
    """The rough line with all that is known along it; stations are on it [m]."""

    line: Polyline
    stretches: tuple[Stretch, ...]
    changes: tuple[Change, ...]
    passages: tuple[_Passage, ...]
    start: float
    destination: float


def route(net: NetContents, edges: Sequence[str], start: tuple[str, float], arrival: tuple[str | None, float]) -> Route:
    """The route along `edges` between two lane positions, as in `RoadMap.route`."""
    _check(net, edges, start, arrival)
    plan = _drawn(net, lane_sequence(net, edges, start, arrival), start[1], arrival[1])
    begin = min(max(plan.start - _BEFORE, 0.0), plan.start - _RUN_UP)
    end = min(plan.destination + _BEYOND, plan.line.length)
    line, along = stepped(*_steerable(net, plan, *smoothed(_clipped(plan.line, begin, end)), begin))
    along = along + begin

    def moved(station: float) -> float:
        return float(np.interp(station, along, line.stations))

    followed = _followed(plan, along)
    edges_of = _bounds(net, plan, line, along)
    passages = [
        _Passage(passage.movement, moved(passage.begin), moved(passage.end))
        for passage in plan.passages
        if begin <= passage.begin < end
    ]
    road_left, road_right = _on_junctions(net, line, passages, edges_of)
    changes = [change for change in _changes(plan, line, along) if change.latest > change.begin]
    crossed = tuple(crossing for p in passages for crossing in crossings(net, p.movement, line, p.begin, p.end))
    departure, destination = moved(plan.start), moved(plan.destination)
    way = Way(
        line=line,
        followed=followed,
        movements=[passage.movement for passage in passages],
        trip=(departure, destination),
        changes=[(change.begin, change.end) for change in changes],
        crossings=[(one.start_station, one.end_station) for one in crossed],
    )
    return Route(
        line=line,
        lane_ids=tuple(lane.id for lane in followed),
        along_lanes=_fixed(along),
        speed_limits=_fixed(np.array([lane.speed_limit for lane in followed])),
        curvatures=line.curvatures,
        lane_left=edges_of.lane_left,
        lane_right=edges_of.lane_right,
        road_left=road_left,
        road_right=road_right,
        start=departure,
        destination=destination,
        stop_lines=tuple(stop_line(net, p.movement, line, p.begin, p.end) for p in passages),
        crossings=crossed,
        unmapped_limits=tuple(
            UnmappedLimit(float(line.stations[rows.start]), float(line.stations[rows.stop - 1]), lane.is_motorway)
            for lane, rows in runs(followed)
            if not lane.is_limit_mapped
        ),
        lane_changes=tuple(lane_change(line, change, [(p.begin, p.end) for p in passages]) for change in changes),
        passing_lanes=passing_lanes(net, way),
    )


def _check(net: NetContents, edges: Sequence[str], start: tuple[str, float], arrival: tuple[str | None, float]) -> None:
    if not edges:
        raise RouteError("a route needs at least one edge")
    for edge in edges:
        if edge not in net.edges:
            raise RouteError(f"edge {edge!r} is not in the net")
    for lane, edge in ((start[0], edges[0]), (arrival[0], edges[-1])):
        if lane is None:
            continue
        if lane not in net.edges[edge]:
            raise RouteError(f"lane {lane!r} is not on edge {edge!r}")
        if not net.lanes[lane].is_drivable:
            raise RouteError(f"lane {lane!r} is closed to this vehicle class")
    if len(edges) == 1 and arrival[1] < start[1]:
        raise RouteError(f"the destination at {arrival[1]:g} m lies behind the start at {start[1]:g} m on {edges[0]!r}")


def _drawn(net: NetContents, legs: Sequence[Leg], start: float, arrival: float) -> _Plan:
    drawing = Drawing()
    first, last = legs[0].entry, legs[-1].exit
    spans = []
    passages = []
    entered: tuple[Movement, float] | None = None
    for order, leg in enumerate(_continued(net, legs, _BEYOND - last.line.length + last.station(arrival))):
        begin = first.station(start) if order == 0 else 0.0
        end = leg.entry.station(arrival) if order == len(legs) - 1 else leg.entry.line.length
        spans.append(_draw_leg(net, drawing, leg, begin, end))
        if entered is not None:
            passages.append(_Passage(*entered, spans[-1][0]))
        if leg.movement is not None:
            entered = (leg.movement, spans[-1][1])
            for lane in leg.movement.internal:
                drawing.follow(net.lanes[lane])
    line = Polyline(drawing.points)
    crossed = [order for order, leg in enumerate(legs) if leg.entry is not leg.exit]
    return _Plan(
        line=line,
        stretches=tuple(drawing.stretches),
        changes=tuple(
            extended(net, change, legs[order:], [end for _, end in spans[order:]])
            for order, change in zip(crossed, drawing.changes, strict=True)
        ),
        passages=tuple(passages),
        start=_located(line, first, first.station(start), spans[0]),
        destination=_located(line, last, last.station(arrival), spans[len(legs) - 1]),
    )


def _continued(net: NetContents, legs: Sequence[Leg], distance: float) -> Iterator[Leg]:
    """The legs, and where the net goes on, further ones for `distance` [m]: straight on if possible."""
    yield from legs[:-1]
    leg = legs[-1]
    while distance > 0.0:
        ahead = [m for m in net.movements.get(leg.exit.id, ()) if m.is_drivable and m.direction not in TURNS_BACK]
        if not ahead:
            break
        movement = min(ahead, key=lambda m: m.direction != "s")
        yield Leg(leg.entry, leg.exit, movement)
        leg = Leg(net.lanes[movement.to_lane], net.lanes[movement.to_lane], None)
        distance -= leg.exit.line.length + sum(net.lanes[lane].line.length for lane in movement.internal)
    yield leg


def _draw_leg(net: NetContents, drawing: Drawing, leg: Leg, begin: float, end: float) -> tuple[float, float]:
    """Draw one edge; a lane change takes place between two stations of the entry lane [m]."""
    if leg.entry is leg.exit:
        return drawing.follow(leg.entry)
    direction = 1 if leg.exit.index > leg.entry.index else -1
    lane_ids = net.edges[leg.entry.edge]
    lanes = [net.lanes[lane_ids[i]] for i in range(leg.entry.index, leg.exit.index + direction, direction)]
    wait = min(_SETTLED, 0.1 * (end - begin))
    length = min(change_length(leg.entry, len(lanes) - 1), end - begin - 2.0 * wait)
    return drawing.cross(lanes, (begin + wait, begin + wait + length))


def _steerable(net: NetContents, plan: _Plan, points: Floats, along: Floats, begin: float) -> tuple[Floats, Floats]:
    """The smooth line, drawn anew where no car could follow it; `along` counts from `begin` of the rough line."""
    line = Polyline(points)
    room = _bounds(net, plan, line, along + begin)
    sharp = unsteerable(line)
    if sharp.any():
        points, stations = steered(line, sharp, room.road_left, room.road_right, WHOLE)
        along = np.interp(stations, line.stations, along)
        line = Polyline(points)
        room = _bounds(net, plan, line, along + begin)
    passages = [(passage.movement, _rows(passage, along + begin)) for passage in plan.passages]
    left, right = off_corners(net, line, passages, (room.lane_left, room.lane_right))
    out = straying(line, left, right)
    if out.any():
        points, stations = steered(line, out, left, right, PART)
        along = np.interp(stations, line.stations, along)
    return points, along


def _bounds(net: NetContents, plan: _Plan, line: Polyline, along: Floats) -> Bounds:
    """The edges along a line whose points lie `along` the rough one [m]."""
    return bounds(net.lanes, line, list(runs(_followed(plan, along))), _changes(plan, line, along))


def _on_junctions(
    net: NetContents, line: Polyline, passages: Sequence[_Passage], edges_of: Bounds
) -> tuple[Floats, Floats]:
    """The road's edges to the left and to the right of `line`; on junctions their area counts."""
    edges = edges_of.road_left.copy(), edges_of.road_right.copy()
    for passage in passages:
        rows, junction = _rows(passage, line.stations), net.junctions[passage.movement.junction]
        lanes = [net.lanes[name] for movement in junction.movements for name in movement.internal]
        area = area_of(junction.outline, junction.walking.values(), [(lane.line.points, lane.width) for lane in lanes])
        for edge in edges:
            edge[rows] = widened(edge[rows], line.points[rows], line.headings[rows], area)
    return _fixed(edges[0]), _fixed(edges[1])


def _rows(passage: _Passage, stations: Floats) -> slice:
    """Which of the points at `stations` [m], of the line that the passage's own are on, lie on its junction."""
    first, last = np.searchsorted(stations, (passage.begin, passage.end))
    return slice(int(first), int(last))


def _changes(plan: _Plan, line: Polyline, along: Floats) -> list[Change]:
    """The lane changes, on a line whose points lie `along` the rough one [m]."""

    def moved(station: float) -> float:
        return float(np.interp(station, along, line.stations))

    destination = moved(plan.destination)
    return [
        Change(change.ways, moved(change.begin), moved(change.end), min(moved(change.latest), destination))
        for change in plan.changes
    ]


def _followed(plan: _Plan, along: Floats) -> list[Lane]:
    """The lane that each of the points `along` the rough line follows."""
    owners = np.searchsorted([stretch.begin for stretch in plan.stretches], along, side="right") - 1
    return [plan.stretches[owner].lane for owner in np.maximum(owners, 0)]


def _located(line: Polyline, lane: Lane, station: float, span: tuple[float, float]) -> float:
    """The station on `line`, within `span`, abreast of a station of `lane` [m]."""
    found, _ = line.project(lane.line.poses([station])[:, :2], between=span)
    return float(found[0])


def _clipped(line: Polyline, begin: float, end: float) -> Polyline:
    """The part of `line` between two stations [m]; it goes on straight beyond the line's ends."""
    inner = line.stations[(line.stations > begin) & (line.stations < end)]
    return Polyline(line.poses(np.concatenate(([begin], inner, [end])))[:, :2])


def _fixed(array: Floats) -> Floats:
    array.setflags(write=False)
    return array
