"""Search the injected faults of the benchmark: each as small and as brief as still causes its scenario's collision.

    python benchmarks/smallest_faults.py [--only perception.miss/cs1 ...] [--jobs 2]

A fault counts when it is the cause, by itself and in its own time:

- the violation that is to be explained is the ego's contact with the scenario's hazard; only where no fault
  leads to that, one by which the ego breaks another rule first, say by speeding into it;
- with everything else ideal the violation stays, from the start, from the fault's start and in the last seconds (ideal
  prediction aside where perception is at fault: it knows what perception does not): no other component's
  imperfection takes part;
- it is not over before the violation is certain: with its component ideal from its end on, the violation stays.

For each fault type and scenario:

1. up a ladder of magnitudes, both signs where both make sense, to the first that counts: active from some
   seconds before the meeting with the hazard on, and where that never counts, in shorter windows around it;
2. its magnitude down by bisection, and up by the stated margin, so that no rounding decides;
3. its start later and its end earlier by bisection, in turn, until no step later or shorter still counts;
   then the window grown by one step at either end, where that still counts;
4. the same fault for the same time in another moment, the first at which it alters at least half as many
   messages and nothing is violated, in jitter mode neither; where there is none, for half the time, and so on.

Nothing is attributed. Writes dvca_sumo/bench/injected.toml after each instance; those that it holds already are
not searched again unless named by --only.
"""

import argparse
import contextlib
import math
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import msgspec

import dvca_sumo
from dvca_sumo.analysis.components import SUBSTITUTABLE
from dvca_sumo.analysis.violating import principal
from dvca_sumo.bench.cases import INJECTED, Case, injected_cases
from dvca_sumo.engine.fork import ForkEngine
from dvca_sumo.engine.processes import Failure, isolated
from dvca_sumo.engine.replay import roadmap
from dvca_sumo.interventions import (
    Ideal,
    Intervention,
    Selection,
    fault_library,
    planted_fault,
    recorded_futures,
)
from dvca_sumo.messages import Component
from dvca_sumo.run import StopRule, Task, rtest
from dvca_sumo.scenario import Scenario
from dvca_sumo.stack.reference import reference_stack
from dvca_sumo.stack.sources import StackSource
from dvca_sumo.violations import Violation

GRID = 0.1  # [s] of windows: one world step
APPROACH = 8.0  # [s] before the meeting, faults are active from then on at first
MARGIN = 1.1  # times the smallest magnitude, at least one resolution more
GROWN = 0.1  # [s] by which the narrowest window is grown at either end
HARMLESS_EVERY = 2.0  # [s] between the moments tried
ENOUGH = 0.5  # of the messages that the harmful one alters
PATIENCE = 8.0  # [s] after the meeting: who has not met the hazard by then will not
AFTER_CONTACT = (0.1, 0.5, 1.0, 2.0, 4.0)  # [s] where the window may end at first
ROUNDS = 6
SETTLE = 7.0  # [s] after the first violation: a close call within it belongs to the contact


class Hazard(msgspec.Struct, frozen=True):
    """What a scenario is about."""

    objects: tuple[str, ...]  # their ids without the kind, or its beginning
    meeting: float  # [s] after departure, about when an ego that keeps its speed is there
    beyond: float  # [m] station of the rear axle past which it lies behind


class Knob(msgspec.Struct, frozen=True):
    """One parameter that makes a fault larger."""

    name: str
    ladder: tuple[float, ...]
    resolution: float
    signs: tuple[float, ...] = (1.0, -1.0)


class Trial(msgspec.Struct, frozen=True):
    """One fault to drive with."""

    fault: str
    target: str  # id of the object; empty where the fault takes none
    start: float  # [s]
    end: float  # [s]
    knob: Knob | None = None
    sign: float = 1.0
    magnitude: float = 0.0

    @property
    def text(self) -> str:
        """The command line's word for it."""
        words = [f"object={self.target}"] if self.target else []
        if self.knob is not None:
            words.append(f"{self.knob.name}={_tidy(self.sign * self.magnitude)}")
        words.append(f"start={_tidy(self.start)}")
        if not math.isinf(self.end):
            words.append(f"end={_tidy(self.end)}")
        return f"{self.fault}:{','.join(words)}"


