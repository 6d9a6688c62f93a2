"""Component level: which component, by the vector of counterfactuals (Algorithm 1, steps 2 and 3).

The questions are asked from the violation backwards: is it prevented when the last 1, 2, 4, 8 ... s are
ideal? Only what stays unprevented falls back to substitution of the whole drive. Each step rests on an
assumption of monotonicity:

- in time: what prevents the violation from t on prevents it from any earlier t on too, so the first
  SAFE answer going backwards stands for Definition 10's substitution of the whole component;
- in components: what one ideal component prevents, all four together prevent at least as late, so
  single substitutions are not asked later than where all four are enough.

The conclusion itself rests on none: it is confirmed at two adjacent messages, and a certified run asks
the whole-component question as well.
"""

import enum
import math
from collections.abc import Mapping, Sequence

import msgspec

from dvca_sumo.analysis.bisection import Outcome
from dvca_sumo.analysis.dtest import Dtest, Question
from dvca_sumo.messages import Component, MessageId
from dvca_sumo.record import MessageMark, Record

# In the order of the data flow: an idealized component may hide the fault of one before it.
SUBSTITUTABLE = (Component.LOCALIZATION, Component.PERCEPTION, Component.PREDICTION, Component.CONTROL)

_NEARLY_WHOLE = 1.5  # times a lookback: a drive that is not longer than this is asked as a whole
_VECTOR = 4.0  # [s] before the violation from which single substitutions are shown when none can be enough


class Verdict(enum.StrEnum):
    """What an attribution concludes."""

    NONE = "none"  # there is nothing to attribute
    COMPONENT = "component"
    PLANNING = "planning"
    UNRESOLVED = "unresolved"
    NOT_REPRODUCIBLE = "not_reproducible"


class ComponentAnswer(msgspec.Struct, frozen=True):
    """The vector of counterfactuals, and what follows from it."""

    verdict: Verdict
    component: Component | None
    alternatives: tuple[Component, ...]  # further single substitutions that suffice
    all_ideal: Outcome
    singles: dict[Component, Outcome]  # at the earliest time they were asked for ...
    since: float  # [s] ... which is this one
    reason: str


def responsible_component(dtest: Dtest, record: Record, time: float) -> ComponentAnswer:
    """Ask the all-ideal question and the four single ones, backwards from the violation at `time` [s], and conclude.

    Planning, when the violation stays although everything else is ideal from the start. That is asked even
    where all four are enough later on but no single one ever is: a perfect hand may save in the last
    second what was planned wrong. Otherwise the most upstream component whose substitution alone is
    enough, since a substitute downstream can hide a fault upstream; the others that are enough are
    alternatives, among which `last_chance` decides.
    """
    search = _Backwards(dtest, record, time)
    all_ideal = search.gallop_together()
    singles = search.gallop_singly() if all_ideal is Outcome.SAFE else search.vector()
    if all_ideal is Outcome.SAFE and Outcome.SAFE not in singles.values():
        all_ideal = search.together_from_the_start()
    return concluded(all_ideal, singles, search.since)


def mark_before(record: Record, component: Component, time: float, back: float | None) -> MessageMark | None:
    """The first message of `component` from `back` [s] before `time` on; None where that is its first of all.

    A component that made any must have made one from then on.
    """
    if back is None:
        return None
    index = record.first_at(component, time - back)
    return record.mark(MessageId(component, index)) if index > 0 else None


def lookbacks(start: float, time: float) -> list[float | None]:
    """1, 2, 4, 8 ... s before `time`, as long as that leaves a good part of the drive; then None, the whole drive."""
    found: list[float | None] = []
    back = 1.0
    while time - _NEARLY_WHOLE * back > start:
        found.append(back)
        back *= 2.0
    return [*found, None]


