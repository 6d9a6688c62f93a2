"""Whose doing the violations of a factual run are."""

import math

from dvca_sumo.oracles import Places
from dvca_sumo.oracles.destination import Destination
from dvca_sumo.record import Record
from dvca_sumo.responsibility.disturbances import Disturbances
from dvca_sumo.responsibility.judging import Judged, judged
from dvca_sumo.roadmap import RoadMap


def places_of(record: Record, roadmap: RoadMap, tick: int | None = None) -> Places:
    """Fresh places of the recorded drive, or of what goes on from a tick of it."""
    begin = None if tick is None else record.stations[tick] + record.moments[0].shape.front
    return Places(record.route, roadmap, record.signed_lanes, begin)


def at_fault(record: Record, roadmap: RoadMap) -> tuple[Judged, ...]:
    """Whose doing each violation is, by time.

    A destination that is not reached is left out: whether others held up the ego, only SUMO's own driver on the same
    trip tells.
    """
    watch = Disturbances(places_of(record, roadmap))
    touched = min((one.time for one in record.violations if one.contact is not None), default=math.inf)
    moments = [moment for moment in record.moments if moment.time <= touched]
    for moment in moments:
        watch.see(moment)
    found = judged(record.judgements, watch, moments[-1], roadmap)
    return tuple(one for one in found if one.violation.kind != Destination.not_reached)
