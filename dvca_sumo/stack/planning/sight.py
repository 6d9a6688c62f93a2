"""Lines of sight at a stop line: where somebody who goes first may come unseen, hidden by others."""

import math

import numpy as np

from dvca_sumo.messages import PREDICTION_STEP, Flags, Floats, Integers, PredictedObjects, VehicleShape
from dvca_sumo.roadmap.route import Control, StopLine
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.junctions import LineView
from dvca_sumo.stack.planning.path import Path
from dvca_sumo.stack.visibility import are_hidden

_BEFORE = 45.0  # [m] before a line the ego begins to look
_LOOKS = (2.0, 4.0)  # [m] past the line it looks from on the way, with its nose there; ...
_END = 6.0  # ... from here on it sees all or nothing
_SLOWEST = 3.0  # [m/s] an ego comes to the line
_STEP = 4.0  # [m] between places on a lane: two in a row hide a car
_WAYS = _STEP * (0.5 + np.arange(25))  # [m] from the junction back along the lane
_BLINK = 0.25  # [s] after which the ego has to look anew
_SURE = 60.0  # [m] within which the ego has found everybody who is in sight
_NEAR = 50.0  # [m] around the ego, who may hide others
_TOUCH = 0.3  # [m] smallest distance to brake on
_ALL_WAIT = (Control.PRIORITY, Control.ALL_WAY_STOP)  # for the ego, or at their own signs
_NARROW = 1.0  # [m] who is no wider hides nobody
_ON_LANE = (2.0, 0.3)  # [m] from a body, lengthwise and sideways: a place there is taken


class Sights:
    """Looks from the ego's path onto the lanes that go first at the lines ahead; remembers where it has seen enough."""

    def __init__(self, shape: VehicleShape, config: PlanningConfig) -> None:
        self._shape = shape
        self._config = config
        self._lanes: dict[StopLine, _Lanes] = {}
        self._passed: set[StopLine] = set()  # lines at which the ego saw everybody, or was too fast to feel its way

    def blind(
        self, views: list[LineView], path: Path, speed: float, predicted: PredictedObjects
    ) -> list[tuple[float, float]]:
        """Stretches of `path` for the ego's nose [m] in which it does not see who comes and goes first.

        They begin at the lines. Somebody may come who has not been in sight yet, is hidden still when the ego is there,
        and reaches the junction before an ego that sets off from peering has passed it. `speed` is the ego's [m/s].
        """
        found = []
        for view in views:
            line = view.line
            is_near = -_END < view.distance < _BEFORE
            if not is_near or not line.prior or line.control in _ALL_WAIT or line in self._passed:
                continue
            clear = self._clear(view, path, speed, predicted)
            is_blind = clear > max(view.distance, 0.0) and not self._is_too_late(view.distance, speed)
            if is_blind:
                found.append((view.distance, clear))
            elif view.distance < 0.0:
                self._passed.add(line)
        return found

    def _is_too_late(self, distance: float, speed: float) -> bool:
        """Whether slowing down until it sees all or nothing, so far before the line [m], takes more than comfort."""
        config = self._config
        lost = speed * speed - config.peering_speed**2
        return lost > 2.0 * config.comfort_braking * max(distance + _END, _TOUCH)

    def _clear(self, view: LineView, path: Path, speed: float, predicted: PredictedObjects) -> float:
        """How far along the path the nose is from where the ego sees everybody who comes [m]."""
        config, shape = self._config, self._shape
        lanes = self._lanes.get(view.line)
        if lanes is None:
            lanes = self._lanes[view.line] = _Lanes(view.line, config)
        eyes, boxes = _eyes(path, shape.centre), predicted.objects.boxes
        hides = (np.hypot(*(boxes[:, :2] - eyes).T) < _NEAR) & (boxes[:, 4] > _NARROW)
        lanes.look(eyes, boxes[hides], predicted.time)
        if not view.goes_first or view.stop:
            return -math.inf
        start = max(view.distance, 0.0)
        past = view.exit_distance - start + shape.length
        peering, gain = config.peering_speed, config.acceleration
        needed = (math.sqrt(peering**2 + 2.0 * gain * max(past, 0.0)) - peering) / gain
        places = lanes.in_reach(needed)
        likeliest = predicted.probabilities.argsort(kind="stable")  # the last one of each object
        for nose in (start, *(place for look in _LOOKS if (place := view.distance + look) > start)):
            wait = start / max(speed, _SLOWEST) + (nose - start) / peering
            ahead = _boxes_in(predicted, likeliest, wait)[hides]
            if not lanes.is_blind(places, _eyes(path, nose + shape.centre), ahead, wait):
                return nose
        return view.distance + _END


