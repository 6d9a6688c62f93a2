import math
from collections.abc import Mapping

import numpy as np
import pytest
from msgspec.structs import replace

from dvca_sumo.interventions import EFFECTS
from dvca_sumo.interventions.effects import Effect, Parameters
from dvca_sumo.messages import (
    ACCELERATION,
    CURVATURE,
    HEADING,
    PREDICTION_TIMES,
    SPEED,
    Component,
    ControlCommand,
    LocalizationEstimate,
    Message,
    PredictedObjects,
    T,
    TrackedObjects,
    Trajectory,
    X,
    Y,
)
from dvca_sumo.truth import EgoTruth
from interventions.scenes import (
    RED,
    Thing,
    command,
    ego,
    estimate,
    occasion,
    predicted,
    tracked,
    trajectory,
    walker,
)

NORTH = ego(heading=math.pi / 2)
LEAD = Thing("lead", 45.0, 0.0, (8.0, 0.0))
PED = walker("person:ped", 60.0, -2.0, across=1.4)
BOTH = (LEAD, PED)
NOBODY = {"object": "ghost"}


def distorted_objects(name: str, who: EgoTruth | None = None, **parameters: float | str) -> TrackedObjects:
    said = EFFECTS[name](tracked(BOTH), parameters, occasion(BOTH, who=who))
    assert isinstance(said, TrackedObjects)
    return said


def distorted_futures(name: str, message: PredictedObjects, **parameters: float | str) -> PredictedObjects:
    said = EFFECTS[name](message, parameters, occasion(BOTH))
    assert isinstance(said, PredictedObjects)
    return said


def distorted_plan(name: str, message: Trajectory, **parameters: float | str) -> Trajectory:
    said = EFFECTS[name](message, parameters, occasion())
    assert isinstance(said, Trajectory)
    return said


# For each effect, something that it has nothing to distort of.
NOTHING_TO_DISTORT: dict[str, list[tuple[Message, Parameters]]] = {
    "shift_pose": [(estimate(), {"left": 0.0})],
    "drop_objects": [(tracked(BOTH), NOBODY), (tracked([]), {"object": "all"}), (tracked([]), {"object": "lead"})],
    "resize_objects": [
        (tracked(BOTH), {**NOBODY, "length": 1.0, "width": 1.0}),
        (tracked(BOTH), {"object": "all", "length": 0.0, "width": 0.0}),
    ],
    "shift_objects": [
        (tracked(BOTH), {**NOBODY, "ahead": 1.0, "left": 1.0}),
        (tracked(BOTH), {"object": "all", "ahead": 0.0, "left": 0.0}),
    ],
    "speed_objects": [
        (tracked(BOTH), {**NOBODY, "ahead": 1.0, "left": 1.0}),
        (tracked(BOTH), {"object": "all", "ahead": 0.0, "left": 0.0}),
    ],
    "drop_predictions": [(predicted(BOTH), NOBODY), (predicted(BOTH, hypotheses=0), {"object": "all"})],
    "drift_predictions": [
        (predicted(BOTH), {**NOBODY, "ahead": 1.0, "left": 1.0}),
        (predicted(BOTH), {"object": "all", "ahead": 0.0, "left": 0.0}),
        (predicted(BOTH, hypotheses=0), {"object": "all", "ahead": 1.0, "left": 1.0}),
    ],
    "shift_path": [(trajectory(), {"left": 0.0})],
    "change_speed": [
        (trajectory(), {"factor": 1.0, "error": 0.0}),
        (trajectory(speed=0.0), {"factor": 3.0, "error": 0.0}),
        (trajectory(speed=0.0), {"factor": 1.0, "error": -5.0}),
    ],
    "publish_nothing": [],
    "offset_acceleration": [(command(), {"error": 0.0})],
    "offset_steering": [(command(), {"error": 0.0})],
}


MESSAGES: dict[Component, Message] = {
    Component.LOCALIZATION: estimate(),
    Component.PERCEPTION: tracked(BOTH),
    Component.PREDICTION: predicted(BOTH),
    Component.PLANNING: trajectory(),
    Component.CONTROL: command(),
}


class Watched(dict[str, float | str]):
    """Parameters that know which of them were read."""

    def __init__(self, values: Mapping[str, float | str]) -> None:
        super().__init__(values)
        self.read: set[str] = set()

    def __getitem__(self, name: str) -> float | str:
        self.read.add(name)
        return super().__getitem__(name)


@pytest.mark.parametrize(
    ("effect", "component"),
    [(effect, component) for effect in EFFECTS.values() for component in effect.components],
    ids=lambda one: one.distort.__name__ if isinstance(one, Effect) else one,
)
def test_an_effect_distorts_its_components_messages_and_reads_what_it_says(
    effect: Effect, component: Component
) -> None:
    parameters = Watched({name: "all" if kind == "object" else 0.5 for name, kind in effect.reads.items()})
    assert effect(MESSAGES[component], parameters, occasion(BOTH)) is not MESSAGES[component]
    assert parameters.read == set(effect.reads)


