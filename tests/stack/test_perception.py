"""The tracker on sweeps made by hand, and once behind the real sensors."""

import math
from collections.abc import Iterable

import numpy as np
import numpy.testing as npt
import pytest

from dvca_sumo.messages import LocalizationEstimate, ObjectClass, SignalColour, TrackedObjects, VehicleShape
from dvca_sumo.stack.bugs import build_with
from dvca_sumo.stack.perception import PerceptionConfig, Tracker, mutual_nearest
from dvca_sumo.stack.protocols import Detections
from dvca_sumo.stack.reference import StackConfig
from dvca_sumo.stack.sensors import SensorConfig, Sensors
from dvca_sumo.truth import EgoTruth, Moment, ObjectsTruth

SHAPE = VehicleShape(length=4.7, width=1.9, wheelbase=2.8, rear_overhang=0.95)

Thing = tuple[ObjectClass, float, float, float, float, float]  # class, x, y, heading, vx, vy, all in the ego frame


def car(x: float, y: float, speed: float = 0.0, heading: float = 0.0) -> Thing:
    return (ObjectClass.VEHICLE, x, y, heading, speed * math.cos(heading), speed * math.sin(heading))


def walker(x: float, y: float, vx: float = 0.0, vy: float = 0.0) -> Thing:
    return (ObjectClass.PEDESTRIAN, x, y, 0.0, vx, vy)


def boxes_of(things: Iterable[Thing]) -> list[list[float]]:
    sizes = {ObjectClass.VEHICLE: (4.6, 1.8)}
    return [[x, y, heading, *sizes.get(kind, (0.5, 0.5))] for kind, x, y, heading, _, _ in things]


def sweep(time: float, things: list[Thing], signals: dict[str, SignalColour] | None = None) -> Detections:
    return Detections(
        time=time,
        boxes=np.array(boxes_of(things), dtype=np.float64).reshape(-1, 5),
        classes=np.array([thing[0] for thing in things], dtype=np.int64),
        radial_speeds=np.array([(x * vx + y * vy) / math.hypot(x, y) for _, x, y, _, vx, vy in things]),
        signals=signals or {},
    )


