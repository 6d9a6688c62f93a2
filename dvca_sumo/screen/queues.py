"""How long a driver is held up in queues that none of the egos heads.

The rule: another vehicle is right ahead on its way, slow, and makes no stop of its own; and if there is an ego farther
ahead, that one is held up itself. Of each second counts the share that it falls short of the speed limit.
"""

import math
from collections.abc import Callable

import numpy as np

from dvca_sumo.messages import ObjectClass
from dvca_sumo.oracles import Places
from dvca_sumo.oracles.ahead import ahead
from dvca_sumo.truth import Moment

_REACH = 150.0  # [m] ahead, within which an ego may head the queue
_CLOSE = 15.0  # [m] ahead, nearest corner
_SLOW = 5.0  # [m/s]
_PERIOD = 1.0  # [s] between two looks


class Queues:
    """The queues of one simulation, as its egos stand in them."""

    def __init__(self, is_stopping: Callable[[str], bool]) -> None:
        """`is_stopping` says of a vehicle whether it makes a stop of its own now."""
        self._is_stopping = is_stopping
        self._held: dict[str, bool] = {}  # by ego

    def holds(self, ego: str, places: Places, moment: Moment) -> bool:
        """Whether `ego` is held up now."""
        found, objects = ahead(places, moment, _REACH), moment.objects
        order = found.gaps.argsort()
        names = [objects.ids[row] for row in found.rows[order].tolist()]
        held = False
        if names and found.gaps[order[0]] < _CLOSE:
            row = int(found.rows[order[0]])
            is_on_wheels = objects.classes[row] in (ObjectClass.VEHICLE, ObjectClass.BICYCLE)
            is_along = math.cos(objects.boxes[row, 2] - moment.ego.heading) > 0.0
            is_slow = np.hypot(*objects.velocities[row]) < _SLOW
            held = bool(is_on_wheels and is_along and is_slow) and not self._is_stopping(names[0])
        self._held[ego] = held and next((self._held[name] for name in names if name in self._held), True)
        return self._held[ego]


class Held:
    """How long one drive was held up, up to now."""

    def __init__(self, ego: str, places: Places, queues: Queues) -> None:
        """The watch over the drive of `ego`, `places` being its oracles'."""
        self.duration = 0.0  # [s]
        self._ego = ego
        self._places = places
        self._queues = queues
        self._looked = -math.inf  # [s]

    def see(self, moment: Moment) -> None:
        """Take in the next moment."""
        passed = moment.time - self._looked
        if passed < _PERIOD:
            return
        self._looked = moment.time
        limit = float(self._places.route.speed_limits[self._places.at(moment).row])
        if self._queues.holds(self._ego, self._places, moment) and passed < math.inf:
            self.duration += passed * max(1.0 - moment.ego.speed / limit, 0.0)