def test_every_effect_is_asked_for_the_case_of_nothing_to_distort() -> None:
    assert set(NOTHING_TO_DISTORT) == set(EFFECTS)


@pytest.mark.parametrize(
    ("name", "message", "parameters"),
    [(name, *case) for name, cases in NOTHING_TO_DISTORT.items() for case in cases],
)
def test_the_very_message_comes_back_when_there_is_nothing_to_distort(
    name: str, message: Message, parameters: Parameters
) -> None:
    assert EFFECTS[name](message, parameters, occasion(BOTH)) is message


def test_a_dropped_object_is_gone_and_the_others_stay_as_they_were() -> None:
    said = distorted_objects("drop_objects", object="lead")
    assert said.ids.tolist() == [101]
    np.testing.assert_array_equal(said.boxes, tracked(BOTH).boxes[1:])
    np.testing.assert_array_equal(said.velocities, tracked(BOTH).velocities[1:])
    assert said.classes.tolist() == [int(PED.kind)]
    assert said.signals == RED


def test_all_objects_can_be_dropped() -> None:
    said = distorted_objects("drop_objects", object="all")
    assert (said.ids.shape, said.boxes.shape, said.velocities.shape) == ((0,), (0, 5), (0, 2))


def test_a_resized_box_keeps_its_centre() -> None:
    said = distorted_objects("resize_objects", object="lead", length=2.0, width=-0.5)
    np.testing.assert_allclose(said.boxes[0], [45.0, 0.0, 0.0, 6.6, 1.3])
    np.testing.assert_array_equal(said.boxes[1], tracked(BOTH).boxes[1])


def test_a_box_never_shrinks_to_nothing() -> None:
    said = distorted_objects("resize_objects", object="all", length=-20.0, width=-20.0)
    np.testing.assert_allclose(said.boxes[:, 3:], 0.1)


def test_an_object_is_shifted_along_and_across_the_egos_heading() -> None:
    said = distorted_objects("shift_objects", object="lead", ahead=20.0, left=3.0)
    np.testing.assert_allclose(said.boxes[0], [65.0, 3.0, 0.0, 4.6, 1.8])
    headed_north = distorted_objects("shift_objects", who=NORTH, object="lead", ahead=20.0, left=3.0)
    np.testing.assert_allclose(headed_north.boxes[0, :3], [42.0, 20.0, 0.0])
    np.testing.assert_array_equal(headed_north.boxes[1], tracked(BOTH).boxes[1])


def test_a_wrong_velocity_leaves_the_place_alone() -> None:
    said = distorted_objects("speed_objects", who=NORTH, object="lead", ahead=10.0, left=1.0)
    np.testing.assert_allclose(said.velocities, [[7.0, 10.0], [0.0, 1.4]])
    np.testing.assert_array_equal(said.boxes, tracked(BOTH).boxes)


def test_the_egos_heading_is_the_one_it_believes() -> None:
    believed = replace(estimate(), heading=math.pi)
    said = EFFECTS["speed_objects"](
        tracked(BOTH), {"object": "all", "ahead": 5.0, "left": 0.0}, occasion(BOTH, believed=believed)
    )
    assert isinstance(said, TrackedObjects)
    np.testing.assert_allclose(said.velocities, [[3.0, 0.0], [-5.0, 1.4]], atol=1e-12)


def test_an_object_loses_all_its_predicted_trajectories_but_stays_tracked() -> None:
    message = predicted(BOTH, hypotheses=2)
    said = distorted_futures("drop_predictions", message, object="lead")
    assert said.owners.tolist() == [1, 1]
    assert said.objects is message.objects
    np.testing.assert_array_equal(said.poses, message.poses[2:])
    np.testing.assert_array_equal(said.probabilities, message.probabilities[2:])
    assert said.lanes == message.lanes[2:]


def test_predicted_trajectories_drift_away_from_where_they_begin() -> None:
    message = predicted(BOTH, hypotheses=2)
    said = distorted_futures("drift_predictions", message, object="ped", ahead=2.0, left=-1.0)
    moved = said.poses - message.poses
    np.testing.assert_allclose(moved[2:, :, 0], np.tile(2.0 * PREDICTION_TIMES, (2, 1)))
    np.testing.assert_allclose(moved[2:, :, 1], np.tile(-PREDICTION_TIMES, (2, 1)), atol=1e-12)
    assert not moved[:2].any()
    assert not moved[:, :, 2].any()


