"""The paper's figures, to stand beside ours (Driving Violation Cause Analysis, its tables of results)."""

import msgspec

from dvca_sumo.messages import Component


class Figures(msgspec.Struct, frozen=True):
    """What was reported of the cases of one kind; shares from 0 to 1."""

    component_success: float
    message_success: float
    reduction_rate: tuple[float, float]  # least and greatest average; over all messages
    minutes: tuple[float, float]  # least and greatest average, for one case


def _single(component: float, message: float, reduction: float, minutes: float) -> Figures:
    return Figures(component, message, (reduction, reduction), (minutes, minutes))


INJECTED = {
    Component.PERCEPTION: _single(1.0, 1.0, 0.9989, 17.2),
    Component.PREDICTION: _single(1.0, 1.0, 0.9991, 15.1),
    Component.PLANNING: _single(1.0, 1.0, 0.9987, 2.7),
    Component.CONTROL: _single(1.0, 0.8, 0.787, 20.3),
    Component.LOCALIZATION: _single(1.0, 1.0, 0.9863, 19.6),
}
REAL_BUGS = {
    Component.PERCEPTION: Figures(1.0, 1.0, (0.985, 0.996), (17.2, 17.2)),
    Component.PLANNING: Figures(1.0, 1.0, (0.985, 0.996), (2.2, 3.8)),
}
BY_SUITE = {"injected": INJECTED, "real-bugs": REAL_BUGS}
