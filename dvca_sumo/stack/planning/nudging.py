"""The path decision: around what stands in the way, on which side and by how much, or not at all."""

import math
from collections.abc import Iterator, Sequence

import msgspec

from dvca_sumo.messages import VehicleShape
from dvca_sumo.stack.planning.blockers import LENGTHWISE, SLOWEST, Beside, Blocker, blockers
from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.keeping import kept
from dvca_sumo.stack.planning.moves import Lateral, Move, blend_length, feasible_length, roomy_length
from dvca_sumo.stack.planning.path import Plateau, way_back
from dvca_sumo.stack.planning.room import room_beside
from dvca_sumo.stack.planning.scene import IN_LANE
from dvca_sumo.stack.planning.sides import Sides
from dvca_sumo.stack.planning.situation import Situation
from dvca_sumo.stack.planning.staying import Staying

_COMMITTED = 0.5  # of the offset: from there on it is safer to go on than to go back
_UNSURE = 0.08  # [m] less room than wanted at least does not end a nudge: noise, and still more than what is in the way
_SHARES = (2.0 / 3.0, 1.0 / 3.0, 0.0)  # of the way from the least clearance to the wanted one
_AT = 0.05  # [m] from an offset, the ego is at it


class Nudge(msgspec.Struct, frozen=True):
    """Passing one object at an offset of the rear axle."""

    track: int
    plateau: Plateau

    @property
    def label(self) -> str:
        """As in `Trajectory.decision`."""
        return f"nudge {'left' if self.plateau.offset > 0.0 else 'right'} {self.track}"


