"""The interventions of one drive: what they make of each message, and what they have left."""

from collections.abc import Sequence

from dvca_sumo.interventions import Fault, Gate, Intervention, Occasion
from dvca_sumo.interventions.effects import EFFECTS
from dvca_sumo.messages import COMPONENTS, Component, Message
from dvca_sumo.stack.ideal import SUBSTITUTES


class Intervening:
    """Faults and substitutes at work, in the order in which they were given."""

    def __init__(self, interventions: Sequence[Intervention]) -> None:
        self.altered: dict[Component, list[int]] = {component: [] for component in COMPONENTS}  # by faults
        self.substituted: float | None = None  # [s] time of the first substituted message
        self.tracks: dict[str, int] = {}  # see Occasion
        self._gates: dict[Component, list[tuple[Intervention, Gate]]] = {component: [] for component in COMPONENTS}
        self.go_on(interventions)

    def go_on(self, interventions: Sequence[Intervention]) -> None:
        """From now on others; those that are the same as before keep what they remember."""
        for component, known in self._gates.items():
            self._gates[component] = [
                (one, next((gate for old, gate in known if old == one), Gate(one.selection)))
                for one in interventions
                if one.component == component
            ]

    def concern(self, component: Component) -> bool:
        """Whether there are any for a component."""
        return bool(self._gates[component])

    def published(self, message: Message, occasion: Occasion) -> Message | None:
        """What becomes of a message; None: nothing is published."""
        result: Message | None = message
        for intervention, gate in self._gates[occasion.message.component]:
            if gate.admits(occasion):
                result = self._replaced(intervention, result, occasion)
        return result

    def _replaced(self, intervention: Intervention, message: Message | None, occasion: Occasion) -> Message | None:
        if not isinstance(intervention, Fault):
            if self.substituted is None:
                self.substituted = occasion.moment.time
            return SUBSTITUTES[intervention.component](occasion)
        if message is None:
            return None
        altered = EFFECTS[intervention.effect](message, intervention.parameters, occasion)
        indices = self.altered[intervention.component]
        if altered is not message and indices[-1:] != [occasion.message.index]:  # two faults may touch one message
            indices.append(occasion.message.index)
        return altered