class _Lanes:
    """Places on the lanes that go first at one line: (lanes, places) of each."""

    def __init__(self, line: StopLine, config: PlanningConfig) -> None:
        lanes = line.prior
        self._points = np.empty((len(lanes), len(_WAYS), 2))
        limits = [each.speed_limit if each.speed_limit < math.inf else config.urban_limit for each in lanes]
        self._speeds = np.array(limits).reshape(-1, 1)
        self._carried = np.zeros(self._speeds.shape)  # [m] of the way to the next place
        self._time = -math.inf
        lengths = np.array([[each.line.length] for each in lanes]).reshape(-1, 1)
        self._exists = lengths > _WAYS
        self._unseen = self._exists
        for points, each in zip(self._points, lanes, strict=True):
            points[:] = each.line.poses(np.maximum(each.line.length - _WAYS, 0.0))[:, :2]

    def in_reach(self, needed: float) -> Flags:
        """From where somebody reaches the junction within `needed` [s]."""
        places: Flags = self._exists & (needed * self._speeds > _WAYS)
        return places

    def look(self, eyes: Floats, boxes: Floats, time: float) -> None:
        """See from `eyes` (2,) past `boxes` (n, 5) [m] at `time` [s]; who was in sight before is still known of."""
        hidden = self._hidden_from(eyes, boxes)
        hidden |= np.hypot(self._points[:, :, 0] - eyes[0], self._points[:, :, 1] - eyes[1]) > _SURE
        elapsed = time - self._time
        self._time = time
        if elapsed > _BLINK:
            self._unseen = hidden
            return
        self._carried += elapsed * self._speeds
        come = self._come(self._carried)
        self._carried %= _STEP
        self._unseen = hidden & (self._unseen | come)

    def is_blind(self, places: Flags, eyes: Floats, boxes: Floats, wait: float) -> bool:
        """Whether somebody may be at `places` unseen, `wait` [s] from now: seen from `eyes` (2,) past `boxes` (n, 5).

        Not behind somebody on the same lane: that one is seen, or would be in the way.
        """
        unseen = places & (self._unseen | self._come(wait * self._speeds))
        if not unseen.any():
            return False
        unseen &= self._hidden_from(eyes, boxes)
        unseen &= ~np.logical_or.accumulate(self._taken(boxes), axis=1)
        return bool((unseen[:, 1:] & unseen[:, :-1]).any())

    def _come(self, ways: Floats) -> Flags:
        """Where somebody may be who was unseen, or out of reach, `ways` (lanes, 1) [m] before."""
        columns = np.arange(len(_WAYS)) + (ways / _STEP).astype(np.int64)
        come: Flags = np.take_along_axis(self._unseen, np.minimum(columns, len(_WAYS) - 1), axis=1)
        return come | (columns >= len(_WAYS))

    def _hidden_from(self, eyes: Floats, boxes: Floats) -> Flags:
        hidden = are_hidden(self._points.reshape(-1, 2) - eyes, boxes - np.append(eyes, (0.0, 0.0, 0.0)), _STEP)
        return hidden.reshape(self._exists.shape)

    def _taken(self, boxes: Floats) -> Flags:
        apart = self._points[:, :, None] - boxes[:, :2]
        cosines, sines = np.cos(boxes[:, 2]), np.sin(boxes[:, 2])
        along = np.abs(apart[..., 0] * cosines + apart[..., 1] * sines) - 0.5 * boxes[:, 3]
        across = np.abs(apart[..., 1] * cosines - apart[..., 0] * sines) - 0.5 * boxes[:, 4]
        taken: Flags = np.any((along < _ON_LANE[0]) & (across < _ON_LANE[1]), axis=2)
        return taken


def _eyes(path: Path, arc: float) -> Floats:
    """Where the ego looks from with the middle of its body at `arc` [m] of the path, (2,)."""
    return np.array((np.interp(arc, path.arcs, path.x), np.interp(arc, path.arcs, path.y)))


def _boxes_in(predicted: PredictedObjects, likeliest: Integers, wait: float) -> Floats:
    """(n, 5) `wait` [s] from now, as the future of each object has it that comes last in the order `likeliest` (h,)."""
    boxes = predicted.objects.boxes.copy()
    column = min(round(wait / PREDICTION_STEP), predicted.poses.shape[1] - 1)
    boxes[predicted.owners[likeliest], :3] = predicted.poses[likeliest, column]
    return boxes
