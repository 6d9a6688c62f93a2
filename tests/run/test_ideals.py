"""Idealized substitutes in a drive: each repairs its own component and no other one's fault."""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from small_scenarios import driven, scenario_file

from dvca_sumo.geometry.frames import transferred
from dvca_sumo.interventions import Futures, Ideal, Selection, Track, planted_fault, recorded_futures
from dvca_sumo.messages import (
    PREDICTION_TIMES,
    Component,
    LocalizationEstimate,
    PredictedObjects,
    SignalColour,
    T,
    TrackedObjects,
    Trajectory,
    X,
    Y,
)
from dvca_sumo.record import Record

LANE = -1.6  # [m] y of the centre of the left lane eastward
EGO = '<trip id="ego" from="bc" to="bc" depart="0" departPos="20" departSpeed="10" departLane="1" arrivalPos="130"/>'
ONCOMING = '<vehicle id="oncoming" depart="0" departPos="150" departSpeed="10"><route edges="cb"/></vehicle>'
# Ahead stands a bus, and before it, out of the sight of an ego that comes from behind, a car.
BUS = "".join(
    f'<vehicle id="{name}" type="{name}" depart="0" departPos="{position}"><route edges="bc"/>'
    f'<stop lane="bc_0" endPos="{position + 1}" duration="1000"/></vehicle>'
    for name, position in (("car", 140), ("bus", 130))
)
TYPES = '<vType id="bus" vClass="bus" length="12" width="2.5"/><vType id="car"/>'
BESIDE = planted_fault("localization.lateral:left=1")


@pytest.fixture
def config(tmp_path: Path, street: Path) -> Path:
    return scenario_file(tmp_path, street, EGO + ONCOMING)


def offset(record: Record) -> float:
    """Where the ego drove at last, left of its lane's centre [m]."""
    assert record.path[-1].x > 300.0
    return record.path[-1].y - LANE


def messages(record: Record, component: Component) -> list[tuple[int, object]]:
    return [(execution.tick, execution.message) for execution in record.executions[component]]


def test_the_healthy_ego_keeps_its_lane_and_one_that_believes_itself_left_of_it_drives_right_of_it(
    config: Path,
) -> None:
    assert offset(driven(config)) == pytest.approx(0.0, abs=0.2)
    assert offset(driven(config, BESIDE)) == pytest.approx(-1.0, abs=0.2)


@pytest.mark.parametrize("ideal", [Component.PERCEPTION, Component.PREDICTION, Component.CONTROL])
def test_a_localization_fault_persists_under_every_other_substitute(config: Path, ideal: Component) -> None:
    assert offset(driven(config, BESIDE, Ideal(ideal))) == pytest.approx(-1.0, abs=0.2)


def test_a_localization_fault_persists_under_all_others_together(config: Path) -> None:
    others = (Ideal(Component.PERCEPTION), Ideal(Component.PREDICTION), Ideal(Component.CONTROL))
    assert offset(driven(config, BESIDE, *others)) == pytest.approx(-1.0, abs=0.2)


def test_ideal_localization_removes_a_localization_fault(config: Path) -> None:
    record = driven(config, BESIDE, Ideal(Component.LOCALIZATION))
    assert offset(record) == pytest.approx(0.0, abs=0.15)
    for tick, message in messages(record, Component.LOCALIZATION):
        assert isinstance(message, LocalizationEstimate)
        truth = record.path[tick]
        assert (message.time, message.x, message.y, message.heading) == (truth.time, truth.x, truth.y, truth.heading)
        assert (message.speed, message.yaw_rate) == (truth.speed, truth.yaw_rate)


def test_ideal_perception_places_objects_through_the_believed_pose(config: Path) -> None:
    record = driven(config, BESIDE, Ideal(Component.PERCEPTION))
    tick, message = messages(record, Component.PERCEPTION)[20]
    assert isinstance(message, TrackedObjects)
    truth, believed = record.moment_at(tick), record.believed_at(tick)
    row = row_of(message, record, tick, "oncoming")
    seen, real = message.boxes[row], truth.objects.boxes[truth.objects.ids.index("oncoming")]
    assert seen[1] - real[1] == pytest.approx(1.0, abs=0.4)
    ahead = math.hypot(seen[0] - believed.x, seen[1] - believed.y)
    assert ahead == pytest.approx(math.hypot(real[0] - truth.ego.x, real[1] - truth.ego.y))


