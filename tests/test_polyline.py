import pickle

import numpy as np
import pytest

from dvca_sumo.geometry.polyline import Floats, Polyline


def arc(radius: float, turn: float, step: float = 1.0) -> Polyline:
    angles = np.linspace(0.0, abs(turn), int(radius * abs(turn) / step) + 1)
    return Polyline(radius * np.column_stack((np.sin(angles), np.sign(turn) * (1.0 - np.cos(angles)))))


def winding() -> Polyline:
    headings = np.sin(np.arange(600) * 0.03)
    return Polyline(np.column_stack((np.cumsum(np.cos(headings)), np.cumsum(np.sin(headings)))))


def test_straight_line_measures_along_and_to_the_left() -> None:
    line = Polyline([[0.0, 0.0], [10.0, 0.0]])
    stations, offsets = line.project([[4.0, 3.0], [6.0, -2.0]])
    assert line.length == 10.0
    assert stations.tolist() == [4.0, 6.0]
    assert offsets.tolist() == [3.0, -2.0]


def test_repeated_points_are_dropped() -> None:
    line = Polyline([[0.0, 0.0], [0.0, 0.0], [5.0, 0.0], [5.0, 0.0]])
    assert line.points.tolist() == [[0.0, 0.0], [5.0, 0.0]]


@pytest.mark.parametrize("points", [[], [[1.0, 2.0]], [[1.0, 2.0], [1.0, 2.0]]])
def test_fewer_than_two_distinct_points_are_no_line(points: list[list[float]]) -> None:
    with pytest.raises(ValueError, match="two distinct points"):
        Polyline(points)


@pytest.mark.parametrize("turn", [2.0, -2.0])
def test_curvature_of_an_arc_is_one_over_its_radius_and_signed(turn: float) -> None:
    line = arc(20.0, turn)
    assert line.curvatures == pytest.approx(np.sign(turn) / 20.0, rel=1e-3)
    assert len(line.curvatures) == len(line.points) == len(line.headings)


def test_straight_line_of_two_points_has_no_curvature() -> None:
    assert Polyline([[0.0, 0.0], [3.0, 4.0]]).curvatures.tolist() == [0.0, 0.0]


def test_headings_are_continuous_over_a_full_turn() -> None:
    line = arc(10.0, 4.0 * np.pi)
    assert np.abs(np.diff(line.headings)).max() < 0.11
    assert line.headings[-1] == pytest.approx(4.0 * np.pi, abs=0.11)


def test_heading_keeps_to_the_segment_away_from_a_kink() -> None:
    line = Polyline([[0.0, 0.0], [100.0, 0.0], [100.0, 100.0]])
    headings = line.poses([0.0, 98.9, 100.0, 101.1, 200.0])[:, 2]
    assert headings == pytest.approx([0.0, 0.0, np.pi / 4, np.pi / 2, np.pi / 2])


def test_projection_is_the_inverse_of_poses() -> None:
    line = winding()
    stations = np.linspace(5.0, line.length - 5.0, 400)
    offsets = 6.0 * np.sin(stations)
    found_stations, found_offsets = line.project(line.poses(stations, offsets)[:, :2])
    assert found_stations == pytest.approx(stations, abs=1e-3)
    assert found_offsets == pytest.approx(offsets, abs=1e-3)


def test_points_beyond_the_ends_keep_to_the_ends_at_their_true_distance() -> None:
    stations, offsets = Polyline([[0.0, 0.0], [10.0, 0.0]]).project([[-3.0, 4.0], [16.0, -8.0]])
    assert stations.tolist() == [0.0, 10.0]
    assert offsets == pytest.approx([5.0, -10.0])


def test_poses_beyond_the_ends_go_straight_on() -> None:
    poses = Polyline([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]]).poses([-2.0, 25.0], 1.0)
    assert poses == pytest.approx(np.array([[-2.0, 1.0, 0.0], [9.0, 15.0, np.pi / 2]]))


def figure_eight() -> Polyline:
    turn = np.linspace(0.0, 2.0 * np.pi, 400)
    return Polyline(np.column_stack((50.0 * np.sin(turn), 50.0 * np.sin(turn) * np.cos(turn))))


def test_window_tells_the_two_passes_of_a_crossing_apart() -> None:
    line = figure_eight()
    half = line.length / 2.0
    first, _ = line.project([[0.1, 0.0]], between=(0.0, 20.0))
    second, _ = line.project([[0.1, 0.0]], between=(half - 20.0, half + 20.0))
    assert first[0] < 1.0
    assert second[0] == pytest.approx(half, abs=1.0)


def test_points_are_each_looked_for_near_a_station_of_their_own() -> None:
    line = figure_eight()
    half = line.length / 2.0
    stations, offsets = line.project_near(np.array([[0.1, 0.0], [0.1, 0.0]]), np.array([8.0, half + 8.0]), 20.0)
    assert stations == pytest.approx([0.0, half], abs=1.0)
    assert np.abs(offsets) == pytest.approx(0.07, abs=0.01)


def test_window_limits_the_stations() -> None:
    stations, _ = winding().project([[0.0, 0.0], [1e4, 1e4]], between=(100.0, 150.0))
    assert (stations >= 100.0).all()
    assert (stations <= 150.0).all()


def test_window_gives_the_same_as_the_whole_line() -> None:
    line = winding()
    points = line.poses(np.linspace(220.0, 280.0, 50), 3.0)[:, :2]
    whole, part = line.project(points), line.project(points, between=(200.0, 300.0))
    assert np.array_equal(whole[0], part[0])
    assert np.array_equal(whole[1], part[1])


def test_projection_moves_steadily_past_a_vertex_on_its_outside() -> None:
    line = arc(8.0, 2.0)
    path = line.poses(np.linspace(2.0, 12.0, 200), -3.0)[:, :2]
    stations, _ = line.project(path)
    assert np.diff(stations) == pytest.approx(10.0 / 199, rel=0.05)


def test_far_from_the_origin_nothing_is_lost() -> None:
    shift = np.array([4.5e5, 5.4e6])
    near = winding()
    far = Polyline(near.points + shift)
    points = near.poses([100.0, 200.0], 2.0)[:, :2]
    assert far.project(points + shift)[0] == pytest.approx(near.project(points)[0], abs=1e-6)


def test_arrays_cannot_be_written_to() -> None:
    line = winding()
    arrays: tuple[Floats, ...] = (line.points, line.stations, line.headings, line.curvatures)
    for array in arrays:
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_a_pickled_line_is_the_same() -> None:
    line = winding()
    again = pickle.loads(pickle.dumps(line))  # noqa: S301 our own bytes
    assert np.array_equal(again.points, line.points)
    assert np.array_equal(again.curvatures, line.curvatures)


def test_one_point_is_found_as_many_are() -> None:
    line = winding()
    points = line.points[3:] + np.random.default_rng(1).normal(0.0, 2.0, (len(line) - 3, 2))
    for point, near in zip(points, line.stations[3:].tolist(), strict=True):
        between = (near - 20.0, near + 30.0)
        (station,), (offset,) = line.project(point, between=between)
        place = line.place(*point.tolist(), between=between)
        assert place[0] == station
        assert place[1] == pytest.approx(offset)
