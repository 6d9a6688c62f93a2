"""POIs and polygons as boxes, and which of them are near."""

import math

import numpy as np
import pytest

from dvca_sumo.messages import ObjectClass
from dvca_sumo.truth import ObjectsTruth
from dvca_sumo.world.obstacles import Obstacles, box_of_poi, boxes_of_polygon, joined

NOTHING = ObjectsTruth(7.0, (), np.zeros(0, dtype=np.int64), np.zeros((0, 5)), np.zeros((0, 2)))


def test_a_poi_is_as_long_as_its_image_is_high() -> None:
    assert box_of_poi((3.0, 4.0), 0.5, width=0.4, height=0.6) == (3.0, 4.0, 0.5, 0.6, 0.4)


def test_a_filled_polygon_is_its_smallest_rectangle() -> None:
    turn = 0.3
    corners = [(0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (1.0, 2.0), (0.0, 1.5)]
    shape = [(x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn)) for x, y in corners]
    ((x, y, heading, length, width),) = boxes_of_polygon(shape, is_filled=True, line_width=9.0)
    assert (x, y) == pytest.approx((2 * math.cos(turn) - math.sin(turn), 2 * math.sin(turn) + math.cos(turn)))
    assert sorted((length, width)) == pytest.approx([2.0, 4.0])
    along = turn if length > width else turn + math.pi / 2
    assert math.sin(heading - along) == pytest.approx(0.0, abs=1e-9)


def test_a_line_is_one_box_a_segment() -> None:
    first, second = boxes_of_polygon(
        [(0.0, 0.0), (10.0, 0.0), (10.0, 0.0), (10.0, 6.0)], is_filled=False, line_width=0.5
    )
    assert first == (5.0, 0.0, 0.0, 10.0, 0.5)
    assert second == (10.0, 3.0, math.pi / 2, 6.0, 0.5)


@pytest.mark.parametrize("is_filled", [True, False])
def test_what_is_very_long_is_several_boxes_end_to_end(*, is_filled: bool) -> None:
    """Who comes to a wall looks for it where its near end is, and places bodies by their middles."""
    outline = [(0.0, 10.0), (0.4, 10.0), (0.4, 310.0), (0.0, 310.0)]
    boxes = np.array(boxes_of_polygon(outline if is_filled else [(0.2, 10.0), (0.2, 310.0)], is_filled, 0.4))
    assert boxes[:, 3].max() <= 50.0
    np.testing.assert_allclose(boxes[:, [0, 4]], np.tile([0.2, 0.4], (len(boxes), 1)), atol=1e-9)
    np.testing.assert_allclose(np.cos(boxes[:, 2]), 0.0, atol=1e-9)
    boxes = boxes[boxes[:, 1].argsort()]
    begins, ends = boxes[:, 1] - 0.5 * boxes[:, 3], boxes[:, 1] + 0.5 * boxes[:, 3]
    assert (begins[0], ends[-1]) == pytest.approx((10.0, 310.0))
    np.testing.assert_allclose(begins[1:], ends[:-1])


@pytest.mark.parametrize("shape", [[(0.0, 0.0), (4.0, 0.0)], [(0.0, 0.0), (3.0, 0.0), (4.0, 0.0)]])
def test_a_filled_polygon_without_an_area_is_a_line(shape: list[tuple[float, float]]) -> None:
    boxes = boxes_of_polygon(shape, is_filled=True, line_width=0.2)
    assert sum(box[3] for box in boxes) == 4.0
    assert {box[4] for box in boxes} == {0.2}


def test_obstacles_join_the_moving_ones_when_their_near_end_is_within_the_radius() -> None:
    rows = [(12.0, 0.0, 0.0, 2.0, 1.0), (11.1, 0.0, 0.0, 2.0, 1.0), (10.9, 0.0, 0.0, 2.0, 1.0)]
    obstacles = Obstacles(("far", "just_not", "near"), np.array(rows))
    seen = joined(NOTHING, obstacles, (0.0, 0.0), radius=10.0)
    assert seen.ids == ("near",)
    assert seen.classes.tolist() == [ObjectClass.STATIC]
    assert seen.velocities.tolist() == [[0.0, 0.0]]
    assert seen.lanes == ("",)
    assert seen.time == 7.0
