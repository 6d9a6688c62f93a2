"""Stacks as users may write them by mistake, found by `--stack users_stacks:NAME` where this file lies."""

import os
import signal
import sys
from dataclasses import replace
from typing import Any

from dvca_sumo.messages import ControlCommand, LocalizationEstimate, PredictedObjects, SignalColour, Trajectory
from dvca_sumo.stack.protocols import Planning
from dvca_sumo.stack.reference import Stack, StackContext, reference_stack


class FailsInCycle57:
    def __init__(self, planning: Planning) -> None:
        self._planning = planning
        self._cycle = 0

    def step(
        self, localization: LocalizationEstimate, predicted: PredictedObjects, signals: dict[str, SignalColour]
    ) -> Trajectory:
        if self._cycle == 57:
            raise ArithmeticError("no\nconvergence")
        self._cycle += 1
        return self._planning.step(localization, predicted, signals)


class Steering:
    """Full throttle, and a road wheel angle that any function of no argument tells."""

    def __init__(self, angle: Any) -> None:
        self._angle = angle

    def step(self, localization: LocalizationEstimate, trajectory: Trajectory | None) -> ControlCommand:  # noqa: ARG002
        return ControlCommand(localization.time, 3.0, self._angle())


class Leaves:
    """It gives up like a script."""

    def step(self, localization: LocalizationEstimate, trajectory: Trajectory | None) -> ControlCommand:  # noqa: ARG002
        sys.exit(3)


def leaves(context: StackContext) -> Stack:
    return replace(reference_stack(context), control=Leaves())


def fails_in_cycle_57(context: StackContext) -> Stack:
    stack = reference_stack(context)
    return replace(stack, planning=FailsInCycle57(stack.planning))


def raising(context: StackContext) -> Stack:
    raise LookupError(f"no weights for seed {context.seed}")


def exiting(context: StackContext) -> Stack:  # noqa: ARG001
    sys.exit("no licence")


def of_another_type(context: StackContext) -> Any:
    return {"planning": reference_stack(context).planning}


def not_a_number(context: StackContext) -> Stack:
    return replace(reference_stack(context), control=Steering(lambda: float("nan")))


def never_the_same(context: StackContext) -> Stack:
    return replace(reference_stack(context), control=Steering(lambda: os.urandom(1)[0] / 2550.0 - 0.05))


def drawn_at_the_start(context: StackContext) -> Stack:
    drawn = 0.05 + int.from_bytes(os.urandom(6)) * 1e-17
    return replace(reference_stack(context), control=Steering(lambda: drawn))


def crashing(context: StackContext) -> Stack:  # noqa: ARG001
    os.kill(os.getpid(), signal.SIGSEGV)
    raise AssertionError


NOT_CALLABLE = "a stack"
