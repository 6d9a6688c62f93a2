"""Where people go on foot: along the pavement up to its kerb, over a crossing, or, off the pavement, straight on."""

from typing import NamedTuple

import msgspec
import numpy as np

from dvca_sumo.messages import PREDICTION_TIMES, Floats, Integers, TrackedObjects
from dvca_sumo.roadmap.walkways import Ground, Walkways, Way, room
from dvca_sumo.stack.hypotheses import Hypotheses

_HORIZON = float(PREDICTION_TIMES[-1])  # [s]
_TURNS = np.array([0.25, -0.25, 0.5, -0.5, 1.0, -1.0])  # that are looked at, as shares of the widest


class WalkingConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How people are taken to walk where the map has ground for them."""

    stepping_off: float = 1.0  # [s] before the kerb people who walk towards it are taken to step off it ...
    veering: float = 0.4  # ... unless they stay on the pavement by turning no more than that [rad]
    kerb_room: float = 0.3  # [m] before the kerb, people stay who do not step off it
    crossing_outlook: float = 4.0  # [s] before a crossing people who walk towards it may be about to cross
    crossing_angle: float = 1.0  # [rad] between their way and that to the crossing, at most, or across it at its entry
    at_crossing: float = 1.0  # [m] from its entry


class _Crossings(NamedTuple):
    """Ways of people to crossings (h,)."""

    rows: Integers  # of those who go
    lanes: list[tuple[str, ...]]  # the ground they are on, and the crossing
    entries: Floats  # (h, 2) [m] where they come to it, straight across if they are abreast of it
    across: Floats  # (h, 2) its direction


class Walking:
    """Predicts people who walk; keeps nothing between cycles."""

    def __init__(self, config: WalkingConfig, walkways: Walkways) -> None:
        self._config = config
        self._walkways = walkways

    def hypotheses(self, tracked: TrackedObjects, rows: Integers) -> Hypotheses:
        """The futures of people `rows`, who move.

        Who is on a pavement walks on along it, turning slightly where that keeps it on, else stays at its kerb, and may
        use each crossing ahead, all equally likely; who is about to step off it, whatever slight turn it makes, who is
        on the road or on a crossing, goes straight on.
        """
        points, velocities = tracked.boxes[rows, :2], tracked.velocities[rows]
        speeds = np.hypot(velocities[:, 0], velocities[:, 1])
        directions = velocities / speeds[:, None]
        places = self._walkways.under(points)
        ways = speeds * _HORIZON
        kept = [(row, place) for row, place in enumerate(places) if isinstance(place, Ground)]
        crossings = self._crossings(points, velocities, speeds, kept)
        if kept:
            on, grounds = np.array([row for row, _ in kept]), [ground for _, ground in kept]
            enough = speeds[on] * self._config.stepping_off
            directions[on], rooms = self._along_grounds(points[on], directions[on], ways[on], enough, grounds)
            crosses = np.zeros(len(rows), dtype=np.bool_)
            crosses[crossings.rows] = True
            stays = (rooms < ways[on]) & (crosses[on] | (rooms > enough))
            ways[on[stays]] = np.maximum(rooms[stays] - self._config.kerb_room, 0.0)
        lanes = [() if place is None else (place if isinstance(place, str) else place.lane,) for place in places]
        owners = np.concatenate((np.arange(len(rows)), crossings.rows))
        counts = np.bincount(owners, minlength=len(rows))
        walked = np.minimum(speeds[:, None] * PREDICTION_TIMES, ways[:, None])
        poses = np.empty((len(owners), len(PREDICTION_TIMES), 3))
        poses[:] = tracked.boxes[rows[owners], None, :3]
        poses[: len(rows), :, :2] += walked[:, :, None] * directions[:, None]
        poses[len(rows) :, :, :2] = _crossed(points[crossings.rows], speeds[crossings.rows], crossings)
        return Hypotheses(rows[owners], 1.0 / counts[owners], poses, [*lanes, *crossings.lanes])

    def _along_grounds(
        self, points: Floats, directions: Floats, lengths: Floats, enough: Floats, grounds: list[Ground]
    ) -> tuple[Floats, Floats]:
        """Directions (n, 2) of people, turned where the ground ends within `lengths` (n,), and how far they get on it.

        They are turned by as little as gets them so far, else by as little as gets them farther than `enough` (n,), if
        anything does. Lengths are in m.
        """
        rooms = room(points, directions, lengths, grounds)
        short = (rooms < lengths).nonzero()[0]
        if not short.size:
            return directions, rooms
        turns = self._config.veering * _TURNS[:, None, None]
        left = np.column_stack((-directions[short, 1], directions[short, 0]))
        turned = np.cos(turns) * directions[short] + np.sin(turns) * left  # (turns, people, 2)
        count = len(_TURNS)
        found = room(
            np.tile(points[short], (count, 1)),
            turned.reshape(-1, 2),
            np.tile(lengths[short], count),
            [grounds[row] for row in short.tolist()] * count,
        ).reshape(count, -1)
        reaches, is_enough = found >= lengths[short], (rooms[short] <= enough[short]) & (found > enough[short])
        wanted = np.where(reaches.any(axis=0), reaches, is_enough)
        columns, first = np.flatnonzero(wanted.any(axis=0)), wanted.argmax(axis=0)
        chosen, directions = short[columns], directions.copy()
        directions[chosen], rooms[chosen] = turned[first[columns], columns], found[first[columns], columns]
        return directions, rooms

    def _crossings(
        self, points: Floats, velocities: Floats, speeds: Floats, kept: list[tuple[int, Ground]]
    ) -> _Crossings:
        """Those that people on pavements may be about to use."""
        found = [(row, ground.lane, way) for row, ground in kept for way in ground.ways]
        if not found:
            return _Crossings(np.empty(0, dtype=np.int64), [], np.empty((0, 2)), np.empty((0, 2)))
        config, rows = self._config, np.array([row for row, _, _ in found])
        entries, across = _entries(points[rows], [way for _, _, way in found])
        gaps, own, velocities = entries - points[rows], speeds[rows], velocities[rows]
        distances, least = np.hypot(gaps[:, 0], gaps[:, 1]), np.cos(config.crossing_angle) * own
        towards = np.einsum("ij,ij->i", gaps, velocities) > least * distances
        towards |= (distances < config.at_crossing) & (np.einsum("ij,ij->i", across, velocities) > least)
        used = (towards & (distances < config.crossing_outlook * own)).nonzero()[0]
        lanes: list[tuple[str, ...]] = [(found[one][1], found[one][2].lane) for one in used.tolist()]
        return _Crossings(rows[used], lanes, entries[used], across[used])


def _entries(points: Floats, ways: list[Way]) -> tuple[Floats, Floats]:
    """Where people at `points` come to a crossing each, and its direction: (h, 2) each."""
    middles = np.array([way.entry for way in ways])
    across = np.array([way.direction for way in ways])
    half_widths = np.array([way.half_width for way in ways])
    gaps = points - middles
    beside = np.clip(across[:, 0] * gaps[:, 1] - across[:, 1] * gaps[:, 0], -half_widths, half_widths)
    return middles + beside[:, None] * np.stack((-across[:, 1], across[:, 0]), axis=1), across


def _crossed(starts: Floats, speeds: Floats, crossings: _Crossings) -> Floats:
    """From `starts` (h, 2) straight to the crossing, then across it: (h, t, 2) [m]."""
    gaps = crossings.entries - starts
    distances = np.hypot(gaps[:, 0], gaps[:, 1])[:, None]
    walked = speeds[:, None] * PREDICTION_TIMES
    shares = np.minimum(walked / np.maximum(distances, 1e-6), 1.0)
    beyond = np.maximum(walked - distances, 0.0)
    crossed: Floats = starts[:, None] + shares[:, :, None] * gaps[:, None]
    crossed += beyond[:, :, None] * crossings.across[:, None]
    return crossed
