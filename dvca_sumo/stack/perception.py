"""Perception: detections -> tracked objects on the map.

Each sweep is placed on the map through the localization estimate, matched to the tracks, and told only
of tracks that have been confirmed.
"""

import math

import msgspec
import numpy as np

from dvca_sumo.geometry.angles import wrapped_all
from dvca_sumo.messages import Flags, Floats, Integers, LocalizationEstimate, ObjectClass, SignalColour, TrackedObjects
from dvca_sumo.stack.protocols import Detections
from dvca_sumo.stack.tracks import LAST_ON_WHEELS, Measurements, MotionConfig, Tracks

_STATIC = int(ObjectClass.STATIC)  # numpy compares with a plain number ten times as fast


class PerceptionConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the tracker takes its sensors to be, and the life of a track."""

    motion: MotionConfig = MotionConfig()
    position_sigma: float = 0.06  # [m] of a detection, each axis, at distance 0
    position_sigma_per_metre: float = 0.003  # [m/m] growth with distance; the believed heading has a share in it
    radial_speed_sigma: float = 0.1  # [m/s]
    gate: float = 13.8  # squared Mahalanobis distance of the worst match (chi2, 2 dof, 99.9 %)
    class_penalty: float = 4.0  # added to the squared distance where track and detection differ in class
    stride: float = 0.75  # [m] that a body, however narrow, may be from where it is expected: people step aside
    lane_step: float = 4.2  # [m] the same for what drives: SUMO's vehicles change lanes from one step to the next ...
    lane_step_turn: float = 0.35  # [rad] ... and keep their heading ...
    lane_step_speed: float = 1.5  # [m/s] ... and their speed, within these
    confirming_hits: int = 2  # hits that confirm a track ...
    confirming_sweeps: int = 3  # ... within its first sweeps; else it is dropped
    coast_time: float = 0.8  # [s] a confirmed track lives on without being seen
    still_speed: float = 0.25  # [m/s] slower tracks are reported at rest
    signal_hold: float = 0.3  # [s] a signal head not read keeps what it showed

    # A real bug (see stack/bugs.py): what the build does wrong.
    swaps_sides: bool = False  # tells boxes with length and width swapped: as if turned by 90 degrees


class Tracker:
    """Multi-object tracker. Ids count up from 1, and none is ever given twice."""

    def __init__(self, config: PerceptionConfig) -> None:
        self._config = config
        self._tracks = Tracks(config.motion)
        self._time = math.nan
        self._signals: dict[str, tuple[SignalColour, float]] = {}

    def step(self, detections: Detections, localization: LocalizationEstimate) -> TrackedObjects:
        """One sweep: the confirmed tracks, in ascending order of id.

        While the pose is unknown (nan) nothing can be placed: tracks only coast.
        """
        time, tracks = detections.time, self._tracks
        if not math.isnan(self._time):
            tracks.predict(time - self._time)
        self._time = time
        if math.isfinite(localization.x + localization.y + localization.heading):
            self._absorb(self._placed(detections, localization), time)
        confirmed = self._live_and_die(time)
        return self._told(confirmed, self._held_signals(detections.signals, time), time)

    def _placed(self, detections: Detections, localization: LocalizationEstimate) -> Measurements:
        config, seen = self._config, detections.boxes
        cos, sin = math.cos(localization.heading), math.sin(localization.heading)
        x, y = seen[:, 0], seen[:, 1]
        east, north = cos * x - sin * y, sin * x + cos * y
        distances = np.maximum(np.hypot(x, y), 1e-6)
        directions, boxes = np.empty((len(seen), 2)), seen.copy()
        directions[:, 0], directions[:, 1] = east / distances, north / distances
        boxes[:, 0], boxes[:, 1] = east + localization.x, north + localization.y
        boxes[:, 2] = wrapped_all(seen[:, 2] + localization.heading)
        return Measurements(
            boxes,
            detections.classes,
            (config.position_sigma + config.position_sigma_per_metre * distances) ** 2,
            directions,
            detections.radial_speeds,
            config.radial_speed_sigma**2,
        )

    def _absorb(self, found: Measurements, time: float) -> None:
        """Correct the tracks that were seen; start tracks of what was not known."""
        rows, matches = mutual_nearest(self._costs(found), self._config.gate)
        if rows.size < min(self._tracks.ids.size, found.classes.size):
            displaced, seen = self._displaced(rows, matches, found)
            self._tracks.displace(displaced, found.boxes[seen, :2])
            rows, matches = np.concatenate((rows, displaced)), np.concatenate((matches, seen))
        if rows.size:
            self._tracks.update(rows, _selected(found, matches), time)
        if matches.size < found.classes.size:
            self._tracks.add(_selected(found, _others(matches, found.classes.size)), time)

    def _costs(self, found: Measurements) -> Floats:
        """Squared distance of each track to each measurement in units of their joint spread, (tracks, n)."""
        tracks = self._tracks
        dx = tracks.means[:, 0, None] - found.boxes[:, 0]
        dy = tracks.means[:, 1, None] - found.boxes[:, 1]
        own = 0.5 * (tracks.estimates[:, 0, 0] + tracks.estimates[:, 1, 1])
        differs = tracks.classes[:, None] != found.classes
        costs: Floats = (dx * dx + dy * dy) / (own[:, None] + found.variances) + self._config.class_penalty * differs
        return costs

    def _displaced(self, rows: Integers, matches: Integers, found: Measurements) -> tuple[Integers, Integers]:
        """Of the tracks and measurements left by the pairs, those within half the width of what was found, or a stride.

        What drives may be a lane farther. What is gone from one place, and there so near to it, has moved as it is not
        expected to, and would go on as two.
        """
        tracks = self._tracks
        lost, new = _others(rows, tracks.ids.size), _others(matches, found.classes.size)
        dx = tracks.means[lost, 0, None] - found.boxes[new, 0]
        dy = tracks.means[lost, 1, None] - found.boxes[new, 1]
        reaches = np.maximum(0.5 * found.boxes[new, 4], self._config.stride)
        reaches = np.where(self._drive_alike(lost, new, found), self._config.lane_step, reaches)
        again, seen = mutual_nearest((dx * dx + dy * dy) / (reaches * reaches), 1.0)
        return lost[again], new[seen]

    def _drive_alike(self, lost: Integers, new: Integers, found: Measurements) -> Flags:
        """Which of the tracks `lost` (k,) and measurements `new` (n,) roll on with one heading and speed: (k, n)."""
        config, tracks = self._config, self._tracks
        velocities = tracks.means[lost, 2:]
        faster = velocities @ found.directions[new].T - found.radial_speeds[new]
        turned = wrapped_all(tracks.forms[lost, 0, None] - found.boxes[new, 2])
        drives = np.hypot(velocities[:, 0], velocities[:, 1]) > config.motion.moving_speed
        drives &= tracks.classes[lost] <= LAST_ON_WHEELS
        alike: Flags = (np.abs(faster) < config.lane_step_speed) & (np.abs(turned) < config.lane_step_turn)
        alike &= drives[:, None] & (found.classes[new] <= LAST_ON_WHEELS)
        return alike

    def _live_and_die(self, time: float) -> Flags:
        """Drop what was lost or never confirmed; of the rest, which are confirmed."""
        config, tracks = self._config, self._tracks
        # Enough hits means enough of them in time: a track without is dropped when its first sweeps are over.
        confirmed = tracks.hits >= config.confirming_hits
        alive = np.where(
            confirmed, time - tracks.last_hits <= config.coast_time + 1e-6, tracks.sweeps < config.confirming_sweeps
        )
        if np.count_nonzero(alive) < len(alive):
            tracks.keep(alive)
            confirmed = confirmed[alive]
        return confirmed

    def _told(self, confirmed: Flags, signals: dict[str, SignalColour], time: float) -> TrackedObjects:
        tracks, rows = self._tracks, confirmed.nonzero()[0]
        means, classes, forms = tracks.means.take(rows, axis=0), tracks.classes[rows], tracks.forms.take(rows, axis=0)
        velocities = means[:, 2:]
        speeds = np.hypot(velocities[:, 0], velocities[:, 1])
        is_still = (speeds < self._config.still_speed) | (classes == _STATIC)
        if self._config.swaps_sides:
            forms = forms[:, [0, 2, 1]]
        return TrackedObjects(
            time,
            tracks.ids[rows],
            classes,
            np.concatenate([means[:, :2], forms], axis=1),
            np.where(is_still[:, None], 0.0, velocities),
            signals,
        )

    def _held_signals(self, seen: dict[str, SignalColour], time: float) -> dict[str, SignalColour]:
        self._signals.update({name: (colour, time) for name, colour in seen.items()})
        oldest = time - self._config.signal_hold - 1e-6
        self._signals = {name: held for name, held in self._signals.items() if held[1] >= oldest}
        return {name: colour for name, (colour, _) in self._signals.items()}


def mutual_nearest(costs: Floats, gate: float) -> tuple[Integers, Integers]:
    """Greedy one-to-one matching: pairs that are each other's cheapest, again and again.

    The cheapest pair left is always mutual, so every round matches at least one and the result is that
    of taking pairs in ascending order of cost. No pair costs `gate` or more.

    Returns:
        Rows and columns of the pairs.
    """
    if costs.size == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    every = np.arange(costs.shape[0])
    matches = np.full(costs.shape[0], -1)
    while True:
        cheapest = costs.argmin(axis=1)
        is_mutual = (costs.argmin(axis=0)[cheapest] == every) & (costs[every, cheapest] < gate)
        matches = np.where(is_mutual, cheapest, matches)
        matched = (matches >= 0).nonzero()[0]
        if matched.size == min(costs.shape) or not is_mutual.any():
            return matched, matches[matched]
        costs = costs.copy()
        costs[is_mutual] = np.inf
        costs[:, cheapest[is_mutual]] = np.inf


def _others(rows: Integers, count: int) -> Integers:
    """Which of `count` rows are not among `rows`."""
    is_other = np.ones(count, dtype=np.bool_)
    is_other[rows] = False
    return is_other.nonzero()[0]


def _selected(found: Measurements, rows: Integers) -> Measurements:
    return Measurements(
        found.boxes.take(rows, axis=0),
        found.classes[rows],
        found.variances[rows],
        found.directions.take(rows, axis=0),
        found.radial_speeds[rows],
        found.radial_variance,
    )
