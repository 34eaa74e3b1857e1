"""The rest of a box around a hull after the land is cut off."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from grebe.planning.paths.land_cut import MOST_SIDES, without_land

BOX = shapely.box(-10, -10, 15, 15)
HULL = shapely.box(0, 0, 5, 5)


def left(hull: shapely.Polygon, box: shapely.Polygon, water: shapely.Polygon) -> shapely.Polygon:
    """One box."""
    pairs = (np.array([one], dtype=object) for one in (hull, box))
    return without_land(*pairs, water)[0]


def differs_m2(one: shapely.Polygon, other: shapely.Polygon) -> float:
    """The area of the symmetric difference of two polygons."""
    return one.symmetric_difference(other).area


def test_open_water_leaves_the_whole_box() -> None:
    assert left(HULL, BOX, shapely.box(-99, -99, 99, 99)).equals(BOX)


def test_a_straight_shore_is_where_it_ends() -> None:
    found = left(HULL, BOX, shapely.box(-3, -99, 99, 99))
    assert differs_m2(found, shapely.box(-3, -10, 15, 15)) < 1e-9


def test_a_shore_that_the_hull_touches_takes_no_more_than_itself() -> None:
    found = left(HULL, BOX, shapely.box(0, -99, 5, 99))
    assert differs_m2(found, shapely.box(0, -10, 5, 15)) < 1e-9


def test_a_bay_that_the_hull_fills_takes_its_three_sides_alone() -> None:
    bay = shapely.union_all([HULL, shapely.box(0, -99, 99, 0)])
    assert left(HULL, BOX, bay).area == pytest.approx(5 * 15)


def test_an_island_is_cut_off_across_its_nearest_point() -> None:
    water = shapely.box(-99, -99, 99, 99).difference(shapely.Point(10, 2.5).buffer(1, quad_segs=64))
    north = shapely.bounds(left(HULL, BOX, water))[2]
    assert north == pytest.approx(9.0, abs=1e-6)


corner = st.tuples(st.floats(0.3, 1.0), st.floats(0.0, 0.9))


@given(
    lake=st.lists(corner, min_size=5, max_size=14),
    islands=st.lists(
        st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(0.2, 3)), max_size=3
    ),
    at=st.tuples(st.floats(-12, 12), st.floats(-12, 12)),
    reach=st.floats(1, 15),
)
def test_what_is_left_is_convex_water_around_the_hull(
    lake: list[tuple[float, float]],
    islands: list[tuple[float, float, float]],
    at: tuple[float, float],
    reach: float,
) -> None:
    turns = [2 * np.pi * (k + share) / len(lake) for k, (_, share) in enumerate(lake)]
    ring = [
        (30 * far * np.cos(turn), 30 * far * np.sin(turn))
        for (far, _), turn in zip(lake, turns, strict=True)
    ]
    water = shapely.Polygon(ring)
    for x, y, r in islands:
        water = water.difference(shapely.Point(x, y).buffer(r, quad_segs=3))
    hull = shapely.box(at[0], at[1], at[0] + 4, at[1] + 4)
    if not isinstance(water, shapely.Polygon) or not water.covers(hull):
        return
    x0, y0, x1, y1 = hull.bounds
    box = shapely.box(x0 - reach, y0 - reach, x1 + reach, y1 + reach)
    found = left(hull, box, water)
    assert found.buffer(1e-6).covers(hull)
    assert found.difference(water).area < 1e-5
    assert found.convex_hull.area == pytest.approx(found.area)
    assert len(found.exterior.coords) <= MOST_SIDES + 1
