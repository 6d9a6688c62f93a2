"""Which messages of a drive a defect changed.

Of a fault, the record tells. A bug's are those of which the fixed build, in the same state and on the
same input, says something else: the component is run again over the recorded input, and at every
message a copy of it is turned into the fixed build and asked as well.
"""

import copy
import pickle
from collections.abc import Callable, Iterator
from typing import Protocol, cast

from dvca_sumo.bench.cases import Case
from dvca_sumo.engine.replay import roadmap
from dvca_sumo.messages import Component, Message, PredictedObjects, TrackedObjects
from dvca_sumo.record import Digest, Record
from dvca_sumo.run import Task
from dvca_sumo.scenario import Scenario
from dvca_sumo.stack.bugs import build_with
from dvca_sumo.stack.reference import Stack, StackConfig, StackContext, reference_stack

_Step = Callable[..., Message]
_Path = tuple[str, ...]


class _Stepping(Protocol):
    step: _Step


class NotRecomputedError(RuntimeError):
    """A component, run again over its recorded input, said something else than in the drive."""


def altered_messages(case: Case, scenario: Scenario, record: Record, jitter: int | None = None) -> tuple[int, ...]:
    """Indices of the messages of `case.component` that the defect changed, ascending.

    Args:
        case: Tells the defect.
        scenario: That was driven.
        record: Of the drive.
        jitter: Of the drive; see `Task`.

    Raises:
        NotRecomputedError: A bug's drive cannot be recomputed.
    """
    if not case.bug:
        return tuple(sorted(set(record.altered[case.component])))
    known = roadmap(scenario.configuration.net, "passenger")  # only prediction reads it, and no bug is there
    context = StackContext(known, record.route, record.moments[0].shape, Task(scenario, jitter=jitter).seed)
    buggy = reference_stack(context, build_with(case.bug, StackConfig()))
    fixed = reference_stack(context, StackConfig())
    ours, theirs = (cast("_Stepping", getattr(stack, case.component.value)) for stack in (buggy, fixed))
    switched = tuple(_switched(ours, theirs))
    altered = []
    for index, (words, said) in enumerate(_inputs(case.component, buggy, record)):
        twin = copy.deepcopy(ours, {id(shared): shared for shared in (context.route, context.roadmap)})
        for path, value in switched:
            _set(twin, path, value)
        if not _is_same(ours.step(*words), said):
            raise NotRecomputedError(f"{case.name}: message {index} of {case.component} comes out different")
        if not _is_same(twin.step(*words), said):
            altered.append(index)
    return tuple(altered)


def _switched(one: object, other: object, path: _Path = ()) -> Iterator[tuple[_Path, object]]:
    """Where two fresh builds differ, and what the other one has there: configuration, and what is derived from it."""
    for name, value in vars(one).items():
        theirs = getattr(other, name)
        if value is theirs or pickle.dumps(value) == pickle.dumps(theirs):
            continue
        if hasattr(value, "__dict__"):
            yield from _switched(value, theirs, (*path, name))
        else:
            yield (*path, name), theirs


def _set(holder: object, path: _Path, value: object) -> None:
    for name in path[:-1]:
        holder = getattr(holder, name)
    setattr(holder, path[-1], value)


def _inputs(component: Component, stack: Stack, record: Record) -> Iterator[tuple[tuple[object, ...], Message | None]]:
    """What each message of `component` was made of, and what it said."""
    for execution in record.executions[component]:
        tick = execution.tick
        believed = record.believed_at(tick)
        if component is Component.PERCEPTION:
            words: tuple[object, ...] = (stack.sensors.detections(record.moment_at(tick), tick // 10), believed)
        else:
            assert component is Component.PLANNING  # as above
            predicted, tracked = record.latest(Component.PREDICTION, tick), record.latest(Component.PERCEPTION, tick)
            assert isinstance(predicted, PredictedObjects)
            assert isinstance(tracked, TrackedObjects)
            words = (believed, predicted, tracked.signals)
        yield words, execution.message


def _is_same(one: Message, other: Message | None) -> bool:
    return Digest().step(one) == Digest().step(other)