HAZARDS = {
    "cs1": Hazard(("pedestrian",), 13.2, 210.0),
    "cs2": Hazard(("van",), 15.0, 260.0),
    "cs3": Hazard(("cone",), 18.4, 275.0),
    "cs4": Hazard(("parked_van",), 17.5, 265.0),
    "cs5": Hazard(("divider", "curb"), 22.0, 270.0),
}
METRES = Knob("left", (0.5, 1.0, 2.0, 4.0, 8.0), 0.05)
VELOCITIES = tuple(Knob(name, (2.0, 4.0, 8.0, 16.0, 32.0), 0.25) for name in ("ahead", "left"))
# Fault type -> scenarios, and the parameters that make it larger: the paper's table of injected errors.
INSTANCES: dict[str, tuple[str, tuple[Knob, ...]]] = {
    "perception.miss": ("1234", ()),
    "perception.box": ("4", (Knob("width", (0.5, 1.0, 2.0, 4.0), 0.05),)),
    "perception.longitudinal": ("1234", (Knob("ahead", (3.0, 6.0, 12.0, 24.0, 48.0, 96.0), 0.25),)),
    "perception.lateral": ("1234", (METRES,)),
    "perception.velocity": ("1234", VELOCITIES),
    "prediction.none": ("1", ()),
    "prediction.wrong": ("1234", VELOCITIES),
    "planning.path": ("345", (METRES,)),
    "planning.speed": ("123", (Knob("error", (2.0, 4.0, 8.0, 16.0), 0.25, (1.0,)),)),
    "planning.none": ("12345", ()),
    "control.longitudinal": ("1234", (Knob("error", (2.0, 4.0, 8.0, 15.0), 0.25, (1.0,)),)),
    "control.lateral": ("5", (Knob("error", (0.02, 0.04, 0.08, 0.16, 0.32), 0.005),)),
    "localization.lateral": ("5", (METRES,)),
}


LATE = 2.0  # [s] before the contact
# Per component at fault: those that are made ideal beside it.
OTHERS = {one: tuple(other for other in SUBSTITUTABLE if other is not one) for one in Component}
OTHERS[Component.PERCEPTION] = (Component.LOCALIZATION, Component.CONTROL)


class Sown(ForkEngine):
    """Branches of a drive without a fault, each with a fault from some moment on."""

    def _can_branch(self, task: Task) -> bool:
        return self._factual is not None and task.scenario == self._factual.scenario

    def _latest_step(self, task: Task) -> int:
        return math.floor(min(one.selection.start for one in task.interventions) / GRID + 1e-6)

    def _landmarks(self, task: Task, latest: int) -> Sequence[int]:  # noqa: ARG002
        return [latest]


