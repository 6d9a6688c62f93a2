"""Where every object really went: what the ideal prediction answers with."""

from collections.abc import Sequence

import msgspec
import numpy as np

from dvca_sumo.messages import PREDICTION_TIMES, Floats, Integers
from dvca_sumo.truth import Moment

_EARLY = 0.05  # [s] before its record an object counts as there already


class Track(msgspec.Struct, frozen=True):
    """One object's recorded motion."""

    times: Floats  # (k,) [s] ascending
    poses: Floats  # (k, 3) x, y of the centre, unwrapped heading
    lanes: tuple[str, ...]  # (k,)


class Futures(msgspec.Struct, frozen=True):
    """Recorded motions of one run by object id; empty before any run was made."""

    tracks: dict[str, Track] = {}

    def of(self, name: str, time: float) -> tuple[Floats, tuple[str, ...]] | None:
        """Poses (len(PREDICTION_TIMES), 3) of an object from `time` [s] on, and the lanes it takes.

        After the end of its record an object keeps its last velocity. None when the record does not
        hold the object at `time`.
        """
        track = self.tracks.get(name)
        if track is None or not track.times[0] - _EARLY <= time <= track.times[-1]:
            return None
        wanted = time + PREDICTION_TIMES
        poses = np.column_stack([np.interp(wanted, track.times, track.poses[:, column]) for column in range(3)])
        if len(track.times) > 1:
            velocity = (track.poses[-1, :2] - track.poses[-2, :2]) / (track.times[-1] - track.times[-2])
            poses[:, :2] += np.maximum(wanted - track.times[-1], 0.0)[:, None] * velocity
        start, end = np.searchsorted(track.times, [time, wanted[-1]])
        lanes = dict.fromkeys(lane for lane in track.lanes[start : end + 1] if lane)
        return poses, tuple(lanes)

    def between(self, begin: float, end: float) -> "Futures":
        """What `of` needs to answer, just the same, for times from `begin` [s] on, of places up to `end` [s]."""
        tracks: dict[str, Track] = {}
        for name, track in self.tracks.items():
            first, last = np.searchsorted(track.times, [begin, end])
            first, last = max(int(first) - 1, 0), int(last) + 1
            if track.times[-1] >= begin and track.times[0] - _EARLY <= end:
                tracks[name] = Track(track.times[first:last], track.poses[first:last], track.lanes[first:last])
        return Futures(tracks)


def recorded_futures(moments: Sequence[Moment]) -> Futures:
    """The futures that a run's truth, step by step, amounts to."""
    owners = {name: row for row, name in enumerate(dict.fromkeys(name for one in moments for name in one.objects.ids))}
    if not owners:
        return Futures()
    owned = np.array([owners[name] for one in moments for name in one.objects.ids])
    times = np.repeat([one.time for one in moments], [len(one.objects.ids) for one in moments])
    poses = np.concatenate([one.objects.boxes[:, :3] for one in moments])
    lanes = [lane for one in moments for lane in one.objects.lanes or ("",) * len(one.objects.ids)]
    order = np.argsort(owned, kind="stable")
    parts = np.split(order, np.cumsum(np.bincount(owned))[:-1])
    return Futures(
        {name: _track(times[rows], poses[rows], lanes, rows) for name, rows in zip(owners, parts, strict=True)}
    )


def _track(times: Floats, poses: Floats, lanes: Sequence[str], rows: Integers) -> Track:
    """The track of an object that is in the given rows of `lanes`."""
    poses[:, 2] = np.unwrap(poses[:, 2])
    return Track(times, poses, tuple(lanes[row] for row in rows.tolist()))
