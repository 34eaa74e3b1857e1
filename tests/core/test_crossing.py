"""Tests of clipping a segment to a convex ring."""

import numpy as np
import pytest
import shapely

from grebe.core.crossing import crossing
from grebe.core.kernels import machine_code

SQUARE = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0), (0.0, 0.0)])


@machine_code
def crossed(ax, ay, bx, by, ring, drawn_in_m):
    return crossing(ax, ay, bx, by, ring, 0, len(ring) - 1, drawn_in_m)


def shares(a, b, ring=SQUARE, drawn_in_m=0.0):
    return crossed(*a, *b, ring, drawn_in_m)


def test_a_stretch_across_enters_and_leaves_where_it_meets_the_sides():
    assert shares((-4.0, 1.0), (12.0, 1.0)) == pytest.approx((0.25, 0.5))
    assert shares((-4.0, 1.0), (12.0, 1.0), drawn_in_m=1.0 - 1e-9) == pytest.approx(
        (5 / 16, 7 / 16)
    )


def test_a_stretch_that_begins_or_ends_within_is_there_from_its_beginning_or_to_its_end():
    assert shares((1.0, 1.0), (8.0, 1.0))[0] == 0.0
    assert shares((-3.0, 1.0), (1.0, 1.0))[1] == 1.0


def test_what_lies_within_the_shares_is_what_geos_finds():
    rng = np.random.default_rng(3)
    met = 0
    for _ in range(300):
        ring = shapely.MultiPoint(rng.uniform(0, 10, (8, 2))).convex_hull.exterior.normalize()
        corners = np.asarray(ring.coords)[:: -1 if not ring.is_ccw else 1].copy()
        a, b = rng.uniform(-5, 15, (2, 2))
        enter, leave = shares(a, b, corners)
        within = shapely.LineString([a, b]).intersection(shapely.Polygon(ring)).length
        found = max(leave - enter, 0.0) * np.hypot(*(b - a))
        assert found == pytest.approx(within, abs=1e-9)
        met += within > 0
    assert 50 < met < 300
