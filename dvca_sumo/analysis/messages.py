"""Message level: the last message of the responsible component that could still have prevented it (Definition 11)."""

import msgspec

from dvca_sumo.analysis.bisection import Bracket, Outcome, best_share, bisect
from dvca_sumo.analysis.dtest import Dtest, Question
from dvca_sumo.interventions import State
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
    latest: float  # [s] of the last message that no question can tell from `last_safe`: itself where runs repeat


def violation_inducing_message(
    dtest: Dtest, record: Record, component: Component, time: float, until: float, *, is_exact: bool
) -> MessageAnswer:
    """Bisect over the vehicle dynamic states of `component`'s messages, then over messages.

    Starts from what is known of the component: SAFE when ideal from some message on, and VIOLATES from a
    later one on or, as the factual run shows, when not ideal at all. In exact mode the search ends on
    adjacent messages; else on adjacent states.
    A substitution from a state on begins where that state is first met: there alone it can be asked for, and
    the message made there is the last that is proven. An ego at rest stays in its state as long as it waits.
    Monotonicity is assumed inside the bracket, and checked against all that was asked, one state to
    either side of where the search ends included.

    Args:
        dtest: To ask; must know of one substitution of `component` that is SAFE.
        record: The factual run.
        component: The responsible one.
        time: [s] of the violation: a substitution after it is none.
        until: [s] at which a safe run ends; inf: with the drive.
        is_exact: Whether runs repeat bit for bit.
    """
    marks = _marks(record, component, time)
    begins = list(range(len(marks))) if is_exact else _first_visits(marks)
    states = [row for row in _first_of_states(marks) if begins[row] == row]

    def question(index: int) -> Question:
        return Question((component,), marks[index] if index > 0 else None)

    def test(index: int) -> Outcome:
        return dtest.ask(question(index))

    def known() -> dict[int, Outcome]:
        return {begins[index]: outcome for index, outcome in dtest.known(component).items()}

    bracket = _bracket(known(), len(marks))
    begin = marks[bracket.low].time
    # Branches run from where they substitute; runs from time 0 cost the same whatever the answer.
    share = best_share(min(until, record.moments[-1].time) - begin, time - begin) if is_exact else 0.5
    bracket = bisect(test, bracket, states, share)
    if is_exact:
        bracket = bisect(test, bracket, share=share)
    dtest.ask_all([question(one) for one in _around(states, dtest.known(component), bracket)])
    is_monotone = _is_monotone(known(), bracket)
    latest = bracket.low
    if not is_exact:
        state = marks[bracket.low].state
        latest = max(index for index in range(bracket.low, bracket.high) if marks[index].state == state)
    is_adjacent = bracket.high == bracket.low + 1 if is_exact else _are_neighbours(states, bracket, len(marks))
    note = "" if is_adjacent else "messages in between could not be told"
    if not is_monotone:
        note = "the outcome is not monotone in the first substituted message" + (f"; {note}" if note else "")
    return MessageAnswer(
        last_safe=marks[bracket.low],
        first_violating=marks[bracket.high] if bracket.high < len(marks) else None,
        is_adjacent=is_adjacent,
        is_monotone=is_monotone,
        note=note,
        proof=tuple(question(end) for end in (bracket.low, bracket.high) if end < len(marks)),
        latest=marks[latest].time,
    )


def _marks(record: Record, component: Component, time: float) -> list[MessageMark]:
    marks = [record.mark(MessageId(component, index)) for index in range(len(record.executions[component]))]
    return [mark for mark in marks if mark.time <= time]


def _first_of_states(marks: list[MessageMark]) -> list[int]:
    """Index of the first message in each stretch of one state."""
    return [row for row, mark in enumerate(marks) if row == 0 or mark.state != marks[row - 1].state]


def _first_visits(marks: list[MessageMark]) -> list[int]:
    """For each message, the index of the first one made in its state."""
    first: dict[State, int] = {}
    return [first.setdefault(mark.state, row) for row, mark in enumerate(marks)]


def _bracket(known: dict[int, Outcome], count: int) -> Bracket:
    low = max(index for index, outcome in known.items() if outcome is Outcome.SAFE)
    later = [index for index, outcome in known.items() if outcome is Outcome.VIOLATES and index > low]
    return Bracket(low, min(later, default=count))


def _are_neighbours(states: list[int], bracket: Bracket, count: int) -> bool:
    between = [state for state in [*states, count] if bracket.low < state < bracket.high]
    return not between


def _around(states: list[int], known: dict[int, Outcome], bracket: Bracket) -> list[int]:
    """One state to either side, where nothing farther out was asked before."""
    before = [one for one in states if 0 < one < bracket.low] if min(known) >= bracket.low else []
    after = [one for one in states if one > bracket.high] if max(known) <= bracket.high else []
    return [*before[-1:], *after[:1]]


def _is_monotone(known: dict[int, Outcome], bracket: Bracket) -> bool:
    return not any(
        (outcome is Outcome.VIOLATES and index < bracket.low) or (outcome is Outcome.SAFE and index > bracket.high)
        for index, outcome in known.items()
    )