@pytest.mark.parametrize(("who", "moved"), [(ego(), (0.0, -2.0)), (NORTH, (2.0, 0.0))])
def test_a_shifted_path_lies_beside_the_planned_one(who: EgoTruth, moved: tuple[float, float]) -> None:
    message = trajectory(who)
    said = distorted_plan("shift_path", message, left=-2.0)
    np.testing.assert_allclose(said.points[:, [X, Y]] - message.points[:, [X, Y]], [moved] * 81, atol=1e-12)
    np.testing.assert_array_equal(said.points[:, HEADING:], message.points[:, HEADING:])


def test_a_plan_that_is_driven_faster_stays_on_its_path_and_goes_straight_on_beyond_it() -> None:
    said = distorted_plan("change_speed", trajectory(), factor=1.5, error=1.0)
    np.testing.assert_allclose(said.points[:, SPEED], 16.0)
    np.testing.assert_allclose(said.points[:, X], 20.0 + 16.0 * said.points[:, T])
    np.testing.assert_allclose(said.points[:, ACCELERATION], 0.0, atol=1e-9)
    np.testing.assert_allclose(said.points[:, Y], 0.0)


def test_a_plan_that_is_driven_slower_ends_before_the_planned_end() -> None:
    said = distorted_plan("change_speed", trajectory(), factor=0.5, error=0.0)
    np.testing.assert_allclose(said.points[:, X], 20.0 + 5.0 * said.points[:, T])


def test_a_curved_plan_is_followed_around_its_curve_at_the_wrong_speed() -> None:
    angles = trajectory().points[:, T] * 10.0 / 40.0  # a circle of 40 m
    points = trajectory().points.copy()
    points[:, X], points[:, Y] = 40.0 * np.sin(angles), 40.0 * (1.0 - np.cos(angles))
    points[:, HEADING], points[:, CURVATURE] = angles, 1.0 / 40.0
    said = distorted_plan("change_speed", Trajectory(0.0, points, "cruise"), factor=0.5, error=0.0)
    radii = np.hypot(said.points[:, X], said.points[:, Y] - 40.0)
    np.testing.assert_allclose(radii, 40.0, atol=0.01)
    np.testing.assert_allclose(said.points[:, HEADING], 0.5 * angles, atol=1e-3)
    np.testing.assert_allclose(said.points[:, CURVATURE], 1.0 / 40.0)


def test_beyond_the_end_of_a_curved_plan_the_way_is_straight() -> None:
    points = trajectory().points.copy()
    points[:, CURVATURE] = 1.0 / 40.0
    said = distorted_plan("change_speed", Trajectory(0.0, points, "cruise"), factor=2.0, error=0.0).points
    is_beyond = said[:, X] > points[-1, X] + 1e-6
    assert 0 < is_beyond.sum() < len(said)
    np.testing.assert_allclose(said[:, CURVATURE], np.where(is_beyond, 0.0, 1.0 / 40.0))


def test_a_plan_to_stand_that_is_driven_nevertheless_goes_straight_on() -> None:
    said = distorted_plan("change_speed", trajectory(NORTH, speed=0.0), factor=1.0, error=6.0)
    np.testing.assert_allclose(said.points[:, Y], 6.0 * said.points[:, T], atol=1e-6)
    np.testing.assert_allclose(said.points[:, X], 20.0, atol=1e-6)


def test_speed_is_never_negative_and_its_changes_are_the_accelerations() -> None:
    points = trajectory().points.copy()
    points[:, SPEED] = 10.0 - points[:, T]
    said = distorted_plan("change_speed", Trajectory(0.0, points, "stop"), factor=1.0, error=-6.0)
    np.testing.assert_allclose(said.points[:, SPEED], np.maximum(4.0 - points[:, T], 0.0))
    np.testing.assert_allclose(said.points[:39, ACCELERATION], -1.0)
    np.testing.assert_allclose(said.points[41:, ACCELERATION], 0.0)


def test_a_lost_message_is_none() -> None:
    assert EFFECTS["publish_nothing"](trajectory(), {}, occasion()) is None


def test_commands_are_off_by_their_error() -> None:
    longitudinal = EFFECTS["offset_acceleration"](command(0.5, 0.01), {"error": 4.0}, occasion())
    lateral = EFFECTS["offset_steering"](command(0.5, 0.01), {"error": -0.1}, occasion())
    assert longitudinal == ControlCommand(0.0, 4.5, 0.01)
    assert isinstance(lateral, ControlCommand)
    assert lateral.acceleration == 0.5
    assert lateral.steering == pytest.approx(-0.09)


@pytest.mark.parametrize(("who", "place"), [(ego(), (20.0, 1.5)), (NORTH, (18.5, 0.0))])
def test_the_believed_position_lies_to_the_left_of_the_estimated_one(who: EgoTruth, place: tuple[float, float]) -> None:
    said = EFFECTS["shift_pose"](estimate(who), {"left": 1.5}, occasion())
    assert isinstance(said, LocalizationEstimate)
    assert (said.x, said.y) == pytest.approx(place)
    assert replace(said, x=20.0, y=0.0) == estimate(who)
