"""Lane and road departure: the ego's corners against the edges of what it may drive on."""

import math

import numpy as np

from dvca_sumo.messages import Floats, VehicleShape
from dvca_sumo.oracles.findings import Findings
from dvca_sumo.oracles.place import OFF_ROUTE, Place, Places
from dvca_sumo.roadmap import Route
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Category, Ending, Judgement, Violation

_SHARPEST = 1.0  # [1/m] what a line shows beyond that is a kink, not a bend


class RoadDeparture:
    """Kind "lane_departure": a corner beyond `road_left` or `road_right` for the dwell time; one for each episode.

    Lanes of the same direction are the ego's to use; the oncoming side, and everything that is no
    road, are not. In a bend an edge is never closer than the ego's outer front corner comes when its
    rear axle follows the line exactly. An ego that is off its route altogether has departed. Corners
    before the beginning and after the end of the route's line are not judged. Cannot tell where the
    map has no edges.
    """

    kind = "lane_departure"

    def __init__(self, places: Places, thresholds: Thresholds) -> None:
        self._findings = Findings(self.kind, Category.TRAFFIC_RULE, places)
        self._places = places
        self._tolerance = thresholds.lane_tolerance
        self._dwell = thresholds.lane_dwell
        self._since: float | None = None  # [s] of the current episode
        self._is_reported = False
        self._edges: tuple[list[float], list[float]] | None = None  # (n,) left, right [m]; endless where not known

    def observe(self, moment: Moment) -> Violation | None:
        """See `Oracle`."""
        if self._edges is None:
            left, right = _edges(self._places.route, moment.shape)
            self._edges = left.tolist(), right.tolist()
        beyond, side = self._beyond(self._places.at(moment), *self._edges)
        if not beyond > self._tolerance:
            self._since, self._is_reported = None, False
            return None
        self._since = moment.time if self._since is None else self._since
        if not self._is_reported and moment.time - self._since >= self._dwell - 1e-9:
            self._is_reported = True
            detail = f"{beyond:.2f} m beyond the {side} edge"
            self._findings.add(self._findings.made(moment, detail, beyond, self._tolerance))
        return self._findings.next()

    def conclude(self, ended: Ending) -> Judgement:  # noqa: ARG002  the answer holds for whatever part was seen
        """See `Oracle`."""
        has_edges = self._edges is None or bool(np.isfinite(self._edges).all())
        return self._findings.judgement("" if has_edges else "the map has no road edges on parts of the route")

    def _beyond(self, place: Place, left: list[float], right: list[float]) -> tuple[float, str]:
        """How far the outermost corner is beyond which edge [m]; negative inside."""
        if not place.is_on_route:
            return abs(place.offset) - OFF_ROUTE + self._tolerance, "left" if place.offset > 0.0 else "right"
        most_left, most_right, length = -math.inf, -math.inf, self._places.route.line.length
        for station, offset, row in zip(place.corner_stations, place.corner_offsets, place.corner_rows, strict=True):
            if 0.0 < station < length:
                most_left, most_right = max(most_left, offset - left[row]), max(most_right, right[row] - offset)
        return (most_left, "left") if most_left >= most_right else (most_right, "right")


def _edges(route: Route, shape: VehicleShape) -> tuple[Floats, Floats]:
    """Left and right edge at each row of the route [m], +-inf where the map has none."""
    right_turns = _swing(-route.curvatures, shape)
    left_turns = _swing(route.curvatures, shape)
    left = np.where(np.isfinite(route.road_left), np.maximum(route.road_left, right_turns), np.inf)
    right = np.where(np.isfinite(route.road_right), np.minimum(route.road_right, -left_turns), -np.inf)
    return left, right


def _swing(curvatures: Floats, shape: VehicleShape) -> Floats:
    """How far the outer front corner comes from the line, at the sharpest bend under the ego's length: (n,) [m].

    On a circle of radius R the corner is at sqrt((R + width / 2)^2 + front^2) from its middle.
    """
    ahead, behind = math.ceil(shape.rear_overhang), math.ceil(shape.front)
    padded = np.pad(np.clip(curvatures, 0.0, _SHARPEST), (behind, ahead), mode="edge")
    sharpest = np.lib.stride_tricks.sliding_window_view(padded, behind + ahead + 1).max(axis=1)
    half_width = 0.5 * shape.width
    radius = 1.0 / np.maximum(sharpest, 1e-6)
    swing: Floats = np.where(sharpest > 1e-6, np.hypot(radius + half_width, shape.front) - radius, half_width)
    return swing
