"""Prediction: tracked objects -> their possible futures over six seconds.

Vehicles and bicycles follow the lane they are on, through every continuation it has, or change to the
next lane when they are seen to drift there. People walk as `walking` has it. Whatever is on no lane goes on as it is.
"""

import math

import msgspec
import numpy as np

from dvca_sumo.geometry.angles import wrapped_all
from dvca_sumo.messages import PREDICTION_TIMES, Floats, Integers, ObjectClass, PredictedObjects, TrackedObjects
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.stack.hypotheses import Hypotheses, message_of
from dvca_sumo.stack.lane_changes import LaneChangeConfig, LaneChanges, lateral_speeds
from dvca_sumo.stack.lane_following import Candidates, LaneFollowing, LaneMatchConfig, Movers
from dvca_sumo.stack.lane_motion import LaneMotion, MotionModelConfig
from dvca_sumo.stack.lane_paths import LanePaths
from dvca_sumo.stack.walking import Walking, WalkingConfig

# Comparing an array with an enumeration's member costs numpy ten times as much as with a number.
_BICYCLE, _PERSON = int(ObjectClass.BICYCLE), int(ObjectClass.PEDESTRIAN)
_LAST_ON_WHEELS = _BICYCLE  # vehicles and bicycles, by class number

_LEAST_COSINE = 0.4  # of the angle between a body and where its nose goes


class PredictionConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How futures are drawn up."""

    matching: LaneMatchConfig = LaneMatchConfig()
    changes: LaneChangeConfig = LaneChangeConfig()
    motion: MotionModelConfig = MotionModelConfig()
    walking: WalkingConfig = WalkingConfig()
    max_branches: int = 3  # continuations of a lane
    standing_speed: float = 0.3  # [m/s] slower vehicles stay where they are, slower people go on as they are
    direction_speed: float = 2.0  # [m/s] faster objects go where their velocity points, slower ones their box
    trend_smoothing: float = 0.5  # [s] time constant of acceleration estimates
    straight: float = 0.2  # [rad] whose nose turns by more slows down and speeds up by turning, and shows no trend
    max_trend: float = 2.5  # [m/s^2] acceleration that is believed
    max_braking_trend: float = 4.0  # [m/s^2] braking that is believed, positive number


class MapPrediction:
    """Map-based prediction. Remembers each object's lane and speed by its track number."""

    def __init__(self, config: PredictionConfig, roadmap: RoadMap) -> None:
        self._config = config
        self._paths = LanePaths(
            roadmap,
            max_branches=config.max_branches,
            lateral_acceleration=config.motion.bend_acceleration,
            braking=config.motion.braking,
        )
        self._following = LaneFollowing(config.matching, roadmap, self._paths)
        self._motion = LaneMotion(config.motion, self._paths)
        self._changes = LaneChanges(config.changes, roadmap, self._paths)
        self._walking = Walking(config.walking, roadmap.walkways)
        self._time = math.nan
        self._speeds: dict[int, tuple[float, float]] = {}  # by track: [m/s], its trend [m/s^2]

    def step(self, tracked: TrackedObjects) -> PredictedObjects:
        """One cycle. Every object owns at least one hypothesis; they are ordered by owner.

        The first pose of each hypothesis is where the object is now.
        """
        velocities = tracked.velocities
        speeds = np.hypot(velocities[:, 0], velocities[:, 1])
        elapsed = tracked.time - self._time if self._speeds else 0.0
        self._time = tracked.time
        trends = self._trends(tracked.ids.tolist(), speeds.tolist(), elapsed)
        reaches = self._motion.reach(speeds, trends)
        candidates = self._on_lanes(tracked, speeds, reaches, elapsed)
        parts = [self._along_lanes(tracked, candidates, trends, reaches)]
        walkers = ((tracked.classes == _PERSON) & (speeds >= self._config.standing_speed)).nonzero()[0]
        if walkers.size:
            parts.append(self._walking.hypotheses(tracked, walkers))
        is_done = np.zeros(len(speeds), dtype=np.bool_)
        for part in parts:
            is_done[part.owners] = True
        rest = (~is_done).nonzero()[0]
        if rest.size:
            parts.append(self._straight_on(tracked, rest, speeds))
        return message_of(tracked, *parts)

    def _trends(self, tracks: list[int], speeds: list[float], elapsed: float) -> Floats:
        """Smoothed rates of change of the objects' speeds (n,) [m/s^2]; 0 for new objects."""
        config, known = self._config, self._speeds
        gain = min(1.0, elapsed / config.trend_smoothing)
        self._speeds = {}
        for track, speed in zip(tracks, speeds, strict=True):
            before, trend = known.get(track, (speed, 0.0))
            if elapsed > 0.0:
                trend += gain * ((speed - before) / elapsed - trend)
            self._speeds[track] = speed, trend
        trends = np.array([trend for _, trend in self._speeds.values()])
        believed: Floats = np.minimum(np.maximum(trends, -config.max_braking_trend), config.max_trend)
        return believed

    def _on_lanes(self, tracked: TrackedObjects, speeds: Floats, reaches: Floats, elapsed: float) -> Candidates:
        """Moving vehicles and bicycles that follow lanes. Standing ones keep the lane they have."""
        tracks, velocities = tracked.ids.tolist(), tracked.velocities
        is_fast = speeds > self._config.direction_speed
        headings = np.where(is_fast, np.arctan2(velocities[:, 1], velocities[:, 0]), tracked.boxes[:, 2])
        self._following.forget_all_but(tracks)
        is_wheeled = tracked.classes <= _LAST_ON_WHEELS
        self._following.find(is_wheeled.nonzero()[0].tolist(), tracks, tracked.boxes[:, :2], headings)
        return self._following.follow(
            Movers(
                rows=(is_wheeled & (speeds >= self._config.standing_speed)).nonzero()[0].tolist(),
                tracks=tracks,
                classes=tracked.classes.tolist(),
                boxes=tracked.boxes,
                headings=headings,
                moved=speeds * elapsed,
                reaches=reaches,
            )
        )

    def _along_lanes(
        self, tracked: TrackedObjects, candidates: Candidates, trends: Floats, reaches: Floats
    ) -> Hypotheses:
        """The candidates and lane changes that differ within the horizon.

        A body follows its nose along the lane. Cars seek its centre, bicycles keep their side of it.
        """
        drifts = lateral_speeds(candidates, tracked.velocities)
        candidates, drifts = self._changes.added(candidates, drifts, tracked, reaches)
        owners, paths, along, probabilities, places = candidates
        if not len(owners):
            return Hypotheses(owners, probabilities, np.empty((0, len(PREDICTION_TIMES), 3)), [])
        boxes = tracked.boxes.take(owners, axis=0)
        own = self._nose_speeds(tracked.velocities.take(owners, axis=0), boxes[:, 2], places.steering)
        own_trends = np.where(np.abs(places.steering) <= self._config.straight, trends[owners], 0.0)
        farthest = float(self._motion.reach(own, own_trends).max())
        stations = self._motion.travelled(along, places.stations, own, own_trends, farthest)
        is_bicycle = tracked.classes[owners] == _BICYCLE
        keeps_side = is_bicycle & (np.abs(places.offsets) <= places.half_widths)
        poses, (cosines, sines) = self._paths.bodies(along, stations, boxes[:, 3])
        x, y, headings = poses
        targets = np.where(keeps_side, places.offsets, 0.0)
        offsets, slants = self._motion.settled(places.offsets, targets, drifts, own)
        x -= offsets * sines
        y += offsets * cosines
        poses[2] = wrapped_all(headings + slants)
        poses[:, :, 0] = boxes[:, :3].T
        ends = zip(paths, stations[:, 0].tolist(), stations[:, -1].tolist(), strict=True)
        lanes = [path.lanes_between(start, end) for path, start, end in ends]
        return _told_apart(Hypotheses(owners, probabilities, poses.transpose(1, 2, 0), lanes))

    def _nose_speeds(self, velocities: Floats, headings: Floats, steering: Floats) -> Floats:
        """Speeds (h,) of noses that follow their paths; a body is slower than its nose, which only pulls it along."""
        along = velocities[:, 0] * np.cos(headings) + velocities[:, 1] * np.sin(headings)
        speeds: Floats = np.maximum(along / np.maximum(np.cos(steering), _LEAST_COSINE), self._config.standing_speed)
        return speeds

    def _straight_on(self, tracked: TrackedObjects, rows: Integers, speeds: Floats) -> Hypotheses:
        """Constant velocity, which is none for a standing vehicle or obstacle."""
        poses = np.empty((len(rows), len(PREDICTION_TIMES), 3))
        poses[:] = tracked.boxes.take(rows, axis=0)[:, None, :3]
        stands = (speeds < self._config.standing_speed) & (tracked.classes != _PERSON)
        moves = (~stands[rows]).nonzero()[0]
        if moves.size:
            poses[moves, :, :2] += tracked.velocities[rows[moves], None] * PREDICTION_TIMES[:, None]
        lanes = [self._following.lanes_of(track) for track in tracked.ids[rows].tolist()]
        return Hypotheses(rows, np.ones(len(rows)), poses, lanes)


def _told_apart(hypotheses: Hypotheses) -> Hypotheses:
    """One of each object's candidates that follow the same lanes: they part beyond the horizon only."""
    owners, probabilities, poses, lanes = hypotheses
    first: dict[tuple[int, tuple[str, ...]], int] = {}
    same = [first.setdefault(key, row) for row, key in enumerate(zip(owners.tolist(), lanes, strict=True))]
    if len(first) == len(lanes):
        return hypotheses
    kept = list(first.values())
    sums = np.zeros(len(lanes))
    np.add.at(sums, same, probabilities)
    return Hypotheses(owners[kept], sums[kept], poses[kept], [lanes[row] for row in kept])
