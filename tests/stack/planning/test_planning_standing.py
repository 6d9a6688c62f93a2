"""People who stand are where they are on average, not where the noise of one cycle puts them."""

import msgspec
import numpy as np
import pytest
from planned_drives import SHAPE, car, person, predicted, road

from dvca_sumo.messages import PredictedObjects
from dvca_sumo.stack.planning import PlanningConfig
from dvca_sumo.stack.planning.reference import Reference
from dvca_sumo.stack.planning.scene import scene_in
from dvca_sumo.stack.planning.standing import Standing


def shifted(seen: PredictedObjects, shift: float) -> PredictedObjects:
    boxes = seen.objects.boxes.copy()
    boxes[:, 1] += shift
    return msgspec.structs.replace(seen, objects=msgspec.structs.replace(seen.objects, boxes=boxes))


def test_noise_of_who_stands_averages_out_and_that_of_others_stays() -> None:
    rng = np.random.default_rng(4)
    standing, seen = Standing(), predicted([person(3, 20.0, 1.0), person(4, 30.0, 2.0), car(5, 40.0, 3.0)], 0.0)
    noise = rng.normal(0.0, 0.1, 200)
    settled = np.array([standing.settled(shifted(seen, shift), {3, 5})[0].objects.boxes[:, 1] for shift in noise])
    spread = settled[50:].std(axis=0)
    assert spread[0] < 0.3 * noise.std()
    assert abs(settled[50:, 0].mean() - 1.0) < 0.02
    assert np.array_equal(settled[:, 1:], np.array([[2.0, 3.0]]) + noise[:, None])


def test_who_has_walked_on_is_where_it_is_seen_and_stands_anew_there() -> None:
    standing = Standing()
    standing.settled(predicted([person(3, 20.0, 1.0)], 0.0), {3})
    elsewhere = predicted([person(3, 25.0, 1.0)], 0.0)
    assert standing.settled(elsewhere, set()) == (elsewhere, set())
    assert standing.settled(elsewhere, {3})[0].objects.boxes[0, 0] == 25.0


def test_who_walks_on_slowly_has_left_where_it_stood_and_is_where_it_is_seen() -> None:
    standing, walker = Standing(), person(3, 20.0, 1.0, speed=0.45, leaves=2.0)
    seen = [predicted([walker, person(4, 30.0, 2.0)], 0.1 * cycle) for cycle in range(60)]
    told = [standing.settled(each, {3, 4}) for each in seen]
    missed = [float(each.objects.boxes[0, 0] - by[0].objects.boxes[0, 0]) for each, by in zip(seen, told, strict=True)]
    assert max(missed) < 0.3 + 1e-9
    assert {stood == {4} for _, stood in told} == {True, False}
    assert all(3 in stood for _, stood in told[:20])


@pytest.mark.parametrize(("stood", "speed", "stands"), [((), 0.4, False), ((), 0.2, True), ((3,), 0.4, True)])
def test_who_slows_down_on_foot_may_walk_on(stood: tuple[int, ...], speed: float, *, stands: bool) -> None:
    """Whoever has stood is not told by the noise of a tracker to walk."""
    window = Reference(road(), SHAPE, PlanningConfig()).window(100.0, 50.0)
    scene = scene_in(window, predicted([person(3, 120.0, 2.5, speed=speed)], 0.0), 0.0, stood, (), PlanningConfig())
    assert scene.is_standing.tolist() == [stands]
