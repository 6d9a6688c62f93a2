"""The map: lanes, connections, right of way, limits, signals and drivable area of any SUMO net."""

from dvca_sumo.roadmap.lanes import Lane, RoadMapError, is_inner
from dvca_sumo.roadmap.roadmap import RoadMap
from dvca_sumo.roadmap.route import Control, Crossing, Overpass, Route, RouteError, StopLine

__all__ = [
    "Control",
    "Crossing",
    "Lane",
    "Overpass",
    "RoadMap",
    "RoadMapError",
    "Route",
    "RouteError",
    "StopLine",
    "is_inner",
]
