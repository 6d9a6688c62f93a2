"""The fork engine: a counterfactual costs the part of the drive that differs.

The factual run is driven once, by a process that leaves parked copies of itself on the way (see
`branching`). A counterfactual is branched off the last copy before the first message that it
substitutes. What cannot be branched goes to the replay engine: everything in jitter mode or with a
stack that runs threads (`fallback` tells why), and all questions that are asked together where one of
them is about another scenario or fault.
"""

import contextlib
import math
import sys
import time
import weakref
from collections.abc import Callable, Sequence
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NoReturn

import msgspec

from dvca_sumo.engine.branches import Branches, Plan
from dvca_sumo.engine.branching import Holder
from dvca_sumo.engine.grove import Grove
from dvca_sumo.engine.orders import Driven
from dvca_sumo.engine.passes import is_ideal_prediction
from dvca_sumo.engine.processes import Failure
from dvca_sumo.engine.protocol import Glimpse
from dvca_sumo.engine.replay import DEFAULT_TIMEOUT, ReplayEngine, raised, roadmap
from dvca_sumo.interventions import Fault, Ideal
from dvca_sumo.messages import PREDICTION_TIMES
from dvca_sumo.record import TICK, Record
from dvca_sumo.run import Task
from dvca_sumo.stack.sources import StackSource, stack_factory

IS_AVAILABLE = sys.platform != "win32"

_TICKS_PER_STEP = 10
_WORTH_A_CHECKPOINT = 5  # world steps from the nearest one
_BEFORE_VIOLATION = (1, 2, 4)  # [s] where the premise's branch leaves checkpoints


