"""What a component may answer, and that nobody changes it afterwards."""

import enum
import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from small_scenarios import EGO, driven, in_child, scenario_file
from small_stacks import undecided

from dvca_sumo.interventions import Fault, Ideal, planted_fault
from dvca_sumo.messages import (
    PREDICTION_TIMES,
    TRAJECTORY_TIMES,
    Component,
    ControlCommand,
    LocalizationEstimate,
    PoseStep,
    PredictedObjects,
    SignalColour,
    TrackedObjects,
    Trajectory,
)
from dvca_sumo.record import Digest
from dvca_sumo.run.answers import checked
from dvca_sumo.scenario import AUTO, load_scenario
from dvca_sumo.screen import driving
from dvca_sumo.screen.results import TripOutcome
from dvca_sumo.screen.trips import Trip
from dvca_sumo.stack.reference import Stack, StackContext, StackError, reference_stack
from dvca_sumo.stack.sources import StackSource

# It stands on the other side of the road, in view.
ASIDE = (
    '<vehicle id="aside" depart="0" departPos="200"><route edges="cb"/>'
    '<stop lane="cb_0" startPos="200" endPos="201" duration="1000" parking="true"/></vehicle>'
)


class Mood(enum.StrEnum):
    """A planner's own words for its decisions."""

    CALM = "calm"


class Grams(float):
    """A number of somebody's own."""


class Name(str):
    """A text of somebody's own."""

    __slots__ = ()


class Explained(Trajectory, frozen=True):
    """A trajectory with more to it."""

    why: object = None


