"""Which lanes moving objects follow: found by distance and heading, then kept from cycle to cycle.

An object is anchored to a lane off the junctions and seen from every continuation of it. Thus lanes that
overlap on a junction compete by how well they fit, and no object hops between them. One that is first seen
on a junction is anchored to all the lanes there that it fits, until it leaves it.
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from dvca_sumo.geometry.angles import wrapped, wrapped_all
from dvca_sumo.messages import Floats, Integers
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.stack.continuations import Traffic
from dvca_sumo.stack.lane_paths import LanePath, LanePaths, Placements, Stretches, stretches_of

_NO_FIT = 1e30  # a misfit beyond that of any lane an object fits


class LaneMatchConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """When an object counts as following a lane."""

    search_radius: float = 4.0  # [m] around the object's centre
    margin: float = 0.3  # [m] the centre may lie this far outside the lane
    max_heading_error: float = 0.8  # [rad]
    heading_weight: float = 3.0  # [m/rad] heading error against distance, when lanes compete
    undrivable_penalty: float = 1.5  # [m] lanes that are not for motor traffic, when lanes compete
    offset_sigma: float = 0.7  # [m] fit of continuations that part on a junction
    heading_sigma: float = 0.2  # [rad]
    min_share: float = 0.03  # less likely continuations are dropped
    retry_distance: float = 1.0  # [m] an object on no lane is looked at again after moving this far


class Candidates(NamedTuple):
    """Objects on lanes, one row for each continuation, by ascending object row."""

    owners: Integers  # (h,) object rows
    paths: list[LanePath]  # (h,)
    stretches: Stretches  # (h,) of the paths
    probabilities: Floats  # (h,) sum to 1 for each object
    placements: Placements  # (h,)

    def chosen(self, rows: Integers) -> "Candidates":
        """Only `rows`, in that order."""
        paths, stretches = [self.paths[i] for i in rows], Stretches(*(column[rows] for column in self.stretches))
        placements = Placements(*(column[rows] for column in self.placements))
        return Candidates(self.owners[rows], paths, stretches, self.probabilities[rows], placements)


class Movers(NamedTuple):
    """Objects, some of which move and are to be found on lanes."""

    rows: list[int]  # of those, ascending
    tracks: list[int]  # (n,)
    classes: list[int]  # (n,) ObjectClass
    boxes: Floats  # (n, 5)
    headings: Floats  # (n,) [rad] directions of motion
    moved: Floats  # (n,) [m] since they were last seen
    reaches: Floats  # (n,) [m] how far they may get


class _Anchor:
    """What is remembered of one object."""

    __slots__ = ("places", "x", "y")

    def __init__(self) -> None:
        # Lanes, and stations from their starts [m], which may lie beyond their ends on a junction: likeliest first, and
        # more than one only of who was found on a junction; none off the road.
        self.places: list[tuple[str, float]] = []
        self.x = self.y = math.inf  # [m] where lanes were last looked for


class LaneFollowing:
    """Remembers each object's lane by its track number; forgets objects that are gone."""

    def __init__(self, config: LaneMatchConfig, roadmap: RoadMap, paths: LanePaths) -> None:
        self._config = config
        self._roadmap = roadmap
        self._lanes = roadmap.lanes
        self._paths = paths
        self._anchors: dict[int, _Anchor] = {}

    def lanes_of(self, track: int) -> tuple[str, ...]:
        """The lane the object was last anchored to, alone; empty off the road."""
        anchor = self._anchors.get(track)
        return () if anchor is None or not anchor.places else (anchor.places[0][0],)

    def forget_all_but(self, tracks: Iterable[int]) -> None:
        """Drops what is remembered of objects that are not in `tracks`."""
        self._anchors = {track: self._anchors[track] for track in tracks if track in self._anchors}

    def find(self, rows: Iterable[int], tracks: Sequence[int], points: Floats, headings: Floats) -> None:
        """Looks for the lanes of the objects `rows` that have none; of all objects are given (n,), (n, 2), (n,)."""
        wanted = []
        for row in rows:
            anchor = self._anchors.get(tracks[row])
            if anchor is None:
                anchor = self._anchors[tracks[row]] = _Anchor()
            if anchor.places:
                continue
            x, y = points[row].tolist()
            if math.hypot(x - anchor.x, y - anchor.y) >= self._config.retry_distance:
                anchor.x, anchor.y = x, y
                wanted.append(row)
        if not wanted:
            return
        near = self._roadmap.lanes_near(points[wanted], self._config.search_radius)
        for row, lanes in zip(wanted, near, strict=True):
            self._anchor(self._anchors[tracks[row]], lanes, points[row], float(headings[row]))

    def follow(self, movers: Movers) -> Candidates:
        """Every continuation of the lanes that `movers` are on. One that left its lanes is anchored anew."""
        found, lost = self._followed(movers)
        if not lost:
            return found
        for row in lost:
            self._anchors[movers.tracks[row]] = _Anchor()
        self.find(lost, movers.tracks, movers.boxes[:, :2], movers.headings)
        more, _ = self._followed(movers._replace(rows=lost, moved=np.zeros(len(movers.moved))))
        return joined(found, more)

    def _followed(self, movers: Movers) -> tuple[Candidates, list[int]]:
        """The candidates of movers that fit their lanes, and the rows of those that do not."""
        owners, paths, priors, guesses = [], [], [], []
        moved, reaches, lengths = movers.moved.tolist(), movers.reaches.tolist(), movers.boxes[:, 3].tolist()
        for row in movers.rows:
            anchor, step = self._anchors[movers.tracks[row]], moved[row]
            anchor.places = [(lane, station + step) for lane, station in anchor.places]
            traffic = Traffic.of(movers.classes[row], lengths[row])
            for lane, station in anchor.places:
                for path, probability in self._paths.branches(lane, station + reaches[row], traffic):
                    owners.append(row)
                    paths.append(path)
                    priors.append(probability)
                    guesses.append(station)
        objects = np.array(owners, dtype=np.int64)
        stretches = stretches_of(paths)
        places = self._paths.place(stretches, np.array(guesses), movers.boxes.take(objects, axis=0))
        config = self._config
        errors = wrapped_all(movers.headings[objects] - places.headings)
        fits = (
            (np.abs(places.offsets) <= places.half_widths + config.margin)
            & (np.abs(errors) <= config.max_heading_error)
            & (places.beyond == 0.0)
        )
        misfit = (places.offsets / config.offset_sigma) ** 2 + (errors / config.heading_sigma) ** 2
        candidates = Candidates(objects, paths, stretches, np.array(priors) * fits, places)
        shared = self._shared(candidates, misfit, len(movers.tracks))
        lost = sorted(set(owners).difference(shared.owners.tolist()))
        self._advance(shared, movers.tracks)
        return shared, lost

    def _shared(self, candidates: Candidates, misfit: Floats, count: int) -> Candidates:
        """Priors times Gaussian likelihood, as probabilities; what does not fit or is unlikely is dropped."""
        owners, priors = candidates.owners, candidates.probabilities
        misfit = np.where(priors > 0.0, misfit, _NO_FIT)
        best = np.empty(count)
        best.fill(_NO_FIT)
        np.minimum.at(best, owners, misfit)
        weights = priors * np.exp(-0.5 * (misfit - best[owners]))
        weights /= np.maximum(np.bincount(owners, weights, count), 1e-12)[owners]
        weights[weights < self._config.min_share] = 0.0
        weights /= np.maximum(np.bincount(owners, weights, count), 1e-12)[owners]
        shared = Candidates(owners, candidates.paths, candidates.stretches, weights, candidates.placements)
        kept = weights.nonzero()[0]
        return shared if len(kept) == len(weights) else shared.chosen(kept)

    def _advance(self, candidates: Candidates, tracks: Sequence[int]) -> None:
        """Moves anchors on to where the likeliest continuation has the object; past junctions to the next lane.

        Who was found on a junction stays anchored to all lanes there of which a continuation is left.
        """
        order = np.lexsort((-candidates.probabilities, candidates.owners))
        stations = candidates.placements.stations.tolist()
        seen, is_open = -1, False
        for row, owner in zip(order.tolist(), candidates.owners[order].tolist(), strict=True):
            if owner == seen and not is_open:
                continue
            anchor, path, station = self._anchors[tracks[owner]], candidates.paths[row], stations[row]
            if owner == seen:
                if all(lane != path.lanes[0] for lane, _ in anchor.places):
                    anchor.places.append((path.lanes[0], station))
                continue
            which = path.lane_at(station)
            if self._lanes[path.lanes[which]].is_internal:
                which = 0
            anchor.places = [(path.lanes[which], station - path.starts[which])]
            seen, is_open = owner, self._lanes[path.lanes[which]].is_internal

    def _anchor(self, anchor: _Anchor, lanes: Sequence[str], point: Floats, heading: float) -> None:
        """Anchors to the best of `lanes` that the object fits, if any; on a junction, to all that it fits there."""
        config, fitting = self._config, []
        for name in lanes:
            lane = self._lanes[name]
            stations, offsets = lane.line.project(point)
            station, offset = float(stations[0]), abs(float(offsets[0]))
            error = abs(wrapped(heading - float(np.interp(station, lane.line.stations, lane.line.headings))))
            if offset <= lane.width / 2.0 + config.margin and error <= config.max_heading_error:
                cost = offset + config.heading_weight * error + (0.0 if lane.is_drivable else config.undrivable_penalty)
                fitting.append((cost, (name, station)))
        places = [place for _, place in sorted(fitting)]
        kinds = [(self._lanes[name].is_internal, self._lanes[name].is_drivable) for name, _ in places]
        is_on_junction = bool(places) and kinds[0][0]
        alike = [place for place, kind in zip(places, kinds, strict=True) if kind == kinds[0]]
        anchor.places = alike if is_on_junction else places[:1]


def joined(one: Candidates, other: Candidates) -> Candidates:
    """Both, by ascending object row."""
    owners = np.concatenate([one.owners, other.owners])
    stretches = Stretches(*map(np.concatenate, zip(one.stretches, other.stretches, strict=True)))
    placements = Placements(*map(np.concatenate, zip(one.placements, other.placements, strict=True)))
    probabilities = np.concatenate([one.probabilities, other.probabilities])
    everything = Candidates(owners, [*one.paths, *other.paths], stretches, probabilities, placements)
    return everything.chosen(np.argsort(owners, kind="stable"))
