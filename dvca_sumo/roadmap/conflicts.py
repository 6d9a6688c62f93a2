"""Whose paths conflict on junctions that a net leaves unregulated: it lists nobody there, but draws their ways."""

from collections.abc import Mapping, Sequence

import numpy as np
import shapely

from dvca_sumo.roadmap.lanes import Lane, Movement


def drawn_foes(movements: Sequence[Movement], lanes: Mapping[str, Lane]) -> dict[int, str]:
    """As `Junction.foes`: movements from different lanes whose centre lines meet between those and the lanes beyond."""
    ways = np.array([_way(movement, lanes) for movement in movements], dtype=object)
    meets = shapely.intersects(ways[:, None], ways)
    return {
        movement.index: "".join(
            "1" if meets[row, other] and movements[other].from_lane != movement.from_lane else "0"
            for other in reversed(range(len(movements)))
        )
        for row, movement in enumerate(movements)
    }


def _way(movement: Movement, lanes: Mapping[str, Lane]) -> shapely.LineString:
    begin, end = lanes[movement.from_lane].line.points[-1:], lanes[movement.to_lane].line.points[:1]
    return shapely.LineString(np.concatenate([begin, *(lanes[lane].line.points for lane in movement.internal), end]))
