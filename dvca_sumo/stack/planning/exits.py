"""Junctions that are kept clear: the ego enters one across which nobody stands, and that it finds room beyond."""

from typing import NamedTuple

import numpy as np

from dvca_sumo.messages import PREDICTION_TIMES, Flags, Floats, Integers, VehicleShape
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.junctions import LineView
from dvca_sumo.stack.planning.scene import ALONG
from dvca_sumo.stack.planning.st_graph import Graph

_SOON = int(np.searchsorted(PREDICTION_TIMES, 3.0))
_CREEPS = 3.0  # [m] within 3 s: who gets no further, and is no faster now, may stop for good
_BRAKING = 4.0  # [m/s^2] is as much as is braked for it
_PASSING = 2.0  # [s] that it takes to pass somebody
_QUEUED = 2.0  # [m] that those who close up leave to each other


class Ahead(NamedTuple):
    """Who is on the path, or will be; places are from the ego's front bumper on [m]."""

    rears: Floats  # (n,)
    fronts: Floats  # (n,)
    stands: Flags  # (n,) or creeps
    is_vehicle: Flags  # (n,)
    is_across: Flags  # (n,) people there now, and vehicles that stand there and do not head the path's way


def ahead(graph: Graph, speed: float, shape: VehicleShape, config: PlanningConfig) -> Ahead:
    """Vehicles on the path at present, and people who are there when an ego at `speed` [m/s] may first get to them.

    Each by the slowest of its futures. Of people who are not there yet, the likely ones count.
    """
    scene, occupied = graph.scene, graph.occupied[:, 0].copy()
    people = scene.is_person.nonzero()[0]
    if people.size:
        counts = occupied[people] | (scene.probabilities[people] >= config.likely)
        occupied[people] = counts & _met(people, graph, speed, shape, config)
    rows = occupied.nonzero()[0]
    ways = np.where(rows < scene.moving, graph.low[rows, _SOON] - graph.low[rows, 0], -np.inf)
    if len(rows) > 1:
        order = np.lexsort((ways, scene.owners[rows]))
        rows, ways = rows[order], ways[order]
        is_slowest = np.ones(len(rows), dtype=np.bool_)
        is_slowest[1:] = scene.owners[rows[1:]] != scene.owners[rows[:-1]]
        rows, ways = rows[is_slowest], ways[is_slowest]
    begun = np.array(graph.first, dtype=np.int64)[rows]
    rears, fronts = graph.low[rows, begun] - shape.front, graph.high[rows, begun] - shape.front
    owners, stands, is_person = scene.owners[rows], ways < _CREEPS, scene.is_person[rows]
    is_across = np.where(is_person, stands, scene.is_standing[owners] & (scene.now.directions[owners] < ALONG))
    return Ahead(rears, fronts, stands, ~is_person, is_across & graph.occupied[rows, 0])


def _met(rows: Integers, graph: Graph, speed: float, shape: VehicleShape, config: PlanningConfig) -> Flags:
    """Whether futures `rows` (k,) occupy the path when the ego may first be there, or while it passes: (k,)."""
    times = graph.scene.times
    places = graph.low[rows, np.array(graph.first, dtype=np.int64)[rows]]
    to_go = np.maximum(places - shape.front, 0.0)
    arrivals = (np.sqrt(speed * speed + 2.0 * config.acceleration * to_go) - speed) / config.acceleration
    begins = np.minimum(arrivals, times[-1])[:, None]
    passing = (times >= begins) & (times <= begins + _PASSING)
    met: Flags = (graph.occupied[rows] & passing).any(axis=1)
    return met


def may_wait_at(view: LineView, distance: float, speed: float) -> bool:
    """Whether an ego at `speed` [m/s] may be to wait for a junction to clear, `distance` [m] ahead of its front bumper.

    Not where nobody crosses, nor at a place that it has passed, or could hardly stop at.
    """
    return bool(view.line.crosses) and distance > 0.0 and speed * speed <= 2.0 * _BRAKING * distance


def is_blocked(view: LineView, distance: float, those: Ahead, shape: VehicleShape, config: PlanningConfig) -> bool:
    """Whether the ego is to wait at a place where it may for the junction behind it to clear.

    That place, `distance` [m] ahead of the front bumper, is the line, or where one lets others pass on the junction.

    It is when one of `those` is on the junction across its way: people, or a vehicle that stands, waiting for others or
    for the ego itself. A vehicle there that heads its way, or moves, goes on. And it is when the ego would not fit
    between the junction and the first one who stands beyond it, after all who drive there before it have closed up.
    """
    leave = view.exit_distance
    inside = (those.rears > distance) & (those.rears <= leave)
    if (those.is_across & inside).any():
        return True
    beyond = those.stands & (those.rears > leave)
    if not beyond.any():
        return False
    tail = float(those.rears[beyond].min())
    before = those.is_vehicle & (those.fronts > distance) & (those.rears < tail)
    taken = float((those.fronts - those.rears + _QUEUED)[before].sum())
    return tail - leave - taken < shape.length + config.follow_gap
