import math

import pytest
from interventions.scenes import RED, Thing, command, predicted, tracked, trajectory, walker
from msgspec.structs import replace

from analysis.scenes import START, drive, saying
from dvca_sumo.analysis.differences import Difference, differences
from dvca_sumo.geometry.frames import rotated, transferred
from dvca_sumo.interventions import EFFECTS, recorded_futures
from dvca_sumo.messages import (
    Component,
    LocalizationEstimate,
    Message,
    MessageId,
    ObjectClass,
    PredictedObjects,
    SignalColour,
    TrackedObjects,
)
from dvca_sumo.record import Record

PERCEPTION, PREDICTION, LOCALIZATION = Component.PERCEPTION, Component.PREDICTION, Component.LOCALIZATION
# One second after the departure the ego's front bumper is at x = 33.6.
PED = walker("person:ped", 55.0, -1.7, across=1.4)
LEAD = Thing("lead", 60.0, 0.0, (8.0, 0.0))
AT = 10  # index of the 10 Hz messages one second after the departure


def seen(things: list[Thing]) -> list[Thing]:
    return [thing.after(1.0) for thing in things]


def found(
    component: Component, said: Message | None, things: list[Thing], focus: str | None = None, index: int = AT
) -> tuple[Difference, ...]:
    record = saying(drive(things, duration=3.0), MessageId(component, index), said)
    return differences(record, MessageId(component, index), recorded_futures(record.moments), focus)


def texts(*args: object, **more: object) -> dict[str, str]:
    return {one.field: one.text for one in found(*args, **more)}  # type: ignore[arg-type]


def test_a_missing_object_is_told_by_where_it_is_from_the_front_bumper_and_what_it_does() -> None:
    (one,) = found(PERCEPTION, tracked([], START + 1.0), [PED])
    assert one.text == "object ped missing; truth: 21.4 m ahead, 0.3 m right, walking 1.4 m/s"


@pytest.mark.parametrize(
    ("thing", "words"),
    [
        (LEAD, "driving 8.0 m/s"),
        (replace(LEAD, kind=ObjectClass.BICYCLE), "riding 8.0 m/s"),
        (replace(LEAD, speed=(0.0, 0.0)), "standing"),
        (Thing("poi:cone", 60.0, 0.5, kind=ObjectClass.STATIC, size=(0.4, 0.4)), "0.5 m left, standing"),
    ],
)
def test_what_a_missing_object_does_depends_on_its_kind(thing: Thing, words: str) -> None:
    (one,) = found(PERCEPTION, tracked([], START + 1.0), [thing])
    assert one.text.endswith(words)


def test_an_object_that_is_tracked_far_from_its_place_is_missing() -> None:
    off = replace(LEAD, x=LEAD.x + 5.0)
    assert "missing" in found(PERCEPTION, tracked(seen([off]), START + 1.0), [LEAD])[0].text


def test_only_the_object_of_the_violation_counts() -> None:
    said = tracked([], START + 1.0)
    assert "ped" in found(PERCEPTION, said, [LEAD, PED], focus="person:ped")[0].text
    assert len(found(PERCEPTION, said, [LEAD, PED], focus="person:ped")) == 1


def test_without_one_the_object_most_in_the_way_counts_also_where_that_of_the_violation_is_out_of_sight() -> None:
    said = tracked([], START + 1.0)
    for focus in (None, "gone"):
        (one,) = found(PERCEPTION, said, [LEAD, PED], focus=focus)
        assert "ped" in one.text


def test_with_nothing_in_the_way_every_object_in_range_counts() -> None:
    beside = [Thing("left", 60.0, 6.0), Thing("right", 70.0, -6.0), Thing("afar", 190.0, 6.0)]
    assert len(found(PERCEPTION, tracked([], START + 1.0), beside)) == 2


@pytest.mark.parametrize("focus", [None, "lead"])
def test_what_is_out_of_range_is_not_missing(focus: str | None) -> None:
    lead = Thing("lead", 125.0, 0.0)
    assert found(PERCEPTION, tracked([], START + 1.0), [lead], focus=focus) == ()


def test_a_wrong_place_is_told_as_the_ego_is_headed() -> None:
    off = replace(LEAD, x=LEAD.x + 2.0, y=-1.0)
    said = texts(PERCEPTION, tracked(seen([off]), START + 1.0), [LEAD])
    assert said == {"position": "object lead 2.0 m ahead, 1.0 m right of its true place"}


def test_a_wrong_size_is_told_with_the_true_one() -> None:
    said = texts(PERCEPTION, tracked(seen([replace(LEAD, size=(4.6, 0.3))]), START + 1.0), [LEAD])
    assert said == {"size": "object lead is 4.6 x 0.3 m; truth: 4.6 x 1.8 m"}


def test_a_wrong_velocity_is_told_with_the_true_one() -> None:
    off = [replace(thing, speed=(18.0, 0.0)) for thing in seen([LEAD])]
    said = texts(PERCEPTION, tracked(off, START + 1.0), [LEAD])
    assert said == {"velocity": "object lead at 18.0 m/s; truth: 8.0 m/s"}


def test_a_wrong_colour_of_a_signal_is_told_but_not_that_one_is_out_of_sight() -> None:
    (name,) = RED
    right = tracked(seen([LEAD]), START + 1.0)
    wrong = replace(right, signals={name: SignalColour.GREEN, "elsewhere": SignalColour.GREEN})
    assert texts(PERCEPTION, wrong, [LEAD]) == {"signals": f"signal {name} green; truth: red"}
    assert found(PERCEPTION, replace(right, signals={}), [LEAD]) == ()


