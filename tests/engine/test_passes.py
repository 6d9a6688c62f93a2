"""Ideal predictions in reactive traffic: passes are made until what was predicted is what happened."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from small_scenarios import scenario_file

from dvca_sumo.engine.passes import MOST_PASSES, TOLERANCE, Pass, divergence, predicts_ideally, settled
from dvca_sumo.engine.protocol import Glimpse
from dvca_sumo.interventions import Futures, Ideal, Selection, Track, planted_fault, recorded_futures
from dvca_sumo.messages import Component, VehicleShape
from dvca_sumo.run import Task
from dvca_sumo.scenario import load_scenario
from dvca_sumo.truth import EgoTruth, Moment, ObjectsTruth
from dvca_sumo.violations import Ending

SHAPE = VehicleShape(4.5, 1.8, 2.7, 0.8)


@pytest.fixture
def task(tmp_path: Path) -> Task:
    (tmp_path / "some.net.xml").write_text("<net/>")
    return Task(load_scenario(scenario_file(tmp_path, tmp_path / "some.net.xml")))


def moments(places: list[tuple[float, float]], name: str = "car") -> list[Moment]:
    """One object at each of `places`, a world step apart, seen by an ego that stands at the origin."""
    found = []
    for step, (x, y) in enumerate(places):
        time = 0.1 * step
        boxes = np.array([[x, y, 0.0, 4.5, 1.8]])
        truth = ObjectsTruth(time, (name,), np.zeros(1, dtype=np.int64), boxes, np.zeros((1, 2)), ("lane",))
        found.append(Moment(EgoTruth(time, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), SHAPE, truth, {}))
    return found


def straight(speed: float, steps: int = 21) -> list[Moment]:
    return moments([(5.0 + speed * 0.1 * step, 3.0) for step in range(steps)])


def glimpse(residual: float | None) -> Glimpse:
    return Glimpse((), (), Ending.ARRIVED, "d", b"", 1, 10.0, 1.0, 1, residual)


def answering(*residuals: float | None) -> tuple[Callable[[Task], Pass], list[Task]]:
    """A run whose passes have these residuals; and the tasks it was given."""
    asked: list[Task] = []

    def run(task: Task) -> Pass:
        asked.append(task)
        track = Track(np.array([float(len(asked))]), np.zeros((1, 3)), ("",))
        return Pass(glimpse(residuals[len(asked) - 1]), Futures({"car": track}))

    return run, asked


def test_only_an_ideal_prediction_predicts_ideally(task: Task) -> None:
    def under(*interventions: object) -> bool:
        return predicts_ideally(Task(task.scenario, interventions))  # type: ignore[arg-type]

    assert not under()
    assert not under(Ideal(Component.PERCEPTION), planted_fault("prediction.none"))
    assert under(Ideal(Component.PERCEPTION), Ideal(Component.PREDICTION, Selection(first=50)))


def test_a_run_without_ideal_predictions_takes_one_pass(task: Task) -> None:
    run, asked = answering(None)
    found = settled(task, run)
    assert (found.passes, found.simulated, found.residual) == (1, 10.0, None)
    assert asked == [task]


def test_predictions_that_come_true_at_once_take_one_pass(task: Task) -> None:
    run, asked = answering(TOLERANCE)
    assert settled(task, run).passes == 1
    assert len(asked) == 1


def test_the_next_pass_predicts_what_the_last_one_recorded_and_keeps_what_it_did_not_meet(task: Task) -> None:
    run, asked = answering(3.0, 0.1)
    gone = Track(np.array([7.0]), np.zeros((1, 3)), ("",))
    found = settled(Task(task.scenario, futures=Futures({"gone": gone, "car": gone})), run)
    assert (found.passes, found.simulated, found.residual) == (2, 20.0, 0.1)
    assert asked[1].futures.tracks["gone"] is gone
    assert asked[1].futures.tracks["car"].times.tolist() == [1.0]


def test_passes_end_where_predictions_never_come_true_and_the_residual_tells(task: Task) -> None:
    run, asked = answering(*[9.0] * MOST_PASSES)
    found = settled(task, run)
    assert (found.passes, found.residual) == (MOST_PASSES, 9.0)
    assert len(asked) == MOST_PASSES


def test_what_happened_as_predicted_diverges_by_nothing() -> None:
    assert divergence(recorded_futures(straight(4.0)), straight(4.0)) == 0.0


def test_divergence_is_the_largest_distance_between_predicted_and_real_places() -> None:
    assert divergence(recorded_futures(straight(4.0)), straight(5.5)) == pytest.approx(2.0 * 1.5)


def test_an_object_far_from_the_ego_does_not_matter() -> None:
    near, far = moments([(29.0, 0.0)] * 6), moments([(31.0, 0.0)] * 6)
    predicted = recorded_futures(moments([(0.0, 0.0)] * 6))
    assert divergence(predicted, near) == pytest.approx(29.0)
    assert divergence(predicted, far) == 0.0


def test_an_object_that_was_not_recorded_is_not_counted() -> None:
    assert divergence(recorded_futures(straight(4.0)), moments([(1.0, 1.0)] * 6, name="new")) == 0.0
    late = recorded_futures(straight(4.0, steps=3))
    assert divergence(late, straight(4.0, steps=3) + straight(9.0)[5:]) == 0.0
