"""Synthetic drives along a straight road, and an engine that answers from a formula instead of a simulation."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, cast

import numpy as np
from interventions.scenes import Thing, ego, estimate, moment, occasion, predicted, road, tracked, trajectory, walker
from msgspec.structs import replace

from dvca_sumo.analysis.attribution import Attribution, Progress, Request, explain
from dvca_sumo.analysis.dtest import Dtest, Probe, Setting
from dvca_sumo.engine.processes import Failure
from dvca_sumo.engine.protocol import Glimpse
from dvca_sumo.interventions import Fault, Futures, Gate, Ideal, planted_fault
from dvca_sumo.messages import COMPONENTS, Component, ControlCommand, Message, MessageId, Trajectory
from dvca_sumo.record import Execution, Record
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.run import StopRule, Task
from dvca_sumo.scenario import Scenario
from dvca_sumo.scenario.configuration import Configuration
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import EgoTruth
from dvca_sumo.violations import Answer, Category, Contact, Ending, Judgement, Violation

START = 5.0  # [s] departure of every drive
STOP = StopRule(after_violation=0.0, at=START + 12.0)
SCENARIO = Scenario(
    Configuration(Path("/scenarios/street.sumocfg"), {}, Path("/street.net.xml"), (), ()), "ego", 1, 0.0, None, ()
)

Answers = Callable[[Task], Glimpse | Failure]


class BareMap:
    """A map without lanes beside the route."""

    lanes: ClassVar[dict[str, Any]] = {}

    def lanes_near(self, points: np.ndarray, radius: float) -> list[tuple[str, ...]]:  # noqa: ARG002
        return [() for _ in points]


BARE_MAP = cast("RoadMap", BareMap())


def collision(time: float, name: str = "lead", contact: Contact | None = Contact.ACTIVE_FRONT) -> Violation:
    return Violation(
        "collision",
        Category.SAFETY,
        time,
        name,
        (60.0, 0.0),
        "in_0",
        0.0,
        0.0,
        f"{name} hit by the ego's front",
        contact,
    )


def breach(kind: str, category: Category, time: float, name: str | None = None) -> Violation:
    return Violation(kind, category, time, name, (60.0, 0.0), "in_0", 1.0, 0.5, f"{kind} of the test")


def drive(
    things: Sequence[Thing] = (),
    *,
    duration: float = 6.0,
    plan: Callable[[EgoTruth], Trajectory | None] = trajectory,
    violations: Sequence[Violation] = (),
    accelerations: Callable[[int], float] = lambda _tick: 0.0,
    ending: Ending = Ending.TIME_OVER,
) -> Record:
    """At 10 m/s from x = 20 on, whatever is planned, with five components that make no mistake; things keep moving."""
    path = [
        replace(ego(START + 0.01 * tick, 20.0 + 0.1 * tick), acceleration=accelerations(tick))
        for tick in range(round(duration * 100.0) + 1)
    ]
    executions: dict[Component, list[Execution]] = {component: [] for component in COMPONENTS}
    moments = []
    for tick, who in enumerate(path):
        if tick % 10 == 0:
            seen = [thing.after(who.time - START) for thing in things]
            moments.append(moment(seen, who))
            if tick < len(path) - 1:
                executions[Component.PERCEPTION].append(Execution(tick, tracked(seen, who.time)))
                executions[Component.PREDICTION].append(Execution(tick, predicted(seen, who.time)))
                executions[Component.PLANNING].append(Execution(tick, plan(who)))
        if tick < len(path) - 1:
            executions[Component.LOCALIZATION].append(Execution(tick, estimate(who)))
            executions[Component.CONTROL].append(Execution(tick, ControlCommand(who.time, 0.0, 0.0)))
    return Record(
        ego="ego",
        stops=(),
        route=road(length=600.0, destination=550.0),
        signed_lanes=frozenset(),
        thresholds=Thresholds(),
        sensor_range=80.0,
        start=START,
        executions=executions,
        altered={component: [] for component in COMPONENTS},
        path=path[:-1],
        stations=[who.x for who in path[:-1]],
        moments=moments,
        violations=list(violations),
        judgements=(Judgement("collision", Answer.VIOLATED if violations else Answer.KEPT, tuple(violations)),),
        ending=ending,
        simulated=START + duration,
        substituted=None,
        digests=[f"step {step}".encode() for step in range(len(moments) - 1)],
    )


def saying(record: Record, message: MessageId, said: Message | None) -> Record:
    """The same drive, but for one message."""
    executions = {component: list(made) for component, made in record.executions.items()}
    made = executions[message.component]
    made[message.index] = Execution(made[message.index].tick, said)
    return replace(record, executions=executions)


def glimpse(*violations: Violation, steps: int = 0, judgements: Sequence[Judgement] = ()) -> Glimpse:
    """What is kept of a run: safe without violations; `steps` of it are those of `drive`."""
    return Glimpse(
        violations=violations,
        judgements=tuple(judgements),
        ending=Ending.CUT,
        digest="0123456789abcdef0123456789abcdef",
        last_step=f"step {steps - 1}".encode(),
        steps=steps,
        simulated=10.0,
        wall=0.5,
        passes=1,
        residual=None,
    )


def unknown(kind: str, *, needs_end: bool = False) -> Judgement:
    return Judgement(kind, Answer.UNKNOWN, reason="it was dark", needs_end=needs_end)


SAFE = glimpse()
VIOLATING = glimpse(collision(START + 4.4))
CRASHED = Failure("killed by SIGSEGV", "Error: boom")


class FakeEngine:
    """Runs nothing; remembers what was asked. Results come in as late ones first."""

    name = "replay"
    fallback: str | None = None
    roadmap = BARE_MAP

    def __init__(self, answers: Answers, records: Sequence[Record | Exception] = ()) -> None:
        self._answers = answers
        self._records = iter(records)
        self.tasks: list[Task] = []

    @property
    def witness(self) -> "FakeEngine":
        return self

    def close(self) -> None:
        pass

    def record(self, task: Task) -> Record:  # noqa: ARG002
        made = next(self._records)
        if isinstance(made, Exception):
            raise made
        return made

    def glimpses(
        self, tasks: Sequence[Task], on_result: Callable[[int, Glimpse | Failure], None]
    ) -> list[Glimpse | Failure]:
        self.tasks += tasks
        answers = [self._answers(task) for task in tasks]
        for row in reversed(range(len(tasks))):
            on_result(row, answers[row])
        return answers


def ideals(task: Task) -> dict[Component, Ideal]:
    return {one.component: one for one in task.interventions if isinstance(one, Ideal)}


def asking(engine: FakeEngine, *, jitters: tuple[int | None, ...] = (None,), is_mission: bool = False) -> Dtest:
    setting = Setting(SCENARIO, (), Futures(), STOP, START, is_mission, jitters)
    heard: list[Probe] = []
    return Dtest(engine, setting, heard.append)


def first_substituted(record: Record, ideal: Ideal) -> int:
    """Index of the message of this drive at which a substitution begins; one past the last when it never does."""
    if ideal.selection.from_state is None:
        return record.first_at(ideal.component, START + ideal.selection.start)
    gate = Gate(ideal.selection)
    made = record.executions[ideal.component]
    for index in range(len(made)):
        mark = record.mark(MessageId(ideal.component, index))
        if gate.admits(occasion(index=index, elapsed=mark.time - START, state=mark.state, route=record.route)):
            return index
    return len(made)


def needing(record: Record, component: Component, last: int, violation: Violation) -> Answers:
    """A world in which `component` must be ideal from message `last` on, or earlier, for a safe run."""

    def answers(task: Task) -> Glimpse:
        ideal = ideals(task).get(component)
        is_safe = ideal is not None and first_substituted(record, ideal) <= last
        return SAFE if is_safe else glimpse(violation)

    return answers


MISS = "perception.miss"
FAULTY = planted_fault(MISS)
WALKER = walker("person:ped", 70.0, -1.7)
HIT = collision(START + 4.4, "person:ped")
FATAL = 29  # the last perception message that, being ideal, still prevents the hit


def faulty_drive(*violations: Violation) -> Record:
    """A drive in which perception misses a pedestrian from its tenth message on."""
    record = drive([WALKER], violations=violations or (HIT,), ending=Ending.CUT)
    record.altered[Component.PERCEPTION] = list(range(10, 60))
    for index in record.altered[Component.PERCEPTION]:
        time = record.mark(MessageId(Component.PERCEPTION, index)).time
        record = saying(record, MessageId(Component.PERCEPTION, index), tracked([], time))
    return record


def answering(record: Record, enough: Mapping[Component, int]) -> Answers:
    """A world where each of these components suffices if ideal from that message on, alone or with others."""

    def answers(task: Task) -> Glimpse:
        substituted = ideals(task)
        is_enough = any(
            component in substituted and first_substituted(record, substituted[component]) <= last
            for component, last in enough.items()
        )
        return SAFE if is_enough else glimpse(*record.violations[:1], steps=44)

    return answers


def attributed(
    record: Record,
    answers: Answers,
    *,
    faults: tuple[Fault, ...] = (),
    repeats: int | None = None,
    again: Sequence[Record | Exception] = (),
    witness: Answers | None = None,
    from_start: bool = False,
) -> Attribution:
    """The whole of an attribution; `again` is what further runs of the factual task leave."""
    engine, request = FakeEngine(answers, again), Request(SCENARIO, faults, repeats)
    second = None if witness is None else FakeEngine(witness)
    return explain(engine, request, record, Progress(), second, from_start=from_start)
