"""What stands or moves in the ego's way, along its route rather than straight on."""

from typing import NamedTuple

import numpy as np

from dvca_sumo.geometry.boxes import corners
from dvca_sumo.messages import Floats, Integers
from dvca_sumo.oracles.place import Places
from dvca_sumo.truth import Moment


class Ahead(NamedTuple):
    """Objects whose boxes reach into the strip of the route that the ego's width will sweep."""

    rows: Integers  # (k,) in the moment's objects
    gaps: Floats  # (k,) [m] along the route from the front bumper to the nearest point of the box in that strip, > 0
    speeds: Floats  # (k,) [m/s] along the route


def ahead(places: Places, moment: Moment, reach: float, margin: float = 0.0, rows: Integers | None = None) -> Ahead:
    """Objects in the ego's way less than `reach` [m] ahead, the strip being `margin` [m] wider on each side.

    Only `rows` are looked at when they are given.
    """
    place, objects = places.at(moment), moment.objects
    rows = places.within(moment, reach) if rows is None else rows
    if rows.size == 0:
        return Ahead(rows, np.empty(0), np.empty(0))
    stations, offsets = places.along(corners(objects.boxes[rows]).reshape(-1, 2), reach)
    left = max(place.corner_offsets[0], place.corner_offsets[3]) + margin
    right = min(place.corner_offsets[0], place.corner_offsets[3]) - margin
    nearest = _nearest_between(right, left, stations.reshape(-1, 4), offsets.reshape(-1, 4))
    gaps = nearest - place.station
    is_ahead = (gaps > 0.0) & (gaps < reach)
    rows, gaps, nearest = rows[is_ahead], gaps[is_ahead], nearest[is_ahead]
    headings = places.route.line.headings[places.rows(nearest)]
    velocities = objects.velocities[rows]
    return Ahead(rows, gaps, velocities[:, 0] * np.cos(headings) + velocities[:, 1] * np.sin(headings))


def _nearest_between(right: float, left: float, stations: Floats, offsets: Floats) -> Floats:
    """The lowest station (n,) of boxes, by their corners (n, 4) in turn, from offset `right` to `left`; inf outside.

    A corner of who stands aslant may be beside the ego, and its side before it.
    """
    nearest: Floats = np.where((offsets > right) & (offsets < left), stations, np.inf).min(axis=1)
    ends, beside = np.roll(stations, -1, axis=1), np.roll(offsets, -1, axis=1)
    for border in (right, left):
        rows, sides = ((offsets < border) != (beside < border)).nonzero()
        shares = (border - offsets[rows, sides]) / (beside[rows, sides] - offsets[rows, sides])
        crossed = stations[rows, sides] + shares * (ends[rows, sides] - stations[rows, sides])
        np.minimum.at(nearest, rows, crossed)
    return nearest
