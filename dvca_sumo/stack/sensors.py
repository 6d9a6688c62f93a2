"""The ego's sensors: truth in, noisy readings out.

Every draw is keyed by (seed, stream, index, object): a reading depends on the truth of that instant and
on its own key, never on what else is in the scene or was read before. An object's id serves as its key
and never leaves the sensor.
"""

import math

import msgspec
import numpy as np

from dvca_sumo.geometry.angles import wrapped, wrapped_all
from dvca_sumo.geometry.randomness import key_of, normals, uniforms
from dvca_sumo.messages import Floats, Integers, ObjectClass, VehicleShape
from dvca_sumo.stack.protocols import Detections, GnssFix, OdometryReading
from dvca_sumo.stack.visibility import nearest_distances, visible_shares
from dvca_sumo.truth import SURROUNDINGS, EgoTruth, Moment

_RUN = key_of("sensors of this run")
_ODOMETRY = key_of("odometry")
_GNSS = key_of("gnss")
_GNSS_BIAS = key_of("gnss bias")
_OBJECT_NOISE = key_of("object noise")
_CHANCES = key_of("misses and confusions")

# What a parameter may be, where that is not any number from 0 on.
_SHARE = (0.0, 1.0)
_ANGLE = (0.0, 6.2832)  # [rad] a full turn, written to four places
_RANGES = {
    "gnss_bias_fixes": (1.0, math.inf),
    "range": (0.1, SURROUNDINGS),  # [m] distances are told as shares of it
    "far_range": (0.1, SURROUNDINGS),  # [m] likewise
    "field_of_view": _ANGLE,
    "far_field_of_view": _ANGLE,
    "visible_share": _SHARE,
    "heading_sigma_limit": (0.001, math.inf),  # [rad] divided by
    "miss_near": _SHARE,
    "miss_far": _SHARE,
    "confusion_far": _SHARE,
    "signal_miss": _SHARE,
}

_CLASSES = len(ObjectClass)
_BLOCK = 512  # indices whose noise is drawn at once


class SensorConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Noise and reach of all sensors. Sigmas are those of zero-mean normal noise."""

    gnss_position_sigma: float = 0.25  # [m] each axis, each fix
    gnss_first_sigma: float = 0.05  # [m] of fix 0: the receiver has averaged while the ego stood before the run
    gnss_bias_bound: float = 0.2  # [m] longest the slowly wandering bias ever gets
    gnss_bias_fixes: int = 200  # fixes between two independent biases
    gnss_heading_sigma: float = 0.005  # [rad]
    odometry_scale_sigma: float = 0.005  # share of the speed, constant over a run (tyre radius)
    odometry_noise_sigma: float = 0.005  # share of the speed, each reading: wheels at rest read exactly 0
    imu_acceleration_sigma: float = 0.05  # [m/s^2]
    imu_yaw_rate_sigma: float = 0.003  # [rad/s]
    imu_yaw_rate_bias_sigma: float = 0.002  # [rad/s] constant over a run
    range: float = 80.0  # [m] to the nearest point of an object
    field_of_view: float = 2.0 * math.pi  # [rad] full angle, centred ahead
    far_range: float = 120.0  # [m] range within the forward cone
    far_field_of_view: float = math.pi / 3.0  # [rad] full angle of the forward cone
    occluder_width: float = 1.0  # [m] narrower bodies (people, cyclists, cones, kerbs) hide nothing
    visible_share: float = 0.25  # of the angle an object fills that must be unhidden for it to be seen
    position_sigma: float = 0.05  # [m] each axis, at distance 0
    position_sigma_per_metre: float = 0.002  # [m/m] growth with distance
    size_sigma: float = 0.05  # [m] of length and of width, at most a tenth of either
    corner_sigma: float = 0.05  # [m] sideways at an object's ends: heading noise is this by half its length
    heading_sigma_limit: float = 0.3  # [rad] largest heading noise, of very short objects
    radial_speed_sigma: float = 0.1  # [m/s]
    miss_near: float = 0.01  # probability that a visible object is missed, at distance 0
    miss_far: float = 0.15  # the same at the limit of the range; grows with the square of the distance
    confusion_far: float = 0.05  # probability of a wrong class at the limit of the range; 0 at distance 0
    signal_range: float = 100.0  # [m] of signal heads ahead
    signal_miss: float = 0.02  # probability that a head in view is not read

    def __post_init__(self) -> None:
        """Raises ValueError for a number that makes no sense: which, and what is allowed."""
        for name, value in msgspec.structs.asdict(self).items():
            low, high = _RANGES.get(name, (0.0, math.inf))
            if not (low <= value <= high and math.isfinite(value)):
                allowed = f"{low:g} or more" if math.isinf(high) else f"{low:g} to {high:g}"
                raise ValueError(f"{name} is {value:g} (allowed: {allowed})")


class Sensors:
    """All sensors of one ego in one run."""

    def __init__(
        self,
        config: SensorConfig,
        seed: int,
        shape: VehicleShape,
        signal_positions: dict[str, tuple[float, float]],
    ) -> None:
        self._config = config
        self._seed = seed
        self._shape = shape
        self._signals = tuple(
            (name, *position, key_of(f"signal {name}")) for name, position in signal_positions.items()
        )
        scale, yaw_rate_bias = normals(seed, _RUN, 0, [0], 2)[0].tolist()
        self._odometry_scale = 1.0 + config.odometry_scale_sigma * scale
        self._yaw_rate_bias = config.imu_yaw_rate_bias_sigma * yaw_rate_bias
        self._odometry_noise = _NoiseBlock(seed, _ODOMETRY)
        self._gnss_noise = _NoiseBlock(seed, _GNSS)
        self._knot = -1
        self._knot_biases = [[0.0, 0.0], [0.0, 0.0]]

    def odometry(self, ego: EgoTruth, index: int) -> OdometryReading:
        """The index-th reading of wheels and inertial unit (100 Hz)."""
        config = self._config
        speed_noise, acceleration_noise, yaw_rate_noise = self._odometry_noise.row(index)
        return OdometryReading(
            ego.time,
            ego.speed * (self._odometry_scale + config.odometry_noise_sigma * speed_noise),
            ego.acceleration + config.imu_acceleration_sigma * acceleration_noise,
            ego.yaw_rate + self._yaw_rate_bias + config.imu_yaw_rate_sigma * yaw_rate_noise,
        )

    def fix(self, ego: EgoTruth, index: int) -> GnssFix:
        """The index-th satellite fix (10 Hz)."""
        config = self._config
        noise_x, noise_y, noise_heading = self._gnss_noise.row(index)
        bias_x, bias_y = self._gnss_bias(index)
        sigma = config.gnss_position_sigma if index > 0 else config.gnss_first_sigma
        return GnssFix(
            ego.x + bias_x + sigma * noise_x,
            ego.y + bias_y + sigma * noise_y,
            wrapped(ego.heading + config.gnss_heading_sigma * noise_heading),
        )

    def _gnss_bias(self, index: int) -> tuple[float, float]:
        """Bias of the index-th fix [m]: keyed knots, joined by half cosines, so it needs no history."""
        period = self._config.gnss_bias_fixes
        knot, phase = divmod(index, period)
        if knot != self._knot:
            reach = self._config.gnss_bias_bound / math.sqrt(2.0)
            draws = uniforms(self._seed, _GNSS_BIAS, 0, [knot, knot + 1], 2)
            self._knot, self._knot_biases = knot, (reach * (2.0 * draws - 1.0)).tolist()
        (start_x, start_y), (end_x, end_y) = self._knot_biases
        share = 0.5 - 0.5 * math.cos(math.pi * phase / period)
        return start_x + share * (end_x - start_x), start_y + share * (end_y - start_y)

    def detections(self, moment: Moment, index: int) -> Detections:
        """The index-th sweep of the object and signal sensors (10 Hz).

        Rows are in order of bearing, as a sweep meets them: nothing of the truth's order remains.
        """
        objects, ego, config = moment.objects, moment.ego, self._config
        boxes = in_ego_frame(objects.boxes, ego)
        rows, shares = visible_rows(boxes, config, self._shape)
        keys = [key_of(objects.ids[row]) for row in rows.tolist()]
        heads = self._signals_in_view(moment)
        draws = uniforms(self._seed, _CHANCES, index, keys + list(heads.values()), 3)
        read = draws[len(keys) :, 0] >= config.signal_miss
        signals = {name: moment.signals[name] for name, is_read in zip(heads, read.tolist(), strict=True) if is_read}
        draws = draws[: len(keys)]
        miss = config.miss_near + (config.miss_far - config.miss_near) * shares**2
        noise = normals(self._seed, _OBJECT_NOISE, index, keys, 6)
        bearings = np.arctan2(boxes[rows, 1], boxes[rows, 0])
        order = bearings.argsort(kind="stable")
        order = order[draws[order, 0] >= miss[order]]
        rows, shares, draws, noise, bearings = rows[order], shares[order], draws[order], noise[order], bearings[order]
        directions = bearings + ego.heading
        velocities = objects.velocities[rows]
        radial_speeds = np.cos(directions) * velocities[:, 0] + np.sin(directions) * velocities[:, 1]
        return Detections(
            moment.time,
            _noisy_boxes(boxes[rows], noise, config),
            _noisy_classes(objects.classes[rows], draws, shares**2, config),
            radial_speeds + config.radial_speed_sigma * noise[:, 5],
            signals,
        )

    def _signals_in_view(self, moment: Moment) -> dict[str, int]:
        """Keys of the signal heads in view, by signal id.

        In view until the rear axle has passed: a car that stands on the line still sees its light.
        """
        ego, reach = moment.ego, self._config.signal_range
        ahead_x, ahead_y = math.cos(ego.heading), math.sin(ego.heading)
        in_view = {}
        for name, x, y, key in self._signals:
            dx, dy = x - ego.x, y - ego.y
            is_ahead = ahead_x * dx + ahead_y * dy >= 0.0
            if is_ahead and math.hypot(dx, dy) <= reach and name in moment.signals:
                in_view[name] = key
        return in_view


class _NoiseBlock:
    """Three standard normals for each index of a 1-D series, drawn a block at a time.

    Index is the key of its own row, so block boundaries change no value.
    """

    def __init__(self, seed: int, stream: int) -> None:
        self._seed = seed
        self._stream = stream
        self._first = -1
        self._rows: list[list[float]] = []

    def row(self, index: int) -> list[float]:
        offset = index % _BLOCK
        if index - offset != self._first:
            self._first = index - offset
            keys = np.arange(self._first, self._first + _BLOCK)
            self._rows = normals(self._seed, self._stream, 0, keys, 3).tolist()
        return self._rows[offset]


def in_ego_frame(boxes: Floats, ego: EgoTruth) -> Floats:
    """Map-frame boxes (n, 5) as seen from the true ego: rear axle at the origin, x forward."""
    cos, sin = math.cos(ego.heading), math.sin(ego.heading)
    dx, dy = boxes[:, 0] - ego.x, boxes[:, 1] - ego.y
    seen = boxes.copy()
    seen[:, 0] = cos * dx + sin * dy
    seen[:, 1] = cos * dy - sin * dx
    seen[:, 2] = wrapped_all(boxes[:, 2] - ego.heading)
    return seen


def visible_rows(boxes: Floats, config: SensorConfig, shape: VehicleShape) -> tuple[Integers, Floats]:
    """Which objects the object sensor can see: in range, in the field of view and not hidden.

    The sensor sits above the centre of the ego's body.

    Args:
        boxes: (n, 5) in the ego frame.
        config: range, field of view and what hides what.
        shape: the ego's body.

    Returns:
        Rows of `boxes`, ascending, and for each its distance as a share of the range in its direction.
    """
    seen = boxes - (shape.centre, 0.0, 0.0, 0.0, 0.0)
    distances = nearest_distances(seen)
    bearings = np.abs(np.arctan2(seen[:, 1], seen[:, 0]))
    limits = np.where(bearings <= config.far_field_of_view / 2.0, config.far_range, config.range)
    rows = ((distances <= limits) & (bearings <= config.field_of_view / 2.0)).nonzero()[0]
    rows = rows[visible_shares(seen[rows], config.occluder_width) >= config.visible_share]
    return rows, distances[rows] / limits[rows]


def _noisy_boxes(boxes: Floats, noise: Floats, config: SensorConfig) -> Floats:
    measured = boxes.copy()
    distances = np.hypot(boxes[:, 0], boxes[:, 1])
    sigmas = config.position_sigma + config.position_sigma_per_metre * distances
    measured[:, :2] += sigmas[:, None] * noise[:, :2]
    heading_sigmas = config.corner_sigma / np.maximum(
        boxes[:, 3] / 2.0, config.corner_sigma / config.heading_sigma_limit
    )
    measured[:, 2] = wrapped_all(boxes[:, 2] + heading_sigmas * noise[:, 2])
    measured[:, 3:] += np.minimum(config.size_sigma, boxes[:, 3:] / 10.0) * noise[:, 3:5]
    return measured


def _noisy_classes(classes: Integers, draws: Floats, squares: Floats, config: SensorConfig) -> Integers:
    is_confused = draws[:, 1] < config.confusion_far * squares
    others = 1 + (draws[:, 2] * (_CLASSES - 1)).astype(np.int64)
    return np.where(is_confused, (classes + others) % _CLASSES, classes)
