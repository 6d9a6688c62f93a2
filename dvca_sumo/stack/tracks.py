"""The tracks of a multi-object tracker as one structure of arrays: rows are tracks, ids ascend.

Motion is a Kalman filter with constant velocity and white acceleration noise, all tracks at once;
heading and size are exponentially smoothed, the class is decided by majority.
"""

import msgspec
import numpy as np

from dvca_sumo.geometry.angles import wrapped_all
from dvca_sumo.messages import Flags, Floats, Integers, ObjectClass

_CLASSES = len(ObjectClass)
LAST_ON_WHEELS = int(ObjectClass.BICYCLE)  # vehicles and bicycles, by class number, move along their heading only
_MEAN = 4  # column of an estimate, after those of its covariance
_AT_REST = np.eye(5)  # how an estimate moves on in no time


class MotionConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How objects are taken to move; tuples are by ObjectClass: vehicle, bicycle, pedestrian, static."""

    accelerations: tuple[float, float, float, float] = (3.0, 1.5, 1.0, 0.1)  # [m/s^2] sigma
    first_speeds: tuple[float, float, float, float] = (8.0, 4.0, 1.0, 0.1)  # [m/s] sigma before any motion is seen
    sideways_sigma: float = 0.1  # [m/s] velocity of what rolls across its heading, at rest
    sideways_share: float = 0.05  # growth of the same with its speed (slip of the centre in curves)
    moving_speed: float = 0.5  # [m/s] below it the heading is taken to stay as it is
    heading_gain_moving: float = 0.5  # least weight of a new heading
    heading_gain_still: float = 0.05  # the same for objects that do not move
    size_gain: float = 0.05  # least weight of a new size


class Measurements(msgspec.Struct, frozen=True):
    """Detections placed on the map, with what the tracker takes their noise to be."""

    boxes: Floats  # (n, 5)
    classes: Integers  # (n,)
    variances: Floats  # (n,) [m^2] of the position, each axis
    directions: Floats  # (n, 2) unit vectors from the sensor
    radial_speeds: Floats  # (n,) [m/s]
    radial_variance: float  # [m^2/s^2]


class Tracks:
    """All tracks, confirmed or not. Arrays are replaced, never written to, so earlier messages may hold them."""

    def __init__(self, config: MotionConfig) -> None:
        self._config = config
        self._acceleration_variances = np.array(config.accelerations) ** 2
        self._first_variances = np.array(config.first_speeds) ** 2
        self._next_id = 1
        self.ids: Integers = np.zeros(0, dtype=np.int64)
        self.estimates: Floats = np.zeros((0, 4, 5))  # covariance of x, y, vx, vy, and as the last column their mean
        self.forms: Floats = np.zeros((0, 3))  # heading, length, width
        self.hits: Integers = np.zeros(0, dtype=np.int64)  # detections each track has had
        self.votes: Integers = np.zeros((0, _CLASSES), dtype=np.int64)  # hits by class
        self.classes: Integers = np.zeros(0, dtype=np.int64)  # what most hits said; a tie goes to the lower class
        self.sweeps: Integers = np.zeros(0, dtype=np.int64)  # since the first hit, that included
        self.last_hits: Floats = np.zeros(0)  # [s]

    @property
    def means(self) -> Floats:
        """(n, 4) x, y, vx, vy."""
        return self.estimates[:, :, _MEAN]

    def predict(self, dt: float) -> None:
        """Move all tracks on by dt [s]."""
        transition = _AT_REST.copy()
        transition[0, 2] = transition[1, 3] = dt
        a, b, c = dt**4 / 4.0, dt**3 / 2.0, dt**2
        noise = np.array([[a, 0.0, b, 0.0, 0.0], [0.0, a, 0.0, b, 0.0], [b, 0.0, c, 0.0, 0.0], [0.0, b, 0.0, c, 0.0]])
        variances = self._acceleration_variances[self.classes]
        moved = transition[:_MEAN, :_MEAN] @ self.estimates @ transition.T
        self.estimates = moved + variances[:, None, None] * noise
        self.sweeps = self.sweeps + 1

    def update(self, rows: Integers, found: Measurements, time: float) -> None:
        """Correct track rows[k] by measurement k."""
        known = self.estimates.take(rows, axis=0)
        speeds = np.hypot(known[:, 2, _MEAN], known[:, 3, _MEAN])
        hits, votes = self.hits.copy(), self.votes.copy()
        hits[rows] += 1
        votes[rows, found.classes] += 1
        last_hits = self.last_hits.copy()
        last_hits[rows] = time
        self.hits, self.votes, self.classes, self.last_hits = hits, votes, votes.argmax(axis=1), last_hits
        self._update_forms(rows, found, speeds)
        self._update_motion(rows, found, known, speeds)

    def displace(self, rows: Integers, places: Floats) -> None:
        """Move tracks to `places` (k, 2) [m], their velocities as they were: a step aside is no speed."""
        estimates = self.estimates.copy()
        estimates[rows, :2, _MEAN] = places
        self.estimates = estimates

    def _update_motion(self, rows: Integers, found: Measurements, known: Floats, speeds: Floats) -> None:
        """Kalman update of estimates (k, 4, 5) by position, radial speed and, for what rolls, no velocity across it.

        Sequential: the noises are independent, so that each number corrects by itself, and no matrix is inverted.
        """
        for axis in range(2):
            seen = known[:, axis].copy()
            known = _corrected(known, seen, seen[:, axis] + found.variances, found.boxes[:, axis])
        headings = found.boxes[:, 2]
        rolls = self.classes[rows] <= LAST_ON_WHEELS
        slips = (self._config.sideways_sigma + self._config.sideways_share * speeds) ** 2
        east, north = found.directions.T
        for x, y, variance, speed in (
            (east, north, found.radial_variance, found.radial_speeds),
            (-np.sin(headings) * rolls, np.cos(headings) * rolls, slips, 0.0),
        ):
            seen = x[:, None] * known[:, 2] + y[:, None] * known[:, 3]
            known = _corrected(known, seen, x * seen[:, 2] + y * seen[:, 3] + variance, speed)
        estimates = self.estimates.copy()
        estimates[rows] = known
        self.estimates = estimates

    def _update_forms(self, rows: Integers, found: Measurements, speeds: Floats) -> None:
        """Heading and size: the mean of all that was seen at first, then exponential smoothing."""
        config = self._config
        shares = 1.0 / self.hits[rows]
        floors = np.where(speeds > config.moving_speed, config.heading_gain_moving, config.heading_gain_still)
        gains = np.empty((len(rows), 3))
        gains[:, 0] = np.maximum(shares, floors)
        gains[:, 1:] = np.maximum(shares, config.size_gain)[:, None]
        known = self.forms.take(rows, axis=0)
        change = found.boxes[:, 2:] - known
        change[:, 0] = wrapped_all(change[:, 0])
        forms = self.forms.copy()
        forms[rows] = known + gains * change
        forms[:, 0] = wrapped_all(forms[:, 0])
        self.forms = forms

    def add(self, found: Measurements, time: float) -> None:
        """Start a track of each measurement, under ids never used before."""
        count = len(found.classes)
        self.ids = np.concatenate([self.ids, np.arange(self._next_id, self._next_id + count)])
        self._next_id += count
        self.estimates = np.concatenate([self.estimates, self._first_motion(found)])
        self.forms = np.concatenate([self.forms, found.boxes[:, 2:]])
        self.hits = np.concatenate([self.hits, np.ones(count, dtype=np.int64)])
        self.votes = np.concatenate([self.votes, np.eye(_CLASSES, dtype=np.int64)[found.classes]])
        self.classes = np.concatenate([self.classes, found.classes])
        self.sweeps = np.concatenate([self.sweeps, np.ones(count, dtype=np.int64)])
        self.last_hits = np.concatenate([self.last_hits, np.full(count, time)])

    def _first_motion(self, found: Measurements) -> Floats:
        """Estimates of new tracks: the radial speed conditions a velocity known only by class.

        The prior of what rolls lies along its heading, so its radial speed tells most of its velocity.
        """
        priors = self._first_variances[found.classes]
        along = np.stack([np.cos(found.boxes[:, 2]), np.sin(found.boxes[:, 2])], axis=1)
        rolls = (found.classes <= LAST_ON_WHEELS)[:, None, None]
        sideways = self._config.sideways_sigma**2 * np.eye(2)
        prior = priors[:, None, None] * np.where(rolls, along[:, :, None] * along[:, None, :], np.eye(2)) + sideways
        cross = (prior @ found.directions[:, :, None])[:, :, 0]
        gain = cross / ((cross * found.directions).sum(axis=1) + found.radial_variance)[:, None]
        estimates = np.zeros((len(gain), 4, 5))
        estimates[:, 0, 0] = estimates[:, 1, 1] = found.variances
        estimates[:, 2:, 2:_MEAN] = prior - gain[:, :, None] * cross[:, None, :]
        estimates[:, :2, _MEAN] = found.boxes[:, :2]
        estimates[:, 2:, _MEAN] = gain * found.radial_speeds[:, None]
        return estimates

    def keep(self, flags: Flags) -> None:
        """Drop every track whose flag is not set."""
        self.ids = self.ids[flags]
        self.estimates = self.estimates[flags]
        self.forms = self.forms[flags]
        self.hits = self.hits[flags]
        self.votes = self.votes[flags]
        self.classes = self.classes[flags]
        self.sweeps = self.sweeps[flags]
        self.last_hits = self.last_hits[flags]


def _corrected(known: Floats, seen: Floats, spread: Floats, measured: Floats | float) -> Floats:
    """Estimates (k, 4, 5) once a number is `measured` of each, of which they say `seen` (k, 5): h P, and h m.

    `spread` (k,) is the variance of what is measured; `seen` is used up. Covariance and mean are less by
    P h' / spread times h P, and times h m less what is measured.
    """
    gains = seen[:, :_MEAN, None] / spread[:, None, None]
    seen[:, _MEAN] -= measured
    corrected: Floats = known - gains * seen[:, None]
    return corrected