ESTIMATE = LocalizationEstimate(0.0, 1.0, 2.0, 0.0, 3.0, 0.0, 0.0)
TRACKED = TrackedObjects(
    0.0, np.array([7]), np.array([0]), np.ones((1, 5)), np.ones((1, 2)), {"b/0": SignalColour.GREEN}
)
PREDICTED = PredictedObjects(
    TRACKED, np.array([0]), np.ones(1), np.ones((1, len(PREDICTION_TIMES), 3)), (("ab_0", "bc_0"),)
)
TRAJECTORY = Trajectory(0.0, np.column_stack([TRAJECTORY_TIMES, np.zeros((len(TRAJECTORY_TIMES), 6))]), "cruise")
COMMAND = ControlCommand(0.0, 0.5, 0.0)
KINDS = (ESTIMATE, TRACKED, PREDICTED, TRAJECTORY, COMMAND)
FITTING: list[tuple[msgspec.Struct, dict[str, Any]]] = [
    *((message, {}) for message in KINDS),
    (ESTIMATE, {"x": np.float64(1.0), "y": np.float32(2.0), "speed": 3}),
    (COMMAND, {"acceleration": 0, "steering": np.int64(0)}),
    (COMMAND, {"exact": PoseStep(0.1, 0.0, 0.0, np.float64(0.0))}),
    (TRACKED, {"ids": np.array([7], dtype=np.int32), "boxes": np.ones((1, 5), dtype=np.int64)}),
    (TRACKED, {"ids": np.array([7], dtype=np.uint64), "velocities": np.ones((1, 2), dtype=np.float32)}),
    (TRACKED, {"signals": {}}),
    (PREDICTED, {"lanes": ((),)}),
    (PREDICTED, {"lanes": ((np.str_("ab_0"),),)}),
    (TRAJECTORY, {"decision": Mood.CALM}),
]
UNFIT: list[tuple[msgspec.Struct, dict[str, Any], str]] = [
    (ESTIMATE, {"speed": "fast"}, "its speed is of type str, not float"),
    (ESTIMATE, {"yaw_rate": None}, "its yaw_rate is of type NoneType, not float"),
    (ESTIMATE, {"x": np.array(1.0)}, "its x is of type ndarray, not float"),
    (ESTIMATE, {"time": Grams(1.0)}, "a record holds a Grams, which has no canonical bytes"),
    (ESTIMATE, {"time": 10**30}, "can't serialize ints"),
    (COMMAND, {"time": object()}, "its time is of type object, not float"),
    (COMMAND, {"steering": 1j}, "its steering is of type complex, not float"),
    (COMMAND, {"exact": (0.1, 0.0, 0.0, 0.0)}, "its exact is of type tuple, not PoseStep"),
    (COMMAND, {"exact": PoseStep(0.1, 0.0, "left", 0.0)}, "its turn is of type str, not float"),  # type: ignore[arg-type]
    (TRAJECTORY, {"decision": object()}, "its decision is of type object, not str"),
    (TRAJECTORY, {"time": None}, "its time is of type NoneType, not float"),
    (TRAJECTORY, {"points": TRAJECTORY.points.astype(object)}, "its points are of type object, not float64"),
    (TRACKED, {"boxes": np.ones((1, 5), dtype=object)}, "its boxes are of type object, not float64"),
    (TRACKED, {"boxes": np.ones((1, 5), dtype=np.longdouble)}, f"its boxes are of type {np.dtype(np.longdouble)}, not"),
    (TRACKED, {"velocities": np.ones((1, 2), dtype=np.bool_)}, "its velocities are of type bool, not float64"),
    (TRACKED, {"ids": np.array(["7"], dtype=object)}, "its ids are of type object, not int64"),
    (TRACKED, {"classes": np.array(["car"])}, "its classes are of type <U3, not int64"),
    (TRACKED, {"ids": np.array([7.0])}, "its ids are of type float64, not int64"),
    (TRACKED, {"signals": []}, "its signals is of type list, not dict"),
    (TRACKED, {"signals": {0: SignalColour.RED}}, "one of its signals is of type int, not str"),
    (TRACKED, {"signals": {"b/0": "red"}}, "one of its colours is of type str, not SignalColour"),
    (PREDICTED, {"objects": None}, "its objects is of type NoneType, not TrackedObjects"),
    (
        PREDICTED,
        {"objects": msgspec.structs.replace(TRACKED, boxes=np.ones((1, 5), dtype=object))},
        "its objects.boxes are of type object, not float64",
    ),
    (
        PREDICTED,
        {"objects": msgspec.structs.replace(TRACKED, signals={"b/0": None})},
        "one of its colours is of type NoneType, not SignalColour",
    ),
    (PREDICTED, {"owners": np.array([True])}, "its owners are of type bool, not int64"),
    (PREDICTED, {"owners": np.array([1])}, "one of its owners is no row of its 1 objects"),
    (PREDICTED, {"owners": np.array([-1])}, "one of its owners is no row of its 1 objects"),
    (PREDICTED, {"probabilities": np.array([np.nan])}, "one of its probabilities is not finite"),
    (PREDICTED, {"poses": np.full_like(PREDICTED.poses, np.inf)}, "one of its poses is not finite"),
    (
        PREDICTED,
        {"objects": msgspec.structs.replace(TRACKED, boxes=np.full((1, 5), np.nan))},
        "one of its objects.boxes is not finite",
    ),
    (TRACKED, {"velocities": np.full((1, 2), np.nan)}, "one of its velocities is not finite"),
    (TRAJECTORY, {"points": TRAJECTORY.points + np.inf}, "one of its points is not finite"),
    (PREDICTED, {"lanes": [("ab_0",)]}, "its lanes is of type list, not tuple"),
    (PREDICTED, {"lanes": (["ab_0"],)}, "one of its lanes is of type list, not tuple"),
    (PREDICTED, {"lanes": ((7,),)}, "one of its lanes is of type int, not str"),
    (PREDICTED, {"lanes": ((Name("ab_0"),),)}, "a record holds a Name, which has no canonical bytes"),
]


@pytest.mark.parametrize(("message", "changed"), FITTING)
def test_what_fits_is_taken_as_it_is_and_into_a_record(message: msgspec.Struct, changed: dict[str, Any]) -> None:
    answer = msgspec.structs.replace(message, **changed)
    assert checked(answer, type(message)) is answer
    assert Digest().step(answer)


