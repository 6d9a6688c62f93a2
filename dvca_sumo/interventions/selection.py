"""Which messages of a run an intervention touches, and what is known when one is made."""

import math

import msgspec

from dvca_sumo.interventions.futures import Futures
from dvca_sumo.interventions.states import State
from dvca_sumo.messages import LocalizationEstimate, MessageId, TrackedObjects, Trajectory
from dvca_sumo.roadmap import Route
from dvca_sumo.truth import Moment


class Occasion(msgspec.Struct):
    """The making of one message, truth included: interventions know everything, components do not."""

    message: MessageId
    elapsed: float  # [s] since the ego's departure
    state: State
    moment: Moment  # at the very time of the message
    believed: LocalizationEstimate  # what the component was given; of localization itself, what it put out
    trajectory: Trajectory | None  # latest one published
    route: Route
    sensor_range: float  # [m]
    futures: Futures
    told: TrackedObjects | None = None  # what the component itself says of the objects; None: nothing
    tracks: dict[str, int] = {}  # by simulator id: under which ids substitutes told of objects before; theirs to fill


class Selection(msgspec.Struct, frozen=True):
    """Messages by time window, index range and state; all conditions hold together."""

    start: float = 0.0  # [s] after the ego's departure
    end: float = math.inf  # [s] exclusive
    first: int = 0  # message index
    last: int | None = None  # inclusive; None: to the end
    state: State | None = None  # made in this state
    from_state: State | None = None  # from the first message in this state, or past it, on


class Gate:
    """A selection at work in one run: it remembers that `from_state` has been reached."""

    def __init__(self, selection: Selection) -> None:
        self._selection = selection
        self._is_reached = selection.from_state is None

    def admits(self, occasion: Occasion) -> bool:
        """Whether this message is selected. Must be asked of every message of the component, in order."""
        wanted = self._selection
        if not self._is_reached and wanted.from_state is not None:
            state = occasion.state
            self._is_reached = state == wanted.from_state or state.position > wanted.from_state.position
        index = occasion.message.index
        return (
            self._is_reached
            and wanted.start <= occasion.elapsed < wanted.end
            and wanted.first <= index
            and (wanted.last is None or index <= wanted.last)
            and (wanted.state is None or wanted.state == occasion.state)
        )
