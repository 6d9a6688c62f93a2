"""What is measured of one drive, moment by moment: the same of the ADS's egos and of SUMO's own drivers."""

import math

from dvca_sumo.oracles import Places
from dvca_sumo.oracles.ttc import TimeToCollision
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import Moment

HARD = 3.5  # [m/s^2] mean deceleration over a world step that is hard braking
HORIZON = 3.0  # [s] a longer time to collision is none
_DWELL = 3  # moments in a row that an object must be so near in time: 0.2 s, as for the oracle


class Measures:
    """Way, time, hard braking and the least time to collision of one drive up to now."""

    def __init__(self, places: Places, thresholds: Thresholds) -> None:
        """Measures that share `places` with the oracles of the same drive."""
        self.distance = 0.0  # [m]
        self.duration = 0.0  # [s]
        self.distance_after = 0.0  # [m] thereof after a contact
        self.duration_after = 0.0  # [s] likewise
        self.hard_brakings = 0  # episodes of deceleration above `HARD`
        self.least_ttc: float | None = None  # [s] that lasted for 0.2 s; None: none below the horizon
        self.last: Moment | None = None
        self._slowest = thresholds.ttc_speed
        self._ttc = TimeToCollision(places, Thresholds(ttc=HORIZON))
        self._recent: dict[str, tuple[float, ...]] = {}  # [s] by object, in the moments up to now without a break
        self._is_braking = False
        self._has_touched = False

    def touch(self) -> None:
        """The last moment was a contact's: of what follows, only how far and how long it goes is measured."""
        self._has_touched = True

    def see(self, moment: Moment) -> None:
        """Take in the next moment."""
        if self.last is not None:
            before, now = self.last.ego, moment.ego
            passed = now.time - before.time
            way = math.dist((before.x, before.y), (now.x, now.y))
            self.duration += passed
            self.distance += way
            if self._has_touched:
                self.duration_after += passed
                self.distance_after += way
            else:
                is_braking = (before.speed - now.speed) / passed > HARD
                self.hard_brakings += is_braking and not self._is_braking
                self._is_braking = is_braking
        self.last = moment
        if not self._has_touched:
            self._follow(moment)

    def _follow(self, moment: Moment) -> None:
        if moment.ego.speed < self._slowest:
            self._recent = {}
            return
        rows, times = self._ttc.times(moment)
        names = moment.objects.ids
        self._recent = {
            names[row]: (*self._recent.get(names[row], ())[1 - _DWELL :], time)
            for row, time in zip(rows.tolist(), times.tolist(), strict=True)
            if 0.0 < time < HORIZON
        }
        lasting = [max(recent) for recent in self._recent.values() if len(recent) == _DWELL]
        if lasting:
            self.least_ttc = min(lasting) if self.least_ttc is None else min(self.least_ttc, *lasting)