class ForkEngine:
    """Branches off parked copies of the factual run."""

    def __init__(self, net: Path, source: StackSource, jobs: int, timeout: float = DEFAULT_TIMEOUT) -> None:
        """As `ReplayEngine`, which it falls back to.

        Raises:
            RoadMapError: The net cannot be read.
            StackError, BugError: The stack cannot be read or imported.
        """
        self.name = "fork"
        self.fallback: str | None = None
        self.jobs = jobs
        self.witness = ReplayEngine(net, source, jobs, timeout)
        self.roadmap = self.witness.roadmap
        self._net = net
        self._source = source
        self._timeout = timeout
        self._grove: Grove | None = None
        self._end: Callable[[], object] = lambda: None
        self._factual: Task | None = None
        self._departed, self._violated = 0.0, math.inf  # [s] of the factual run: begin, first violation

    @property
    def checkpoint_processes(self) -> tuple[int, ...]:
        """The parked processes, by their step."""
        checkpoints = [] if self._grove is None else self._grove.checkpoints
        return tuple(one.process for one in sorted((one.parked for one in checkpoints), key=lambda one: one.step))

    def record(self, task: Task) -> Record:
        """See `Engine`. The first run recorded is the one that `glimpses` branches off."""
        if self._factual is None and self.fallback is None:
            self._plant(task)
        if self._factual is not None or self._grove is None:
            return self.witness.record(task)
        try:
            return self._taken(task, self._grove)
        except BaseException:
            self.close()
            raise

    def glimpses(
        self, tasks: Sequence[Task], on_result: Callable[[int, Glimpse | Failure], None]
    ) -> list[Glimpse | Failure]:
        """See `Engine`. The answers, but for the wall time they took, do not depend on `jobs`."""
        plans = self._plans(tasks)
        if self._grove is None or not all(plan.checkpoints for plan in plans):
            return self.witness.glimpses(tasks, on_result)
        answers: dict[int, Glimpse | Failure] = {}
        branches = Branches(self._grove, self.jobs, self._timeout)
        with contextlib.closing(branches.answers(plans)) as found:
            for row, answer in found:
                answers[row] = answer
                on_result(row, answer)
        return [answers[row] for row in range(len(tasks))]

    def close(self) -> None:
        """See `Engine`: ends every process that is left."""
        self._end()
        self._grove = None

    def _plant(self, task: Task) -> None:
        if task.jitter is not None:
            self._fall_back("in jitter mode every run is drawn anew")
        elif not IS_AVAILABLE:
            self._fall_back("this system cannot copy a process")
        else:
            try:
                self._grove = Grove(partial(_hold, self._net, self._source, task))
            except OSError as error:
                self._fall_back(f"the system gives no process or socket: {error}")
            else:
                self._end = weakref.finalize(self, self._grove.close)  # also when the engine is forgotten

    def _fall_back(self, reason: str) -> None:
        self.close()
        self.name, self.fallback = self.witness.name, reason

    def _taken(self, task: Task, grove: Grove) -> Record:
        driven = self._driven(grove)
        if isinstance(driven.answer, Failure):
            raise raised(msgspec.structs.replace(driven.answer, said=grove.said_by(None)))
        record = driven.answer
        self._factual, self._departed = task, record.start
        self._violated = min((violation.time for violation in record.violations), default=math.inf)
        grove.catch_up()
        if not grove.checkpoints:
            self._fall_back(f"the run cannot be branched: {driven.obstacle}")
        return record

    def _driven(self, grove: Grove) -> Driven:
        deadline = time.monotonic() + self._timeout
        while said := grove.heard(deadline):
            for connection, message in said:
                if isinstance(message, Driven):
                    return message
                if connection is grove.stem:
                    return Driven(Failure(grove.stem_death(), ""), "")
        return Driven(Failure(f"no answer within {self._timeout:g} s", ""), "")

    def _can_branch(self, task: Task) -> bool:
        factual = self._factual
        if factual is None or task.jitter is not None or task.scenario != factual.scenario:
            return False
        return tuple(one for one in task.interventions if isinstance(one, Fault)) == factual.interventions

    def _plans(self, tasks: Sequence[Task]) -> list[Plan]:
        """How to branch each task off what is parked now; without checkpoints where it cannot be.

        What comes to be parked while they run is for later tasks: so no cost depends on timing.
        """
        if self._grove is None:
            return []
        self._grove.catch_up()
        checkpoints = sorted(self._grove.checkpoints, key=lambda one: one.parked.step)
        known = {one.parked.step for one in checkpoints}
        is_full = self._grove.memory.is_over_budget(self.checkpoint_processes)
        plans = []
        for task in tasks:
            latest = self._latest_step(task)
            usable = tuple(one for one in checkpoints if one.parked.step <= latest and self._can_branch(task))
            nearest = usable[-1].parked.step if usable else 0
            new = tuple(
                step
                for step in ([] if is_full else self._landmarks(task, latest))
                if step - nearest >= _WORTH_A_CHECKPOINT and known.isdisjoint(range(step, step + _WORTH_A_CHECKPOINT))
            )
            known.update(new)
            plans.append(Plan(self._with_needed_futures(task), usable, new))
        return plans

    def _with_needed_futures(self, task: Task) -> Task:
        """The same run, with no more recorded motion than it asks for: an order is sent, the longer the costlier."""
        starts = [one.selection.start for one in task.interventions if is_ideal_prediction(one)]
        begin, end = self._departed + min(starts, default=math.inf) - 1.0, task.stop.at + PREDICTION_TIMES[-1] + 1.0
        return msgspec.structs.replace(task, futures=task.futures.between(begin, end))

    def _latest_step(self, task: Task) -> int:
        """World step up to which a run of `task` is the factual run: nothing is substituted, and it goes on."""
        ends = [_step(end - self._departed) for end in (task.stop.at, task.stop.settled, self._violated)]
        starts = [one.selection.start for one in task.interventions if isinstance(one, Ideal)]
        if starts:
            change = float(math.ceil(min(starts) / TICK - 1e-6) // _TICKS_PER_STEP)
        else:
            change = min(self._before_violation(), default=0.0)
        return int(max(min(change, *ends), 0.0))

    def _landmarks(self, task: Task, latest: int) -> Sequence[int]:
        """Where later questions are likely to branch."""
        return [latest] if any(isinstance(one, Ideal) for one in task.interventions) else self._before_violation()

    def _before_violation(self) -> list[int]:
        steps = [_step(self._violated - self._departed - before) for before in _BEFORE_VIOLATION]
        return [int(step) for step in steps if 0.0 < step < math.inf]


def _step(elapsed: float) -> float:
    """World step that begins `elapsed` [s] after departure, or is under way then."""
    return elapsed if math.isinf(elapsed) else math.floor(elapsed / (_TICKS_PER_STEP * TICK) + 1e-6)


def _hold(net: Path, source: StackSource, task: Task, address: str, folder: Path, connection: Connection) -> NoReturn:
    Holder(address, folder, connection).hold(task, partial(roadmap, net), stack_factory(source))
