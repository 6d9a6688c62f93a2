"""Passing who is slow on the next lane, and coming back: changes of lane that the route does not need.

As in MOBIL (Kesting, Treiber, Helbing, General lane-changing model, 2007) there has to be something to gain, and
room for it.
"""

import math
from collections.abc import Sequence

import numpy as np

from dvca_sumo.messages import PREDICTION_TIMES, PredictedObjects, VehicleShape
from dvca_sumo.roadmap.route import LaneChange, PassingLane
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.lane_changing import (
    ARRIVED,
    LaneChoice,
    goes_on,
    is_at_junction,
    is_caught,
    is_last_chance,
    keeping,
    last_stop,
    letting_in,
)
from dvca_sumo.stack.planning.lane_gaps import Gaps, Neighbours, Urgency
from dvca_sumo.stack.planning.limits import cruise_speeds
from dvca_sumo.stack.planning.reference import BEHIND, Window
from dvca_sumo.stack.planning.speed import Stop

_BESIDE, _OWN = 0, 1  # lanes of the way back
_LONGER = 2.0  # that the next lane is to be the faster one
_FIRST, _LAST = np.searchsorted(PREDICTION_TIMES, (2.0, 3.0)).tolist()  # when what is predicted tells how fast one is
_BETWEEN = float(PREDICTION_TIMES[_LAST] - PREDICTION_TIMES[_FIRST])  # [s]