def row_of(told: TrackedObjects, record: Record, tick: int, name: str) -> int:
    """Row of the object that stands where `name` truly is, as the ego believes to stand."""
    truth, believed = record.moment_at(tick), record.believed_at(tick)
    box = truth.objects.boxes[[truth.objects.ids.index(name)], :3]
    here = (truth.ego.x, truth.ego.y, truth.ego.heading)
    place = transferred(box, here, (believed.x, believed.y, believed.heading))[0]
    away = np.hypot(*(told.boxes[:, :2] - place[:2]).T)
    assert away.min() < 0.01
    return int(away.argmin())


def test_ideal_perception_goes_on_under_the_ids_that_perception_gave_and_keeps_them(config: Path) -> None:
    at = 20
    record = driven(config, Ideal(Component.PERCEPTION, Selection(first=at)))
    (_, before), *after = messages(record, Component.PERCEPTION)[at - 1 : at + 15]
    assert isinstance(before, TrackedObjects)
    for tick, message in after:
        assert isinstance(message, TrackedObjects)
        row = row_of(message, record, tick, "oncoming")
        assert message.ids[row] in before.ids


def test_ideal_perception_and_ideal_prediction_call_an_object_the_same(config: Path) -> None:
    record = driven(config, Ideal(Component.PERCEPTION), Ideal(Component.PREDICTION))
    for (_, seen), (_, told) in zip(
        messages(record, Component.PERCEPTION), messages(record, Component.PREDICTION), strict=True
    ):
        assert isinstance(seen, TrackedObjects)
        assert isinstance(told, PredictedObjects)
        assert seen.ids.tolist() == told.objects.ids.tolist()


def test_ideal_control_takes_over_without_a_jump_of_speed(config: Path) -> None:
    faster = planted_fault("control.longitudinal:error=3,start=0.5,end=2")
    record = driven(config, faster, Ideal(Component.CONTROL, Selection(start=2.0)))
    speeds = [truth.speed for truth in record.path[150:400]]
    assert max(abs(one - other) for one, other in pairwise(speeds)) <= 0.09 + 1e-9


def test_ideal_perception_hides_nothing_in_range(tmp_path: Path, street: Path) -> None:
    ego = EGO.replace('departLane="1"', 'departLane="0"')
    config = scenario_file(tmp_path, street, TYPES + BUS + ego + ONCOMING, end="3")
    ideal, real = driven(config, Ideal(Component.PERCEPTION)), driven(config)
    for tick, message in messages(ideal, Component.PERCEPTION):
        assert isinstance(message, TrackedObjects)
        truth = ideal.moment_at(tick)
        gaps = np.hypot(truth.objects.boxes[:, 0] - truth.ego.x, truth.objects.boxes[:, 1] - truth.ego.y)
        near = [name for name, gap in zip(truth.objects.ids, gaps, strict=True) if gap < ideal.sensor_range]
        assert len(message.ids) == len(set(message.ids.tolist())) == len(near)
    _, first = messages(ideal, Component.PERCEPTION)[10]
    _, sensed = messages(real, Component.PERCEPTION)[10]
    assert isinstance(first, TrackedObjects)
    assert isinstance(sensed, TrackedObjects)
    car = ideal.moments[10].objects.boxes[ideal.moments[10].objects.ids.index("car"), :2]
    assert np.hypot(*(first.boxes[:, :2] - car).T).min() < 1.0
    assert np.hypot(*(sensed.boxes[:, :2] - car).T).min() > 8.0


