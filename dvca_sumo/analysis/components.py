"""Component level: which component, by the vector of counterfactuals (Algorithm 1, steps 2 and 3)."""

import enum

import msgspec

from dvca_sumo.analysis.bisection import Outcome
from dvca_sumo.analysis.dtest import Dtest, Question
from dvca_sumo.messages import Component

# In the order of the data flow: an idealized component may hide the fault of one before it.
SUBSTITUTABLE = (Component.LOCALIZATION, Component.PERCEPTION, Component.PREDICTION, Component.CONTROL)

ALL_IDEAL = Question(SUBSTITUTABLE)


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
    singles: dict[Component, Outcome]
    reason: str


def responsible_component(dtest: Dtest) -> ComponentAnswer:
    """Ask the all-ideal question and the four single ones, and conclude.

    Planning, when the violation stays although everything else is ideal. Otherwise the most upstream
    component whose substitution alone is enough; the others that are enough are alternatives, since a
    substitute downstream can hide a fault upstream, never the reverse.
    """
    outcomes = dtest.ask_all([ALL_IDEAL, *(Question((component,)) for component in SUBSTITUTABLE)])
    all_ideal, singles = outcomes[0], dict(zip(SUBSTITUTABLE, outcomes[1:], strict=True))
    enough = tuple(component for component in SUBSTITUTABLE if singles[component] is Outcome.SAFE)

    def answer(verdict: Verdict, component: Component | None, reason: str) -> ComponentAnswer:
        others = tuple(one for one in enough if one is not component)
        return ComponentAnswer(verdict, component, others, all_ideal, singles, reason)

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
