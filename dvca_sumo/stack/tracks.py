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
_STATE = np.eye(4)  # x, y, vx, vy


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
        self.means: Floats = np.zeros((0, 4))  # x, y, vx, vy
        self.covariances: Floats = np.zeros((0, 4, 4))
        self.forms: Floats = np.zeros((0, 3))  # heading, length, width
        self.hits: Integers = np.zeros(0, dtype=np.int64)  # detections each track has had
        self.votes: Integers = np.zeros((0, _CLASSES), dtype=np.int64)  # hits by class
        self.classes: Integers = np.zeros(0, dtype=np.int64)  # what most hits said; a tie goes to the lower class
        self.sweeps: Integers = np.zeros(0, dtype=np.int64)  # since the first hit, that included
        self.last_hits: Floats = np.zeros(0)  # [s]

    def predict(self, dt: float) -> None:
        """Move all tracks on by dt [s]."""
        transition = _STATE.copy()
        transition[0, 2] = transition[1, 3] = dt
        a, b, c = dt**4 / 4.0, dt**3 / 2.0, dt**2
        noise = np.array([[a, 0.0, b, 0.0], [0.0, a, 0.0, b], [b, 0.0, c, 0.0], [0.0, b, 0.0, c]])
        variances = self._acceleration_variances[self.classes]
        self.means = self.means @ transition.T
        self.covariances = transition @ self.covariances @ transition.T + variances[:, None, None] * noise
        self.sweeps = self.sweeps + 1

    def update(self, rows: Integers, found: Measurements, time: float) -> None:
        """Correct track rows[k] by measurement k."""
        means = self.means.take(rows, axis=0)
        speeds = np.hypot(means[:, 2], means[:, 3])
        hits, votes = self.hits.copy(), self.votes.copy()
        hits[rows] += 1
        votes[rows, found.classes] += 1
        last_hits = self.last_hits.copy()
        last_hits[rows] = time
        self.hits, self.votes, self.classes, self.last_hits = hits, votes, votes.argmax(axis=1), last_hits
        self._update_forms(rows, found, speeds)
        self._update_motion(rows, found, means, speeds)

    def displace(self, rows: Integers, places: Floats) -> None:
        """Move tracks to `places` (k, 2) [m], their velocities as they were: a step aside is no speed."""
        means = self.means.copy()
        means[rows, :2] = places
        self.means = means

    def _update_motion(self, rows: Integers, found: Measurements, means: Floats, speeds: Floats) -> None:
        """Kalman update by position, radial speed and, for what rolls, no velocity across the heading."""
        count = len(rows)
        headings = found.boxes[:, 2]
        rolls = self.classes[rows] <= LAST_ON_WHEELS
        observation = np.zeros((count, 4, 4))
        observation[:, 0, 0] = observation[:, 1, 1] = 1.0
        observation[:, 2, 2:] = found.directions
        observation[:, 3, 2] = -np.sin(headings) * rolls
        observation[:, 3, 3] = np.cos(headings) * rolls
        measured = np.zeros((count, 4))
        measured[:, :2] = found.boxes[:, :2]
        measured[:, 2] = found.radial_speeds
        noise = np.empty((count, 4))
        noise[:, 0] = noise[:, 1] = found.variances
        noise[:, 2] = found.radial_variance
        noise[:, 3] = (self._config.sideways_sigma + self._config.sideways_share * speeds) ** 2

        covariances = self.covariances.take(rows, axis=0)
        cross = observation @ covariances
        spread = cross @ observation.transpose(0, 2, 1) + noise[:, :, None] * _STATE
        gain = np.linalg.solve(spread, cross).transpose(0, 2, 1)
        residual = measured - (observation @ means[:, :, None])[:, :, 0]
        new_means, new_covariances = self.means.copy(), self.covariances.copy()
        new_means[rows] = means + (gain @ residual[:, :, None])[:, :, 0]
        new_covariances[rows] = covariances - gain @ cross
        self.means, self.covariances = new_means, new_covariances

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
        means, covariances = self._first_motion(found)
        self.ids = np.concatenate([self.ids, np.arange(self._next_id, self._next_id + count)])
        self._next_id += count
        self.means = np.concatenate([self.means, means])
        self.covariances = np.concatenate([self.covariances, covariances])
        self.forms = np.concatenate([self.forms, found.boxes[:, 2:]])
        self.hits = np.concatenate([self.hits, np.ones(count, dtype=np.int64)])
        self.votes = np.concatenate([self.votes, np.eye(_CLASSES, dtype=np.int64)[found.classes]])
        self.classes = np.concatenate([self.classes, found.classes])
        self.sweeps = np.concatenate([self.sweeps, np.ones(count, dtype=np.int64)])
        self.last_hits = np.concatenate([self.last_hits, np.full(count, time)])

    def _first_motion(self, found: Measurements) -> tuple[Floats, Floats]:
        """Means and covariances of new tracks: the radial speed conditions a velocity known only by class.

        The prior of what rolls lies along its heading, so its radial speed tells most of its velocity.
        """
        priors = self._first_variances[found.classes]
        along = np.stack([np.cos(found.boxes[:, 2]), np.sin(found.boxes[:, 2])], axis=1)
        rolls = (found.classes <= LAST_ON_WHEELS)[:, None, None]
        sideways = self._config.sideways_sigma**2 * np.eye(2)
        prior = priors[:, None, None] * np.where(rolls, along[:, :, None] * along[:, None, :], np.eye(2)) + sideways
        cross = (prior @ found.directions[:, :, None])[:, :, 0]
        gain = cross / ((cross * found.directions).sum(axis=1) + found.radial_variance)[:, None]
        means = np.concatenate([found.boxes[:, :2], gain * found.radial_speeds[:, None]], axis=1)
        covariances = np.zeros((len(means), 4, 4))
        covariances[:, 0, 0] = covariances[:, 1, 1] = found.variances
        covariances[:, 2:, 2:] = prior - gain[:, :, None] * cross[:, None, :]
        return means, covariances

    def keep(self, flags: Flags) -> None:
        """Drop every track whose flag is not set."""
        self.ids = self.ids[flags]
        self.means = self.means[flags]
        self.covariances = self.covariances[flags]
        self.forms = self.forms[flags]
        self.hits = self.hits[flags]
        self.votes = self.votes[flags]
        self.classes = self.classes[flags]
        self.sweeps = self.sweeps[flags]
        self.last_hits = self.last_hits[flags]
