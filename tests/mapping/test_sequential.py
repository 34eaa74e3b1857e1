"""A map that takes in readings as they come equals the map of all of them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from grebe.mapping.covariance.drift import linear
from grebe.mapping.covariance.models import KINDS, CovarianceModel
from grebe.mapping.fields.kriging import krige
from grebe.mapping.fields.sequential import SequentialField, StraightPrior, sequential
from grebe.mapping.fields.simulation import circulant_fields
from grebe.mapping.grid import make_grid
from grebe.mapping.methods.base import Domain, Model, Readings
from grebe.mapping.methods.kriging import Kriging
from grebe.mapping.methods.spde import Spde

WATER = shapely.box(0, 0, 100, 200)
GRID = make_grid(WATER, np.sqrt(WATER.area / 1600))
STILL = Model(kind="", text="", nugget=0.0)


def lanes(count):
    """Places (n, 2) along lanes 20 m apart."""
    there = np.linspace(4, 196, 200)
    ways = [
        np.column_stack([np.full(200, north), there[:: 1 if k % 2 else -1]])
        for k, north in enumerate(range(10, 100, 20))
    ]
    return np.vstack(ways)[np.linspace(0, 999, count).astype(int)]


def water_of(kind, range_m, count, seed=3):
    """A covariance, readings of a field that has it, and the field's true values at the nodes."""
    model = CovarianceModel(kind=kind, sill=1.0, range_m=range_m, nugget=0.01)
    at, rng = lanes(count), np.random.default_rng(seed)
    _, fields = circulant_fields(model, GRID, np.vstack([at, GRID.nodes]), 1, rng, 3)
    values = fields[0][:count] + rng.normal(0, 0.1, count)
    return model, at, values, fields[0][count:]


def told(model, at, values, each=10):
    """The field after it has taken in the readings, `each` at a time."""
    prior = StraightPrior(model=model, nodes=GRID.nodes)
    field = SequentialField(prior, STILL, float(values.mean()), float(values.var()))
    for start in range(0, len(values), each):
        field.add(at[start : start + each], values[start : start + each])
    return field


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("range_m", [15.0, 50.0])
def test_the_map_is_the_one_of_all_the_readings_within_a_share_of_its_own_error(kind, range_m):
    model, at, values, truth = water_of(kind, range_m, 600)
    field = told(model, at, values)
    full = krige(at, values, GRID.nodes, model, neighbours=600)
    off = (field.node_mean - full.mean) / full.sd
    assert np.sqrt(np.mean(off**2)) < 0.3
    assert np.all(np.abs(field.node_sd / full.sd - 1) < 0.25)
    error, least = (np.sqrt(np.mean((m - truth) ** 2)) for m in (field.node_mean, full.mean))
    assert error < 1.03 * least


def test_readings_at_the_nodes_give_the_kriging_of_them_to_the_digit():
    """Nothing is lost if the nodes determine a reading completely."""
    model = CovarianceModel(kind="matern32", sill=2.0, range_m=30.0, nugget=0.05)
    rng = np.random.default_rng(5)
    chosen = rng.choice(len(GRID.nodes), 100, replace=False)
    at, values = GRID.nodes[chosen], 5 + rng.normal(size=100)
    field, full = told(model, at, values), krige(at, values, GRID.nodes, model, neighbours=100)
    assert field.node_mean == pytest.approx(full.mean, abs=2e-3)
    assert field.node_sd == pytest.approx(full.sd, rel=2e-3)


@given(each=st.integers(1, 90), shift=st.floats(-1e3, 1e3))
@settings(max_examples=8)
def test_it_matters_little_in_which_batches_readings_come_and_not_at_all_in_which_unit(each, shift):
    model, at, values, _ = water_of("exponential", 40.0, 150)
    one, other = told(model, at, values, 64), told(model, at, values + shift, each)
    assert np.abs(other.node_mean - shift - one.node_mean).max() < 0.5 * one.node_sd.max()
    assert (
        np.sqrt(np.mean((other.node_mean - shift - one.node_mean) ** 2)) < 0.1 * one.node_sd.mean()
    )


def test_more_readings_make_no_place_less_sure():
    model, at, values, _ = water_of("matern52", 30.0, 300)
    prior = StraightPrior(model=model, nodes=GRID.nodes)
    field = SequentialField(prior, STILL, float(values.mean()), float(values.var()))
    before = np.full(len(GRID.nodes), np.inf)
    for start in range(0, 300, 50):
        field.add(at[start : start + 50], values[start : start + 50])
        assert np.all(field.node_sd <= before + 1e-6)
        before = field.node_sd


def test_between_the_nodes_it_is_as_sure_as_it_says():
    model, at, values, _ = water_of("exponential", 40.0, 500)
    field = told(model, at, values)
    places = np.random.default_rng(1).uniform((5, 5), (95, 195), (200, 2))
    full = krige(at, values, places, model, neighbours=500)
    assert np.sqrt(np.mean(((field.mean(places) - full.mean) / full.sd) ** 2)) < 0.3
    assert np.median(field.sd(places) / full.sd) == pytest.approx(1.0, abs=0.1)
    drawn = field.draws(places, 400, 0)
    assert drawn.std(axis=0) == pytest.approx(field.sd(places), rel=0.25)
    assert np.abs(drawn.mean(axis=0) - field.mean(places)).max() < 0.3


def test_behind_land_it_is_the_field_with_no_flux_through_the_shore():
    """On the mesh itself, the two models give the same numbers, apart from the unknown mean."""
    water = WATER.difference(shapely.box(20, 90, 80, 110))
    grid = make_grid(water, 4.0)
    rng = np.random.default_rng(2)
    at = rng.uniform((5, 5), (95, 195), (120, 2))
    at = at[shapely.contains_xy(water, at)]
    values = np.sin(at[:, 1] / 30) + 0.05 * rng.normal(size=len(at))
    fitted = Spde().fit(Readings(positions=at, values=values), Domain(water, grid))
    field = sequential(fitted, grid.nodes)
    assert field.node_mean == pytest.approx(fitted.mean(grid.nodes), abs=0.01)
    assert field.node_sd == pytest.approx(fitted.sd(grid.nodes), rel=0.05, abs=0.003)
    more = rng.uniform((5, 5), (95, 80), (40, 2))
    field.add(more, np.sin(more[:, 1] / 30))
    both = Readings(
        positions=np.vstack([at, more]), values=np.append(values, np.sin(more[:, 1] / 30))
    )
    whole = type(fitted)(
        parameters=fitted.parameters, model=fitted.model, readings=both,
        domain=fitted.domain, mesh=fitted.mesh,
    )  # fmt: skip
    assert field.node_mean == pytest.approx(whole.mean(grid.nodes), abs=0.02)


def test_what_it_does_not_know_how_to_continue_is_left_to_a_new_fit():
    _, at, values, _ = water_of("exponential", 40.0, 100)
    readings, domain = Readings(positions=at, values=values), Domain(WATER, GRID)
    assert sequential(Kriging(drift=linear).fit(readings, domain), GRID.nodes) is None
    assert sequential(SimpleNamespace(), GRID.nodes) is None
    flat = Readings(positions=at, values=np.ones(100))
    assert sequential(Kriging().fit(flat, domain), GRID.nodes) is None
