"""What one run leaves behind, and its digest."""

import bisect
import hashlib
import math
from typing import Any

import msgspec
import numpy as np

from dvca_sumo.columns import Columns, packed
from dvca_sumo.interventions import State, state_of
from dvca_sumo.messages import COMPONENTS, Component, LocalizationEstimate, Message, MessageId
from dvca_sumo.roadmap import Route
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import EgoTruth, Moment
from dvca_sumo.violations import Ending, Judgement, Violation

TICK = 0.01  # [s] of the fastest components; ticks count from the ego's departure


class Execution(msgspec.Struct, frozen=True, gc=False):
    """One run of one component."""

    tick: int
    message: Message | None  # None: nothing was published


class MessageMark(msgspec.Struct, frozen=True):
    """Where in a drive a message was made."""

    component: Component
    index: int
    time: float  # [s]
    state: State


class Record(msgspec.Struct):
    """One ego's drive. `path`, `stations` have one entry a tick, `moments` one a world step."""

    ego: str
    stops: tuple[str, ...]  # the vehicle's own, which the ego did not make
    route: Route
    signed_lanes: frozenset[str]  # whose limit may be another than the route's, at any time
    thresholds: Thresholds
    sensor_range: float  # [m] of the stack
    start: float  # [s] departure
    executions: dict[Component, list[Execution]]
    altered: dict[Component, list[int]]  # indices of messages that a fault changed
    path: list[EgoTruth]
    stations: list[float]  # [m] of the rear axle along the route
    moments: list[Moment]
    violations: list[Violation]  # by time, up to the first contact
    judgements: tuple[Judgement, ...]
    ending: Ending
    simulated: float  # [s] of SUMO time, the way to the departure included
    substituted: float | None  # [s] time of the first message that an idealized substitute made
    digests: list[bytes]  # (steps,) of everything up to each world step, the oracles' findings excluded

    def __reduce__(self) -> tuple[object, ...]:
        """To another process in columns: one by one, its messages would take as long as their making."""
        values = msgspec.structs.asdict(self)
        columns = {name: packed(values.pop(name)) for name in _LONG}
        executions = {component: packed(made) for component, made in values.pop("executions").items()}
        return _restored, (values, columns, executions)

    @property
    def digest(self) -> str:
        """Of the whole run, violations included."""
        return Digest().step(self.digests, self.violations).hex()

    def mark(self, message: MessageId) -> MessageMark:
        """Time and vehicle dynamic state of a message."""
        tick = self.executions[message.component][message.index].tick
        ego = self.path[tick]
        return MessageMark(
            message.component,
            message.index,
            ego.time,
            state_of(self.stations[tick], ego.speed, ego.acceleration),
        )

    def first_at(self, component: Component, time: float) -> int:
        """Index of the component's first message at or after `time` [s]; the number of messages if there is none."""
        tick = math.ceil((time - self.start) / TICK - 1e-6)
        return bisect.bisect_left(self.executions[component], tick, key=lambda execution: execution.tick)

    def latest(self, component: Component, tick: int) -> Message:
        """The component's message in force at a tick: the last one published up to and including it.

        Raises:
            IndexError: There is none yet.
        """
        executions = self.executions[component]
        row = bisect.bisect_right(executions, tick, key=lambda execution: execution.tick) - 1
        while row >= 0:
            message = executions[row].message
            if message is not None:
                return message
            row -= 1
        raise IndexError(f"no message of {component} at or before tick {tick}")

    def believed_at(self, tick: int) -> LocalizationEstimate:
        """The localization estimate in force at a tick; raises what `latest` does."""
        believed = self.latest(Component.LOCALIZATION, tick)
        assert isinstance(believed, LocalizationEstimate)  # localization publishes nothing else
        return believed

    def moment_at(self, tick: int) -> Moment:
        """The truth at a tick: the world step's, moved on to the tick."""
        step = min(tick // 10, len(self.moments) - 1)
        return moved_on(self.moments[step], self.path[tick])

    @property
    def message_counts(self) -> dict[Component, int]:
        """How many messages each component made."""
        return {component: len(self.executions[component]) for component in COMPONENTS}


def moved_on(moment: Moment, ego: EgoTruth) -> Moment:
    """The truth between two world steps: the ego as it is, other objects at their last velocity."""
    elapsed = ego.time - moment.time
    if elapsed <= 0.0:
        return moment
    boxes = moment.objects.boxes.copy()
    boxes[:, :2] += elapsed * moment.objects.velocities
    return Moment(
        ego, moment.shape, msgspec.structs.replace(moment.objects, time=ego.time, boxes=boxes), moment.signals
    )


_LONG = ("path", "stations", "moments")


def _restored(values: dict[str, Any], columns: dict[str, Columns], executions: dict[Component, Columns]) -> Record:
    for name, column in columns.items():
        values[name] = list(column.rows())
    values["executions"] = {component: list(column.rows()) for component, column in executions.items()}
    return Record(**values)


class Digest:
    """A fingerprint of everything a run produced, taken step by step.

    Equal runs have equal digests on every machine with the same floating point results; the digest of a
    step covers all before it, so that two runs can be compared up to any step.
    """

    def __init__(self) -> None:
        self._summed = hashlib.blake2b(digest_size=16)

    def step(self, *parts: object) -> bytes:
        """Take in what a step produced (messages, truth, or collections of them); the digest so far."""
        self._summed.update(_ENCODER.encode(parts))
        return self._summed.copy().digest()


def _bytes_of(value: object) -> object:
    if isinstance(value, np.ndarray):
        return value.tobytes()
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a record holds a {type(value).__name__}, which has no canonical bytes")


_ENCODER = msgspec.msgpack.Encoder(enc_hook=_bytes_of, order="deterministic")
