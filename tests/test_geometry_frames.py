import math

import numpy as np
import pytest

from dvca_sumo.geometry.frames import Pose, relative, rotated, transferred

POSES: list[Pose] = [(0.0, 0.0, 0.0), (3.0, -4.0, 0.5), (450_000.0, 5_000_000.0, math.pi), (-7.0, 2.0, -2.9)]


def test_what_lies_ahead_of_the_source_lies_ahead_of_the_target() -> None:
    ahead_left = np.array([[10.0, 2.0, 0.25]])
    placed = transferred(ahead_left, (0.0, 0.0, 0.0), (100.0, 50.0, math.pi / 2))
    np.testing.assert_allclose(placed, [[98.0, 60.0, 0.25 + math.pi / 2]])


@pytest.mark.parametrize("source", POSES)
@pytest.mark.parametrize("target", POSES)
def test_transferred_there_and_back_is_where_it_was(source: Pose, target: Pose) -> None:
    poses = np.array([[1.0, 2.0, 0.3], [-30.0, 4.0, -1.0]]) + np.array([source[0], source[1], 0.0])
    back = transferred(transferred(poses, source, target), target, source)
    np.testing.assert_allclose(back, poses, atol=1e-7)


@pytest.mark.parametrize("source", POSES)
@pytest.mark.parametrize("target", POSES)
def test_a_transfer_keeps_what_is_seen_from_the_vehicle(source: Pose, target: Pose) -> None:
    pose = (source[0] + 12.0, source[1] - 5.0, 1.1)
    placed = transferred(np.array([pose]), source, target)[0]
    seen = relative((float(placed[0]), float(placed[1]), float(placed[2])), target)
    assert seen == pytest.approx(relative(pose, source), abs=1e-7)


def test_a_transfer_to_the_same_place_changes_nothing() -> None:
    poses = np.array([[1.0, 2.0, 0.3]])
    np.testing.assert_array_equal(transferred(poses, (0.0, 0.0, 1.0), (0.0, 0.0, 1.0)), poses)


def test_no_poses_stay_no_poses() -> None:
    assert transferred(np.empty((0, 3)), (1.0, 2.0, 3.0), (0.0, 0.0, 0.0)).shape == (0, 3)
    assert rotated(np.empty((0, 2)), 1.0).shape == (0, 2)


def test_vectors_turn_counter_clockwise() -> None:
    np.testing.assert_allclose(rotated(np.array([[1.0, 0.0], [0.0, 2.0]]), math.pi / 2), [[0, 1], [-2, 0]], atol=1e-15)


def test_turned_there_and_back_is_as_it_was() -> None:
    vectors = np.array([[3.0, -1.0], [0.5, 8.0]])
    np.testing.assert_allclose(rotated(rotated(vectors, 0.7), -0.7), vectors)


def test_a_pose_is_seen_forward_left_and_turned() -> None:
    assert relative((1.0, 5.0, math.pi), (1.0, 2.0, math.pi / 2)) == pytest.approx((3.0, 0.0, math.pi / 2))
    assert relative((0.0, 2.0, 0.0), (1.0, 2.0, math.pi / 2)) == pytest.approx((0.0, 1.0, -math.pi / 2))