class Ground:
    """A scenario with its healthy drive, on which faults are tried."""

    def __init__(self, name: str, jobs: int) -> None:
        self.name = name
        self.hazard = HAZARDS[name]
        self.drives = 0
        self._scenario = dvca_sumo.load_scenario(f"nets/{name}.sumocfg")
        self._engine = Sown(self._scenario.configuration.net, StackSource(), jobs)
        healthy = self._engine.record(Task(self._scenario))
        if healthy.violations:
            raise SystemExit(f"{name} violates without a fault: {healthy.violations[0].detail}")
        self._futures = recorded_futures(healthy.moments)
        self._departed, self._end = healthy.start, healthy.path[-1].time
        self._is_strict = True
        self._known: dict[str, Sequence[Violation]] = {}  # by fault

    def judge(self, *, is_strict: bool) -> None:
        """From now on: whether the violation to be explained must be the contact itself."""
        self._is_strict = is_strict
        self._known.clear()

    def close(self) -> None:
        """End what is parked."""
        self._engine.close()

    def contacts(self, trials: Sequence[Trial]) -> list[float | None]:
        """[s] after departure of the contact that each leads to, None where it leads to none."""
        fresh = {trial.text: trial for trial in trials if trial.text not in self._known}
        found = dict(zip(fresh, self._violations([(planted_fault(text),) for text in fresh]), strict=True))
        for text, trial in fresh.items():
            contact = self._contact(found[text])
            is_cause = contact is not None and all(self._violations(self._doubts(trial, contact)))
            self._known[text] = found[text] if is_cause else ()
        return [self._contact(self._known[trial.text]) for trial in trials]

    def _doubts(self, trial: Trial, contact: float) -> list[tuple[Intervention, ...]]:
        """What must violate as well, for the fault to be the cause."""
        fault = planted_fault(trial.text)
        beside = OTHERS[fault.component]
        doubts: list[tuple[Intervention, ...]] = [
            (fault, *(Ideal(component, Selection(start=start)) for component in beside))
            for start in (0.0, trial.start, max(contact - LATE, trial.start))
        ]
        if fault.component in SUBSTITUTABLE and trial.end < contact:
            doubts.append((fault, Ideal(fault.component, Selection(start=trial.end))))
        return doubts

    def _violations(self, drives: Sequence[tuple[Intervention, ...]]) -> list[Sequence[Violation]]:
        latest = self._departed + self.hazard.meeting + PATIENCE
        stop = StopRule(after_violation=SETTLE, at=latest, settled=0.0, place=self.hazard.beyond)
        tasks = [Task(self._scenario, interventions, stop, self._futures) for interventions in drives]
        self.drives += len(tasks)
        found: list[Sequence[Violation]] = []
        for task, answer in zip(tasks, self._engine.glimpses(tasks, lambda _row, _answer: None), strict=True):
            if isinstance(answer, Failure):
                raise SystemExit(f"{self.name} {task.interventions}: {answer.reason}\n{answer.said}")
            found.append(answer.violations)
        return found

    def whole(self, trial: Trial) -> tuple[bool, bool, int]:
        """Of the whole drive: whether it leads to the contact, whether nothing is violated, messages altered."""
        violations, altered = self._driven(trial, StopRule())
        return self._contact(violations) is not None, not violations, altered

    def altered(self, trial: Trial) -> int:
        """How many messages it alters."""
        return self._driven(trial, StopRule(at=self._departed + trial.end))[1]

    def is_clean_with_jitter(self, trial: Trial) -> bool:
        """Whether nothing is violated either when phases and noise are drawn."""
        return not self._driven(trial, StopRule(), jitter=0)[0]

    def _driven(self, trial: Trial, stop: StopRule, jitter: int | None = None) -> tuple[list[Violation], int]:
        self.drives += 1
        ((_, answer),) = isolated([partial(_drive, self._scenario, trial.text, stop, jitter)], 1, 600.0)
        if isinstance(answer, Failure):
            raise SystemExit(f"{self.name} {trial.text}: {answer.reason}\n{answer.said}")
        return answer

    def moments(self) -> list[float]:
        """[s] after departure at which a fault may be harmless."""
        count = int((self._end - self._departed) / HARMLESS_EVERY)
        return [_grid(_steps(HARMLESS_EVERY) * row + 5) for row in range(count)]

    def _contact(self, violations: Sequence[Violation]) -> float | None:
        if not violations:
            return None
        last = principal(violations) if self._is_strict else violations[-1]  # nothing is judged after a contact
        name = (last.object or "").rpartition(":")[2]
        is_meant = last.contact is not None and name.startswith(self.hazard.objects)
        return last.time - self._departed if is_meant else None


def _drive(scenario: Scenario, fault: str, stop: StopRule, jitter: int | None) -> tuple[list[Violation], int]:
    task = Task(scenario, (planted_fault(fault),), stop, jitter=jitter)
    record = rtest(task, partial(roadmap, scenario.configuration.net), reference_stack)
    return record.violations, sum(map(len, record.altered.values()))


