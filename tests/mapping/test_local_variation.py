"""Readings along a few passes show where the water varies more than elsewhere."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grebe.mapping.local_variation import MOST, local_variation

LANES = np.array([(n, e) for e in range(0, 200, 40) for n in np.arange(0.0, 200.0, 2.0)])
PLACES = np.array([(n, e) for e in range(10, 200, 20) for n in range(10, 200, 20)], dtype=float)


def test_a_front_is_where_it_is():
    values = np.tanh((LANES[:, 0] - 100) / 5) + 0.05 * np.sin(LANES[:, 1])
    found = local_variation(PLACES, LANES, values, 16.0, 30.0)
    near = np.abs(PLACES[:, 0] - 100) < 15
    assert found[near].min() > 1.5 * found[np.abs(PLACES[:, 0] - 100) > 60].max()


def test_water_that_varies_alike_everywhere_is_alike():
    rng = np.random.default_rng(1)
    values = np.sin(LANES[:, 0] / 7 + rng.uniform(0, 6)) + 0.2 * rng.normal(size=len(LANES))
    found = local_variation(PLACES, LANES, values, 16.0, 30.0)
    assert found == pytest.approx(1.0, abs=0.5)


@given(scale=st.floats(1e-3, 1e3), shift=st.floats(-1e3, 1e3))
@settings(max_examples=20, deadline=None)
def test_it_knows_no_unit(scale, shift):
    values = np.tanh((LANES[:, 0] - 100) / 5) + 0.1 * np.sin(LANES[:, 1])
    same = local_variation(PLACES, LANES, values, 16.0, 30.0)
    moved = local_variation(PLACES, LANES, scale * values + shift, 16.0, 30.0)
    assert moved == pytest.approx(same, rel=1e-3)


def test_a_quantity_that_is_the_same_everywhere_and_readings_far_apart_tell_nothing():
    assert np.all(np.isfinite(local_variation(PLACES, LANES, np.ones(len(LANES)), 16.0, 30.0)))
    few = LANES[::97]
    assert local_variation(PLACES, few, few[:, 0], 1.0, 30.0) == pytest.approx(1.0)


def test_it_is_bounded():
    values = np.where(LANES[:, 0] > 100, 1e6, 0.0)
    found = local_variation(PLACES, LANES, values, 16.0, 5.0)
    assert found.max() <= MOST
    assert found.min() >= 1 / MOST
