"""Replacing messages: faults and idealized substitutes are one mechanism."""

import msgspec

from dvca_sumo.interventions.effects import EFFECTS
from dvca_sumo.interventions.entries import FaultError, FaultType, Parameter
from dvca_sumo.interventions.futures import Futures, Track, recorded_futures
from dvca_sumo.interventions.library import COMMON, Fault, assert_met, fault_library, planted_fault
from dvca_sumo.interventions.selection import Gate, Occasion, Selection
from dvca_sumo.interventions.states import UNITS, State, StateUnits, state_of
from dvca_sumo.messages import Component

__all__ = [
    "COMMON",
    "EFFECTS",
    "UNITS",
    "Fault",
    "FaultError",
    "FaultType",
    "Futures",
    "Gate",
    "Ideal",
    "Intervention",
    "Occasion",
    "Parameter",
    "Selection",
    "State",
    "StateUnits",
    "Track",
    "assert_met",
    "fault_library",
    "planted_fault",
    "recorded_futures",
    "state_of",
]


class Ideal(msgspec.Struct, frozen=True):
    """An idealized substitute for one component, over a selection of its messages."""

    component: Component
    selection: Selection = Selection()


Intervention = Fault | Ideal