def test_the_worst_difference_comes_first() -> None:
    off = [replace(thing, x=thing.x + 1.0, size=(7.6, 1.8), speed=(10.0, 0.0)) for thing in seen([LEAD])]
    assert [one.field for one in found(PERCEPTION, tracked(off, START + 1.0), [LEAD])] == [
        "size",
        "velocity",
        "position",
    ]


@pytest.mark.parametrize("component", [LOCALIZATION, PERCEPTION, PREDICTION, Component.CONTROL])
def test_a_message_without_a_mistake_has_no_differences(component: Component) -> None:
    record = drive([LEAD, PED], duration=3.0)
    assert differences(record, MessageId(component, AT), recorded_futures(record.moments), None) == ()


def misled(record: Record) -> tuple[Record, LocalizationEstimate]:
    """The same drive by an ego that believes, after one second, to be elsewhere and headed elsewhere."""
    message = record.executions[LOCALIZATION][100].message
    assert isinstance(message, LocalizationEstimate)
    believed = replace(message, y=message.y + 3.0, heading=0.4)
    return saying(record, MessageId(LOCALIZATION, 100), believed), believed


def test_perception_is_not_blamed_for_what_localization_is_wrong_about() -> None:
    record, believed = misled(drive([LEAD, PED], duration=3.0))
    here, there = (30.0, 0.0, 0.0), (believed.x, believed.y, believed.heading)
    right = tracked(seen([LEAD, PED]), START + 1.0)
    boxes = right.boxes.copy()
    boxes[:, :3] = transferred(boxes[:, :3], here, there)
    placed = TrackedObjects(
        right.time, right.ids, right.classes, boxes, rotated(right.velocities, believed.heading), right.signals
    )
    message = MessageId(PERCEPTION, AT)
    futures = recorded_futures(record.moments)
    for focus in ("lead", "person:ped"):
        assert differences(saying(record, message, placed), message, futures, focus) == ()


def test_a_wrong_pose_is_told_from_the_true_one() -> None:
    record, _ = misled(drive(duration=3.0))
    said = differences(record, MessageId(LOCALIZATION, 100), recorded_futures(record.moments), None)
    by_field = {one.field: one.text for one in said}
    assert by_field["position"] == "believed 0.0 m ahead, 3.0 m left of the true position"
    assert by_field["heading"] == f"off by {math.degrees(0.4):+.1f} degrees"
    assert "speed" not in by_field


def test_a_wrong_believed_speed_is_told_with_the_true_one() -> None:
    record = drive(duration=3.0)
    message = record.executions[LOCALIZATION][100].message
    assert isinstance(message, LocalizationEstimate)
    said = texts(LOCALIZATION, replace(message, speed=4.0), [], index=100)
    assert said == {"speed": "4.0 m/s; truth: 10.0 m/s"}


def test_an_object_without_a_future_is_told() -> None:
    right = predicted(seen([LEAD, PED]), START + 1.0)
    none = PredictedObjects(right.objects, right.owners[:1], right.probabilities[:1], right.poses[:1], right.lanes[:1])
    (one,) = found(PREDICTION, none, [LEAD, PED], focus="person:ped")
    assert one.text.startswith("object ped without trajectory; truth: 21.4 m ahead")


def test_an_object_that_prediction_does_not_know_is_missing_there_as_well() -> None:
    assert "ped missing" in found(PREDICTION, predicted([], START + 1.0), [PED])[0].text


def test_a_wrong_future_is_told_by_how_far_off_it_is_after_three_seconds() -> None:
    wrong = predicted([replace(thing, speed=(8.0, 2.0)) for thing in seen([LEAD])], START + 1.0)
    assert texts(PREDICTION, wrong, [LEAD]) == {"trajectory": "object lead predicted 6.0 m from where it is 3 s later"}


def test_the_likeliest_future_is_the_one_that_counts() -> None:
    right = predicted(seen([LEAD]), START + 1.0)
    poses = predicted(seen([LEAD]), START + 1.0, hypotheses=2).poses.copy()
    poses[1, :, 1] += 30.0
    both = PredictedObjects(
        right.objects, right.owners.repeat(2), right.probabilities.repeat(2), poses, (("in_0",),) * 2
    )
    assert found(PREDICTION, replace(both, probabilities=right.probabilities.repeat(2) * [0.8, 0.2]), [LEAD]) == ()
    assert found(PREDICTION, replace(both, probabilities=right.probabilities.repeat(2) * [0.2, 0.8]), [LEAD]) != ()


def test_a_wrong_command_is_told_beside_what_the_trajectory_has() -> None:
    said = texts(Component.CONTROL, command(4.0, -0.1), [], index=100)
    assert said == {
        "acceleration": "+4.0 m/s^2; the trajectory has +0.0 m/s^2",
        "steering": "-0.100 rad; the trajectory has +0.000 rad",
    }


def test_a_lost_message_and_planning_have_no_ideal_to_differ_from() -> None:
    assert found(PERCEPTION, None, [PED]) == ()
    record = drive([PED], duration=3.0)
    wrong = EFFECTS["shift_path"](trajectory(record.path[100]), {"left": 5.0}, None)  # type: ignore[arg-type]
    assert found(Component.PLANNING, wrong, [PED]) == ()
