"""Where a vehicle gets to that goes on as it does: along its lane, and those that follow on it."""

import math
from collections.abc import Callable

import numpy as np

from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.messages import Floats
from dvca_sumo.roadmap import Lane, RoadMap

Motion = Callable[[float], tuple[float, float, float]]  # where a body is after so many seconds: x, y, heading

_ALIGNED = 0.1  # [rad] between a body and the lane that it drives along
_ON_LANE = 1.5  # [m] from the middle of the lane that its rear is still on
_SAME = 0.1  # [m] from the end of a lane to where the next one begins


def lane_courses(roadmap: RoadMap, lane: str, box: Floats, speed: float, horizon: float) -> list[Motion]:
    """One motion for each way on from `lane`, where the front of `box` (5,) is, over `horizon` [s] at `speed` [m/s].

    The front keeps its distance to the middle of the lanes, the rear comes after it. None where the body is at an angle
    to the lanes under it, as one that leaves them is: within a bend or corner its heading is between theirs.
    """
    known = roadmap.lanes.get(lane)
    if known is None:
        return []
    heading, length = float(box[2]), float(box[3])
    half = 0.5 * length * np.array([math.cos(heading), math.sin(heading)])
    front, rear = box[:2] + half, box[:2] - half
    (station,), (offset,) = known.line.project([front])
    lines = [known.line] if station >= length else _lines_before(roadmap, lane, rear)
    turns = [wrapped(heading - _heading(known.line, front)), *(wrapped(heading - _heading(one, rear)) for one in lines)]
    if min(turns) > _ALIGNED or max(turns) < -_ALIGNED:
        return []
    reach = float(station) + speed * horizon
    return [
        _following(Polyline(points), float(station), float(offset), front, rear, speed)
        for points in _onward(roadmap, known, reach)
    ]


def _lines_before(roadmap: RoadMap, lane: str, rear: Floats) -> list[Polyline]:
    """Those of the lanes under the rear from which one gets onto `lane`."""
    (near,) = roadmap.lanes_near([rear], _ON_LANE)
    return [roadmap.lanes[one].line for one in near if lane in roadmap.lanes[one].successors]


def _heading(line: Polyline, point: Floats) -> float:
    return float(line.headings_at(line.project([point])[0])[0])


def _onward(roadmap: RoadMap, lane: Lane, reach: float) -> list[Floats]:
    """Points (n, 2) of each line from the begin of `lane` on, `reach` [m] long or up to where there is no further."""
    points = lane.line.points
    following = [roadmap.lanes[one] for one in lane.successors if one in roadmap.lanes]
    if lane.line.length >= reach or not following:
        return [points]
    onward = [more for one in following for more in _onward(roadmap, one, reach - lane.line.length)]
    return [np.vstack([points, more[math.dist(points[-1], more[0]) < _SAME :]]) for more in onward]


def _following(line: Polyline, station: float, offset: float, front: Floats, rear: Floats, speed: float) -> Motion:
    length = math.dist(front, rear)

    def motion(time: float) -> tuple[float, float, float]:
        way = speed * time
        ahead = line.poses([station + way], offset)[0, :2]
        if way < length:
            behind = rear + (front - rear) * (way / length)
        else:
            behind = line.poses([station + way - length], offset)[0, :2]
        x, y = (0.5 * (ahead + behind)).tolist()
        east, north = (ahead - behind).tolist()
        return x, y, math.atan2(north, east)

    return motion
