"""Definitions 1, 2 and 8 on target sets."""

import math

import numpy as np
import pytest
import shapely
from conftest import convex_polygons, states, target_sets
from hypothesis import assume, given
from hypothesis import strategies as st

from grebe.core.errors import PlanError
from grebe.core.sets import TargetSet, polygon_rows, rectangle, sets_of

share = st.floats(0, 1)


def mix(a, b, t):
    return tuple(t * p + (1 - t) * q for p, q in zip(a, b, strict=True))


@given(target_sets(), states())
def test_distance_is_zero_exactly_inside(omega, z):
    assert (omega.distance(z) == 0) == omega.contains(z)


@given(target_sets(), states(), states(), share)
def test_distance_is_convex(omega, a, b, t):
    between = omega.distance(mix(a, b, t))
    assert between <= t * omega.distance(a) + (1 - t) * omega.distance(b) + 1e-9


@given(target_sets(), states())
def test_footprint_distance_is_that_of_an_independent_library(omega, z):
    expected = omega.polygon.distance(shapely.Point(z[0], z[1]))
    assert omega.footprint_distance(z[0], z[1]) == pytest.approx(expected, abs=1e-9)


@given(target_sets(), states())
def test_half_spaces_agree_with_contains(omega, z):
    rows = omega.halfspaces
    inside = rows[:, :3] @ np.array([z[0], z[1], z[3]]) - rows[:, 3]
    assume(np.min(np.abs(inside)) > 1e-9)
    assert bool(np.all(inside <= 0)) == omega.contains(z)


@given(target_sets(), st.floats(0, 30), st.floats(0, 3))
def test_shrinking_moves_every_side_in_and_never_empties(omega, margin, speed_margin):
    inner = omega.shrunk(margin, speed_margin)
    assert inner.polygon.area > 0
    assert omega.polygon.buffer(1e-6).contains(inner.polygon)
    assert omega.speed_min_mps <= inner.speed_min_mps < inner.speed_max_mps <= omega.speed_max_mps


def test_a_margin_that_fits_is_kept():
    inner = rectangle((0, 5), (0, 5), (1, 2)).shrunk(0.15, 0.05)
    assert inner.polygon.bounds == pytest.approx((0.15, 0.15, 4.85, 4.85))
    assert (inner.speed_min_mps, inner.speed_max_mps) == pytest.approx((1.05, 1.95))


@pytest.mark.parametrize(
    "vertices",
    [
        ((0, 0), (4, 0), (1, 1), (0, 4)),
        ((0, 0), (1, 0)),
        ((0, 0), (1, 0), (1, 0), (0, 1)),
        ((0, 0), (1, 0), (float("nan"), 1)),
        ((0, 0), (2, 2), (2, 0), (0, 2)),
    ],
)
def test_what_is_not_convex_is_refused(vertices):
    with pytest.raises(PlanError):
        TargetSet(vertices=vertices, speed_min_mps=1, speed_max_mps=2)


def test_an_empty_speed_window_is_refused():
    with pytest.raises(PlanError, match="2:1"):
        rectangle((0, 1), (0, 1), (2, 1))


@given(convex_polygons(), states())
def test_a_corridor_s_rows_are_its_half_planes(polygon, z):
    rows = polygon_rows(polygon)
    assert np.hypot(rows[:, 0], rows[:, 1]) == pytest.approx(1.0)
    inside = rows[:, :2] @ z[:2] - rows[:, 3]
    assume(np.min(np.abs(inside)) > 1e-6)
    assert bool(np.all(inside < 0)) == polygon.covers(shapely.Point(z[0], z[1]))


def test_rounding_leaves_no_row_behind():
    """The ring has a vertex that is repeated up to rounding, and one on a straight side."""
    polygon = shapely.Polygon([(0, 0), (5, 0), (10, 0), (10, 1e-9), (10, 10), (0, 10)])
    rows = polygon_rows(polygon)
    assert len(rows) == 4
    assert rows[:, :2] @ [5, 5] - rows[:, 3] == pytest.approx([-5] * 4)


def test_many_sets_are_what_they_are_one_by_one():
    rings = [
        ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)),
        ((0.0, 0.0), (0.0, 4.0), (4.0, 4.0), (4.0, 0.0)),
        ((1e5, 1e5), (1e5 + 3, 1e5), (1e5, 1e5 + 3)),
    ]
    windows = [(0.0, 1.0), (0.5, 2.0), (0.0, 2.0)]
    one_by_one = [
        TargetSet(vertices=ring, speed_min_mps=low, speed_max_mps=high)
        for ring, (low, high) in zip(rings, windows, strict=True)
    ]
    together = sets_of(rings, windows)
    assert together == one_by_one
    assert [one.centre for one in together] == [one.centre for one in one_by_one]


@pytest.mark.parametrize(
    ("ring", "window"),
    [
        (((0.0, 0.0), (4.0, 0.0), (1.0, 1.0), (0.0, 4.0)), (0.0, 1.0)),
        (((0.0, 0.0), (0.0, 0.0), (4.0, 4.0), (0.0, 4.0)), (0.0, 1.0)),
        (((0.0, 0.0), (4.0, math.nan), (4.0, 4.0), (0.0, 4.0)), (0.0, 1.0)),
        (((0.0, 0.0), (4.0, 0.0)), (0.0, 1.0)),
        (((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)), (1.0, 1.0)),
    ],
)
def test_of_many_sets_one_that_is_none_is_refused(ring, window):
    good = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))
    with pytest.raises(PlanError):
        sets_of([good, ring], [(0.0, 1.0), window])
