"""People within the ground that SUMO has them on.

At junctions SUMO has people on walking areas stand and walk beside those, on the road, as well: those who wait at a
crossing, in a row along its whole width, stand where its corner reaches over the kerb, in the middle of the lane of who
turns there. Its own drivers drive through them; nobody else gets past. Here they stand on the walking area, and come
back to SUMO's places on their way across. Who walks on a walking area, along its edge, does so with all of its body,
and beside the lanes that lead across the area, where those leave people a way.
"""

import math
import re
from collections.abc import Callable, Sequence

import numpy as np
import shapely

from dvca_sumo.messages import Floats
from dvca_sumo.roadmap.areas import Shape, Strip, grounds, polygon

_WALKING_AREA = re.compile(r":.*_w\d+")  # how SUMO names them
_FROM_KERB = (0.5, 0.25)  # [m] the middle of a body; the first that the area is wide enough for
_STANDING = 0.1  # [m/s]
_AWAY = 1.0  # [m/s] at which somebody moves away from SUMO's place
_BACK = 0.5  # [m/s] and back to it, on top of walking


class Footing:
    """How far everybody is from SUMO's place, at one world step after another."""

    def __init__(self, area_of: Callable[[str], tuple[Shape, Sequence[Strip]]]) -> None:
        """`area_of` gives the outline of a walking area, as an edge, and the lanes of vehicles at its junction."""
        self._area_of = area_of
        self._areas: dict[str, tuple[shapely.Geometry, shapely.Geometry]] = {}
        self._shifts: dict[str, tuple[float, tuple[float, float]]] = {}  # by person: when [s], and how far [m]

    def concerns(self, person: str, edge: str) -> bool:
        """Whether a person may be elsewhere than at SUMO's place."""
        return person in self._shifts or _WALKING_AREA.fullmatch(edge) is not None

    def placed(
        self, time: float, people: Sequence[str], edges: Sequence[str], places: Floats, headings: Floats, speeds: Floats
    ) -> Floats:
        """Where `people` are (n, 2) [m] who are concerned, at `time` [s].

        SUMO's `places` (n, 2) [m] are on the `edges`; it has them walk at `speeds` (n,) [m/s], or look, along
        `headings` (n,) [rad].
        """
        areas, insides = (np.array(parts) for parts in zip(*map(self._area, edges), strict=True))
        points, is_on_area = shapely.points(places), ~shapely.is_empty(areas)
        out = (is_on_area & ~shapely.intersects(insides, points)).nonzero()[0]
        ways = shapely.get_coordinates(shapely.shortest_line(insides[out], points[out])).reshape(-1, 2, 2)
        moves = ways[:, 0] - ways[:, 1]
        at_edge = shapely.intersects(areas[out], points[out])  # on the area ...
        at_edge &= speeds[out] > _STANDING  # ... they leave and enter it at their own pace
        left = np.column_stack((-np.sin(headings), np.cos(headings)))[out[at_edge]]
        moves[at_edge] = (moves[at_edge] * left).sum(axis=1)[:, None] * left
        wanted = np.zeros_like(places)
        wanted[out] = moves
        shifts = [self._shift(time, *one) for one in zip(people, wanted.tolist(), strict=True)]
        for person, shift, stays in zip(people, shifts, is_on_area.tolist(), strict=True):
            self._shifts[person] = (time, shift)
            if shift == (0.0, 0.0) and not stays:
                del self._shifts[person]
        placed: Floats = places + np.array(shifts)
        return placed

    def _shift(self, time: float, person: str, wanted: list[float]) -> tuple[float, float]:
        seen, before = self._shifts.get(person, (time, (0.0, 0.0)))
        fastest = _AWAY if math.hypot(*wanted) > math.hypot(*before) else _BACK
        way, most = math.dist(before, wanted), fastest * (time - seen)
        share = most / way if way > most else 1.0
        return before[0] + share * (wanted[0] - before[0]), before[1] + share * (wanted[1] - before[1])

    def _area(self, edge: str) -> tuple[shapely.Geometry, shapely.Geometry]:
        """A walking area, and where the middles of bodies are on it; empty for any other edge."""
        if edge not in self._areas:
            outline, lanes = self._area_of(edge) if _WALKING_AREA.fullmatch(edge) else ((), ())
            (ground,) = grounds([outline], lanes)
            insides = (shapely.buffer(ground, -kept) for kept in _FROM_KERB)
            inside = next((one for one in insides if not shapely.is_empty(one)), ground)
            self._areas[edge] = polygon(outline), inside
        return self._areas[edge]
