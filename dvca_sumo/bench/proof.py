"""Is the reported message the one that decided it? Asked again, of an engine that the analysis did not use."""

from dvca_sumo.analysis.attribution import Attribution, setting_of
from dvca_sumo.analysis.bisection import Outcome
from dvca_sumo.analysis.components import SUBSTITUTABLE, mark_before
from dvca_sumo.analysis.dtest import Dtest, Question
from dvca_sumo.analysis.last_chance import FURTHER
from dvca_sumo.analysis.specification import first_unusable_plan, first_violating_plan
from dvca_sumo.api import FactualDrive
from dvca_sumo.messages import Component, MessageId


def is_proven(drive: FactualDrive, found: Attribution) -> bool:
    """Whether the definition of the violation-inducing message holds of the one that was reported.

    Of a planning message: it is the first that breaks the specification by itself, and the violation stays
    when everything else is ideal from the start, or from well before it; or nobody can follow it at all, and it
    is the first such of a row. Of any other: ideal from it on, the component prevents the violation; ideal from
    the next on, it does not (Definition 11). The runs begin at time 0.
    """
    mark, violation, record = found.message, found.violation, found.record
    if mark is None or violation is None:
        return False
    dtest = Dtest(drive.engine.witness, setting_of(drive.request, record, violation), lambda _probe: None)
    if mark.component is Component.PLANNING:
        unusable = first_unusable_plan(record, mark.time, violation.time)
        if unusable is not None and unusable.mark == mark:
            return True
        first = first_violating_plan(record, drive.engine.roadmap, record.thresholds, violation)
        if first is None or first.mark != mark:
            return False
        well_before = mark_before(record, SUBSTITUTABLE[0], violation.time, FURTHER)
        return Outcome.VIOLATES in dtest.ask_all([Question(SUBSTITUTABLE), Question(SUBSTITUTABLE, well_before)])
    following = mark.index + 1
    has_next = following < len(record.executions[mark.component])
    after = record.mark(MessageId(mark.component, following)) if has_next else None
    questions = [Question((mark.component,), mark if mark.index > 0 else None)]
    if after is not None and after.time <= violation.time:
        questions.append(Question((mark.component,), after))
    return dtest.ask_all(questions) == [Outcome.SAFE, Outcome.VIOLATES][: len(questions)]
