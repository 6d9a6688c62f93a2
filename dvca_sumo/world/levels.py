"""Bodies on bridges over an ego, and under those that it drives on: it does not meet them."""

import math
from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from dvca_sumo.roadmap import Route
from dvca_sumo.truth import ObjectsTruth
from dvca_sumo.world.net import edge_of

_BRIDGE = 30.0  # [m] around the place where two lanes pass over each other
_AROUND = 200.0  # [m] along the route: it may come by again on the other level


def on_level(objects: ObjectsTruth, grounds: Sequence[str], route: Route, station: float) -> ObjectsTruth:
    """The objects without those that are on another level than an ego at `station` [m] of its route.

    `grounds` (n,) are the edges that people on foot are on, "" of others.
    """
    near = [one for one in route.overpasses if abs(one.station - station) <= _AROUND]
    if not near:
        return objects
    lanes, edges = defaultdict(list), defaultdict(list)  # where on each the two levels are
    for one in near:
        lanes[one.lane].append(one.position)
        edges[edge_of(one.lane)].append(one.position)
    there = [
        row
        for row, (lane, ground) in enumerate(zip(objects.lanes, grounds, strict=True))
        for places in (edges.get(ground, ()) if ground else lanes.get(lane, ()),)
        if any(math.dist(place, objects.boxes[row, :2].tolist()) <= _BRIDGE for place in places)
    ]
    if not there:
        return objects
    rows = np.delete(np.arange(len(objects.ids)), there)
    kept = rows.tolist()
    return ObjectsTruth(
        objects.time,
        tuple(objects.ids[row] for row in kept),
        objects.classes[rows],
        objects.boxes[rows],
        objects.velocities[rows],
        tuple(objects.lanes[row] for row in kept),
    )