def searched(ground: Ground, fault: str) -> Case:
    """One instance."""
    name = f"{fault}/{ground.name}"
    ground.judge(is_strict=True)
    trial = first(ground, fault)
    if trial is None:
        ground.judge(is_strict=False)
        trial = first(ground, fault)
    if trial is None:
        raise NotFoundError(f"{name}: no magnitude in any window leads to the contact")
    minimum = smallest(ground, trial)
    # Not everything is monotone: where the grown one does not count, the minimum is what there is.
    chosen = minimum if ground.contacts([grown(minimum)]) == [None] else grown(minimum)
    is_contact, _, altered = ground.whole(chosen)
    if not is_contact:
        raise NotFoundError(f"{name}: {minimum.text} leads to the contact on a branch, and not on a whole drive")
    print(f"{name:<30}minimum {minimum.text}", flush=True)
    return Case(
        suite="injected",
        name=name,
        scenario=f"nets/{ground.name}.sumocfg",
        component=planted_fault(chosen.text).component,
        fault=chosen.text,
        harmless=harmless(ground, chosen, altered).text,
    )


class NotFoundError(Exception):
    """There is no such fault."""


def first(ground: Ground, fault: str) -> Trial | None:
    """The first trial up the ladder that leads to the contact: over the whole drive, else in shorter windows."""
    target = ground.hazard.objects[0] if "object" in fault_library()[fault].parameters else ""
    meeting = ground.hazard.meeting
    for windows in ([(_grid(_steps(meeting - APPROACH)), math.inf)], _windows(meeting)):
        for rung in _rungs(INSTANCES[fault][1]):
            trials = [
                Trial(fault, target, start, end, knob, sign, magnitude)
                for start, end in windows
                for knob, sign, magnitude in rung
            ]
            for trial, contact in zip(trials, ground.contacts(trials), strict=True):
                if contact is not None:
                    return trial
    return None


def _rungs(knobs: Sequence[Knob]) -> list[list[tuple[Knob | None, float, float]]]:
    """Parameters, signs and magnitudes to try together, from the smallest on."""
    if not knobs:
        return [[(None, 1.0, 0.0)]]
    return [
        [(knob, sign, knob.ladder[rung]) for knob in knobs if rung < len(knob.ladder) for sign in knob.signs]
        for rung in range(max(len(knob.ladder) for knob in knobs))
    ]


def _windows(meeting: float) -> list[tuple[float, float]]:
    """Around the meeting, long ones first."""
    return [
        (_grid(_steps(max(meeting - before, 0.0))), _grid(_steps(meeting - before + length)))
        for length in (12.0, 6.0, 3.0, 1.5)
        for before in (12.0, 10.0, 8.0, 6.0, 4.0, 2.5, 1.0, -1.0)
    ]


def smallest(ground: Ground, trial: Trial) -> Trial:
    """The magnitude down to the least and up by its margin; then no start later and no end earlier, or `ROUNDS`."""
    trial = _smaller(ground, trial)
    for _ in range(ROUNDS):
        before = trial
        trial = _shorter(ground, _later(ground, trial))
        if trial == before:
            break
    return trial


def _smaller(ground: Ground, trial: Trial) -> Trial:
    if trial.knob is None:
        return trial
    step = trial.knob.resolution

    def at(count: int) -> Trial:
        return msgspec.structs.replace(trial, magnitude=round(count * step, 6))

    least = _least(ground, at, 0, round(trial.magnitude / step))
    count = round(least.magnitude / step)
    robust = at(max(math.ceil(MARGIN * count - 1e-9), count + 1))
    return least if ground.contacts([robust]) == [None] else robust


def _later(ground: Ground, trial: Trial) -> Trial:
    last = _steps(min(_time_of_contact(ground, trial), trial.end))
    return _least(
        ground, lambda count: msgspec.structs.replace(trial, start=_grid(-count)), -last, -_steps(trial.start)
    )


def _shorter(ground: Ground, trial: Trial) -> Trial:
    def at(count: int) -> Trial:
        return msgspec.structs.replace(trial, end=_grid(count))

    contact = _steps(_time_of_contact(ground, trial))
    if trial.end <= _grid(contact + 1):
        return _least(ground, at, _steps(trial.start), _steps(trial.end))
    for later in AFTER_CONTACT:  # what is ideal beside the fault may put the contact off
        if ground.contacts([at(contact + _steps(later))]) != [None]:
            return _least(ground, at, _steps(trial.start), contact + _steps(later))
    return trial


