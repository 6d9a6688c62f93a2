"""Lane changes, as they show in an object's lateral motion."""

import msgspec
import numpy as np

from dvca_sumo.messages import Floats, TrackedObjects
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.stack.continuations import Traffic
from dvca_sumo.stack.lane_following import Candidates, joined
from dvca_sumo.stack.lane_paths import LanePath, LanePaths, stretches_of


class LaneChangeConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """When drifting counts as changing lanes."""

    preview: float = 1.5  # [s] a change shows in where the lateral speed leads within this time ...
    onset: float = 0.7  # ... from this share of half the lane's width on
    certain: float = 1.5  # ... and would be certain at this share
    min_lateral_speed: float = 0.3  # [m/s] slower drifting shows nothing
    max_probability: float = 0.9  # but no change is certain
    min_probability: float = 0.1  # less likely changes are not told


class LaneChanges:
    """Adds changes to neighbouring lanes to the candidates that keep theirs."""

    def __init__(self, config: LaneChangeConfig, roadmap: RoadMap, paths: LanePaths) -> None:
        self._config = config
        self._lanes = roadmap.lanes
        self._paths = paths

    def added(
        self, candidates: Candidates, drift: Floats, tracked: TrackedObjects, reaches: Floats
    ) -> tuple[Candidates, Floats]:
        """The candidates and, for each object that drifts to a neighbouring lane, that lane's likeliest continuation.

        What a change is given is taken from the object's other candidates.

        Args:
            candidates: What the objects do that keep their lanes.
            drift: (h,) their lateral speeds [m/s], to the left.
            tracked: The objects.
            reaches: (n,) how far each object may get [m].

        Returns:
            All candidates, and the lateral speeds of all.
        """
        if not np.count_nonzero(np.abs(drift) >= self._config.min_lateral_speed):
            return candidates, drift
        likely, sides = self._changing(candidates, drift)
        rows: list[int] = []
        paths: list[LanePath] = []
        guesses: list[float] = []
        for row in np.flatnonzero(likely).tolist():
            neighbour = self._neighbour(candidates.paths[row], float(candidates.placements.stations[row]), sides[row])
            if neighbour is not None:
                lane, station = neighbour
                owner = candidates.owners[row]
                traffic = Traffic.of(tracked.classes[owner], tracked.boxes[owner, 3])
                rows.append(row)
                guesses.append(station)
                branches = self._paths.branches(lane, station + float(reaches[owner]), traffic)
                paths.append(max(branches, key=lambda branch: branch[1])[0])
        if not rows:
            return candidates, drift
        owners = candidates.owners[rows]
        stretches = stretches_of(paths)
        places = self._paths.place(stretches, np.array(guesses), tracked.boxes[owners])
        everybody = Candidates(owners, paths, stretches, likely[rows], places)
        changes = everybody.chosen(np.flatnonzero(places.beyond == 0.0))
        kept = np.ones(len(tracked.ids))
        kept[changes.owners] -= changes.probabilities
        keeping = candidates._replace(probabilities=candidates.probabilities * kept[candidates.owners])
        everything = joined(keeping, changes)
        return everything, lateral_speeds(everything, tracked.velocities)

    def _changing(self, candidates: Candidates, drift: Floats) -> tuple[Floats, list[str]]:
        """How likely a change is (h,), 0 where none shows, and to which side; `drift` (h,) [m/s] is to the left."""
        config, places = self._config, candidates.placements
        aims = places.offsets + drift * config.preview
        shares = np.abs(aims) / places.half_widths
        likely = np.minimum((shares - config.onset) / (config.certain - config.onset), config.max_probability)
        shows = (np.abs(drift) >= config.min_lateral_speed) & (aims * drift > 0.0) & (likely >= config.min_probability)
        # Off the junctions, all candidates of an object place it alike: the first one speaks for them.
        shows[1:] &= candidates.owners[1:] != candidates.owners[:-1]
        return np.where(shows, likely, 0.0), np.where(aims > 0.0, "left", "right").tolist()

    def _neighbour(self, path: LanePath, station: float, side: str) -> tuple[str, float] | None:
        """The lane beside the path's at `station`, and about which station [m] of it lies abreast."""
        which = path.lane_at(station)
        lane = self._lanes[path.lanes[which]]
        beside = lane.left if side == "left" else lane.right
        if lane.is_internal or beside is None:
            return None
        return beside, (station - path.starts[which]) * self._lanes[beside].line.length / lane.line.length


def lateral_speeds(candidates: Candidates, velocities: Floats) -> Floats:
    """Speeds to the left of the path (h,) of objects with `velocities` (n, 2) [m/s]."""
    owned, headings = velocities.take(candidates.owners, axis=0), candidates.placements.headings
    leftward: Floats = owned[:, 1] * np.cos(headings) - owned[:, 0] * np.sin(headings)
    return leftward
