"""Places where a map errs more than elsewhere are found, and no others."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from grebe.mapping.proof.calibration import Calibration, spread
from grebe.mapping.proof.unrest import BELIEF_BLOCKS, Unrest, calmed, unrest_of
from grebe.mapping.proof.validation import Errors


def errors_of(rng, sizes, places):
    """Independent errors of given sizes (n,), with standard deviations stated as 1."""
    return Errors(
        places=places,
        error=sizes * rng.normal(size=len(places)),
        sd=np.ones(len(places)),
        read=np.zeros(len(places)),
    )


def lanes(step=3.0):
    """Places along lanes that cover 200 m x 200 m."""
    along, across = np.meshgrid(np.arange(0, 200, step), np.arange(0, 200, 20.0))
    return np.column_stack([along.ravel(), across.ravel()])


def test_a_restless_corner_is_found_and_other_water_is_made_surer():
    rng = np.random.default_rng(1)
    places = lanes()
    corner = (places > 120).all(axis=1)
    found = unrest_of([errors_of(rng, np.where(corner, 5.0, 1.0), places)])
    inside, outside = found.factor(np.array([[170.0, 170.0], [50.0, 50.0]]))
    assert inside / outside > 2.5
    assert found.factor(np.array([[5000.0, 5000.0]])) == pytest.approx(1.0)


def test_errors_are_nearer_to_normal_with_it_on_stretches_that_did_not_tell_it():
    rng = np.random.default_rng(2)
    places = lanes()
    sizes = np.where((places > 120).all(axis=1), 5.0, 1.0)
    told, other = (errors_of(rng, sizes, places) for _ in range(2))
    found = unrest_of([told])
    raw = other.z / spread(other, 100)
    better = calmed(other, found)
    calm = better.z / spread(better, 100)

    def kurtosis(z):
        return np.mean(z**4) / np.mean(z**2) ** 2

    # The kurtosis of normal errors is 3.
    assert kurtosis(calm) - 3 < 0.5 * (kurtosis(raw) - 3)


def test_even_water_is_left_as_it_is():
    places = lanes()
    found = [
        unrest_of([errors_of(np.random.default_rng(seed), np.ones(len(places)), places)])
        for seed in range(40)
    ]
    assert sum(one is not None for one in found) <= 2


def test_few_errors_tell_nothing():
    places = lanes()[:20]
    rng = np.random.default_rng(3)
    assert unrest_of([errors_of(rng, np.linspace(1, 9, 20), places)]) is None
    assert unrest_of([errors_of(rng, np.empty(0), np.empty((0, 2)))]) is None


def test_the_raster_is_as_good_as_the_sum_over_all_blocks():
    rng = np.random.default_rng(4)
    one = Unrest(
        centres=rng.uniform(0, 300, (300, 2)), squares=rng.exponential(1, 300), width_m=30.0
    )
    places = rng.uniform(-50, 350, (500, 2))
    weight = np.exp(-0.5 * (cdist(places, one.centres) / 30.0) ** 2)
    exact = np.sqrt((BELIEF_BLOCKS + weight @ one.squares) / (BELIEF_BLOCKS + weight.sum(axis=1)))
    assert one.factor(places) == pytest.approx(exact, abs=0.02)


def test_it_multiplies_both_factors_of_a_map():
    rng = np.random.default_rng(5)
    one = Unrest(centres=rng.uniform(0, 99, (50, 2)), squares=rng.exponential(1, 50), width_m=15.0)
    way = np.column_stack([np.arange(50.0), np.zeros(50)])
    places = rng.uniform(0, 99, (20, 2))
    usual = Calibration(on_way=0.7, off_way=1.4, way=way)
    both = Calibration(on_way=0.7, off_way=1.4, way=way, unrest=one)
    assert both.factor(places) == pytest.approx(usual.factor(places) * one.factor(places))
