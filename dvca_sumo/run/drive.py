"""One ego's closed loop: sense, five components, move, be judged."""

import math
from functools import cached_property
from typing import NamedTuple

import msgspec

from dvca_sumo.geometry.randomness import uniforms
from dvca_sumo.interventions import Occasion, state_of
from dvca_sumo.messages import (
    COMPONENTS,
    Component,
    ControlCommand,
    LocalizationEstimate,
    Message,
    MessageId,
    PredictedObjects,
    TrackedObjects,
    Trajectory,
)
from dvca_sumo.oracles import Oracle, Places
from dvca_sumo.oracles.no_progress import NoProgress
from dvca_sumo.record import TICK, Digest, Execution, Record, moved_on
from dvca_sumo.run.answers import checked, freeze, told
from dvca_sumo.run.intervening import Intervening
from dvca_sumo.run.task import Task
from dvca_sumo.stack.reference import Stack, StackError
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import EgoTruth, Moment
from dvca_sumo.violations import Ending, Judgement, Violation
from dvca_sumo.world import ControlCommandError, Ego

TICKS_PER_STEP = 10
ARRIVED_WITHIN = 3.0  # [m] or within the tolerance of its destination, where that is less
_LOST_BEYOND = 60.0  # [m] past its destination an ego will not come back
_PHASE_STREAM = 101
_CHANNELS = {component: component.value for component in COMPONENTS}  # an enum's value is slow to ask for


class Channels:
    """The latest message of each component; None until there is one."""

    def __init__(self) -> None:
        self.localization: LocalizationEstimate | None = None
        self.perception: TrackedObjects | None = None
        self.prediction: PredictedObjects | None = None
        self.planning: Trajectory | None = None
        self.control: ControlCommand | None = None


class Judging(NamedTuple):
    """The oracles of one drive, and what they hold it against."""

    oracles: tuple[Oracle, ...]
    thresholds: Thresholds
    places: Places  # that the oracles share


class DriveResult(msgspec.Struct, frozen=True):
    """How a drive came out."""

    violations: tuple[Violation, ...]  # by time, up to the first contact
    judgements: tuple[Judgement, ...]
    ending: Ending
    digest: str  # of the whole run, as its record's


