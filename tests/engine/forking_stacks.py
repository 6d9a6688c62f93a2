"""Stacks for tests of the fork engine, as `--stack forking_stacks:NAME` finds them.

Messages carry no sign of being substituted, but ideally perceived vehicles have SUMO's default size to the
last bit, which measured ones never have: planning can tell by it, and do what the stack is named after.
"""

import ctypes
import faulthandler
import os
import random
import select
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from small_stacks import Spoilt

from dvca_sumo.messages import ControlCommand, LocalizationEstimate, PredictedObjects, SignalColour, Trajectory
from dvca_sumo.stack.protocols import Planning
from dvca_sumo.stack.reference import Stack, StackContext, reference_stack

_DEFAULT_SIZE = (5.0, 1.8)  # [m]
_PR_SET_PDEATHSIG = 1

told = -1  # descriptor that the stacks write into, set by a test
analysis = -1  # process id, likewise


class OnIdeal:
    """Planning that does something when it is given ideally perceived objects."""

    def __init__(self, planning: Planning, act: Callable[[], None]) -> None:
        self._planning, self._act = planning, act

    def step(
        self, localization: LocalizationEstimate, predicted: PredictedObjects, signals: dict[str, SignalColour]
    ) -> Trajectory:
        if (predicted.objects.boxes[:, 3:5] == _DEFAULT_SIZE).all(axis=1).any():
            self._act()
        return self._planning.step(localization, predicted, signals)


def on_ideal(context: StackContext, act: Callable[[], None]) -> Stack:
    stack = reference_stack(context)
    return replace(stack, planning=OnIdeal(stack.planning, act))


def at_planning(context: StackContext, call: int, act: Callable[[], None]) -> Stack:
    """Does something besides at the planning call of that number."""
    stack = reference_stack(context)
    return replace(stack, planning=Besides(stack.planning, call, act))


class Besides(Spoilt):
    """A component that once, at its call number `call`, does something besides."""

    def step(self, *inputs: Any) -> Any:
        self._left -= 1
        if self._left == -1:
            self._act()
        return self._component.step(*inputs)


def _crash() -> None:
    faulthandler.disable()  # pytest's
    print("last words", file=sys.stderr, flush=True)  # noqa: T201
    os.kill(os.getpid(), signal.SIGSEGV)


def _raise() -> None:
    raise ZeroDivisionError("no way out")


def _hang() -> None:
    os.write(told, f"{os.getpid()} ".encode())
    signal.pause()


def _interrupt() -> None:
    os.write(told, f"{os.getpid()} ".encode())
    os.kill(analysis, signal.SIGINT)
    signal.pause()


def _scribble() -> None:
    os.write(told, b"from a run")


def _wait_for_ever() -> None:
    threading.Thread(target=threading.Event().wait, daemon=True).start()


crashing = partial(on_ideal, act=_crash)
raising = partial(on_ideal, act=_raise)
leaving = partial(on_ideal, act=partial(sys.exit, 3))
hanging = partial(on_ideal, act=_hang)
interrupting = partial(on_ideal, act=_interrupt)
killing_its_parent = partial(on_ideal, act=lambda: os.kill(os.getppid(), signal.SIGKILL))

crashing_at_once = partial(at_planning, call=15, act=_crash)
hanging_at_once = partial(at_planning, call=15, act=_hang)
scribbling = partial(at_planning, call=15, act=_scribble)
threaded_late = partial(at_planning, call=15, act=_wait_for_ever)


class Wobbling:
    """Control that draws its steering from Python's own random numbers, as a user's may."""

    def step(self, localization: LocalizationEstimate, trajectory: Trajectory | None) -> ControlCommand:  # noqa: ARG002
        return ControlCommand(localization.time, 0.5, random.uniform(-0.01, 0.01))  # noqa: S311


def wobbling(context: StackContext) -> Stack:
    random.seed(context.seed)
    return replace(reference_stack(context), control=Wobbling())


def conversing(context: StackContext) -> Stack:
    """Has a process of its own to talk to."""
    process = subprocess.Popen(["cat"], stdin=subprocess.PIPE, stdout=subprocess.PIPE)  # noqa: S607
    stack = reference_stack(context)
    return replace(stack, planning=Besides(stack.planning, 15, process.poll))


def threaded(context: StackContext) -> Stack:
    _wait_for_ever()
    return reference_stack(context)


def outliving_the_analysis(context: StackContext) -> Stack:
    """In a branch that is under way before step 24: drives on without an analysis.

    As it would where the system does not tell a branch of its parent's death.
    """
    stem = os.getpid()

    def act() -> None:
        if os.getpid() != stem:
            ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, 0)
            end = os.pidfd_open(analysis)
            os.kill(analysis, signal.SIGKILL)
            select.select([end], [], [])

    return at_planning(context, 24, act)