class _Backwards:
    """The questions of one attribution, asked at earlier and earlier levels."""

    def __init__(self, dtest: Dtest, record: Record, time: float) -> None:
        self._dtest = dtest
        self._record = record
        self._time = time
        self._levels = lookbacks(record.start, time)
        self._enough = 0  # level at which all four are enough
        self.since = -math.inf  # [s] from when on single substitutions were asked for last

    def gallop_together(self) -> Outcome:
        """All four ideal: SAFE at the first level that is, else what the whole drive says."""
        outcome = Outcome.UNRESOLVED
        for level in range(len(self._levels)):
            (outcome,) = self._ask([SUBSTITUTABLE], level)
            self._enough = level
            if outcome is Outcome.SAFE:
                break
        return outcome

    def together_from_the_start(self) -> Outcome:
        """All four ideal for the whole drive."""
        (outcome,) = self._ask([SUBSTITUTABLE], len(self._levels) - 1)
        return outcome

    def gallop_singly(self) -> dict[Component, Outcome]:
        """Each alone, from where all four are enough, to where one of them is."""
        level, outcomes = self._enough, self._singly(self._enough)
        while Outcome.SAFE not in outcomes.values() and level + 1 < len(self._levels):
            level += 1
            outcomes = self._singly(level)
        return outcomes

    def vector(self) -> dict[Component, Outcome]:
        """Each alone, over the last seconds: to be seen, not to conclude from."""
        level = next((row for row, back in enumerate(self._levels) if back is None or back >= _VECTOR), 0)
        return self._singly(level)

    def _singly(self, level: int) -> dict[Component, Outcome]:
        self.since = self._time - (self._levels[level] or math.inf)
        answers = self._ask([(component,) for component in SUBSTITUTABLE], level)
        return dict(zip(SUBSTITUTABLE, answers, strict=True))

    def _ask(self, ideals: Sequence[tuple[Component, ...]], level: int) -> list[Outcome]:
        back = self._levels[level]
        marks = [mark_before(self._record, ideal[0], self._time, back) for ideal in ideals]
        return self._dtest.ask_all([Question(ideal, mark) for ideal, mark in zip(ideals, marks, strict=True)])


def concluded(all_ideal: Outcome, singles: dict[Component, Outcome], since: float = -math.inf) -> ComponentAnswer:
    """What the vector of counterfactuals says; see `responsible_component`.

    `since` [s] is from when on single substitutions were asked for: by default, from the start.
    """
    enough = _enough(singles)

    def answer(verdict: Verdict, component: Component | None, reason: str) -> ComponentAnswer:
        others = tuple(one for one in enough if one is not component)
        return ComponentAnswer(verdict, component, others, all_ideal, singles, since, reason)

    if all_ideal is Outcome.VIOLATES:
        reason = "the violation stays although every other component is ideal"
        return answer(Verdict.PLANNING, Component.PLANNING, reason)
    doubtful = [one for one in SUBSTITUTABLE if singles[one] is Outcome.UNRESOLVED]
    if not enough:
        if all_ideal is Outcome.UNRESOLVED:
            return answer(Verdict.UNRESOLVED, None, "the run with all components ideal could not be told")
        if doubtful:
            reason = f"runs with ideal {', '.join(doubtful)} could not be told, and no other substitution prevents it"
            return answer(Verdict.UNRESOLVED, None, reason)
        reason = "no single substitution prevents it, all together do: more than one component takes part"
        return answer(Verdict.UNRESOLVED, None, reason)
    if doubtful and SUBSTITUTABLE.index(doubtful[0]) < SUBSTITUTABLE.index(enough[0]):
        reason = f"the run with ideal {doubtful[0]} could not be told, and it lies upstream of {enough[0]}"
        return answer(Verdict.UNRESOLVED, None, reason)
    return answer(Verdict.COMPONENT, enough[0], f"ideal {enough[0]} alone prevents it")


def named_instead(answer: ComponentAnswer, component: Component) -> ComponentAnswer:
    """The same vector, concluded from by the last chance: `component` could still have prevented it later."""
    enough = {one for one in SUBSTITUTABLE if answer.singles[one] is Outcome.SAFE} - {component}
    return msgspec.structs.replace(
        answer,
        component=component,
        alternatives=tuple(one for one in SUBSTITUTABLE if one in enough),
        reason=f"ideal {component} alone prevents it, and still does when it is too late for {answer.component}",
    )


def planning_named_instead(answer: ComponentAnswer) -> ComponentAnswer:
    """The same vector, where planning put out what nobody can follow: who saves the ego from that is not to blame."""
    enough = _enough(answer.singles)
    return msgspec.structs.replace(
        answer,
        verdict=Verdict.PLANNING,
        component=Component.PLANNING,
        alternatives=enough,
        reason=f"ideal {', '.join(enough)} prevents it, but planning put out what cannot be followed",
    )


def undecided(answer: ComponentAnswer, reason: str) -> ComponentAnswer:
    """The same vector, where a run that decides between those that are enough could not be told."""
    return msgspec.structs.replace(
        answer, verdict=Verdict.UNRESOLVED, component=None, alternatives=_enough(answer.singles), reason=reason
    )


def _enough(singles: Mapping[Component, Outcome]) -> tuple[Component, ...]:
    """Those that prevent it alone."""
    return tuple(one for one in SUBSTITUTABLE if singles[one] is Outcome.SAFE)
