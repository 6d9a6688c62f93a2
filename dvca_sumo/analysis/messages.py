"""Message level: the last message of the responsible component that could still have prevented it (Definition 11)."""

from collections.abc import Callable

import msgspec

from dvca_sumo.analysis.bisection import Bracket, Outcome, bisect
from dvca_sumo.analysis.dtest import Dtest, Question
from dvca_sumo.messages import Component, MessageId
from dvca_sumo.record import MessageMark, Record


class MessageAnswer(msgspec.Struct, frozen=True):
    """The proven interval: ideal from `last_safe` on is SAFE, from `first_violating` on VIOLATES."""

    last_safe: MessageMark
    first_violating: MessageMark | None  # None: ideal after the last message before the violation, i.e. not at all
    is_adjacent: bool
    is_monotone: bool  # as far as was asked
    note: str
    proof: tuple[Question, ...]  # what was asked at the two ends; the run as driven is no question


def violation_inducing_message(
    dtest: Dtest, record: Record, component: Component, time: float, *, is_exact: bool
) -> MessageAnswer:
    """Bisect over the vehicle dynamic states of `component`'s messages, then over messages.

    Whole-run substitution must have been asked and be SAFE. In exact mode the search ends on adjacent
    messages; else on adjacent states, of which the last message of the safe one is meant. Monotonicity
    is assumed inside the bracket, and checked one state to either side of the states where it ends.
    A substitution from a state on begins where a run first meets it, so states met again are not asked of.

    Args:
        dtest: To ask.
        record: The factual run.
        component: The responsible one.
        time: [s] of the violation: a substitution after it is none.
        is_exact: Whether runs repeat bit for bit.
    """
    marks = _marks(record, component, time)
    states = _first_of_states(marks)
    if not is_exact:
        states = sorted({marks[row].state: row for row in reversed(states)}.values())

    def question(index: int) -> Question:
        return Question((component,), marks[index] if index > 0 else None)

    def test(index: int) -> Outcome:
        return dtest.ask(question(index))

    # M[c][0:] is the whole component, M[c][len:] nothing at all: both ends are proven already.
    whole = Bracket(0, len(marks))
    between_states = bisect(test, whole, states)
    bracket = bisect(test, between_states) if is_exact else between_states
    is_monotone = _agrees(test, states, between_states)
    low = bracket.low
    if not is_exact:
        state = marks[bracket.low].state
        low = max(index for index in range(bracket.low, bracket.high) if marks[index].state == state)
    is_adjacent = bracket.high == bracket.low + 1 if is_exact else _are_neighbours(states, bracket, len(marks))
    note = "" if is_adjacent else "messages in between could not be told"
    if not is_monotone:
        note = "the outcome is not monotone in the first substituted message" + (f"; {note}" if note else "")
    return MessageAnswer(
        last_safe=marks[low],
        first_violating=marks[bracket.high] if bracket.high < len(marks) else None,
        is_adjacent=is_adjacent,
        is_monotone=is_monotone,
        note=note,
        proof=tuple(question(end) for end in (bracket.low, bracket.high) if end < len(marks)),
    )


def _marks(record: Record, component: Component, time: float) -> list[MessageMark]:
    marks = [record.mark(MessageId(component, index)) for index in range(len(record.executions[component]))]
    return [mark for mark in marks if mark.time <= time]


def _first_of_states(marks: list[MessageMark]) -> list[int]:
    """Index of the first message in each stretch of one state."""
    return [row for row, mark in enumerate(marks) if row == 0 or mark.state != marks[row - 1].state]


def _are_neighbours(states: list[int], bracket: Bracket, count: int) -> bool:
    ends = [*states, count]
    return ends.index(bracket.high) == ends.index(bracket.low) + 1


def _agrees(test: Callable[[int], Outcome], states: list[int], bracket: Bracket) -> bool:
    before = [one for one in states if 0 < one < bracket.low]
    after = [one for one in states if one > bracket.high]
    is_safe_before = not before or test(before[-1]) is not Outcome.VIOLATES
    return is_safe_before and (not after or test(after[0]) is not Outcome.SAFE)