@pytest.mark.parametrize(("message", "changed", "words"), UNFIT)
def test_what_does_not_fit_is_refused(message: msgspec.Struct, changed: dict[str, Any], words: str) -> None:
    answer = msgspec.structs.replace(message, **changed)
    with pytest.raises((TypeError, ValueError, OverflowError), match=re.escape(words)):
        checked(answer, type(message))


def test_what_a_subclass_adds_has_to_fit_into_a_record() -> None:
    values = msgspec.structs.asdict(TRAJECTORY)
    answer = Explained(**values, why="there is room")
    assert checked(answer, Trajectory) is answer
    with pytest.raises(TypeError, match="a record holds a object"):
        checked(Explained(**values, why=object()), Trajectory)


def undecided_when_long(context: StackContext) -> Stack:
    return undecided(context) if context.shape.length > 5.0 else reference_stack(context)


def test_an_answer_of_another_type_costs_no_other_trip_of_the_simulation(tmp_path: Path, street: Path) -> None:
    trips = "".join(
        f'<trip id="{name}" type="{name}" from="bc" to="bc" depart="1" departPos="{place}" arrivalPos="{place + 60}"/>'
        for name, place in (("long", 20), ("short", 120))
    )
    scenario = load_scenario(
        scenario_file(tmp_path, street, f'<vType id="long" length="6"/><vType id="short"/>{trips}'), AUTO
    )
    asked = [Trip(name, 1.0, 60.0, 5.0, 10.0) for name in ("long", "short")]
    source = StackSource("test_answers:undecided_when_long")
    found = in_child(partial(driving.driven, scenario, source, asked, 2, lambda _time, _done: None))
    results = {result.ego: result for result in found.results}
    assert results["long"].outcome is TripOutcome.ABORTED
    assert "planning raised TypeError: its decision is of type object, not str" in results["long"].reason
    assert results["short"].outcome is TripOutcome.ARRIVED


class Scribbling:
    """A component that writes into one of the arrays that it is told, from some time on."""

    def __init__(self, component: Any, array_of: Callable[..., Any]) -> None:
        self._component, self._array_of = component, array_of

    def step(self, *inputs: Any) -> Any:
        if inputs[0].time > SCRIBBLING:
            array = self._array_of(*inputs)
            array[...] = array.copy()
        return self._component.step(*inputs)


def scribbling(context: StackContext, component: str, array_of: Callable[..., Any]) -> Stack:
    stack = reference_stack(context)
    return replace(stack, **{component: Scribbling(getattr(stack, component), array_of)})  # type: ignore[arg-type]


SCRIBBLING = 2.0  # [s] by then it has seen who is there
scribbling_prediction = partial(scribbling, component="prediction", array_of=lambda tracked: tracked.boxes)
scribbling_planning = partial(scribbling, component="planning", array_of=lambda _, predicted, __: predicted.poses)
scribbling_control = partial(scribbling, component="control", array_of=lambda _, trajectory: trajectory.points)


@pytest.mark.parametrize(
    ("intervention", "writer"),
    [
        (planted_fault("perception.box:object=aside"), "prediction"),
        (planted_fault("prediction.wrong:object=aside"), "planning"),
        (planted_fault("planning.path"), "control"),
        (Ideal(Component.PERCEPTION), "prediction"),
        (Ideal(Component.PREDICTION), "planning"),
    ],
)
def test_who_writes_to_a_message_that_was_put_in_the_place_of_anothers_is_named(
    tmp_path: Path, street: Path, intervention: Fault | Ideal, writer: str
) -> None:
    """Else the record would show what was never said."""
    config = scenario_file(tmp_path, street, EGO + ASIDE)
    with pytest.raises(StackError, match=rf"{writer} raised ValueError: .*not to be written to\) in cycle (19|20) "):
        driven(config, intervention, stack=f"test_answers:scribbling_{writer}")