def test_ideal_perception_knows_the_signals_of_the_whole_route(tmp_path: Path, street: Path) -> None:
    ego = EGO.replace('from="bc"', 'from="ab"')
    red = f'<tlLogic id="b" programID="red" type="static"><phase duration="99" state="{"r" * 20}"/></tlLogic>'
    record = driven(scenario_file(tmp_path, street, ego, red, end="3"), Ideal(Component.PERCEPTION))
    for _, message in messages(record, Component.PERCEPTION):
        assert isinstance(message, TrackedObjects)
        assert list(message.signals.values()) == [SignalColour.RED]


def test_ideal_control_moves_exactly_along_the_plan(config: Path) -> None:
    record = driven(config, Ideal(Component.LOCALIZATION), Ideal(Component.CONTROL))
    plans = dict(messages(record, Component.PLANNING))
    plan = plans[0]
    for tick, truth in enumerate(record.path):
        plan = plans.get(tick - 1, plan)
        assert isinstance(plan, Trajectory)
        places = [np.interp(truth.time - plan.time, plan.points[:, T], plan.points[:, column]) for column in (X, Y)]
        assert math.dist(places, (truth.x, truth.y)) < 0.02


def test_real_control_does_not_move_exactly_along_the_plan(config: Path) -> None:
    record = driven(config, Ideal(Component.LOCALIZATION))
    plans = dict(messages(record, Component.PLANNING))
    gaps = []
    for tick, plan in plans.items():
        assert isinstance(plan, Trajectory)
        if tick + 9 < len(record.path):
            truth = record.path[tick + 9]
            places = [np.interp(0.09, plan.points[:, T], plan.points[:, column]) for column in (X, Y)]
            gaps.append(math.dist(places, (truth.x, truth.y)))
    assert max(gaps) > 0.001


def test_ideal_prediction_answers_with_recorded_futures(config: Path) -> None:
    times = np.arange(0.0, 20.0, 0.1)
    track = Track(times, np.column_stack([400.0 - 3.0 * times, 5.0 + times, np.full(len(times), 2.0)]), ("cb_0",) * 200)
    ideals = (Ideal(Component.LOCALIZATION), Ideal(Component.PREDICTION))
    record = driven(config, *ideals, futures=Futures({"oncoming": track}))
    for tick, message in messages(record, Component.PREDICTION):
        assert isinstance(message, PredictedObjects)
        if len(message.objects.ids):  # it is in range
            row = row_of(message.objects, record, tick, "oncoming")
            (hypothesis,) = np.flatnonzero(message.owners == row)
            wanted = message.time + PREDICTION_TIMES
            assert message.poses[hypothesis, :, 0] == pytest.approx(400.0 - 3.0 * wanted, abs=1e-6)
            assert message.poses[hypothesis, :, 1] == pytest.approx(5.0 + wanted, abs=1e-6)
            assert message.lanes[hypothesis] == ("cb_0",)


def test_futures_of_the_factual_run_come_true_for_those_who_do_not_react(config: Path) -> None:
    futures = recorded_futures(driven(config).moments)
    record = driven(config, Ideal(Component.LOCALIZATION), Ideal(Component.PREDICTION), futures=futures)
    real = recorded_futures(record.moments).tracks["oncoming"]
    tick, message = messages(record, Component.PREDICTION)[5]
    assert isinstance(message, PredictedObjects)
    row = row_of(message.objects, record, tick, "oncoming")
    (hypothesis,) = np.flatnonzero(message.owners == row)
    wanted = message.time + PREDICTION_TIMES[:13]
    for column in (0, 1):
        assert message.poses[hypothesis, :13, column] == pytest.approx(
            np.interp(wanted, real.times, real.poses[:, column]), abs=0.05
        )


def test_without_futures_everyone_keeps_its_velocity(config: Path) -> None:
    record = driven(config, Ideal(Component.LOCALIZATION), Ideal(Component.PREDICTION))
    _, message = messages(record, Component.PREDICTION)[5]
    assert isinstance(message, PredictedObjects)
    assert len(message.owners) == len(message.objects.ids) > 0
    for hypothesis, row in enumerate(message.owners):
        start, velocity = message.objects.boxes[row, :2], message.objects.velocities[row]
        assert message.poses[hypothesis, :, :2] == pytest.approx(start + PREDICTION_TIMES[:, None] * velocity)
