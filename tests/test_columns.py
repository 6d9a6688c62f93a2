"""Values that go through columns come back as they were, whatever they are."""

import pickle
from collections.abc import Sequence

import msgspec
import numpy as np
import pytest

from dvca_sumo.columns import Columns, packed


class Point(msgspec.Struct, frozen=True):
    x: float
    y: float | None = None


class Named(msgspec.Struct, frozen=True):
    name: str
    point: Point


class Keyed(msgspec.Struct, kw_only=True):
    x: float = 0.0


def sent(columns: Columns) -> Columns:
    received: Columns = pickle.loads(pickle.dumps(columns))  # noqa: S301 - made in the line itself
    return received


@pytest.mark.parametrize(
    "values",
    [
        [],
        [1.5, -0.0, float("inf")],
        [3, 1, 2],
        [True, False],
        [1, 2.0, None],
        ["a", "b"],
        [("a",), ("b", "c")],
        [{"a": 1}, {}],
        [None, None],
        [Point(1.0), Point(2.0)],
        [Point(1.0, 2.0), Point(2.0, 3.0)],
        [Point(1.0), Named("b", Point(2.0))],
        [Named("a", Point(1.0)), Named("b", Point(2.0))],
        [Keyed(x=1.0), Keyed(x=2.0)],
        [np.float64(1.0), np.float64(2.0)],
    ],
)
def test_values_come_back(values: Sequence[object]) -> None:
    back = list(sent(packed(values)).rows())
    assert repr(back) == repr(values)
    assert [type(one) for one in back] == [type(one) for one in values]


@pytest.mark.parametrize(
    "arrays",
    [
        [np.zeros((2, 3)), np.ones((0, 3)), np.full((1, 3), 7.0)],
        [np.zeros((2, 3)), np.ones((2, 4))],
        [np.zeros(2), np.zeros(2, dtype=np.int64)],
        [np.array(1.0), np.array(2.0)],
    ],
)
def test_arrays_come_back(arrays: Sequence[np.ndarray]) -> None:
    for one, other in zip(sent(packed(arrays)).rows(), arrays, strict=True):
        assert one.dtype == other.dtype
        assert np.array_equal(one, other)
        assert one.shape == other.shape
