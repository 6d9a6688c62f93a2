"""What an oracle finds: violations, and its judgement of a whole run."""

import enum

import msgspec

from dvca_sumo.truth import whole


class Category(enum.StrEnum):
    """The three families of violations."""

    SAFETY = "safety"
    TRAFFIC_RULE = "traffic_rule"
    MISSION = "mission"


class Contact(enum.StrEnum):
    """Who touched whom, after nuPlan's collision types: the first two say that the other one ran into the ego."""

    STOPPED_EGO = "stopped_ego"  # the ego stood
    HIT_FROM_BEHIND = "hit_from_behind"  # the other one came from behind
    ACTIVE_FRONT = "active_front"  # the ego's front bumper is part of the contact
    ACTIVE_SIDE = "active_side"  # only a flank, or the rear of an ego that swings out or reverses


class Violation(msgspec.Struct, frozen=True):
    """One breach of one rule, as the ground truth shows it."""

    kind: str  # "collision", "speed_limit", ...
    category: Category
    time: float  # [s] when it was established; of the closest approach for "safe_distance"
    object: str | None  # id of the other party
    position: tuple[float, float]  # [m] centre of the ego's box at `time`
    lane: str | None  # the ego's lane at `time`, None off the road
    value: float | None  # what was measured, in the unit of `threshold`
    threshold: float | None  # what it had to keep
    detail: str  # one phrase for people
    contact: Contact | None = None  # collisions only

    @property
    def whom(self) -> str:
        """The other party, parts of what is drawn being one; empty where there is none."""
        return whole(self.object or "")


class Answer(enum.StrEnum):
    """The three answers to "was the rule kept?"."""

    KEPT = "kept"
    VIOLATED = "violated"
    UNKNOWN = "unknown"


class Judgement(msgspec.Struct, frozen=True):
    """An oracle's answer for a whole run."""

    kind: str  # of the oracle
    answer: Answer
    violations: tuple[Violation, ...] = ()  # by time; empty unless VIOLATED
    reason: str = ""  # why it could not tell; empty unless UNKNOWN
    needs_end: bool = False  # only a whole drive can answer: not known of one that is cut short is no reason for doubt


class Ending(enum.StrEnum):
    """How the run ended that is judged."""

    ARRIVED = "arrived"  # the ego stands at its destination
    TIME_OVER = "time_over"  # the longest allowed duration has passed
    CUT = "cut"  # stopped before either: what was still to come is not known
