"""dtest: would the violation still occur if these messages had been ideal?

One object wraps every question: it turns a question into runs, caches and counts them, keeps each as
evidence, and tells progress.
"""

from collections import Counter
from collections.abc import Callable, Sequence

import msgspec

from dvca_sumo.analysis.bisection import Outcome
from dvca_sumo.engine.processes import Failure
from dvca_sumo.engine.protocol import Engine, Glimpse
from dvca_sumo.geometry.randomness import key_of
from dvca_sumo.interventions import Fault, Futures, Ideal, Selection, State
from dvca_sumo.messages import Component
from dvca_sumo.record import TICK, MessageMark
from dvca_sumo.run import StopRule, Task
from dvca_sumo.scenario import Scenario
from dvca_sumo.violations import Answer, Judgement, Violation

_QUOTED_LINES = 3  # of a failed run's standard error

_Run = tuple[tuple[Component, ...], Selection]


class Question(msgspec.Struct, frozen=True):
    """Are the messages of `ideal` from `since` on (None: all of them), being ideal, enough for a safe run?"""

    ideal: tuple[Component, ...]
    since: MessageMark | None = None


class Probe(msgspec.Struct, frozen=True):
    """One run of one question: evidence."""

    id: int
    question: Question
    jitter: int | None
    outcome: Outcome
    violation: Violation | None
    reason: str  # why it is unresolved
    simulated: float  # [s]
    wall: float  # [s]
    digest: str | None
    last_step: bytes  # see Glimpse
    steps: int
    passes: int
    residual: float | None  # [m] see Glimpse


class Setting(msgspec.Struct, frozen=True):
    """What all probes of one attribution share."""

    scenario: Scenario
    faults: tuple[Fault, ...]
    futures: Futures  # of the factual run, continued past the violation
    stop: StopRule  # a probe without a violation up to there is safe
    start: float  # [s] the ego's departure
    is_mission: bool  # the factual violation is one that only a finished drive can answer
    jitters: tuple[int | None, ...]  # numbers of the runs of each question; (None,) in exact mode
    untold: tuple[str, ...] = ()  # oracles that could not tell of the factual run: no probe is held to what they say


