"""The field that knows the shore."""

import numpy as np
import pytest
import shapely
from conftest import TEMPERATURE
from scipy.sparse import csc_matrix
from scipy.special import k1

from grebe.core.samples import Flag
from grebe.mapping.fields import spde
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, MapSettings
from grebe.mapping.methods.choice import METHODS

SEA = shapely.box(0, 0, 200, 200)


def prior_covariance(mesh, kappa, node):
    """Covariance of the unconditional field of unit sill between a node and all others."""
    operator = spde._operator(mesh, kappa)
    area = mesh.step_m**2
    precision = csc_matrix(operator @ operator) / area / (4 * np.pi * kappa**2)
    right = np.zeros(len(mesh.nodes))
    right[node] = 1.0
    return spde._factor(precision).solve(right)


def nearest(mesh, place):
    return int(np.argmin(np.hypot(*(mesh.nodes - place).T)))


def matern1(h, kappa):
    x = kappa * np.maximum(h, 1e-9)
    return x * k1(x)


def test_far_from_land_it_is_matern_s_covariance():
    mesh = spde.Mesh(make_grid(SEA, 2.0), SEA)
    kappa = 4 / 40
    middle = nearest(mesh, (100, 100))
    found = prior_covariance(mesh, kappa, middle)
    h = np.hypot(*(mesh.nodes - mesh.nodes[middle]).T)
    ring = (h > 8) & (h < 40)
    assert found[ring] == pytest.approx(matern1(h[ring], kappa), abs=0.02)


def test_a_straight_shore_reflects():
    """At a wall without flux, the covariance is that of open water plus its mirror image."""
    mesh = spde.Mesh(make_grid(SEA, 2.0), SEA)
    kappa = 4 / 40
    # Half a step beyond the first row of nodes.
    wall = mesh.nodes[:, 0].min() - 1.0
    place = nearest(mesh, (9, 100))
    found = prior_covariance(mesh, kappa, place)
    here = mesh.nodes[place]
    mirror = np.array([2 * wall - here[0], here[1]])
    direct = np.hypot(*(mesh.nodes - here).T)
    echo = np.hypot(*(mesh.nodes - mirror).T)
    ring = (direct > 8) & (direct < 40)
    expected = matern1(direct, kappa) + matern1(echo, kappa)
    assert found[ring] == pytest.approx(expected[ring], abs=0.03)


def test_a_wall_parts_the_water():
    """Two places 10 m apart on either side of a long wall are uncorrelated."""
    water = SEA.difference(shapely.box(-1, 99, 180, 101))
    mesh = spde.Mesh(make_grid(water, 2.0), water)
    found = prior_covariance(mesh, 4 / 40, nearest(mesh, (20, 95)))
    assert found[nearest(mesh, (20, 105))] < 1e-3
    assert found[nearest(mesh, (20, 85))] > 0.5


def test_a_thin_wall_between_nodes_parts_it_too():
    water = SEA.difference(shapely.box(-1, 99.9, 180, 100.1))
    mesh = spde.Mesh(make_grid(water, 4.0), water)
    found = prior_covariance(mesh, 4 / 40, nearest(mesh, (20, 96)))
    assert found[nearest(mesh, (20, 104))] < 1e-2


def test_the_selected_inverse_is_the_inverse():
    mesh = spde.Mesh(make_grid(SEA, 12.0), SEA)
    operator = spde._operator(mesh, 0.05)
    matrix = csc_matrix(operator @ operator)
    found = spde.inverse_diagonal(spde._factor(matrix))
    assert found == pytest.approx(np.diag(np.linalg.inv(matrix.toarray())), rel=1e-9)


def field(seed, count=250, noise=0.1):
    """A field drawn from the model itself on water with a wall, and samples of it."""
    water = shapely.box(0, 0, 300, 200).difference(shapely.box(-1, 95, 220, 105))
    mesh = spde.Mesh(make_grid(water, 4.0), water)
    rng = np.random.default_rng(seed)
    kappa = 4 / 150
    # Applied twice, for a field as smooth as one that spreads through water.
    operator = spde._factor(spde._operator(mesh, kappa))
    truth = operator.solve(operator.solve(rng.normal(size=len(mesh.nodes))))
    truth /= truth.std()
    chosen = rng.choice(len(truth), count, replace=False)
    values = truth[chosen] + rng.normal(0, noise, count)
    return water, mesh, truth, mesh.nodes[chosen], values


