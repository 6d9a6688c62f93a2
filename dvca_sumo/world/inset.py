"""How much nearer to its lane SUMO is told that an ego is, which swings out beyond the lane's edge to turn.

A body is on a lane to SUMO as long as the two overlap. What is on no lane its drivers do not see: who is behind passes,
and meets it where it turns.
"""

import math

import shapely

_OVERLAP = 0.2  # [m] told
_FARTHEST = 5.0  # [m] from the middle of the lane: a turn back swings out no further, what is beyond has left the road


class Inset:
    """One ego's, at one world step after another."""

    def __init__(self) -> None:
        self._is_needed = False  # since SUMO found no lane for it

    def at(
        self, x: float, y: float, middle: shapely.LineString, reach: float, *, is_on_lane: bool
    ) -> tuple[float, float]:
        """Where to tell it, after SUMO did or did not find a lane where it was told last.

        Args:
            x: Its place [m].
            y: Its place [m].
            middle: The centre line of its lane.
            reach: Half the width of lane and body together [m].
            is_on_lane: What SUMO found.
        """
        if is_on_lane and not self._is_needed:
            return x, y
        away, most = middle.distance(shapely.Point(x, y)), reach - _OVERLAP
        self._is_needed = most < away < _FARTHEST
        return within(x, y, middle, most) if self._is_needed else (x, y)


def within(x: float, y: float, middle: shapely.LineString, most: float) -> tuple[float, float]:
    """The place, or the one on the way from it to the line that is no farther than `most` [m] from that."""
    near = middle.interpolate(middle.project(shapely.Point(x, y)))
    away = math.dist((x, y), (near.x, near.y))
    if away <= most:
        return x, y
    part = most / away
    return near.x + part * (x - near.x), near.y + part * (y - near.y)
