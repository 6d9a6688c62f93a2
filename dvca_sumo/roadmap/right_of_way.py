"""Stop lines and pedestrian crossings of the movements a route takes."""

from collections.abc import Iterable

import numpy as np

from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.roadmap.lanes import Lane, Movement
from dvca_sumo.roadmap.reading import NetContents
from dvca_sumo.roadmap.route import Approach, Control, Crossing, StopLine

# SUMO's letters of right of way where no signal stands; Z: a zipper merge, where nobody may insist.
_CONTROLS = {
    "s": Control.STOP,
    "w": Control.ALL_WAY_STOP,
    "m": Control.YIELD,
    "Z": Control.YIELD,
    "=": Control.RIGHT_BEFORE_LEFT,
}
STOP_SIGNS = (Control.STOP, Control.ALL_WAY_STOP)
_AROUND = 10.0  # [m] before and behind a junction a crossing may still touch the route
_MERGING = 0.5  # [rad] between the directions of two approaches, at most
_SAMPLE = 0.1  # [m]


def stop_line(net: NetContents, movement: Movement, line: Polyline, station: float, exit_station: float) -> StopLine:
    """The stop line before `movement`, which the route drives between two stations of its `line` [m]."""
    junction = net.junctions[movement.junction]
    x, y = net.lanes[movement.from_lane].line.points[-1]
    prior = _prior_movements(net, movement)
    yields_to = frozenset(lane for one in prior for lane in one.lanes)
    otherwise = Control.YIELD if yields_to else Control.PRIORITY
    control = Control.SIGNAL if movement.signal_id else _CONTROLS.get(movement.state, otherwise)
    return StopLine(
        station=station,
        lane=movement.from_lane,
        control=control,
        signal_id=movement.signal_id,
        position=(float(x), float(y)),
        yields_to=yields_to,
        crosses=junction.conflicting(movement),
        exit_station=exit_station,
        stop_signs=_stop_signs(net, movement) if control in STOP_SIGNS else (),
        prior=_from_aside(net, movement, prior),
        direction=movement.direction,
        waiting_station=_waiting_station(net, movement, line, station, exit_station),
    )


def _waiting_station(
    net: NetContents, movement: Movement, line: Polyline, station: float, exit_station: float
) -> float | None:
    """The end of its first lane on the junction, where the net has it go on by another one."""
    if len(movement.internal) < 2:
        return None
    end = net.lanes[movement.internal[0]].line.points[-1]
    stations, _ = line.project(end[None], between=(station, exit_station))
    return float(stations[0])


def _stop_signs(net: NetContents, movement: Movement) -> tuple[Approach, ...]:
    """The approaches of other edges that come to stop signs of their own, in the junction's order."""
    own = net.lanes[movement.from_lane].edge
    foes = net.junctions[movement.junction].conflicting_movements(movement)
    stopping = (foe for foe in foes if _CONTROLS.get(foe.state) in STOP_SIGNS)
    return tuple(_approach(lane) for lane in _begins(net, stopping) if lane.edge != own)


def _prior_movements(net: NetContents, movement: Movement) -> list[Movement]:
    """Those that have priority: where all stop it is who came first, though a net gives everybody's responses."""
    prior = net.junctions[movement.junction].prior_movements(movement)
    return [one for one in prior if not (_stops_as_all(movement) and _stops_as_all(one))]


def _stops_as_all(movement: Movement) -> bool:
    return movement.signal_id is None and _CONTROLS.get(movement.state) is Control.ALL_WAY_STOP


def _from_aside(net: NetContents, movement: Movement, prior: Iterable[Movement]) -> tuple[Approach, ...]:
    """The approaches of who has priority, but for people, and who merges: that one is seen along its way."""
    own = net.lanes[movement.from_lane].line.headings[-1]
    return tuple(
        _approach(lane)
        for lane in _begins(net, prior)
        if not lane.is_crossing and abs(wrapped(float(lane.line.headings[-1] - own))) > _MERGING
    )


def _begins(net: NetContents, movements: Iterable[Movement]) -> list[Lane]:
    return [net.lanes[name] for name in dict.fromkeys(movement.from_lane for movement in movements)]


def _approach(lane: Lane) -> Approach:
    return Approach(lane.id, lane.line, lane.width, lane.mapped_limit)


def crossings(
    net: NetContents, movement: Movement, line: Polyline, station: float, exit_station: float
) -> list[Crossing]:
    """The pedestrian crossings of the junction that the route passes over between two stations [m], in order."""
    found = []
    for lane in net.junctions[movement.junction].crossings:
        span = (max(station - _AROUND, 0.0), min(exit_station + _AROUND, line.length))
        covered = _covered(net.lanes[lane], line, *span)
        if covered is not None:
            found.append(Crossing(lane, *covered))
    return sorted(found, key=lambda crossing: crossing.start_station)


def _covered(lane: Lane, line: Polyline, begin: float, end: float) -> tuple[float, float] | None:
    """Where `line` lies on the crossing, to the nearest decimetre."""
    stations = np.arange(begin, end, _SAMPLE)
    along, offsets = lane.line.project(line.poses(stations)[:, :2])
    on = stations[(np.abs(offsets) <= 0.5 * lane.width) & (along > 0.0) & (along < lane.line.length)]
    return (float(on[0]), float(on[-1])) if len(on) else None
