"""The path decision: around what stands in the way, on which side and by how much, or not at all."""

import math
from collections.abc import Container, Iterator, Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from dvca_sumo.messages import Floats, ObjectClass, VehicleShape
from dvca_sumo.stack.planning.blockers import LENGTHWISE, PARALLEL, SLOWEST, Beside, Blocker, blockers
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.junctions import LineView
from dvca_sumo.stack.planning.keeping import kept
from dvca_sumo.stack.planning.moves import Lateral, Move, blend_length, feasible_length, roomy_length
from dvca_sumo.stack.planning.path import Plateau, way_back
from dvca_sumo.stack.planning.reference import Window
from dvca_sumo.stack.planning.room import room_beside
from dvca_sumo.stack.planning.scene import ALONG, IN_LANE, Flags, Scene

_VEHICLE, _PERSON, _STATIC = (int(kind) for kind in (ObjectClass.VEHICLE, ObjectClass.PEDESTRIAN, ObjectClass.STATIC))
_COMMITTED = 0.5  # of the offset: from there on it is safer to go on than to go back
_UNSURE = 0.08  # [m] less room than wanted at least does not end a nudge: noise, and still more than what is in the way
_DRIVING = 1.0  # [s] of moving: what is seen first may seem to move for less
_BAND_GAP = 3.0  # [m] lengthwise to others in the neighbouring lane
_CLOSING = 2.0  # [s] of closing speed kept to those who come from behind
_AT = 0.05  # [m] from an offset, the ego is at it
_SURE = 1.0  # [s] for which nobody has come alongside who did before, until the ego leaves its lane


class Nudge(msgspec.Struct, frozen=True):
    """Passing one object at an offset of the rear axle."""

    track: int
    plateau: Plateau

    @property
    def label(self) -> str:
        """As in `Trajectory.decision`."""
        return f"nudge {'left' if self.plateau.offset > 0.0 else 'right'} {self.track}"


class Taken(NamedTuple):
    """Somebody comes alongside."""

    offset: float  # [m] from the line, of an ego as near to it as that, or farther off
    time: float  # [s] when that was last found


class Situation(msgspec.Struct, frozen=True, eq=False):
    """What the path decision of one cycle looks at."""

    time: float  # [s]
    speed: float  # [m/s] of the ego
    lateral: Lateral
    window: Window
    scene: Scene
    views: list[LineView]


_NEVER = Taken(math.inf, -math.inf)