def mapped(water, grid, positions, values, method):
    flags = np.full(len(values), Flag.GOOD)
    mapper = Mapper(water, grid, MapSettings(method=METHODS.get(method)))
    return mapper.map_quantity(TEMPERATURE, positions, values, flags)


@pytest.mark.slow
def test_with_land_between_it_is_better_than_straight_distances():
    ratios, inside, methods = [], [], []
    for seed in range(5):
        water, mesh, truth, positions, values = field(seed, count=120)
        rmse = {}
        for method in ("kriging", "spde", None):
            one = mapped(water, mesh.grid, positions, values, method)
            error = one.mean[mesh.grid.inside] - truth
            rmse[method] = np.sqrt(np.mean(error**2))
        methods.append(one.method.key)
        inside.append(np.mean(np.abs(error) <= 1.96 * one.sd[mesh.grid.inside]))
        ratios.append(rmse["spde"] / rmse["kriging"])
    assert set(methods) == {"spde"}
    assert np.mean(ratios) < 0.7
    assert np.mean(inside) > 0.9


def test_without_land_kriging_is_chosen():
    rng = np.random.default_rng(0)
    positions = rng.uniform(0, 200, (80, 2))
    values = np.sin(positions[:, 0] / 40) + rng.normal(0, 0.05, 80)
    one = mapped(SEA, make_grid(SEA, 10.0), positions, values, None)
    assert one.method.key == "kriging"
    assert "no land" in one.reason


def test_draws_have_the_map_s_mean_and_spread():
    water, mesh, _, positions, values = field(1)
    for method in ("kriging", "spde"):
        one = mapped(water, mesh.grid, positions, values, method)
        draws = one.draws(120, seed=3)[:, mesh.grid.inside]
        sd = one.sd[mesh.grid.inside]
        apart = (draws.mean(axis=0) - one.mean[mesh.grid.inside]) / sd
        assert np.median(np.abs(apart)) < 0.15
        assert np.median(draws.std(axis=0) / sd) == pytest.approx(1.0, abs=0.15)


def test_equal_values_are_refused_by_the_fit():
    mesh = spde.coarse_mesh(SEA)
    with pytest.raises(ValueError, match="vary"):
        spde.fit_spde(mesh, np.random.default_rng(0).uniform(0, 200, (30, 2)), np.ones(30))


def test_samples_on_both_sides_of_a_thin_spit_are_kept_apart():
    """With samples a metre from a wall as thin, on a grid of 4 m, each side keeps its value."""
    water = shapely.box(0, 0, 100, 100).difference(shapely.box(-1, 50.2, 80, 51.2))
    rng = np.random.default_rng(2)
    north = rng.uniform(2, 75, 120)
    east = np.where(rng.random(120) < 0.5, rng.uniform(40, 50, 120), rng.uniform(51.4, 61, 120))
    east[:4], north[:4] = (49.9, 51.5, 49.9, 51.5), (20.0, 20.0, 50.0, 50.0)
    values = np.where(east > 50.7, 10.0, 0.0) + rng.normal(0, 0.05, 120)
    grid = make_grid(water, 4.0)
    one = mapped(water, grid, np.column_stack([north, east]), values, "spde")
    west = np.argmin(np.abs(grid.east - 46))
    row = np.argmin(np.abs(grid.north - 30))
    assert one.mean[row, west] == pytest.approx(0.0, abs=0.5)
    assert np.nanmin(one.mean) > -3
    assert np.nanmax(one.mean) < 13


def test_the_weights_of_a_place_do_not_reach_through_land():
    water = shapely.box(0, 0, 100, 100).difference(shapely.box(-1, 50.2, 80, 51.2))
    mesh = spde.Mesh(make_grid(water, 4.0), water)
    weights = mesh.interpolation(np.array([[20.0, 49.9], [20.0, 51.5], [20.0, 50.7]])).toarray()
    assert weights.sum(axis=1) == pytest.approx(1.0)
    assert (mesh.nodes[weights[0] > 0, 1] < 50.2).all()
    assert (mesh.nodes[weights[1] > 0, 1] > 51.2).all()
