"""The ego's way through the map, as a stack plans on it."""

import enum

import msgspec
import numpy as np

from dvca_sumo.geometry.polyline import Floats, Polyline


class RouteError(ValueError):
    """The edges cannot be driven as asked; says in one line which and why."""


class Control(enum.StrEnum):
    """What regulates the right of way where the ego enters a junction."""

    SIGNAL = "signal"
    STOP = "stop"
    ALL_WAY_STOP = "all_way_stop"
    YIELD = "yield"
    RIGHT_BEFORE_LEFT = "right_before_left"
    PRIORITY = "priority"


class Approach(msgspec.Struct, frozen=True, eq=False):
    """A lane that comes to a junction."""

    lane: str
    line: Polyline  # centre line, up to the junction
    width: float  # [m]
    speed_limit: float  # [m/s] infinite where the map has none


class StopLine(msgspec.Struct, frozen=True, eq=False):
    """Where the route enters a junction, and whom it meets there."""

    station: float  # [m] end of the approach lane
    lane: str  # approach lane
    control: Control
    signal_id: str | None  # "tls/linkIndex", with SIGNAL only
    position: tuple[float, float]  # [m] x, y
    yields_to: frozenset[str]  # lanes of movements with priority; with SIGNAL: under permissive green or dark
    crosses: frozenset[str]  # lanes of all movements whose paths conflict
    exit_station: float  # [m] where the route leaves the junction
    stop_signs: tuple[Approach, ...] = ()  # others of conflicting movements, with STOP and ALL_WAY_STOP
    prior: tuple[Approach, ...] = ()  # those of `yields_to` that come from aside or ahead
    direction: str = "s"  # of the movement, as `Movement` has it
    waiting_station: float | None = None  # [m] on the junction, where those wait who let the oncoming traffic pass


class Crossing(msgspec.Struct, frozen=True, eq=False):
    """A pedestrian crossing the route passes over."""

    lane: str
    start_station: float  # [m]
    end_station: float  # [m]


class LaneChange(msgspec.Struct, frozen=True, eq=False):
    """Where the route crosses from lane to lane: drawn as early as there is room, to be done anywhere on the way.

    That may lead across junctions, as far as all of the lanes run on side by side, and are let go together.
    """

    lanes: tuple[tuple[str, ...], ...]  # in the order of crossing, at least two, and along each of them
    widths: tuple[float, ...]  # [m] where they are narrowest
    start_station: float  # [m] from where the line crosses over
    latest_station: float  # [m] where it must be over: one of the lanes leads elsewhere, or the route ends
    stations: Floats  # (n,) [m] from start to latest
    offsets: Floats  # (lanes, n) [m] of their centres from the line, there
    junctions: tuple[tuple[float, float], ...] = ()  # [m] where each on the way begins and ends

    def centres(self, stations: Floats) -> Floats:
        """(lanes, m) offsets of the lanes' centres at `stations` (m,) [m]; held before and after."""
        return np.array([np.interp(stations, self.stations, offsets) for offsets in self.offsets])

    def lane(self, station: float, which: int) -> str:
        """One of the lanes, by its place among them, at a station [m]."""
        row = min(max(int(self.stations.searchsorted(station, side="right")) - 1, 0), len(self.stations) - 1)
        return self.lanes[which][row]

    def nearest(self, station: float, offset: float) -> int:
        """The lane, by its place in `lanes`, whose centre is nearest to a point beside the line [m]."""
        return int(np.abs(self.centres(np.array([station]))[:, 0] - offset).argmin())


class PassingLane(msgspec.Struct, frozen=True, eq=False):
    """A lane beside the route's own for a while, along which the ego may pass who is slow, and come back.

    Where it leads on to the destination the ego may stay on it. A queue before another end may be for where the ego
    goes.
    """

    lane_ids: tuple[str, ...]  # (n,) junctions that it runs across make it more than one
    widths: tuple[float, float]  # [m] of it and of the route's own, where they are narrowest
    stations: Floats  # (n,) [m]
    offsets: Floats  # (n,) [m] of its centre from the line
    leads_on: bool
    halts: tuple[tuple[float, float], ...] = ()  # [m] where one may have to wait on the way: from there to there

    def covers(self, station: float) -> bool:
        """Whether it is there at `station` [m]."""
        return bool(self.stations[0] <= station <= self.stations[-1])


class Overpass(msgspec.Struct, frozen=True, eq=False):
    """A lane that passes over or under the route: who is on it does not meet the ego there."""

    lane: str
    station: float  # [m]
    position: tuple[float, float]  # [m] x, y


class UnmappedLimit(msgspec.Struct, frozen=True, eq=False):
    """A stretch whose speed limit the map that the ego drives on does not have."""

    start_station: float  # [m]
    end_station: float  # [m]
    is_motorway: bool


class Route(msgspec.Struct, frozen=True, eq=False):
    """The ego's reference line and everything known along it.

    Arrays hold one value per point of `line`; points are 1 m apart, the last one possibly closer.
    Lateral edges are offsets from `line` [m], left > 0 > right. All arrays are read-only.
    """

    line: Polyline  # through lanes and junctions, lane changes blended in
    lane_ids: tuple[str, ...]
    along_lanes: Floats  # [m] how much lane lies behind: where the line cuts a corner, it grows faster than stations
    speed_limits: Floats  # [m/s] by law
    curvatures: Floats  # [1/m]
    lane_left: Floats  # [m] edges of the lane, of both lanes during a lane change
    lane_right: Floats  # [m]
    road_left: Floats  # [m] edges of all lanes in this direction the ego may use
    road_right: Floats  # [m]
    start: float  # [m] front bumper at departure
    destination: float  # [m] where the front bumper shall stop
    stop_lines: tuple[StopLine, ...]  # by station
    crossings: tuple[Crossing, ...]  # by station
    unmapped_limits: tuple[UnmappedLimit, ...] = ()  # by station
    lane_changes: tuple[LaneChange, ...] = ()  # by station
    passing_lanes: tuple[PassingLane, ...] = ()  # by station
    overpasses: tuple[Overpass, ...] = ()  # by station

    def row_at(self, station: float) -> int:
        """The row of the arrays that holds at a station within the line [m]."""
        return int(self.line.stations.searchsorted(station, side="right")) - 1

    def lane_between(self, rear: float, front: float) -> float:
        """How much lane, along its centre, two stations [m] have between them [m]."""
        behind, ahead = np.interp((rear, front), self.line.stations, self.along_lanes).tolist()
        return float(ahead - behind)

    def lane_change_at(self, station: float) -> LaneChange | None:
        """The change of lanes that is to be done at `station` [m], if there is one."""
        return next((one for one in self.lane_changes if one.start_station <= station <= one.latest_station), None)

    def passing_lane_at(self, station: float) -> PassingLane | None:
        """The lane to pass on at `station` [m], if there is one."""
        return next((one for one in self.passing_lanes if one.covers(station)), None)

    def lane_at(self, station: float, offset: float) -> str:
        """Of the lanes that the ego may be on at `station` [m], the one with its centre nearest to `offset` [m]."""
        change, passing = self.lane_change_at(station), self.passing_lane_at(station)
        if change is None:
            own, aside = self.lane_ids[self.row_at(station)], offset
        else:
            nearest = change.nearest(station, offset)
            own, aside = change.lane(station, nearest), offset - float(change.centres(np.array([station]))[nearest, 0])
        if passing is not None:
            row = int(passing.stations.searchsorted(station, side="right")) - 1
            if abs(offset - float(passing.offsets[row])) < abs(aside):
                return passing.lane_ids[row]
        return own
