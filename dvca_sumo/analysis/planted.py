"""The answer held against the faults that were planted."""

from collections.abc import Sequence

import msgspec

from dvca_sumo.interventions import Fault
from dvca_sumo.messages import Component, MessageId
from dvca_sumo.record import MessageMark, Record


class Planted(msgspec.Struct, frozen=True):
    """How the answer compares with the faults that were planted."""

    component: Component
    altered: tuple[int, ...]  # messages of the factual run that a fault changed
    component_success: bool
    message_success: bool
    message_distance: float | None  # [s] from the reported message to the nearest altered one


def planted(
    faults: Sequence[Fault], record: Record, component: Component | None, message: MessageMark | None
) -> Planted | None:
    """How what was named compares with `faults`: with that of the component, else the first; None without faults."""
    if not faults:
        return None
    fault = next((one for one in faults if one.component == component), faults[0])
    altered = tuple(dict.fromkeys(record.altered[fault.component]))  # two faults may touch one message
    is_right = component == fault.component
    distance: float | None = None
    if is_right and message is not None and altered:
        times = [record.mark(MessageId(fault.component, index)).time for index in altered]
        distance = min(abs(time - message.time) for time in times)
    has_message = is_right and message is not None and message.index in altered
    return Planted(fault.component, altered, is_right, has_message, distance)