def _time_of_contact(ground: Ground, trial: Trial) -> float:
    (contact,) = ground.contacts([trial])
    assert contact is not None
    return contact


def _least(ground: Ground, at: Callable[[int], Trial], low: int, high: int) -> Trial:
    """The least count down from `high`, which leads to the contact, as bisection finds it; `low` does not."""
    if high - low > 1 and ground.contacts([at(high - 1)]) == [None]:
        return at(high)  # nothing moves, as in every last round
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if ground.contacts([at(middle)]) == [None] else (low, middle)
    return at(high)


def grown(trial: Trial) -> Trial:
    """Active a little longer at either end."""
    start, end = _grid(max(_steps(trial.start - GROWN), 0)), _grid(_steps(trial.end + GROWN))
    return msgspec.structs.replace(trial, start=start, end=end)


def harmless(ground: Ground, harmful: Trial, altered: int) -> Trial:
    """The same for the same time at the first moment at which nothing is violated, and enough is altered.

    What breaks a rule wherever it lasts so long, as full throttle does, is active for half the time, or a quarter ...
    """
    length, least = _steps(harmful.end - harmful.start), ENOUGH * altered
    while length > 0:
        for start in ground.moments():
            trial = msgspec.structs.replace(harmful, start=start, end=_grid(_steps(start) + length))
            is_enough = ground.altered(trial) >= least
            if is_enough and ground.whole(trial)[1] and ground.is_clean_with_jitter(trial):
                return trial
        length, least = length // 2, 0.5 * least
    raise NotFoundError(f"{harmful.text} is harmless in {ground.name} at no other moment")


def _steps(time: float) -> int:
    return round(time / GRID)


def _grid(count: int) -> float:
    return round(count * GRID, 6)


def _tidy(number: float) -> str:
    return f"{round(number, 6):g}"


def main() -> None:
    """Search what is missing; the file grows case by case."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--only", nargs="+", default=[])
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    cases = {case.name: case for case in injected_cases()} if INJECTED.exists() else {}
    is_complete = True
    for scenario in HAZARDS:
        faults = [fault for fault, (numbers, _) in INSTANCES.items() if scenario[-1] in numbers]
        wanted = [
            fault
            for fault in faults
            if (name := f"{fault}/{scenario}") in options.only or (not options.only and name not in cases)
        ]
        if wanted:
            with contextlib.closing(Ground(scenario, options.jobs)) as ground:
                for fault in wanted:
                    is_complete &= _added(ground, fault, cases)
    sys.exit(not is_complete)


def _added(ground: Ground, fault: str, cases: dict[str, Case]) -> bool:
    begin, before = time.perf_counter(), ground.drives
    try:
        case = searched(ground, fault)
    except NotFoundError as error:
        print(error, flush=True)
        return False
    cases[case.name] = case
    write(INJECTED, [cases[name] for name in sorted(cases)])
    cost = f"{ground.drives - before} drives, {time.perf_counter() - begin:.0f} s"
    print(f"{case.name:<30}{case.fault}  harmless: {case.harmless}  ({cost})", flush=True)
    return True


def write(path: Path, cases: Sequence[Case]) -> None:
    """The whole file anew."""
    head = [
        "# Found by benchmarks/smallest_faults.py: nothing in here is written by hand.",
        "# Each fault is the smallest that still makes the ego hit the scenario's hazard, plus a margin; active in the",
        f"# shortest window that then suffices, plus a margin. Margins: magnitude x {MARGIN:g}, at least one step",
        f"# more; window {GROWN:g} s at either end. Resolution: windows {GRID:g} s; magnitudes by fault type:",
    ]
    for fault, (_, knobs) in INSTANCES.items():
        head += [f"#   {fault}: {knob.name} {knob.resolution:g}" for knob in knobs]
    blocks = []
    for case in cases:
        fields = msgspec.structs.asdict(case)
        lines = [f'{key} = "{fields[key]}"' for key in ("name", "scenario", "component", "fault", "harmless")]
        blocks.append("\n".join(["[[case]]", *lines]))
    path.write_text("\n".join(head) + "\n\n" + "\n\n".join(blocks) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