class Drive:
    """One ego's drive, advanced by one world step at a time."""

    def __init__(
        self, ego: Ego, stack: Stack, judging: Judging, task: Task, latest: float, *, is_whole: bool = True
    ) -> None:
        """A drive that is late at `latest` [s], unless it is cut before by its task or the scenario's end.

        Unless it `is_whole`, every step forgets what the one before left: there is an outcome, but no record.
        """
        self.ego = ego
        self.judging = judging
        self._is_whole = is_whole
        self._thresholds = judging.thresholds
        self._arrived_within = min(ARRIVED_WITHIN, judging.thresholds.destination_tolerance)  # [m]
        self._oracles = judging.oracles
        self._stack = stack
        self._task = task
        self._latest = latest
        self._end = math.inf if task.scenario.end is None else task.scenario.end
        self._due = _due(task)
        self._intervening = Intervening(task.interventions)
        self._channels = Channels()
        self._steps = {
            Component.LOCALIZATION: self._localize,
            Component.PERCEPTION: self._perceive,
            Component.PREDICTION: self._predict,
            Component.PLANNING: self._plan,
            Component.CONTROL: self._control,
        }
        self._tick = 0
        self._start = ego.vehicle.truth.time
        self._contact = self._breach = math.inf  # [s] time of the first contact, of the first violation
        self._is_stuck = False
        self._ending: Ending | None = None
        self._executions: dict[Component, list[Execution]] = {component: [] for component in COMPONENTS}
        self._forgotten = dict.fromkeys(COMPONENTS, 0)  # how many before those
        self._path: list[EgoTruth] = []
        self._stations: list[float] = []
        self._moments: list[Moment] = []
        self._violations: list[Violation] = []
        self._digest = Digest()
        self._digests: list[bytes] = []

    @property
    def steps(self) -> int:
        """World steps driven so far."""
        return self._tick // TICKS_PER_STEP

    @property
    def has_violated(self) -> bool:
        """Whether an oracle has found a violation so far."""
        return not math.isinf(self._breach)

    def branch(self, task: Task) -> None:
        """Go on under another task; interventions that both have keep what they remember."""
        self._intervening.go_on(task.interventions)
        self._task = task

    def cycle(self, moment: Moment) -> bool:
        """Judge this step's truth, then drive to the next step; False when the drive is over.

        Raises:
            StackError: A component failed; which, in which cycle, and its own words.
        """
        if not self._is_whole:
            self._forget()
        self._moments.append(moment)
        self._judge(moment)
        self._ending = self._ended(moment)
        if self._ending is not None:
            return False
        station = self.ego.station()
        counts = [len(made) for made in self._executions.values()]
        for phase in range(TICKS_PER_STEP):
            truth = self.ego.vehicle.truth
            self._path.append(truth)
            self._stations.append(station)
            for component in self._due[phase]:
                self._execute(component, moment)
            # Until control has published anything, the ego rolls straight on.
            command = self._channels.control or ControlCommand(truth.time, 0.0, 0.0)
            try:
                self.ego.vehicle.advance(command, TICK)
            except ControlCommandError as error:
                raise StackError(f"{error}, in cycle {self._tick // TICKS_PER_STEP}") from None
            station += truth.speed * TICK
            self._tick += 1
        fresh = [made[count:] for made, count in zip(self._executions.values(), counts, strict=True)]
        self._digests.append(self._digest.step(fresh, self._path[-TICKS_PER_STEP:], moment.objects))
        return True

    @cached_property
    def outcome(self) -> DriveResult:
        """How the drive came out that is over, or is cut here and not to go on."""
        ending = self._ending or Ending.CUT
        is_judged = math.isinf(self._contact)  # after a contact nothing was judged
        judgements = tuple(oracle.conclude(ending if is_judged else Ending.CUT) for oracle in self._oracles)
        known = {id(violation) for violation in self._violations}
        concluded = (one for judged in judgements for one in judged.violations if id(one) not in known)
        violations = sorted([*self._violations, *concluded], key=lambda violation: violation.time)
        digest = Digest().step(self._digests, violations).hex()
        return DriveResult(tuple(violations), judgements, ending, digest)

    def record(self, simulated: float) -> Record:
        """What the whole drive left, `simulated` [s] of SUMO time having passed."""
        assert self._is_whole  # else most of it is forgotten
        outcome = self.outcome
        return Record(
            ego=self.ego.name,
            stops=self.ego.stops,
            route=self.ego.route,
            signed_lanes=self.judging.places.signed_lanes,
            thresholds=self._thresholds,
            sensor_range=self._stack.sensor_range,
            start=self._start,
            executions=self._executions,
            altered=self._intervening.altered,
            path=self._path,
            stations=self._stations,
            moments=self._moments,
            violations=list(outcome.violations),
            judgements=outcome.judgements,
            ending=outcome.ending,
            simulated=simulated,
            substituted=self._intervening.substituted,
            digests=self._digests,
        )

    def _forget(self) -> None:
        for component, made in self._executions.items():
            self._forgotten[component] += len(made)
            made.clear()
        for left in (self._path, self._stations, self._moments):
            left.clear()

    def _execute(self, component: Component, moment: Moment) -> None:
        made = self._executions[component]
        try:
            message = self._steps[component](moment)
        except (Exception, SystemExit) as error:  # a component has no business with the process, to end it neither
            cycle = self._tick // TICKS_PER_STEP
            said = told(error)
            raise StackError(f"{component} raised {said} in cycle {cycle} ({self._path[-1].time:.2f} s)") from error
        if message is None:  # its input has not arrived yet
            return
        published: Message | None = message
        if self._intervening.concern(component):
            index = self._forgotten[component] + len(made)
            published = self._intervening.published(message, self._occasion(component, index, message, moment))
        made.append(Execution(self._tick, published))
        if published is not None:
            if published is not message:
                freeze(published)
            setattr(self._channels, _CHANNELS[component], published)

    def _occasion(self, component: Component, index: int, message: Message, moment: Moment) -> Occasion:
        truth = self._path[-1]
        believed = message if isinstance(message, LocalizationEstimate) else self._channels.localization
        assert believed is not None  # localization is the first to speak
        return Occasion(
            message=MessageId(component, index),
            elapsed=round(truth.time - self._start, 9),
            state=state_of(self._stations[-1], truth.speed, truth.acceleration),
            moment=moved_on(moment, truth),
            believed=believed,
            trajectory=self._channels.planning,
            route=self.ego.route,
            sensor_range=self._stack.sensor_range,
            futures=self._task.futures,
            told=_objects_in(message),
            tracks=self._intervening.tracks,
        )

    def _localize(self, moment: Moment) -> Message:  # noqa: ARG002 - all steps are called alike
        truth, sensors = self._path[-1], self._stack.sensors
        cycle, phase = divmod(self._tick, TICKS_PER_STEP)
        fix = sensors.fix(truth, cycle) if phase == 0 else None
        step = self._stack.localization.step
        estimate = checked(step(sensors.odometry(truth, self._tick), fix), LocalizationEstimate)
        pose, motion = estimate.x + estimate.y + estimate.heading, estimate.speed + estimate.acceleration
        if not math.isfinite(pose + motion + estimate.yaw_rate):
            raise ValueError("its estimate holds a number that is not finite")
        return estimate

    def _perceive(self, moment: Moment) -> Message | None:
        believed = self._channels.localization
        if believed is None:
            return None
        detections = self._stack.sensors.detections(moved_on(moment, self._path[-1]), self._tick // TICKS_PER_STEP)
        return checked(self._stack.perception.step(detections, believed), TrackedObjects)

    def _predict(self, moment: Moment) -> Message | None:  # noqa: ARG002
        tracked = self._channels.perception
        if tracked is None:
            return None
        return checked(self._stack.prediction.step(tracked), PredictedObjects)

    def _plan(self, moment: Moment) -> Message | None:  # noqa: ARG002
        channels = self._channels
        if channels.localization is None or channels.prediction is None or channels.perception is None:
            return None
        signals = channels.perception.signals
        return checked(self._stack.planning.step(channels.localization, channels.prediction, signals), Trajectory)

    def _control(self, moment: Moment) -> Message | None:  # noqa: ARG002
        believed = self._channels.localization
        if believed is None:
            return None
        return checked(self._stack.control.step(believed, self._channels.planning), ControlCommand)

    def _judge(self, moment: Moment) -> None:
        if moment.time > self._contact:
            return  # what follows a crash is not simulated truly
        for oracle in self._oracles:
            violation = oracle.observe(moment)
            if violation is not None:
                self._violations.append(violation)
                self._breach = min(self._breach, moment.time)
                self._is_stuck |= violation.kind == NoProgress.kind
                if violation.contact is not None:
                    self._contact = moment.time

    def _ended(self, moment: Moment) -> Ending | None:
        rule, beyond = self._task.stop, self.ego.station() + self.ego.shape.front - self.ego.route.destination
        if abs(beyond) <= self._arrived_within and moment.ego.speed == 0.0:
            return Ending.ARRIVED
        if moment.time >= self._latest - TICK or beyond > _LOST_BEYOND or self._is_stuck:
            return Ending.TIME_OVER
        if moment.time >= rule.settled - TICK and self.ego.station() > rule.place:
            return Ending.CUT
        stop = min(rule.at, self._end, self._breach + rule.after_violation, self._contact + rule.after_contact)
        return Ending.CUT if moment.time >= stop - TICK else None


def _objects_in(message: Message) -> TrackedObjects | None:
    if isinstance(message, PredictedObjects):
        return message.objects
    return message if isinstance(message, TrackedObjects) else None


def _due(task: Task) -> tuple[tuple[Component, ...], ...]:
    """The components that run at each tick of a world step, in their order."""
    drawn = [0, 0, 0]
    if task.jitter is not None:
        drawn = [int(draw * TICKS_PER_STEP) for draw in uniforms(task.seed, _PHASE_STREAM, 0, [0], 3)[0]]
    slower = dict(zip((Component.PERCEPTION, Component.PREDICTION, Component.PLANNING), drawn, strict=True))
    return tuple(
        tuple(component for component in COMPONENTS if slower.get(component, tick) == tick)
        for tick in range(TICKS_PER_STEP)
    )