class Dtest:
    """Asks counterfactual questions of an engine."""

    def __init__(self, engine: Engine, setting: Setting, on_probe: Callable[[Probe], None], first_id: int = 0) -> None:
        self._engine = engine
        self._setting = setting
        self._on_probe = on_probe
        self._answers: dict[_Run, Outcome] = {}
        self._first_id = first_id
        self.probes: list[Probe] = []

    @property
    def futures(self) -> Futures:
        """Of the factual run."""
        return self._setting.futures

    @property
    def until(self) -> float:
        """A probe without a violation up to there is safe [s]."""
        return self._setting.stop.at

    def ask(self, question: Question) -> Outcome:
        """The outcome of one question; asked before, it costs nothing."""
        return self.ask_all([question])[0]

    def ask_all(self, questions: Sequence[Question]) -> list[Outcome]:
        """The outcomes of several questions, run side by side.

        Probe ids follow the order of the questions, not of their finishing.
        """
        asked: dict[_Run, Question] = {}
        for question in questions:
            asked.setdefault(self._run(question), question)
        new = [question for run, question in asked.items() if run not in self._answers]
        runs = [(question, self._drawn(question, number)) for question in new for number in self._setting.jitters]
        first = self._first_id + len(self.probes)

        heard: dict[int, Probe] = {}

        def hear(row: int, answer: Glimpse | Failure) -> None:
            heard[row] = _probe(first + row, *runs[row], answer, self._setting)
            self._on_probe(heard[row])

        try:
            self._engine.glimpses([self._task(question, jitter) for question, jitter in runs], hear)
        finally:  # who is interrupted keeps what was answered before
            probes = [heard[row] for row in sorted(heard)]
            self.probes += probes
        for question in new:
            outcomes = [one.outcome for one in probes if one.question == question]
            self._answers[self._run(question)] = majority(outcomes)
        return [self._answers[self._run(question)] for question in questions]

    def known(self, component: Component) -> dict[int, Outcome]:
        """What is known already of substituting `component` alone, by the index of the first message."""
        questions = (probe.question for probe in self.probes if probe.question.ideal == (component,))
        return {
            0 if question.since is None else question.since.index: self._answers[self._run(question)]
            for question in questions
        }

    def evidence(self, question: Question) -> Probe | None:
        """The first probe of a question, among those that agree with its answer; None when it was not asked."""
        run = self._run(question)
        if run not in self._answers:
            return None
        outcome = self._answers[run]
        of_question = [probe for probe in self.probes if self._run(probe.question) == run]
        return next((probe for probe in of_question if probe.outcome is outcome), of_question[0])

    def _run(self, question: Question) -> _Run:
        """What is run for a question: asked in other words, it is the same one."""
        return question.ideal, self._selection(question.since)

    def _drawn(self, question: Question, number: int | None) -> int | None:
        """Which schedule and noise a run of a question has: others than any other run, whatever was asked before."""
        if number is None:
            return None
        return key_of(msgspec.json.encode((self._run(question), number)).decode())

    def _task(self, question: Question, jitter: int | None) -> Task:
        ideals = [Ideal(component, self._selection(question.since)) for component in question.ideal]
        return Task(
            scenario=self._setting.scenario,
            interventions=(*self._setting.faults, *ideals),
            stop=self._setting.stop,
            futures=self._setting.futures,
            jitter=jitter,
        )

    def _selection(self, since: MessageMark | None) -> Selection:
        if since is None:
            return Selection()
        if self._setting.jitters == (None,):
            # Runs are bit-exact: the messages of both are made at the same ticks, whatever the component.
            return Selection(start=since.time - self._setting.start - TICK / 2.0)
        return Selection(from_state=State(*since.state))


def majority(outcomes: Sequence[Outcome]) -> Outcome:
    """What more than half of the runs say; UNRESOLVED when no outcome has that many."""
    outcome, count = Counter(outcomes).most_common(1)[0]
    return outcome if 2 * count > len(outcomes) else Outcome.UNRESOLVED


def _probe(number: int, question: Question, jitter: int | None, answer: Glimpse | Failure, setting: Setting) -> Probe:
    if isinstance(answer, Failure):
        reason = "; ".join([answer.reason, *answer.said.splitlines()[-_QUOTED_LINES:]])
        return Probe(number, question, jitter, Outcome.UNRESOLVED, None, reason, 0.0, 0.0, None, b"", 0, 0, None)
    outcome, reason = outcome_of(answer, setting)
    return Probe(
        id=number,
        question=question,
        jitter=jitter,
        outcome=outcome,
        violation=answer.violations[0] if answer.violations else None,
        reason=reason,
        simulated=answer.simulated,
        wall=answer.wall,
        digest=answer.digest,
        last_step=answer.last_step,
        steps=answer.steps,
        passes=answer.passes,
        residual=answer.residual,
    )


def outcome_of(answer: Glimpse, setting: Setting) -> tuple[Outcome, str]:
    """What a counterfactual run says, and why it says nothing when it is UNRESOLVED."""
    if answer.violations:
        return Outcome.VIOLATES, ""
    blind = [one for one in could_not_tell(answer.judgements) if one.kind not in setting.untold]
    if setting.is_mission:
        blind += [one for one in answer.judgements if one.answer is Answer.UNKNOWN and one.needs_end]
    if blind:
        return Outcome.UNRESOLVED, "; ".join(f"{one.kind}: {one.reason}" for one in blind)
    return Outcome.SAFE, ""


def could_not_tell(judgements: Sequence[Judgement]) -> list[Judgement]:
    """What oracles could not tell, whose rules hold all along a drive, however early it ends."""
    return [one for one in judgements if one.answer is Answer.UNKNOWN and not one.needs_end]
