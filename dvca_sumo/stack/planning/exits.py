"""Junctions that are kept clear: the ego enters one where it finds room behind the queue beyond."""

from typing import NamedTuple

import numpy as np

from dvca_sumo.messages import PREDICTION_TIMES, Floats, Integers, VehicleShape
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.junctions import LineView
from dvca_sumo.stack.planning.scene import Flags
from dvca_sumo.stack.planning.st_graph import Graph

_SOON = int(np.searchsorted(PREDICTION_TIMES, 3.0))
_CREEPS = 3.0  # [m] within 3 s: who gets no further, and is no faster now, may stop for good
_BRAKING = 4.0  # [m/s^2] is as much as is braked for it
_QUEUED = 2.0  # [m] that those who close up leave to each other


class Ahead(NamedTuple):
    """Who is on the path at present; places are from the ego's front bumper on [m]."""

    rears: Floats  # (n,)
    fronts: Floats  # (n,)
    stands: Flags  # (n,) or creeps
    is_vehicle: Flags  # (n,)


def ahead(graph: Graph, speed: float, shape: VehicleShape, config: PlanningConfig) -> Ahead:
    """Those whom the path meets where they are now: each by the slowest of its futures.

    People who walk off it before an ego at `speed` [m/s] gets to them do not stand there.
    """
    scene = graph.scene
    rows = graph.occupied[:, 0].nonzero()[0]
    ways = np.where(rows < scene.moving, graph.low[rows, _SOON] - graph.low[rows, 0], -np.inf)
    ways[_walks_off(rows, graph, speed, shape, config)] = np.inf
    slowest = np.argsort(ways, kind="stable")
    _, firsts = np.unique(scene.owners[rows[slowest]], return_index=True)
    rows, ways = rows[slowest[firsts]], ways[slowest[firsts]]
    rears, fronts = graph.low[rows, 0] - shape.front, graph.high[rows, 0] - shape.front
    return Ahead(rears, fronts, ways < _CREEPS, ~scene.is_person[rows])


def _walks_off(rows: Integers, graph: Graph, speed: float, shape: VehicleShape, config: PlanningConfig) -> Flags:
    """Whether each future of `rows` (k,) is that of a person who is off the path when the ego may get there: (k,)."""
    scene, last = graph.scene, np.array(graph.last, dtype=np.int64)[rows]
    to_go = np.maximum(graph.low[rows, 0] - shape.front, 0.0)
    arrivals = (np.sqrt(speed * speed + 2.0 * config.acceleration * to_go) - speed) / config.acceleration
    leaves = (last < len(scene.times) - 1) & (scene.times[last] < arrivals)
    off: Flags = leaves & scene.is_person[rows]
    return off


def is_blocked(
    view: LineView, distance: float, those: Ahead, speed: float, shape: VehicleShape, config: PlanningConfig
) -> bool:
    """Whether the ego, at `speed` [m/s], is to wait at a place it has not passed for the junction behind it to clear.

    That place, `distance` [m] ahead of the front bumper, is the line, or where one lets others pass on the junction.

    It is when one of `those` stands on the junction who is no vehicle: vehicles there go on. And when it would not fit
    between the junction and the first one who stands beyond it, after all who drive there before the ego have
    closed up. It is not any more where it could hardly stop.
    """
    if not view.line.crosses or distance <= 0.0 or speed * speed > 2.0 * _BRAKING * distance:
        return False
    leave = view.exit_distance
    if (those.stands & ~those.is_vehicle & (those.rears > distance) & (those.rears <= leave)).any():
        return True
    beyond = those.stands & (those.rears > leave)
    if not beyond.any():
        return False
    tail = float(those.rears[beyond].min())
    before = those.is_vehicle & (those.fronts > distance) & (those.rears < tail)
    taken = float((those.fronts - those.rears + _QUEUED)[before].sum())
    return tail - leave - taken < shape.length + config.follow_gap
