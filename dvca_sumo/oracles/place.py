"""Where the ego truly is on its route, looked up once a moment for all oracles."""

import math
from bisect import bisect_right

import msgspec
import numpy as np

from dvca_sumo.geometry.boxes import Neighbours, box_of, neighbours
from dvca_sumo.messages import Floats, Integers
from dvca_sumo.roadmap import RoadMap, Route
from dvca_sumo.truth import Moment, ObjectsTruth

OFF_ROUTE = 15.0  # [m] farther from its line than this the ego is no longer on the route

_BACK, _AHEAD = 20.0, 8.0  # [m] searched around the last known station: a route may soon come by the same place again
_BESIDE = 30.0  # [m] beyond which what is behind the ego, or just out of reach, need not be told apart
_FASTEST = 60.0  # [m/s] the search window grows so fast while the ego is off its route


class Place(msgspec.Struct, frozen=True):
    """Where the ego is on its route: stations along the route's line, offsets to its left."""

    time: float  # [s]
    box: Floats  # (5,) of the ego
    station: float  # [m] of the middle of the front bumper
    offset: float  # [m]
    row: int  # of the route's per-station arrays, at the front bumper
    corner_stations: list[float]  # (4,) [m] front left, rear left, rear right, front right
    corner_offsets: list[float]  # (4,) [m]
    corner_rows: list[int]  # (4,)

    @property
    def is_on_route(self) -> bool:
        """Whether the route says anything about this place."""
        return abs(self.offset) <= OFF_ROUTE


class Places:
    """Places of one ego over one run, in the order of time.

    Remembers the last place only. Oracles that share an instance cost one projection a moment.
    """

    def __init__(
        self,
        route: Route,
        roadmap: RoadMap,
        signed_lanes: frozenset[str] = frozenset(),
        begin: float | None = None,
    ) -> None:
        """Places along `route`, from its start on, or from the station `begin` of the front bumper [m].

        The limit of `signed_lanes` may be another than the route's, at any time.
        """
        self.route = route
        self.roadmap = roadmap
        self.signed_lanes = signed_lanes
        self._last: Place | None = None
        self._stations = route.line.stations.tolist()
        self._neighbours: tuple[ObjectsTruth, Neighbours] | None = None
        self._anchor = route.start if begin is None else begin  # [m] last station known to be right ...
        self._anchor_time: float | None = None  # [s] ... and when

    def at(self, moment: Moment) -> Place:
        """The ego's place at `moment`, which is never earlier than the one asked for before."""
        if self._last is None or self._last.time != moment.time:
            self._last = self._place(moment)
        return self._last

    @property
    def is_empty(self) -> bool:
        """Whether no place was ever asked for: nothing of the run was seen."""
        return self._last is None

    def within(self, moment: Moment, reach: float | Floats) -> Integers:
        """Rows of the objects that may be closer than `reach` [m] to the ego; see `Neighbours.within`."""
        objects = moment.objects
        if self._neighbours is None or self._neighbours[0] is not objects:
            self._neighbours = objects, neighbours(self.at(moment).box, objects.boxes)
        return self._neighbours[1].within(reach)

    def along(self, points: Floats, reach: float) -> tuple[Floats, Floats]:
        """Stations and offsets [m] of points (m, 2) near the ego's last place.

        Right for stations up to `reach` [m] ahead of it; what is farther ahead gets one beyond that.
        """
        return self.route.line.project(points, between=(self._anchor - _BESIDE, self._anchor + reach + _BESIDE))

    def rows(self, stations: Floats) -> Integers:
        """Rows of the route's arrays that hold at `stations`."""
        last = len(self.route.lane_ids) - 1
        found: Integers = self.route.line.stations.searchsorted(stations, side="right")
        return np.minimum(np.maximum(found - 1, 0), last)

    def lane(self, moment: Moment) -> str | None:
        """The ego's lane: the route's where its front is inside it, else the nearest to its middle within 3 m."""
        place = self.at(moment)
        row = place.row
        if place.is_on_route and self.route.lane_right[row] <= place.offset <= self.route.lane_left[row]:
            return self.route.lane_ids[row]
        nearest = self.roadmap.lanes_near(place.box[None, :2], 3.0)[0]
        return nearest[0] if nearest else None

    def _place(self, moment: Moment) -> Place:
        ego, shape = moment.ego, moment.shape
        cos, sin = math.cos(ego.heading), math.sin(ego.heading)
        front_x, front_y = ego.x + shape.front * cos, ego.y + shape.front * sin
        rear_x, rear_y = ego.x - shape.rear_overhang * cos, ego.y - shape.rear_overhang * sin
        side_x, side_y = -0.5 * shape.width * sin, 0.5 * shape.width * cos
        points = np.array(
            [
                [front_x, front_y],
                [front_x + side_x, front_y + side_y],
                [rear_x + side_x, rear_y + side_y],
                [rear_x - side_x, rear_y - side_y],
                [front_x - side_x, front_y - side_y],
            ]
        )
        stations, offsets = self._projected(points, moment.time)
        last = len(self.route.lane_ids) - 1
        row, *corner_rows = (min(max(bisect_right(self._stations, one) - 1, 0), last) for one in stations.tolist())
        place = Place(
            time=moment.time,
            box=box_of(ego.x, ego.y, ego.heading, shape),
            station=float(stations[0]),
            offset=float(offsets[0]),
            row=row,
            corner_stations=stations[1:].tolist(),
            corner_offsets=offsets[1:].tolist(),
            corner_rows=corner_rows,
        )
        if place.is_on_route or self._anchor_time is None:
            self._anchor_time = moment.time
            self._anchor = place.station
        return place

    def _projected(self, points: Floats, time: float) -> tuple[Floats, Floats]:
        line = self.route.line
        lost = 0.0 if self._anchor_time is None else time - self._anchor_time
        low, high = self._anchor - _BACK, self._anchor + _AHEAD + _FASTEST * lost
        stations, offsets = line.project(points, between=(low, high))
        if self._anchor_time is None and not low < stations[0] < high:
            # The run did not begin where the route says; from then on the window follows.
            stations, offsets = line.project(points)
        return self._carried_on(points, stations, offsets)

    def _carried_on(self, points: Floats, stations: Floats, offsets: Floats) -> tuple[Floats, Floats]:
        """The same, those past the end of the line, which a road may have with it, along a straight continuation."""
        line = self.route.line
        rows = (stations >= line.length).nonzero()[0]
        if rows.size:
            heading = float(line.headings[-1])
            axes = np.array([[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]])
            beyond, aside = ((points[rows] - line.points[-1]) @ axes).T
            is_past = (beyond > 0.0) & (beyond <= OFF_ROUTE)
            stations[rows[is_past]] += beyond[is_past]
            offsets[rows[is_past]] = aside[is_past]
        return stations, offsets
