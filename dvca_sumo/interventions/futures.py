"""Where every object really went: what the ideal prediction answers with."""

from collections.abc import Sequence

import msgspec
import numpy as np

from dvca_sumo.messages import PREDICTION_TIMES, Floats
from dvca_sumo.truth import Moment


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
        if track is None or not track.times[0] - 0.05 <= time <= track.times[-1]:
            return None
        wanted = time + PREDICTION_TIMES
        poses = np.column_stack([np.interp(wanted, track.times, track.poses[:, column]) for column in range(3)])
        if len(track.times) > 1:
            velocity = (track.poses[-1, :2] - track.poses[-2, :2]) / (track.times[-1] - track.times[-2])
            poses[:, :2] += np.maximum(wanted - track.times[-1], 0.0)[:, None] * velocity
        start, end = np.searchsorted(track.times, [time, wanted[-1]])
        lanes = dict.fromkeys(lane for lane in track.lanes[start : end + 1] if lane)
        return poses, tuple(lanes)


def recorded_futures(moments: Sequence[Moment]) -> Futures:
    """The futures that a run's truth, step by step, amounts to."""
    times: dict[str, list[float]] = {}
    rows: dict[str, list[Floats]] = {}
    lanes: dict[str, list[str]] = {}
    for moment in moments:
        objects = moment.objects
        for row, name in enumerate(objects.ids):
            times.setdefault(name, []).append(moment.time)
            rows.setdefault(name, []).append(objects.boxes[row, :3])
            lanes.setdefault(name, []).append(objects.lanes[row] if objects.lanes else "")
    tracks: dict[str, Track] = {}
    for name, instants in times.items():
        poses = np.array(rows[name])
        poses[:, 2] = np.unwrap(poses[:, 2])
        tracks[name] = Track(np.array(instants), poses, tuple(lanes[name]))
    return Futures(tracks)