class Passing:
    """Decides at each lane to pass on whether to be on it."""

    def __init__(self, lanes: Sequence[PassingLane], gaps: Gaps, shape: VehicleShape, config: PlanningConfig) -> None:
        self._lanes = lanes
        self._ways_back = [_way_back(lane) for lane in lanes]
        self._gaps = gaps
        self._shape = shape
        self._config = config
        self._next = 0  # row of the lane to pass on that the ego is beside, or comes to
        self._lane = self._target = _OWN  # that the ego is on, and is to be on

    def step(self, window: Window, offset: float, speed: float, predicted: PredictedObjects) -> LaneChoice | None:
        """As `LaneChanger.step`; None where the ego is on the route's own lane, and stays there."""
        nose, ways = window.station + self._shape.front, self._ways_back
        while self._next < len(ways) and nose >= ways[self._next].latest_station:
            self._next, self._lane, self._target = self._next + 1, _OWN, _OWN
        if self._next == len(ways) or window.station < ways[self._next].start_station:
            return None
        return self._choice(ways[self._next], window, offset, speed, predicted)

    def _choice(
        self, way: LaneChange, window: Window, offset: float, speed: float, predicted: PredictedObjects
    ) -> LaneChoice | None:
        config, shape = self._config, self._shape
        leads_on = self._lanes[self._next].leads_on
        nose = window.station + shape.front
        wanted = float(cruise_speeds(window.speed_limits[BEHIND], config))
        halt = min((begin for begin, end in way.junctions if end > nose), default=way.latest_station)
        is_short = halt - nose < config.passing_room * wanted
        if not leads_on:
            is_short |= way.latest_station - nose < (config.passing_room + config.return_room) * wanted
        if self._lane == self._target == _OWN and is_short:
            return None
        aside = np.abs(offset - way.centres(np.array([window.station]))[:, 0])
        if aside[self._target] < ARRIVED:
            self._lane = self._target
        if self._lane == self._target == _OWN and (is_short or aside[_OWN] > ARRIVED):
            return None
        occupied, gains = self._gaps.occupied(way, window.station, predicted.objects), _gains(predicted)
        stop = None if leads_on else last_stop(way, window, 1, speed, shape, config)
        beside = self._pace_on(occupied[_BESIDE], gains, wanted, _LONGER * config.passing_outlook, is_own=False)
        own = self._pace_on(occupied[_OWN], gains, wanted, config.passing_outlook, is_own=True)
        is_queue = own < config.passing_slowest
        is_late = not leads_on and (is_queue or way.latest_station - nose < config.return_room * speed)
        wish = target = self._wish(beside, own, is_late=is_late, is_queue=is_queue)
        if target != self._lane:
            is_under_way = self._lane != self._target
            urgency = self._urgency(target, stop, speed, is_late=is_late)
            is_begun = is_under_way and (
                goes_on(float(aside[self._lane]), way.widths[self._lane], occupied[target], shape)
                or is_caught(occupied[self._lane], occupied[target], speed, shape, config)
            )
            is_pulling_out = target == _BESIDE != self._target
            may_begin = is_begun or (
                (urgency is Urgency.PRESSED or not is_at_junction(way, window, speed, shape, config))
                and self._gaps.is_free(occupied[target], way, window, speed, urgency)
                and (not is_pulling_out or self._gaps.is_in_sight(occupied[_OWN], occupied[_BESIDE], wanted, speed))
            )
            if not may_begin:
                target = self._lane
        pace = math.inf
        if target != wish and (is_late or (is_queue and wish == _BESIDE)):
            pace = self._gaps.pace(occupied[wish], way, window, speed)
        behind = letting_in([occupied[target]], shape) if target != self._lane else frozenset()
        self._target = target
        if target == _BESIDE:
            return LaneChoice(keeping(way, _BESIDE, window, speed, stop, config), behind, pace)
        if self._lane == target == wish:
            return None
        return LaneChoice(None, behind, pace)

    def _wish(self, beside: float, own: float, *, is_late: bool, is_queue: bool) -> int:
        """The lane to be on by how fast one gets on there [m/s]; a change that is under way is not thought over."""
        if self._lane != self._target:
            return self._target
        if self._lane == _BESIDE:
            return _OWN if is_late or own >= beside else _BESIDE
        is_worth_it = beside > own + self._config.passing_gain
        return _BESIDE if is_worth_it and (self._lanes[self._next].leads_on or not is_queue) else _OWN

    def _urgency(self, target: int, stop: Stop | None, speed: float, *, is_late: bool) -> Urgency:
        """How much there is to a change to the lane `target` now."""
        if self._lane != self._target or (stop is not None and is_last_chance(stop, speed)):
            return Urgency.PRESSED
        return Urgency.CAN_WAIT if target == _OWN and not is_late else Urgency.WANTED

    def _pace_on(
        self, lane: Neighbours, gains: dict[int, float], wanted: float, outlook: float, *, is_own: bool
    ) -> float:
        """How fast the slowest soon is whom the ego, at the speed `wanted`, catches up with within `outlook` [s] [m/s].

        What is no traffic slows it down on another lane; on its own it is passed in the lane, or next to it.
        """
        speeds = lane.speeds + np.array([gains[track] for track in lane.tracks])
        ahead = lane.rears - self._shape.front
        is_met = (ahead > 0.0) & (ahead < outlook * (wanted - speeds))
        if is_own:
            is_met &= lane.is_traffic
        return float(speeds[is_met].min(initial=wanted))


def _gains(predicted: PredictedObjects) -> dict[int, float]:
    """How much faster each track soon is than now [m/s], as its likeliest hypothesis has it; 0 without any."""
    objects, owners, order = predicted.objects, predicted.owners, predicted.probabilities.argsort(kind="stable")
    moved = predicted.poses[order, _LAST, :2] - predicted.poses[order, _FIRST, :2]
    speeds = np.hypot(objects.velocities[:, 0], objects.velocities[:, 1])
    soon = speeds.copy()
    soon[owners[order]] = np.hypot(moved[:, 0], moved[:, 1]) / _BETWEEN
    return dict(zip(objects.ids.tolist(), (soon - speeds).tolist(), strict=True))


def _way_back(passing: PassingLane) -> LaneChange:
    """From the lane to pass on to the route's own, anywhere along it."""
    offsets = np.stack((passing.offsets, np.zeros_like(passing.offsets)))
    first, last = float(passing.stations[0]), float(passing.stations[-1])
    return LaneChange(
        lanes=(passing.lane_ids,) * 2,
        widths=passing.widths,
        start_station=first,
        latest_station=last,
        stations=passing.stations,
        offsets=offsets,
        junctions=passing.halts,
    )