class NudgeDecider:
    """Decides for each standing object in the way; keeps the side, and the offset within noise."""

    def __init__(self, shape: VehicleShape, config: PlanningConfig) -> None:
        self._shape = shape
        self._config = config
        self._half = 0.5 * shape.width
        self._since: dict[int, float] = {}  # by track: when it came to stand
        self._moving: dict[int, float] = {}  # by track: when it came to move
        self._driven: set[int] = set()  # tracks that were seen driving
        self._held: dict[int, Plateau] = {}  # by track: the last cycle's, in route stations
        self._taken: dict[tuple[int, bool], Taken] = {}  # by track, and whether on its left

    @property
    def stood(self) -> Container[int]:
        """The tracks that stood in the last cycle."""
        return self._since

    def step(self, situation: Situation) -> tuple[list[Nudge], list[Plateau]]:
        """The nudges of this cycle by station, and where the ego has to be to go by all who stand beside its way.

        Objects without a nudge are passed by staying in lane, or stopped for.
        """
        scene, station = situation.scene, situation.window.station
        standing = [scene.ids[row] for row in scene.is_standing.nonzero()[0].tolist()]
        moving = [scene.ids[row] for row in (~scene.is_standing).nonzero()[0].tolist()]
        self._since = {track: self._since.get(track, situation.time) for track in standing}
        self._moving = {track: self._moving.get(track, situation.time) for track in moving}
        self._taken = {key: taken for key, taken in self._taken.items() if key[0] in scene.ids}
        self._driven &= set(scene.ids)
        self._driven.update(track for track, since in self._moving.items() if situation.time - since > _DRIVING)
        passed: list[tuple[Blocker, Plateau]] = []
        found, beside = blockers(scene, situation.window, situation.speed, self._held, self._shape, self._config)
        last = self._present(situation)
        for blocker in found:
            plateau = self._plateau(blocker, situation)
            if last is not None and self._goes_on(blocker, plateau, last, situation):
                plateau = self._passed_at(blocker, last.offset)
            if plateau is not None:
                passed.append((blocker, plateau))
                last = plateau
        nudges = [Nudge(blocker.track, plateau) for blocker, plateau in self._reconciled(passed, beside)]
        self._held = {
            nudge.track: Plateau(station + begin, station + end, offset)
            for nudge in nudges
            for begin, end, offset in (nudge.plateau,)
        }
        plateaus = sorted(nudge.plateau for nudge in nudges)
        return nudges, kept(plateaus, situation.lateral, beside, self._shape, self._config)

    def _plateau(self, blocker: Blocker, situation: Situation) -> Plateau | None:
        """Where and how far to move aside; None where there is no way round, or where none is needed.

        Where it cannot be reached before the object is passed, the front staying in the lane or on the road, it is the
        smallest move possible, if one is needed at all; not for who walks. Beside it, the ego does not turn back
        towards it, however little room it has.
        """
        late = []
        latest, is_clear = blocker.high, self._clears(blocker, 0.0)
        if not is_clear:
            # In the second half of the move, the front, turned outwards, is as far aside as the ego is going to be.
            room = blocker.low - self._shape.front
            latest = min(room + min(room, self._shape.front), latest)
        for offset in self._choices(blocker, situation):
            if self._meets_another(blocker, offset):
                continue
            if not offset:
                return None
            soonest = self._reached(blocker, offset, situation)
            if offset == self._held_offset(blocker.track):
                return soonest
            move = Move(situation.lateral, offset, 0.0, soonest.begin)
            roomy = roomy_length(move, situation.window, self._shape)
            begin = max(soonest.begin, min(roomy, latest))
            plateau = Plateau(begin, max(soonest.end, begin), offset)
            if roomy <= begin <= blocker.high:
                return plateau
            late.append(plateau)
        if is_clear:
            return None
        if blocker.track in self._held and blocker.low < self._shape.front:
            return self._reached(blocker, self._held_offset(blocker.track), situation)
        return None if blocker.walks else min(late, key=lambda plateau: abs(plateau.offset), default=None)

    def _reached(self, blocker: Blocker, offset: float, situation: Situation) -> Plateau:
        """Where the offset can be reached and left. A move once begun later than that ends where it did before."""
        begin = blocker.low - self._shape.front - LENGTHWISE
        end = blocker.high + self._shape.rear_overhang + LENGTHWISE
        end += blocker.speed * end / max(situation.speed - blocker.speed, SLOWEST)
        if offset == self._held_offset(blocker.track):
            begin = max(begin, self._held[blocker.track].begin - situation.window.station)
        else:
            move = Move(situation.lateral, offset, 0.0, begin)
            begin = feasible_length(move, situation.speed, situation.window, self._config)
        return Plateau(begin, max(end, begin), offset)

    def _present(self, situation: Situation) -> Plateau | None:
        """Where the ego is, on one of the last cycle's plateaus or past it; None if it is on none."""
        offset = situation.lateral.offset
        held = [plateau.offset for plateau in self._held.values() if abs(plateau.offset - offset) < _AT]
        return Plateau(0.0, 0.0, min(held, key=lambda one: abs(one - offset))) if held else None

    def _goes_on(self, blocker: Blocker, plateau: Plateau | None, last: Plateau, situation: Situation) -> bool:
        """Whether the ego passes an object as far aside as what it passed before, though it need not.

        On less way than it takes to go back and out again, its front would turn towards it.
        """
        offset, wanted = last.offset, 0.0 if plateau is None else plateau.offset
        if blocker.walks or wanted * offset < 0.0 or abs(wanted) >= abs(offset) or self._meets_another(blocker, offset):
            return False
        if blocker.clearance(offset) < blocker.clearance(wanted):
            return False
        window, speed = situation.window, situation.speed
        back = way_back(Lateral(offset, 0.0, 0.0), last.end, speed, window, self._shape, self._config)
        out = blend_length(wanted, speed, self._config)
        if self._passed_at(blocker, offset).begin > last.end + back.length + out:
            return False
        least = self._config.nudge_clearance_least
        room = room_beside(blocker, window, speed, least, self._shape, self._config)
        return room.is_in_lane(offset) or self._may_leave_lane(blocker, offset, 0.0, situation)

    def _reconciled(self, passed: Sequence[tuple[Blocker, Plateau]], standing: Beside) -> list[tuple[Blocker, Plateau]]:
        """Where others, soon before or after one, could not be passed as far aside as it, it is as little as need be.

        Beside it, the ego stays as far aside as it is. Those that are stopped for do not count.
        """
        least = self._config.nudge_clearance_least
        clear = standing.of(standing.clearances(0.0) >= least)
        found = []
        for blocker, plateau in passed:
            offset = plateau.offset
            way = blend_length(offset, SLOWEST, self._config) + LENGTHWISE
            begin, end = plateau.begin - way - self._shape.rear_overhang, plateau.end + way + self._shape.front
            in_way = (clear.low < end) & (clear.high > begin) & (clear.clearances(offset) < least)
            is_close = bool(in_way.any()) or any(
                one.low < end and one.high > begin and one.clearance(offset) < least
                for one, _ in passed
                if not one.walks
            )
            if is_close and not blocker.walks:
                is_ahead = blocker.low > self._shape.front
                offset = self._tightened(blocker, offset) if is_ahead else self._held_offset(blocker.track)
            if offset:
                found.append((blocker, plateau._replace(offset=offset)))
        return found

    def _passed_at(self, blocker: Blocker, offset: float) -> Plateau:
        """Where to be at an offset to pass an object that stands."""
        begin = blocker.low - self._shape.front - LENGTHWISE
        return Plateau(begin, max(blocker.high + self._shape.rear_overhang + LENGTHWISE, begin), offset)

    def _choices(self, blocker: Blocker, situation: Situation) -> Iterator[float]:
        """Offsets to pass at, best first: on the side of the last cycle if that still works, else the smaller one.

        While there is no room beside for the wanted clearance, the room that the lane leaves will do if it is enough,
        or else the least clearance.
        """
        hold, least = self._config.nudge_hold, self._config.nudge_clearance_least
        if blocker.track in self._held:
            least -= _UNSURE
        room = room_beside(blocker, situation.window, situation.speed, least, self._shape, self._config)
        held = self._held_offset(blocker.track)
        begun = 0.0 if room.is_in_lane(held, hold) else held
        turns_in = self._turns_in(blocker, situation)
        wanted = sorted(room.wanted, key=lambda offset: (offset * held <= 0.0, abs(offset)))
        for offset in wanted:
            stays_in_lane = offset == 0.0 or (room.is_in_lane(offset) and not turns_in)
            if stays_in_lane or self._may_leave_lane(blocker, offset, begun, situation):
                beside = self._sparing(blocker, offset, situation) if stays_in_lane else offset
                if abs(beside - held) < hold and self._clears(blocker, held):
                    yield held
                yield beside
        has_lane = room.lane_right <= room.lane_left and not turns_in
        may_pass = has_lane and (blocker.walks or self._will_stay(blocker, situation))
        if may_pass:
            inside = (min(max(offset, room.lane_right), room.lane_left) for offset in wanted)
            yield from (self._sparing(blocker, offset, situation) for offset in inside if self._clears(blocker, offset))
        for offset in wanted:
            tight = self._tightened(blocker, offset)
            if (may_pass and room.is_in_lane(tight)) or self._may_leave_lane(blocker, tight, begun, situation):
                yield tight

    def _held_offset(self, track: int) -> float:
        """The offset of the last cycle; 0 without one."""
        return self._held[track].offset if track in self._held else 0.0

    def _clears(self, blocker: Blocker, offset: float) -> bool:
        return blocker.clearance(offset) >= self._config.nudge_clearance_least

    def _meets_another(self, blocker: Blocker, offset: float) -> bool:
        """Whether another standing object leaves no room at that offset, alongside this one."""
        return bool((blocker.others.clearances(offset) < self._config.nudge_clearance_least - 1e-6).any())

    def _tightened(self, blocker: Blocker, offset: float) -> float:
        """The offset on the same side that leaves the least clearance to this one, and to others who stand there [m].

        That is 0 where none is needed, and at most `offset`.
        """
        side = math.copysign(1.0, offset)
        gaps = offset - blocker.others.left if offset > 0.0 else blocker.others.right - offset
        spare = float(gaps[gaps > 0.0].min(initial=blocker.clearance(offset))) - self._config.nudge_clearance_least
        return offset - side * min(max(spare, 0.0), abs(offset))

    def _may_leave_lane(self, blocker: Blocker, offset: float, begun: float, situation: Situation) -> bool:
        """For what will not move by itself, when the other lane is free; always to finish what was `begun`.

        That is the offset of the last cycle if it is beyond the lane, else 0.
        """
        if (
            begun * offset > 0.0
            and abs(offset) <= abs(begun) + self._config.nudge_hold
            and (blocker.track not in self._since or situation.lateral.offset / offset > _COMMITTED)
        ):
            return True
        return self._will_stay(blocker, situation) and self._has_been_free(blocker, offset, situation)

    def _will_stay(self, blocker: Blocker, situation: Situation) -> bool:
        """Whether it has stood for so long, where it is, that it will not move by itself."""
        if blocker.track not in self._since:
            return False
        kind, stood = situation.scene.classes[blocker.row], situation.time - self._since[blocker.track]
        if kind == _STATIC:
            return True
        patience = self._config.parked_after
        if kind == _PERSON:
            if self._is_near_line(blocker.high, situation.views):  # who waits at a crossing will go
                patience = max(patience, self._config.person_patience)
                if not self._held and situation.speed >= self._config.standing_speed:
                    return False
            return stood >= patience
        if self._is_in_traffic(blocker, situation):
            patience = max(patience, self._config.broken_down_after)
        return stood >= patience and not self._is_queueing(blocker, situation)

    def _is_in_traffic(self, blocker: Blocker, situation: Situation) -> bool:
        """Who stands in the middle of our lane may be in a queue that it hides.

        Near a junction anyone may; farther away, who was seen driving.
        """
        if self._turns_in(blocker, situation):
            return True
        if abs(float(situation.scene.now.offsets[blocker.row])) >= IN_LANE:
            return False
        to_lines = [view.distance + self._shape.front - blocker.high for view in situation.views]
        is_near = any(0.0 < distance < self._config.queue_length for distance in to_lines)
        return is_near or blocker.track in self._driven

    def _turns_in(self, blocker: Blocker, situation: Situation) -> bool:
        """Whether a vehicle stands aslant in our way at a junction: it drives on into our lane as soon as it can."""
        scene, row = situation.scene, blocker.row
        if scene.classes[row] != _VEHICLE or blocker.clearance(0.0) >= self._config.object_margin:
            return False
        is_aslant = ALONG < float(scene.now.directions[row]) < PARALLEL
        return is_aslant and self._is_near_line(blocker.high, situation.views)

    def _is_queueing(self, blocker: Blocker, situation: Situation) -> bool:
        """A vehicle in our lane may just wait, however long it has stood: near a line, or behind one that waits."""
        scene, now = situation.scene, situation.scene.now
        is_vehicle = (scene.classes != _PERSON) & (scene.classes != _STATIC)
        in_lane = is_vehicle & (np.abs(now.offsets) < IN_LANE)
        if not in_lane[blocker.row]:
            return False
        lows, highs = now.stations - now.half_lengths, now.stations + now.half_lengths
        nose = blocker.high
        while not self._is_near_line(nose, situation.views):
            ahead = np.flatnonzero(in_lane & (lows > nose) & (lows < nose + self._config.queue_gap))
            if not len(ahead):
                return False
            nearest = ahead[lows[ahead].argmin()]
            if not scene.is_standing[nearest]:
                return True
            nose = float(highs[nearest])
        return True

    def _is_near_line(self, station: float, views: list[LineView]) -> bool:
        """Whether the place lies on a junction or shortly before its stop line."""
        for view in views:
            to_line = view.distance + self._shape.front - station
            if view.line.station - view.line.exit_station < to_line < self._config.queue_reach:
                return True
        return False

    def _has_been_free(self, blocker: Blocker, offset: float, situation: Situation) -> bool:
        """As `_is_free`, and for a while, if it was not before: predictions that change do not move the ego about."""
        key, distance, time = (blocker.track, offset > 0.0), abs(offset), situation.time
        taken = self._taken.get(key, _NEVER)
        if not self._is_free(blocker, offset, situation):
            self._taken[key] = Taken(min(distance, taken.offset) if time - taken.time < _SURE else distance, time)
            return False
        return time - taken.time >= _SURE or distance < taken.offset

    def _is_free(self, blocker: Blocker, offset: float, situation: Situation) -> bool:
        """Whether nobody who moves comes alongside while the ego is out of its lane; who is right behind it follows."""
        scene, now = situation.scene, situation.scene.now
        beside = self._alongside(blocker, offset, self._config.object_margin, situation)
        follows = (now.stations < 0.0) & (np.abs(now.offsets - situation.lateral.offset) < now.half_widths + self._half)
        return not bool(beside[~follows[scene.owners[: scene.moving]]].any())

    def _sparing(self, blocker: Blocker, offset: float, situation: Situation) -> float:
        """The offset within the lane, or a smaller one: who moves on that side is to have as much room as the ego."""
        scene, least = situation.scene, self._config.nudge_clearance_least
        is_beyond = (scene.futures.offsets[: scene.moving, 0] - offset) * offset > 0.0
        if is_beyond.any() and (is_beyond & self._alongside(blocker, offset, least, situation)).any():
            return self._tightened(blocker, offset)
        return offset

    def _alongside(self, blocker: Blocker, offset: float, margin: float, situation: Situation) -> Flags:
        """Which futures that move (moving,) come alongside, within `margin` [m], while the ego is at that offset."""
        scene = situation.scene
        futures, moving = scene.futures, slice(0, scene.moving)
        pace, length = max(situation.speed, SLOWEST), blend_length(offset, situation.speed, self._config)
        ego: Floats = pace * scene.times
        out: Flags = (ego > blocker.low - self._shape.front - length) & (ego < blocker.high + length)
        stations, lengths = futures.stations[moving], futures.half_lengths[moving]
        beside = np.abs(futures.offsets[moving] - offset) < futures.half_widths[moving] + self._half + margin
        rates = (stations[:, -1:] - stations[:, :1]) / (scene.times[-1] - scene.times[0])
        behind = self._shape.rear_overhang + _BAND_GAP + _CLOSING * np.maximum(rates - pace, 0.0)
        beside &= (stations + lengths > ego - behind) & (stations - lengths < ego + self._shape.front + _BAND_GAP)
        found: Flags = np.any(beside & out, axis=1)
        return found
