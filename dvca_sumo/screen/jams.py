"""Whether an ego is held up by a jam that is none of its doing.

The rule: the ego stands, off the junctions, and on its way ahead somebody has stood for longer than any signal holds
and makes no stop of its own. SUMO's vehicles come to such jams by themselves, when one needs another lane on an edge
too short to change; SUMO ends them by teleports, after minutes.
"""

import math

import numpy as np

from dvca_sumo.messages import ObjectClass
from dvca_sumo.oracles import Places
from dvca_sumo.oracles.ahead import ahead
from dvca_sumo.truth import Moment

REACH = 50.0  # [m] ahead
LONG = 120.0  # [s]
_STANDING = 0.1  # [m/s]
_PERIOD = 1.0  # [s] between two looks


class Jams:
    """Who stands around one ego, and since when."""

    def __init__(self, places: Places) -> None:
        """The watch over one drive, `places` being its oracles'."""
        self._places = places
        self._since: dict[str, float] = {}  # [s] by name
        self._looked = -math.inf  # [s]

    def see(self, moment: Moment) -> None:
        """Take in the next moment."""
        if moment.time - self._looked < _PERIOD:
            return
        self._looked = moment.time
        objects = moment.objects
        stands = np.hypot(objects.velocities[:, 0], objects.velocities[:, 1]) < _STANDING
        stands &= (objects.classes == ObjectClass.VEHICLE) | (objects.classes == ObjectClass.BICYCLE)
        names = [objects.ids[row] for row in stands.nonzero()[0].tolist()]
        self._since = {name: self._since.get(name, moment.time) for name in names}

    def holding(self, moment: Moment) -> list[str]:
        """Those who hold up the ego at `moment`, if they make no stops of their own."""
        place, route = self._places.at(moment), self._places.route
        under = {route.lane_ids[row] for row in (place.row, *place.corner_rows)}
        if moment.ego.speed >= _STANDING or any(self._places.roadmap.lanes[lane].is_internal for lane in under):
            return []
        names = [moment.objects.ids[row] for row in ahead(self._places, moment, REACH).rows.tolist()]
        return [name for name in names if moment.time - self._since.get(name, moment.time) >= LONG]
