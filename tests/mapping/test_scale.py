"""Positive, skewed quantities: their logarithm is mapped and transformed back."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from grebe.core.errors import InputError
from grebe.core.quantities import BUILTIN
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, MapSettings
from grebe.mapping.scale import LINEAR, LOGARITHMIC, exceedance, scale_of
from grebe.report.tables import area_classes

TURBIDITY = BUILTIN["turbidity_ntu"]
WATER = shapely.box(0, 0, 120, 120)


@given(st.floats(-3, 5), st.floats(0.05, 1.5))
def test_moments_are_those_of_the_lognormal_distribution(middle, width):
    known = stats.lognorm(s=width, scale=np.exp(middle))
    at = np.array([middle]), np.array([width])
    assert LOGARITHMIC.mean(*at)[0] == pytest.approx(known.mean())
    assert LOGARITHMIC.sd(*at)[0] == pytest.approx(known.std())
    threshold = float(np.exp(middle + 0.3))
    assert exceedance(LOGARITHMIC, *at, threshold)[0] == pytest.approx(known.sf(threshold))
    assert exceedance(LOGARITHMIC, *at, 0.0)[0] == 1.0
    assert exceedance(LINEAR, *at, middle)[0] == pytest.approx(0.5)


def lanes():
    along = np.arange(0.0, 121.0, 3.0)
    rows = [(n, e) for k, n in enumerate(range(5, 120, 15)) for e in along[:: (-1) ** k]]
    return np.array(rows, dtype=float)


def waves(seed, places):
    rng = np.random.default_rng(seed)
    each = rng.normal(size=(200, 2)) / 25.0
    phase = rng.uniform(0, 2 * np.pi, 200)
    return np.sqrt(2 / 200) * np.cos(places @ each.T + phase).sum(axis=1)


@pytest.mark.parametrize("seed", range(5))
def test_what_is_normal_keeps_its_scale_and_what_is_lognormal_does_not(seed):
    at = lanes()
    normal = waves(seed, at)
    assert scale_of(at, 5 + 0.1 * normal) is LINEAR
    assert scale_of(at, np.exp(normal)) is LOGARITHMIC
    assert scale_of(at, np.exp(normal) - 1.0) is LINEAR
    spread = normal / normal.std()
    assert scale_of(at, 5 + 1.6 * np.clip(spread, -2.9, 2.9)) is LINEAR


def mapped(seed=0, settings=None, spread=1.0):
    at, rng = lanes(), np.random.default_rng(seed)
    read = 4 * np.exp(spread * waves(seed, at) + 0.03 * rng.normal(size=len(at)))
    mapper = Mapper(WATER, make_grid(WATER, 6.0), settings or MapSettings())
    return mapper.map_quantity(TURBIDITY, at, read, np.ones(len(at), dtype=np.int64))


@pytest.fixture(scope="module")
def one():
    return mapped()


def test_intervals_are_asymmetric_positive_and_hold_the_water(one):
    assert one.scale is LOGARITHMIC
    nodes = one.grid.nodes
    found, truth = one.at(nodes), 4 * np.exp(waves(0, nodes))
    assert (found.low > 0).all()
    assert (found.high - found.mean > found.mean - found.low).all()
    assert np.mean((found.low <= truth) & (truth <= found.high)) > 0.9
    assert np.abs(np.mean(found.mean - truth)) < 0.05 * truth.mean()
    assert found.mean == pytest.approx(one.mean[one.grid.inside])
    assert found.sd == pytest.approx(one.sd[one.grid.inside])


def test_all_that_is_said_is_in_the_unit_of_the_quantity(one):
    read = one.values
    assert read.min() > 0
    assert read.mean() == pytest.approx(one.mean[one.grid.inside].mean(), rel=0.3)
    # Part of it is taken for water that varies within metres.
    assert one.noise_sd == pytest.approx(0.03 * np.nanmedian(one.mean), rel=0.65)
    assert 0.3 < one.validation.rmse / read.std() < 1.2
    assert 0.1 < one.error95 < read.std()


def test_draws_and_probabilities_agree_with_the_intervals(one):
    nodes = one.grid.nodes
    drawn, found = one.draws_at_nodes(400), one.at(nodes)
    assert (drawn > 0).all()
    inside = (drawn >= found.low) & (drawn <= found.high)
    assert inside.mean() == pytest.approx(0.95, abs=0.01)
    above = one.exceedance(5.0)[one.grid.inside]
    assert np.abs((drawn > 5.0).mean(axis=0) - above).max() < 0.12


def test_a_scale_may_be_asked_for_and_is_refused_where_it_cannot_be():
    plain = mapped(settings=MapSettings(scale=LINEAR))
    assert plain.scale is LINEAR
    assert plain.on_scale is None
    asked = MapSettings(scale=LOGARITHMIC)
    assert mapped(settings=asked, spread=0.05).scale is LOGARITHMIC
    at = lanes()
    with pytest.raises(InputError, match="logarithm needs readings above 0"):
        Mapper(WATER, make_grid(WATER, 20.0), asked).map_quantity(
            TURBIDITY, at, waves(0, at), np.ones(len(at), dtype=np.int64)
        )


def test_shares_of_the_area_are_those_of_the_skewed_water(one):
    for each in area_classes(one):
        if np.isfinite(each.low):
            above = np.nanmean(one.exceedance(each.low)[one.grid.inside])
            break
    assert sum(c.share for c in area_classes(one) if c.low >= each.low) == pytest.approx(above)


def test_nothing_positive_lies_below_nothing():
    mean, sd = np.zeros(3), np.ones(3)
    assert (exceedance(LOGARITHMIC, mean, sd, -1.0) == 1.0).all()


def test_a_temperature_near_its_zero_is_no_plume():
    at = lanes()
    read = 1.5 * np.exp(waves(0, at))
    mapper = Mapper(WATER, make_grid(WATER, 20.0))
    flags = np.ones(len(at), dtype=np.int64)
    assert mapper.map_quantity(BUILTIN["temperature_degc"], at, read, flags).scale is LINEAR
