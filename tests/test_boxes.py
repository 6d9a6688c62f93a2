import math

import numpy as np
import pytest
import shapely

from dvca_sumo.geometry.boxes import Floats, box_of, contact_times, corners, distances, neighbours
from dvca_sumo.messages import VehicleShape

EGO = np.array([0.3, 0.2, 0.7, 4.6, 1.8])


def random_boxes(count: int, seed: int) -> Floats:
    draws = np.random.default_rng(seed)
    centres = draws.uniform(-9.0, 9.0, (count, 2))
    return np.column_stack(
        [centres, draws.uniform(-7.0, 7.0, count), draws.uniform(0.1, 12.0, count), draws.uniform(0.1, 3.0, count)]
    )


def test_box_of_a_body_is_centred_ahead_of_the_rear_axle() -> None:
    shape = VehicleShape(length=5.0, width=2.0, wheelbase=3.0, rear_overhang=1.0)
    assert box_of(10.0, 20.0, math.pi / 2.0, shape) == pytest.approx([10.0, 21.5, math.pi / 2.0, 5.0, 2.0])


def test_corners_go_round_from_front_left() -> None:
    box = np.array([[1.0, 2.0, math.pi / 2.0, 4.0, 2.0]])
    assert corners(box)[0] == pytest.approx(np.array([[0.0, 4.0], [0.0, 0.0], [2.0, 0.0], [2.0, 4.0]]))


def test_distances_agree_with_shapely_for_random_pairs() -> None:
    boxes = random_boxes(5000, seed=1)
    ego = shapely.polygons(corners(EGO[None])[0])
    expected = shapely.distance(shapely.polygons(corners(boxes)), ego)
    found = distances(EGO, boxes)
    assert np.abs(found - expected).max() < 1e-9
    assert 500 < (found == 0.0).sum() < 4500


def test_touching_boxes_have_no_distance() -> None:
    ego = np.array([0.0, 0.0, 0.0, 4.0, 2.0])
    front_to_rear = [4.5, 0.0, 0.0, 5.0, 2.0]
    side_by_side = [0.5, 2.0, math.pi, 4.0, 2.0]
    corner_to_corner = [3.0, 2.0, 0.0, 2.0, 2.0]
    one_inside = [0.5, 0.0, 0.4, 1.0, 0.5]
    crossing = [0.0, 0.0, math.pi / 2.0, 9.0, 1.0]
    boxes = np.array([front_to_rear, side_by_side, corner_to_corner, one_inside, crossing])
    assert distances(ego, boxes).tolist() == [0.0] * 5


def test_distance_between_an_edge_and_a_corner_turned_towards_it() -> None:
    diamond = np.array([[5.0, 0.0, math.pi / 4.0, 2.0, 2.0]])
    ego = np.array([0.0, 0.0, 0.0, 4.0, 2.0])
    assert distances(ego, diamond)[0] == pytest.approx(3.0 - math.sqrt(2.0))


def test_within_never_leaves_out_a_box_in_reach() -> None:
    boxes = random_boxes(2000, seed=2)
    close = np.flatnonzero(distances(EGO, boxes) <= 1.5)
    kept = neighbours(EGO, boxes).within(1.5)
    assert set(close) <= set(kept)
    assert len(kept) < 2000


def test_no_boxes_give_no_distances() -> None:
    nothing = np.empty((0, 5))
    assert distances(EGO, nothing).shape == (0,)
    assert contact_times(EGO, np.zeros(2), nothing, np.empty((0, 2)), 1.0).shape == (0,)


def test_contact_times_agree_with_small_steps() -> None:
    boxes = random_boxes(400, seed=3)
    velocity = np.array([5.0, 1.0])
    velocities = np.random.default_rng(4).uniform(-10.0, 10.0, (400, 2))
    found = contact_times(EGO, velocity, boxes, velocities, 2.0)
    step = 0.002
    stepped = np.full(400, np.inf)
    least = np.full(400, np.inf)
    for time in np.arange(0.0, 2.0, step):
        moved = boxes.copy()
        moved[:, :2] += (velocities - velocity) * time
        apart = distances(EGO, moved)
        least = np.minimum(least, apart)
        stepped = np.where((apart == 0.0) & np.isinf(stepped), time, stepped)
    both = np.isfinite(found) & np.isfinite(stepped)
    assert both.sum() > 50
    late = stepped[both] - found[both]
    assert (late > -1e-9).all()
    assert (late <= step + 1e-9).all()
    only_one = np.isfinite(found) != np.isfinite(stepped)
    # A graze shorter than a step, or a contact after the last one.
    assert (least[only_one] < 20.0 * step).all()


def test_boxes_touch_exactly_at_the_contact_time() -> None:
    boxes = random_boxes(3000, seed=5)
    velocities = np.random.default_rng(6).uniform(-10.0, 10.0, (3000, 2))
    times = contact_times(EGO, np.zeros(2), boxes, velocities, 3.0)
    later = np.isfinite(times) & (times > 0.01)
    assert later.sum() > 300
    for shift, is_apart in ((0.0, False), (-0.001, True)):
        moved = boxes[later].copy()
        moved[:, :2] += velocities[later] * (times[later] + shift)[:, None]
        assert ((distances(EGO, moved) > 1e-9) == is_apart).all()


def test_contact_time_of_a_follower_is_gap_over_closing_speed() -> None:
    follower = np.array([0.0, 0.0, 0.0, 4.0, 2.0])
    leader = np.array([[14.0, 0.3, 0.0, 4.0, 2.0]])
    times = contact_times(follower, np.array([8.0, 0.0]), leader, np.array([[3.0, 0.0]]), 10.0)
    assert times[0] == pytest.approx(10.0 / 5.0)


@pytest.mark.parametrize(
    ("y", "velocity", "expected"),
    [
        (0.0, (0.0, 0.0), math.inf),  # both stand
        (0.0, (1.0, 0.0), math.inf),  # drives away
        (2.01, (-9.0, 0.0), math.inf),  # passes just beside
        (1.99, (-9.0, 0.0), 10.0 / 9.0),  # clips the side
        (0.0, (-1.9, 0.0), math.inf),  # touches after the horizon
    ],
)
def test_contact_time_at_the_edges(y: float, velocity: tuple[float, float], expected: float) -> None:
    ego = np.array([0.0, 0.0, 0.0, 4.0, 2.0])
    other = np.array([[14.0, y, 0.0, 4.0, 2.0]])
    assert contact_times(ego, np.zeros(2), other, np.array([velocity]), 5.0)[0] == pytest.approx(expected)


def test_boxes_that_overlap_touch_now() -> None:
    assert contact_times(EGO, np.zeros(2), EGO[None], np.zeros((1, 2)), 1.0).tolist() == [0.0]