class NudgeDecider:
    """Decides for each standing object in the way; keeps the side, and the offset within noise."""

    def __init__(self, shape: VehicleShape, config: PlanningConfig) -> None:
        self._shape = shape
        self._config = config
        self._staying = Staying(shape, config)
        self._sides = Sides(shape, config)
        self._held: dict[int, Plateau] = {}  # by track: the last cycle's, in route stations
        self._followers: set[int] = set()  # tracks that were passed as far aside as those before them

    @property
    def stood(self) -> set[int]:
        """The tracks that stood in the last cycle; of people, those that did so for longer than a moment."""
        return self._staying.stood

    def step(self, situation: Situation) -> tuple[list[Nudge], list[Plateau]]:
        """The nudges of this cycle by station, and where the ego has to be to go by all who stand beside its way.

        Objects without a nudge are passed by staying in lane, or stopped for.
        """
        scene, station = situation.scene, situation.window.station
        self._staying.see(situation)
        self._sides.see(situation)
        found, beside = blockers(scene, situation.window, situation.speed, self._held, self._shape, self._config)
        if not found:
            self._held, self._followers = {}, set()
            return [], []
        passed: list[tuple[Blocker, Plateau]] = []
        last: Plateau | None = None
        followers = set()
        for blocker in found:
            plateau = self._plateau(blocker, situation)
            before = last or self._present(blocker.track, situation)
            going_on = before and self._going_on(blocker, plateau, before, situation)
            if going_on:
                plateau = going_on
                followers.add(blocker.track)
            if plateau is not None:
                passed.append((blocker, plateau))
                last = plateau
        self._followers = followers
        settled = self._reconciled(passed, beside) + self._gone_by(found, passed, situation)
        nudges = [Nudge(blocker.track, plateau) for blocker, plateau in settled]
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
        towards it, however little room it has. For what it goes by anyway it begins no move that is not comfortable.
        """
        late = []
        latest, is_clear = blocker.high, self._clears(blocker, 0.0)
        if not is_clear:
            # In the second half of the move, the front, turned outwards, is as far aside as the ego is going to be.
            room = blocker.low - self._shape.front
            latest = min(room + min(room, self._shape.front), latest)
        goes_by = situation.speed >= self._config.standing_speed and blocker.low < self._shape.front
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
            if is_clear or goes_by:
                begin = max(begin, self._unhurried(blocker.track, offset, situation))
            plateau = Plateau(begin, max(soonest.end, begin), offset)
            if roomy <= begin <= blocker.high:
                return plateau
            late.append(plateau)
        if is_clear:
            return None
        if blocker.track in self._held and blocker.low < self._shape.front:
            return self._reached(blocker, self._held_offset(blocker.track), situation)
        return None if blocker.walks else min(late, key=lambda plateau: abs(plateau.offset), default=None)

    def _unhurried(self, track: int, offset: float, situation: Situation) -> float:
        """Where a comfortable move ends; for an object that the ego moves aside for already, where that move does."""
        if track in self._held:
            return self._held_begin(track, situation)
        return blend_length(offset - situation.lateral.offset, situation.speed, self._config)

    def _reached(self, blocker: Blocker, offset: float, situation: Situation) -> Plateau:
        """Where the offset can be reached and left. A move once begun later than that ends where it did before."""
        begin, end, _ = self._passed_at(blocker, offset)
        end += blocker.speed * end / max(situation.speed - blocker.speed, SLOWEST)
        if offset == self._held_offset(blocker.track):
            begin = max(begin, self._held_begin(blocker.track, situation))
        else:
            move = Move(situation.lateral, offset, 0.0, begin)
            begin = feasible_length(move, situation.speed, situation.window, self._config)
        return Plateau(begin, max(end, begin), offset)

    def _present(self, follower: int, situation: Situation) -> Plateau | None:
        """Where the ego is: at a plateau of the last cycle, or past it, for another one than `follower` (a track).

        None if it is at none.
        """
        offset, is_one = situation.lateral.offset, follower in self._followers
        held = [
            plateau.offset
            for track, plateau in self._held.items()
            if abs(plateau.offset - offset) < _AT and (is_one or track != follower)
        ]
        return Plateau(0.0, 0.0, min(held, key=lambda one: abs(one - offset))) if held else None

    def _going_on(
        self, blocker: Blocker, plateau: Plateau | None, last: Plateau, situation: Situation
    ) -> Plateau | None:
        """Where the ego passes an object as far aside as what it passed before, though it need not; None: it does not.

        On less way than it takes to go back and out again, its front would turn towards it. Where the road does not
        reach that far, it is as far as it does.
        """
        offset, wanted = last.offset, 0.0 if plateau is None else plateau.offset
        if blocker.walks or wanted * offset < 0.0 or self._meets_another(blocker, offset):
            return None
        if blocker.clearance(offset) < 0.0:  # it is in the way there, too: it is stopped for
            return None
        window, speed = situation.window, situation.speed
        back = way_back(Lateral(offset, 0.0, 0.0), last.end, speed, window, self._shape, self._config)
        out = blend_length(wanted, speed, self._config)
        begin, end, _ = self._passed_at(blocker, offset)
        if begin > last.end + back.length + out:
            return None
        least = self._config.nudge_clearance_least
        room = room_beside(blocker, window, speed, least, self._shape, self._config)
        offset = min(max(offset, room.road_right), room.road_left)
        if abs(wanted) >= abs(offset) or blocker.clearance(offset) < blocker.clearance(wanted):
            return None
        if not room.is_in_lane(offset) and not self._may_leave_lane(blocker, offset, 0.0, situation):
            return None
        return Plateau(max(begin, last.begin), max(end, last.begin), offset)

    def _reconciled(self, passed: Sequence[tuple[Blocker, Plateau]], standing: Beside) -> list[tuple[Blocker, Plateau]]:
        """Where others, soon before or after one, could not be passed as far aside as it, it is as little as need be.

        Beside it, the ego stays as far aside as it is. Those that are stopped for do not count.
        """
        if not passed:
            return []
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

    def _gone_by(
        self, found: Sequence[Blocker], passed: Sequence[tuple[Blocker, Plateau]], situation: Situation
    ) -> list[tuple[Blocker, Plateau]]:
        """Those in the way on the line whom the ego, half-way to it, is beside: it stays where it is until past them.

        They may wait in traffic, and are not passed otherwise.
        """
        offset, decided = situation.lateral.offset, {blocker.track for blocker, _ in passed}
        return [
            (blocker, self._passed_at(blocker, offset)._replace(begin=0.0))
            for blocker in found
            if blocker.low < self._shape.front
            and abs(situation.scene.now.offsets[blocker.row]) < IN_LANE
            and blocker.clearance(0.0) < 0.0 <= blocker.clearance(offset)
            and not (blocker.walks or blocker.track in decided)
        ]

    def _passed_at(self, blocker: Blocker, offset: float) -> Plateau:
        """Where to be at an offset to pass an object that stands."""
        begin = blocker.low - self._shape.front - LENGTHWISE
        return Plateau(begin, blocker.high + self._shape.rear_overhang + LENGTHWISE, offset)

    def _choices(self, blocker: Blocker, situation: Situation) -> Iterator[float]:
        """Offsets to pass at, best first: on the side of the last cycle if that still works, else the smaller one.

        While there is no room beside for the wanted clearance, the room that the lane leaves will do if it is enough,
        or else part of it, down to the least clearance: some of it can be reached in time.
        """
        hold, least = self._config.nudge_hold, self._config.nudge_clearance_least
        if blocker.track in self._held:
            least -= _UNSURE
        room = room_beside(blocker, situation.window, situation.speed, least, self._shape, self._config)
        held = self._held_offset(blocker.track)
        begun = 0.0 if room.is_in_lane(held, hold) else held
        turns_in = self._staying.turns_in(blocker, situation)
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
            for less in (tight + share * (offset - tight) for share in _SHARES):
                if (may_pass and room.is_in_lane(less)) or self._may_leave_lane(blocker, less, begun, situation):
                    yield held if abs(less - held) < hold and self._clears(blocker, held) else less

    def _held_offset(self, track: int) -> float:
        """The offset of the last cycle; 0 without one."""
        return self._held[track].offset if track in self._held else 0.0

    def _held_begin(self, track: int, situation: Situation) -> float:
        """Where the plateau of the last cycle begins, in this cycle's window [m]; there has to be one."""
        return self._held[track].begin - situation.window.station

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

    def _will_stay(self, blocker: Blocker, situation: Situation) -> bool:
        return self._staying.will_stay(blocker, situation, is_passing=bool(self._held))

    def _may_leave_lane(self, blocker: Blocker, offset: float, begun: float, situation: Situation) -> bool:
        """For what will not move by itself, when the other lane is free; always to finish what was `begun`.

        That is the offset of the last cycle if it is beyond the lane, else 0.
        """
        if (
            begun * offset > 0.0
            and abs(offset) <= abs(begun) + self._config.nudge_hold
            and (blocker.track not in self._staying.since or situation.lateral.offset / offset > _COMMITTED)
        ):
            return True
        return self._will_stay(blocker, situation) and self._sides.has_been_free(blocker, offset, situation)

    def _sparing(self, blocker: Blocker, offset: float, situation: Situation) -> float:
        """The offset within the lane, or a smaller one: who moves on that side is to have as much room as the ego."""
        scene, least = situation.scene, self._config.nudge_clearance_least
        is_beyond = (scene.futures.offsets[: scene.moving, 0] - offset) * offset > 0.0
        if is_beyond.any() and (is_beyond & self._sides.taking(blocker, offset, least, situation)).any():
            return self._tightened(blocker, offset)
        return offset
