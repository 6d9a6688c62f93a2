"""Where people go on foot: along the pavement up to its kerb, over a crossing, or, off the pavement, straight on."""

from typing import NamedTuple

import msgspec
import numpy as np

from dvca_sumo.messages import PREDICTION_TIMES, Floats, Integers, TrackedObjects
from dvca_sumo.roadmap.walkways import Ground, Walkways, Way, room
from dvca_sumo.stack.hypotheses import Hypotheses

_HORIZON = float(PREDICTION_TIMES[-1])  # [s]


class WalkingConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How people are taken to walk where the map has ground for them."""

    stepping_off: float = 1.0  # [s] before the kerb people who walk towards it are taken to step off it
    kerb_room: float = 0.3  # [m] before the kerb, people stay who do not step off it
    crossing_outlook: float = 4.0  # [s] before a crossing people who walk towards it may be about to cross
    crossing_angle: float = 1.0  # [rad] between their way and that to the crossing, at most, unless they are at it
    at_crossing: float = 1.0  # [m] from its entry


class _Crossing(NamedTuple):
    """Somebody's way to a crossing."""

    row: int
    ground: str
    way: Way


class Walking:
    """Predicts people who walk; keeps nothing between cycles."""

    def __init__(self, config: WalkingConfig, walkways: Walkways) -> None:
        self._config = config
        self._walkways = walkways

    def hypotheses(self, tracked: TrackedObjects, rows: Integers) -> Hypotheses:
        """The futures of people `rows`, who move.

        Who is on a pavement walks on along it, stays at its kerb, and may use each crossing ahead, all equally likely;
        who is about to step off it, who is on the road or on a crossing, goes straight on.
        """
        points, velocities = tracked.boxes[rows, :2], tracked.velocities[rows]
        speeds = np.hypot(velocities[:, 0], velocities[:, 1])
        places = self._walkways.under(points)
        ways = speeds * _HORIZON
        kept = [(row, place) for row, place in enumerate(places) if isinstance(place, Ground)]
        on = np.array([row for row, _ in kept], dtype=np.int64)
        crossings = self._crossings(points, velocities, speeds, kept)
        if kept:
            grounds = [ground for _, ground in kept]
            rooms = room(points[on], velocities[on] / speeds[on, None], ways[on], grounds)
            crosses = np.zeros(len(rows), dtype=np.bool_)
            crosses[[crossing.row for crossing in crossings]] = True
            stays = (rooms < ways[on]) & (crosses[on] | (rooms > speeds[on] * self._config.stepping_off))
            ways[on[stays]] = np.maximum(rooms[stays] - self._config.kerb_room, 0.0)
        lanes = [() if place is None else (place if isinstance(place, str) else place.lane,) for place in places]
        owners = np.concatenate((np.arange(len(rows)), [crossing.row for crossing in crossings])).astype(np.int64)
        counts = np.bincount(owners, minlength=len(rows))
        walked = np.minimum(speeds[:, None] * PREDICTION_TIMES, ways[:, None])
        poses = np.empty((len(owners), len(PREDICTION_TIMES), 3))
        poses[:] = tracked.boxes[rows[owners], None, :3]
        poses[: len(rows), :, :2] += walked[:, :, None] * (velocities / speeds[:, None])[:, None]
        if crossings:
            poses[len(rows) :, :, :2] = _crossed(points, speeds, crossings)
        return Hypotheses(
            rows[owners],
            1.0 / counts[owners],
            poses,
            [*lanes, *((crossing.ground, crossing.way.lane) for crossing in crossings)],
        )

    def _crossings(
        self, points: Floats, velocities: Floats, speeds: Floats, kept: list[tuple[int, Ground]]
    ) -> list[_Crossing]:
        """Those that people on pavements may be about to use."""
        found = [_Crossing(row, ground.lane, way) for row, ground in kept for way in ground.ways]
        if not found:
            return []
        config, rows = self._config, [crossing.row for crossing in found]
        gaps = _entries(points, found) - points[rows]
        distances = np.hypot(gaps[:, 0], gaps[:, 1])
        level = np.cos(config.crossing_angle) * distances * speeds[rows]
        towards = np.einsum("ij,ij->i", gaps, velocities[rows]) > level
        across = np.array([crossing.way.direction for crossing in found])
        towards |= (distances < config.at_crossing) & (np.einsum("ij,ij->i", across, velocities[rows]) > 0.0)
        towards &= distances < config.crossing_outlook * speeds[rows]
        return [crossing for crossing, is_towards in zip(found, towards.tolist(), strict=True) if is_towards]


def _entries(points: Floats, crossings: list[_Crossing]) -> Floats:
    """Where people at `points` come to their crossings, straight across if they are abreast of them (h, 2) [m]."""
    middles = np.array([crossing.way.entry for crossing in crossings])
    across = np.array([crossing.way.direction for crossing in crossings])
    half_widths = np.array([crossing.way.half_width for crossing in crossings])
    gaps = points[[crossing.row for crossing in crossings]] - middles
    beside = np.clip(across[:, 0] * gaps[:, 1] - across[:, 1] * gaps[:, 0], -half_widths, half_widths)
    entries: Floats = middles + beside[:, None] * np.stack((-across[:, 1], across[:, 0]), axis=1)
    return entries


def _crossed(points: Floats, speeds: Floats, crossings: list[_Crossing]) -> Floats:
    """Straight to the crossing, then across it: (h, t, 2) [m]."""
    rows = [crossing.row for crossing in crossings]
    starts, entries = points[rows], _entries(points, crossings)
    across = np.array([crossing.way.direction for crossing in crossings])
    gaps = entries - starts
    distances = np.hypot(gaps[:, 0], gaps[:, 1])[:, None]
    walked = speeds[rows, None] * PREDICTION_TIMES
    shares = np.minimum(walked / np.maximum(distances, 1e-6), 1.0)
    beyond = np.maximum(walked - distances, 0.0)
    crossed: Floats = starts[:, None] + shares[:, :, None] * gaps[:, None] + beyond[:, :, None] * across[:, None]
    return crossed
