"""Where people stand. By noise each cycle sees them elsewhere, and the ego would creep past on the luckiest."""

import msgspec
import numpy as np

from dvca_sumo.messages import Floats, ObjectClass, PredictedObjects

_PERSON = int(ObjectClass.PEDESTRIAN)
_NEW = 0.1  # weight of what is seen now: the mean is over about two seconds
_LEFT = 0.3  # [m] off the mean place, at most: who is seen farther from it has walked on, the noise is less


class Standing:
    """Remembers the mean place of each person who stands (exponential smoothing)."""

    def __init__(self) -> None:
        self._places: dict[int, Floats] = {}  # [m] by track

    def settled(self, predicted: PredictedObjects, stood: set[int]) -> tuple[PredictedObjects, set[int]]:
        """The same with those people where they are on average who `stood`, as tracks, in the last cycle.

        And which of those who stood are still there.
        """
        objects = predicted.objects
        people = (objects.classes == _PERSON).nonzero()[0].tolist()
        rows = [row for row in people if objects.ids[row] in stood]
        if not rows:
            self._places = {}
            return predicted, stood
        tracks: list[int] = objects.ids[rows].tolist()
        seen = objects.boxes[rows, :2]
        known = np.array([self._places.get(track, place) for track, place in zip(tracks, seen, strict=True)])
        missed = (1.0 - _NEW) * (known - seen)
        away = np.hypot(missed[:, 0], missed[:, 1])
        places = seen + missed * (_LEFT / np.maximum(away, _LEFT))[:, None]
        self._places = dict(zip(tracks, places, strict=True))
        boxes = objects.boxes.copy()
        boxes[rows, :2] = places
        gone = {track for track, off in zip(tracks, away.tolist(), strict=True) if off > _LEFT}
        return msgspec.structs.replace(predicted, objects=msgspec.structs.replace(objects, boxes=boxes)), stood - gone