def believed(time: float, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> LocalizationEstimate:
    return LocalizationEstimate(time, x, y, heading, 0.0, 0.0, 0.0)


def tracked(scenes: list[list[Thing]], tracker: Tracker | None = None, first: int = 0) -> list[TrackedObjects]:
    """One message per scene, 0.1 s apart, seen from an ego that stands at the origin."""
    tracker = tracker or Tracker(PerceptionConfig())
    times = [0.1 * (first + k) for k in range(len(scenes))]
    return [tracker.step(sweep(t, scene), believed(t)) for t, scene in zip(times, scenes, strict=True)]


def ids(messages: list[TrackedObjects]) -> list[list[int]]:
    return [message.ids.tolist() for message in messages]


def test_a_build_that_swaps_the_sides_of_boxes_tells_everything_else_alike() -> None:
    scenes = [[car(20.0, 0.0, heading=math.pi / 2.0)]] * 4
    fixed = tracked(scenes)[-1]
    buggy = tracked(scenes, Tracker(build_with("apollo-3634", StackConfig()).perception))[-1]
    npt.assert_allclose(fixed.boxes[0, 3:], [4.6, 1.8], atol=1e-9)
    npt.assert_allclose(buggy.boxes[0, 3:], [1.8, 4.6], atol=1e-9)
    npt.assert_array_equal(buggy.boxes[:, :3], fixed.boxes[:, :3])
    npt.assert_array_equal(buggy.velocities, fixed.velocities)


def test_nothing_detected_gives_empty_arrays_of_the_right_shapes() -> None:
    for message in tracked([[], []]):
        assert message.ids.shape == (0,)
        assert message.classes.shape == (0,)
        assert message.boxes.shape == (0, 5)
        assert message.velocities.shape == (0, 2)
        assert message.signals == {}


def test_the_second_hit_confirms() -> None:
    assert ids(tracked([[car(30, 0)], [car(30, 0)]])) == [[], [1]]
    assert ids(tracked([[car(30, 0)], [], [car(30, 0)]])) == [[], [], [1]]


def test_two_hits_too_far_apart_do_not_confirm() -> None:
    messages = tracked([[car(30, 0)], [], [], [car(30, 0)], [car(30, 0)]])
    assert ids(messages) == [[], [], [], [], [2]]


def test_a_lost_track_is_coasted_along_its_way_and_then_dropped() -> None:
    moving = [[car(20 + k, 0, 10.0)] for k in range(10)]
    messages = tracked(moving + [[]] * 12)
    assert messages[17].ids.tolist() == [1]
    assert messages[17].boxes[0, 0] == pytest.approx(37.0, abs=0.3)
    assert messages[17].velocities[0, 0] == pytest.approx(10.0, abs=0.3)
    assert messages[18].ids.tolist() == []


def test_an_object_that_comes_back_in_time_keeps_its_id_and_later_gets_a_new_one() -> None:
    scene = [[car(20, 0)]]
    back_in_time = tracked(scene * 5 + [[]] * 7 + scene)
    too_late = tracked(scene * 5 + [[]] * 9 + scene * 2)
    assert back_in_time[-1].ids.tolist() == [1]
    assert too_late[-1].ids.tolist() == [2]


def test_a_car_that_slides_farther_than_any_car_is_taken_to_does_not_become_two() -> None:
    scenes = [[car(20, 0.06 * k)] for k in range(30)]
    messages = tracked(scenes)
    assert ids(messages[1:]) == [[1]] * 29
    assert messages[-1].boxes[0, 1] == pytest.approx(0.06 * 29, abs=0.9)


def test_who_steps_aside_is_there_at_once_and_has_no_speed_from_it() -> None:
    scenes = [[walker(15 - 0.14 * k, 0.6 * (k >= 20), -1.4)] for k in range(30)]
    messages = tracked(scenes)
    assert ids(messages[1:]) == [[1]] * 29
    for k, message in enumerate(messages[20:], start=20):
        npt.assert_allclose(message.boxes[0, :2], (15 - 0.14 * k, 0.6), atol=0.02)
        npt.assert_allclose(message.velocities[0], (-1.4, 0.0), atol=0.1)


def test_who_comes_up_a_stride_beside_another_who_is_still_seen_is_another() -> None:
    scenes = [[walker(15, 0)]] * 5 + [[walker(15, 0), walker(15, 0.7)]] * 5
    assert tracked(scenes)[-1].ids.tolist() == [1, 2]


def test_who_comes_up_farther_than_a_stride_from_one_who_is_gone_is_another() -> None:
    messages = tracked([[walker(15, 0)]] * 5 + [[walker(15, 0.9)]] * 10)
    assert messages[-1].ids.tolist() == [2]


def test_a_car_that_is_on_the_next_lane_from_one_sweep_to_the_next_stays_the_same_and_leaves_nothing_behind() -> None:
    messages = tracked([[car(20 + k, 0, 10.0)] for k in range(6)] + [[car(26 + k, 3.2, 10.0)] for k in range(6)])
    assert all(message.ids.tolist() == [1] for message in messages[1:])
    npt.assert_allclose(messages[6].boxes[0, :2], [26.0, 3.2], atol=0.1)
    for message in messages[6:]:
        npt.assert_allclose(message.velocities[0], (10.0, 0.0), atol=0.1)


@pytest.mark.parametrize(
    "beside",
    [car(26, 3.2, 14.0), car(26, 3.2, 10.0, heading=0.6), car(26, 4.5, 10.0)],
    ids=["faster", "turned", "two lanes over"],
)
def test_a_car_that_comes_up_beside_one_that_is_gone_is_another(beside: Thing) -> None:
    messages = tracked([[car(20 + k, 0, 10.0)] for k in range(6)] + [[beside], [beside]])
    assert messages[6].ids.tolist() == [1]
    npt.assert_allclose(messages[6].boxes[0, :2], [26.0, 0.0], atol=0.1)


def test_a_car_that_comes_up_beside_one_that_stood_and_is_gone_is_another() -> None:
    messages = tracked([[car(20, 0)]] * 6 + [[car(20, 3.2)]] * 2)
    assert messages[-1].ids.tolist() == [1, 2]


def test_pedestrians_who_cross_each_others_way_keep_their_ids() -> None:
    scenes = [[walker(15, -3 + 0.14 * k, 0, 1.4), walker(15.6, 3 - 0.14 * k, 0, -1.4)] for k in range(43)]
    messages = tracked(scenes)
    upward = [message.boxes[message.ids == 1, 1][0] for message in messages[1:]]
    assert upward == sorted(upward)
    assert all(message.ids.tolist() == [1, 2] for message in messages[1:])


def test_cars_side_by_side_do_not_swap_ids_when_their_order_in_the_sweep_does() -> None:
    scenes = [[car(20 + k, -1.6, 10.0), car(20 + k, 1.6, 10.0)][:: (-1) ** k] for k in range(30)]
    for message in tracked(scenes)[1:]:
        assert message.ids.tolist() == [1, 2]
        assert message.boxes[0, 1] < 0.0 < message.boxes[1, 1]


def test_detections_are_placed_through_the_believed_pose() -> None:
    tracker = Tracker(PerceptionConfig())
    for t in (0.0, 0.1):
        message = tracker.step(sweep(t, [car(20, 3)]), believed(t, x=100.0, y=50.0, heading=math.pi / 2))
    npt.assert_allclose(message.boxes[0], [97.0, 70.0, math.pi / 2, 4.6, 1.8], atol=1e-9)


def test_while_the_pose_is_unknown_nothing_is_placed_and_nothing_is_spoilt() -> None:
    tracker = Tracker(PerceptionConfig())
    lost = LocalizationEstimate(0.0, math.nan, math.nan, math.nan, 0.0, 0.0, 0.0)
    assert tracker.step(sweep(0.0, [car(20, 0)], {"j/0": SignalColour.RED}), lost).ids.tolist() == []
    messages = tracked([[car(20, 0)]] * 2, tracker, first=1)
    npt.assert_allclose(messages[-1].boxes[0, :2], [20.0, 0.0])


def test_a_vehicle_has_its_speed_along_its_heading_from_the_first_message() -> None:
    message = tracked([[car(30 + 1.2 * k, 8 + 0.5 * k, 13.0, math.atan2(5, 12))] for k in range(2)])[-1]
    npt.assert_allclose(message.velocities[0], [12.0, 5.0], atol=0.7)


def test_a_braking_car_is_known_to_brake() -> None:
    times = [0.1 * k for k in range(26)]
    scenes = [[car(20 + 12 * t - 2 * t * t, 0, 12 - 4 * t)] for t in times]
    assert tracked(scenes)[-1].velocities[0, 0] == pytest.approx(2.0, abs=0.6)


def test_the_class_is_what_most_sweeps_said() -> None:
    wrong = (ObjectClass.BICYCLE, *car(20, 0)[1:])
    messages = tracked([[car(20, 0)], [car(20, 0)], [wrong], [wrong], [car(20, 0)]])
    assert {int(message.classes[0]) for message in messages[1:]} == {ObjectClass.VEHICLE}


def test_a_signal_not_read_for_a_moment_is_held_and_then_forgotten() -> None:
    tracker = Tracker(PerceptionConfig())
    shown = [{"j/0": SignalColour.GREEN}, {}, {}, {}, {}, {"j/0": SignalColour.RED}]
    times = [0.1 * k for k in range(len(shown))]
    told = [tracker.step(sweep(t, [], signals), believed(t)).signals for t, signals in zip(times, shown, strict=True)]
    green: dict[str, SignalColour] = {"j/0": SignalColour.GREEN}
    assert told == [green, green, green, green, {}, {"j/0": SignalColour.RED}]


def test_a_message_is_not_changed_by_later_sweeps() -> None:
    tracker = Tracker(PerceptionConfig())
    message = tracked([[car(20, 0, 10.0)], [car(21, 0, 10.0)]], tracker)[-1]
    kept = message.boxes.copy(), message.velocities.copy(), message.ids.copy()
    tracked([[car(22 + k, 0, 10.0)] for k in range(5)] + [[]] * 12, tracker, first=2)
    npt.assert_array_equal(message.boxes, kept[0])
    npt.assert_array_equal(message.velocities, kept[1])
    npt.assert_array_equal(message.ids, kept[2])


def seen_standing(things: dict[str, Thing], seed: int, seconds: float) -> list[TrackedObjects]:
    """What the tracker makes of real, noisy sweeps of things that stand still."""
    sensors, tracker = Sensors(SensorConfig(), seed, SHAPE, {}), Tracker(PerceptionConfig())
    scene = list(things.values())
    messages = []
    for index in range(round(seconds * 10)):
        time = 0.1 * index
        truth = ObjectsTruth(
            time,
            tuple(things),
            np.array([thing[0] for thing in scene], dtype=np.int64),
            np.array(boxes_of(scene)),
            np.zeros((len(scene), 2)),
        )
        moment = Moment(EgoTruth(time, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), SHAPE, truth, {})
        messages.append(tracker.step(sensors.detections(moment, index), believed(time)))
    return messages


STANDING = {"ahead": car(40, 0), "parked": car(15, 4, heading=0.3), "person": walker(18, -5), "distant": car(70, -9)}


@pytest.mark.parametrize("seed", range(5))
def test_what_stands_is_at_rest_within_a_second_and_does_not_turn(seed: int) -> None:
    for message in seen_standing(STANDING, seed, 4.0)[10:]:
        speeds = np.hypot(*message.velocities.T)
        assert len(speeds) == len(STANDING)
        assert (speeds < 0.6).all()
        for kind, x, y, heading, _, _ in STANDING.values():
            row = np.argmin(np.hypot(message.boxes[:, 0] - x, message.boxes[:, 1] - y))
            assert message.classes[row] == kind
            if kind == ObjectClass.VEHICLE:
                assert speeds[row] < 0.3
                assert abs(message.boxes[row, 2] - heading) < 0.03


def test_noisy_sweeps_of_standing_things_never_start_a_second_track() -> None:
    for seed in range(5):
        assert {int(number) for message in seen_standing(STANDING, seed, 4.0) for number in message.ids} == {1, 2, 3, 4}


def test_matching_takes_pairs_in_ascending_order_of_cost() -> None:
    costs = np.array([[1.0, 2.0, 9.0], [1.5, 8.0, 9.0], [9.0, 9.0, 20.0]])
    rows, columns = mutual_nearest(costs, gate=10.0)
    assert list(zip(rows.tolist(), columns.tolist(), strict=True)) == [(0, 0), (1, 1)]


def test_matching_agrees_with_the_plain_greedy_loop() -> None:
    draws = np.random.default_rng(1)
    for _ in range(50):
        costs = draws.uniform(0.0, 20.0, size=tuple(draws.integers(0, 7, size=2)))
        rows, columns = mutual_nearest(costs, gate=12.0)
        left = sorted((cost, row, column) for (row, column), cost in np.ndenumerate(costs) if cost < 12.0)
        expected: dict[int, int] = {}
        for _cost, row, column in left:
            if row not in expected and column not in expected.values():
                expected[row] = column
        assert dict(zip(rows.tolist(), columns.tolist(), strict=True)) == expected
