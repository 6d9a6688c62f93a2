"""Which of several components that are each enough alone was the last that could have prevented the violation.

Any ideal component may prevent a violation by luck, if it begins early enough: the ego is a little
elsewhere by then. The one at fault can prevent it until the last moment at which anything can. A
substitute upstream has gone through all components after it within a latency; so the responsible
component is the most upstream of those whose last chance is not earlier than that before the latest.

Ideal prediction knows what nobody can foresee, and ideal control moves as no vehicle does: both may find
a way out when others could no more. They are held responsible in place of localization or perception
only where, as they were, they let a violation happen in spite of true inputs from the last chance of
those, or from further back.

Where even that lies more than `PROMPT` before the violation, it is asked as well whether all four, ideal
from the start, prevent it: if not, the violation is planning's, and what helped was luck. Of control it is
asked in any case, from `FURTHER` before: in the last moment a perfect hand saves a plan that was wrong.

Where one of these questions could not be told, it is left open who is responsible.
"""

from collections.abc import Iterator

from dvca_sumo.analysis.bisection import Outcome
from dvca_sumo.analysis.components import SUBSTITUTABLE, ComponentAnswer, mark_before
from dvca_sumo.analysis.dtest import Dtest, Question
from dvca_sumo.analysis.messages import MessageAnswer, violation_inducing_message
from dvca_sumo.messages import Component
from dvca_sumo.record import Record

LATENCY = 0.15  # [s] a cycle of the components that run ten times a second, and a half
# [s] with jitter: besides, a cycle of drawn phases for each component in between, and a state's length at the
# beginning of either substitution, which runs enter at different moments.
LATENCY_OF_STATES = 0.6
PROMPT = 2.5  # [s]
FURTHER = 4.0  # [s]

_SENSING = (Component.LOCALIZATION, Component.PERCEPTION)
_BACK = (0.0, 1.0, 2.0, 4.0)  # [s] further back: that once all goes well may be luck, not that it does so each time


class UndecidedError(Exception):
    """A question that decides who is responsible could not be told."""

    def __init__(self, question: Question) -> None:
        since = "" if question.since is None else f" from {question.since.time:.2f} s on"
        said = f"the run with ideal {', '.join(question.ideal)}{since} could not be told"
        super().__init__(f"{said}, and it decides who is responsible")


def decisive(
    dtest: Dtest, record: Record, answer: ComponentAnswer, time: float, until: float, *, is_exact: bool
) -> tuple[Component, MessageAnswer]:
    """The component that had the last chance, and its last message that could have prevented the violation.

    Args:
        dtest: To ask; must know the single substitutions of `answer`.
        record: The factual run.
        answer: Names a component that is enough.
        time: [s] of the violation.
        until: [s] at which a safe run ends.
        is_exact: Whether runs repeat bit for bit.

    Raises:
        UndecidedError: See there.
    """
    component = answer.component
    assert component is not None  # see above
    seen = [component]
    while True:
        messages = violation_inducing_message(dtest, record, component, time, until, is_exact=is_exact)
        latency = LATENCY if is_exact else LATENCY_OF_STATES
        rival = next(_later(dtest, record, answer, seen, (messages.latest, latency), time), None)
        if rival is None:
            return component, messages
        seen.append(rival)
        component = rival


def is_by_luck(dtest: Dtest, record: Record, component: Component, messages: MessageAnswer, time: float) -> bool:
    """Whether all four, ideal from further back than the last chance of `component`, do not prevent the violation.

    Raises:
        UndecidedError: See there.
    """
    is_early = time - messages.latest > PROMPT
    if not is_early and component is not Component.CONTROL:
        return False
    since = None if is_early else mark_before(record, SUBSTITUTABLE[0], time, FURTHER)
    return not _is_prevented(dtest, Question(SUBSTITUTABLE, since))


def _later(
    dtest: Dtest, record: Record, answer: ComponentAnswer, seen: list[Component], last: tuple[float, float], time: float
) -> Iterator[Component]:
    """Components not `seen` that could have prevented it later than the last one that was.

    `last`: its last chance, and the latency [s]. Those upstream count as later up to the latency earlier. One
    that was not enough from where all were asked is not asked after that again; one that could not be told is.
    """
    component, (chance, latency) = seen[-1], last
    place = SUBSTITUTABLE.index(component)
    for other in (one for one in SUBSTITUTABLE[:place] if one not in seen):
        single = answer.singles[other]
        is_earlier = single is Outcome.VIOLATES and chance - latency < answer.since
        if (is_earlier or single is Outcome.UNRESOLVED) and _is_enough(dtest, record, other, chance - latency, time):
            yield other
    for other in (one for one in SUBSTITUTABLE[place + 1 :] if one not in seen):
        is_open = answer.singles[other] is not Outcome.VIOLATES
        if not is_open or not _is_enough(dtest, record, other, chance + latency, time):
            continue
        if other not in _SENSING and component in _SENSING and _do_their_best(dtest, record, chance):
            continue
        yield other


def _do_their_best(dtest: Dtest, record: Record, chance: float) -> bool:
    """Whether the others as they were prevent the violation, given the truth from `chance` [s] on or from before."""
    marks = [mark_before(record, _SENSING[0], chance, back) for back in _BACK]
    return all(_is_prevented(dtest, Question(_SENSING, mark)) for mark in marks)


def _is_enough(dtest: Dtest, record: Record, component: Component, since: float, time: float) -> bool:
    if record.first_at(component, since) == len(record.executions[component]):
        return False  # the drive ended before, and nothing would be replaced
    mark = mark_before(record, component, since, 0.0)
    if mark is not None and mark.time > time:
        return False
    return _is_prevented(dtest, Question((component,), mark))


def _is_prevented(dtest: Dtest, question: Question) -> bool:
    outcome = dtest.ask(question)
    if outcome is Outcome.UNRESOLVED:
        raise UndecidedError(question)
    return outcome is Outcome.SAFE
