"""What one run leaves behind, and its digest."""

import hashlib

import msgspec
import numpy as np

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
    route: Route
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

    def believed_at(self, tick: int) -> LocalizationEstimate:
        """The localization estimate in force at a tick."""
        executions = self.executions[Component.LOCALIZATION]
        for execution in reversed(executions[: tick + 1]):
            if isinstance(execution.message, LocalizationEstimate):
                return execution.message
        raise IndexError(f"no localization estimate at or before tick {tick}")

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


def digest_of(record: Record) -> str:
    """A fingerprint of everything the run produced: messages, motion, truth, violations.

    Equal records have equal digests on every machine with the same floating point results.
    """
    summed = hashlib.blake2b(digest_size=16)
    for component in COMPONENTS:
        for execution in record.executions[component]:
            summed.update(_ENCODER.encode((execution.tick, execution.message)))
    summed.update(np.array([msgspec.structs.astuple(ego) for ego in record.path]).tobytes())
    for moment in record.moments:
        summed.update(_ENCODER.encode(moment.objects))
    summed.update(_ENCODER.encode(record.violations))
    return summed.hexdigest()


def _bytes_of(value: object) -> object:
    if isinstance(value, np.ndarray):
        return np.ascontiguousarray(value).tobytes()
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a record holds a {type(value).__name__}, which has no canonical bytes")


_ENCODER = msgspec.msgpack.Encoder(enc_hook=_bytes_of, order="deterministic")
