"""Foreign stacks for tests, as `--stack small_stacks:NAME` finds them: the reference stack with one part exchanged."""

import faulthandler
import os
import signal
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import msgspec
import numpy as np

from dvca_sumo.messages import TRAJECTORY_TIMES, ControlCommand, LocalizationEstimate, PredictedObjects, Trajectory
from dvca_sumo.stack.protocols import Planning
from dvca_sumo.stack.reference import Stack, StackContext, reference_stack

CRASHING_SEED = 13


class Spoilt:
    """A component that does something else from its call number `call` on."""

    def __init__(self, component: Any, call: int, act: Callable[[], Any]) -> None:
        self._component, self._left, self._act = component, call, act

    def step(self, *inputs: Any) -> Any:
        self._left -= 1
        return self._act() if self._left < 0 else self._component.step(*inputs)


class Driver:
    """Control that accelerates alike for ever."""

    def __init__(self, acceleration: float) -> None:
        self._acceleration = acceleration

    def step(self, localization: LocalizationEstimate, trajectory: Trajectory | None) -> ControlCommand:  # noqa: ARG002
        return ControlCommand(localization.time, self._acceleration, 0.0)


class Buffering:
    """Planning that puts every trajectory into the same buffer, and returns a view of that."""

    def __init__(self, planning: Planning) -> None:
        self._planning = planning
        self._buffer = np.zeros((2, *TRAJECTORY_TIMES.shape, 7))

    def step(self, *inputs: Any) -> Trajectory:
        trajectory = self._planning.step(*inputs)
        self._buffer[0] = trajectory.points
        return msgspec.structs.replace(trajectory, points=self._buffer[0])


class Scribbling:
    """Planning that writes into what prediction has told it."""

    def __init__(self, planning: Planning) -> None:
        self._planning = planning

    def step(self, localization: LocalizationEstimate, predicted: PredictedObjects, signals: Any) -> Trajectory:
        predicted.objects.boxes[:, 3] += 1.0
        return self._planning.step(localization, predicted, signals)


def spoilt(context: StackContext, component: str, call: int, act: Callable[[], Any]) -> Stack:
    stack = reference_stack(context)
    return replace(stack, **{component: Spoilt(getattr(stack, component), call, act)})  # type: ignore[arg-type]


def _raise() -> None:
    raise ZeroDivisionError("the lidar said 0")


def _crash() -> None:
    faulthandler.disable()  # pytest's
    print("last words", file=sys.stderr, flush=True)  # noqa: T201
    os.kill(os.getpid(), signal.SIGSEGV)


RAISING_CYCLE = 57
raising_localization = partial(spoilt, component="localization", call=10 * RAISING_CYCLE + 5, act=_raise)
raising_perception = partial(spoilt, component="perception", call=RAISING_CYCLE, act=_raise)
raising_prediction = partial(spoilt, component="prediction", call=RAISING_CYCLE, act=_raise)
raising_planning = partial(spoilt, component="planning", call=RAISING_CYCLE, act=_raise)
raising_control = partial(spoilt, component="control", call=10 * RAISING_CYCLE, act=_raise)

silent_planning = partial(spoilt, component="planning", call=RAISING_CYCLE, act=lambda: None)
wordy_control = partial(spoilt, component="control", call=10 * RAISING_CYCLE, act=lambda: "full speed ahead")
lost_localization = partial(
    spoilt,
    component="localization",
    call=10 * RAISING_CYCLE,
    act=lambda: LocalizationEstimate(0.0, float("nan"), 0.0, 0.0, 0.0, 0.0, 0.0),
)
wild_control = partial(
    spoilt, component="control", call=10 * RAISING_CYCLE, act=lambda: ControlCommand(0.0, float("nan"), 0.0)
)
hanging = partial(spoilt, component="planning", call=5, act=signal.pause)
leaving = partial(spoilt, component="planning", call=5, act=partial(os._exit, 3))


def buffering_planning(context: StackContext) -> Stack:
    stack = reference_stack(context)
    return replace(stack, planning=Buffering(stack.planning))


def scribbling_planning(context: StackContext) -> Stack:
    stack = reference_stack(context)
    return replace(stack, planning=Scribbling(stack.planning))


class Altering:
    """A component whose answers are altered."""

    def __init__(self, component: Any, alter: Callable[[Any], Any]) -> None:
        self._component, self._alter = component, alter

    def step(self, *inputs: Any) -> Any:
        return self._alter(self._component.step(*inputs))


def altered(context: StackContext, component: str, alter: Callable[[Any], Any]) -> Stack:
    stack = reference_stack(context)
    return replace(stack, **{component: Altering(getattr(stack, component), alter)})  # type: ignore[arg-type]


def reshaped(component: str, **arrays: Any) -> Callable[[StackContext], Stack]:
    return partial(altered, component=component, alter=lambda said: msgspec.structs.replace(said, **arrays))


flat_boxes = reshaped("perception", boxes=np.zeros((0, 4)))
listed_velocities = reshaped("perception", velocities=[])
brief_poses = reshaped("prediction", poses=np.zeros((0, 3, 3)))
unnamed_lanes = reshaped("prediction", lanes=((),))
undecided = reshaped("planning", decision=object())
uncertain = partial(
    altered,
    component="prediction",
    alter=lambda said: msgspec.structs.replace(said, probabilities=said.probabilities.astype(object)),
)
short_points = reshaped("planning", points=np.zeros((80, 7)))
hasty_points = partial(
    altered,
    component="planning",
    alter=lambda plan: msgspec.structs.replace(plan, points=plan.points * [2.0, *[1.0] * 6]),
)


def crashing_by_seed(context: StackContext) -> Stack:
    """Crashes the process when the seed is `CRASHING_SEED`."""
    return spoilt(context, "planning", 5, _crash) if context.seed == CRASHING_SEED else reference_stack(context)


def full_throttle(context: StackContext) -> Stack:
    return replace(reference_stack(context), control=Driver(3.0))


def standing(context: StackContext) -> Stack:
    return replace(reference_stack(context), control=Driver(-3.0))


def reading_a_file(context: StackContext) -> Stack:
    """Needs a file beside which the command was typed."""
    with open("weights.txt", encoding="utf-8") as file:  # noqa: PTH123 relative on purpose
        assert file.read() == "7"
    return reference_stack(context)


def refusing(context: StackContext) -> Stack:  # noqa: ARG001
    raise LookupError("no weights here")


def returning_nonsense(context: StackContext) -> Any:  # noqa: ARG001
    return "a stack"


NOT_CALLABLE = 5
