"""Variogram estimators, directions, likelihood and noise."""

import gstools as gs
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grebe.mapping.covariance.likelihood import fit_reml
from grebe.mapping.covariance.models import KINDS, CovarianceModel
from grebe.mapping.covariance.noise import noise_variance
from grebe.mapping.covariance.variogram import empirical_variogram, fit_variogram


def scatter(n, seed=0, size=100.0):
    return np.random.default_rng(seed).uniform(0, size, (n, 2))


@pytest.mark.parametrize(("ours", "theirs"), [("matheron", "matheron"), ("cressie", "cressie")])
def test_estimators_are_those_of_gstools(ours, theirs):
    positions = scatter(300)
    values = gs.SRF(gs.Exponential(dim=2, len_scale=20), seed=1)(positions.T)
    edges = np.linspace(0, 40, 11)
    found = empirical_variogram(positions, values, bins=10, cutoff_m=40, estimator=ours)
    _, gamma = gs.vario_estimate(positions.T, values, edges, estimator=theirs)
    assert found.semivariance == pytest.approx(gamma, rel=1e-3)


@pytest.mark.parametrize("estimator", ["cressie", "dowd"])
def test_robust_estimators_bear_outliers(estimator):
    positions = scatter(400)
    values = np.random.default_rng(2).normal(size=400)
    spoilt = values.copy()
    spoilt[::40] += 50.0
    clean = empirical_variogram(positions, values, estimator=estimator).semivariance
    dirty = empirical_variogram(positions, spoilt, estimator=estimator).semivariance
    plain = empirical_variogram(positions, spoilt).semivariance
    assert np.median(dirty / clean) < 4
    assert np.median(plain / clean) > 50


@given(st.sampled_from(KINDS), st.floats(0.2, 1.0), st.floats(0, 180))
def test_an_anisotropic_covariance_reaches_as_far_as_it_says(kind, ratio, angle):
    model = CovarianceModel(
        kind=kind, sill=1.0, range_m=50.0, nugget=0.0, ratio=ratio, angle_deg=angle
    )
    along = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    across = np.array([-along[1], along[0]])
    places = model.isotropic(np.array([[0.0, 0.0], 20 * along, 20 * ratio * across]))
    lengths = np.hypot(*(places[1:] - places[0]).T)
    assert lengths == pytest.approx([20.0, 20.0], abs=1e-9)


def test_a_direction_is_found():
    model = gs.Exponential(dim=2, len_scale=[40, 10], angles=np.radians(90))
    positions = scatter(900, size=200)
    # GSTools measures angles from its first axis, our north, towards its second, our east.
    values = gs.SRF(model, seed=5)(positions.T)
    fit = fit_variogram(positions, values).model
    assert fit.ratio < 0.6
    assert abs((fit.angle_deg - 90 + 90) % 180 - 90) < 25


def test_no_direction_is_found_where_there_is_none():
    positions = scatter(900, size=200)
    values = gs.SRF(gs.Exponential(dim=2, len_scale=15), seed=8)(positions.T)
    assert fit_variogram(positions, values).model.ratio == 1.0


@pytest.mark.slow
def test_restricted_likelihood_finds_the_truth_within_its_errors():
    """Over twenty fields, range and noise scatter around the truth."""
    ranges, nuggets = [], []
    for seed in range(20):
        positions = scatter(300, seed)
        values = gs.SRF(gs.Exponential(dim=2, len_scale=15), seed=seed)(positions.T)
        values += np.random.default_rng(seed).normal(0, 0.3, 300)
        fit = fit_reml(positions, values)
        ranges.append(fit.model.practical_range_m)
        nuggets.append(fit.model.nugget)
    assert np.median(ranges) == pytest.approx(45, rel=0.3)
    assert np.median(nuggets) == pytest.approx(0.09, rel=0.6)


@given(st.floats(0.01, 1.0), st.integers(0, 50))
def test_noise_is_told_from_a_gradient(sd, seed):
    along = np.column_stack([np.arange(500.0), np.zeros(500)])
    values = 0.1 * along[:, 0] + np.random.default_rng(seed).normal(0, sd, 500)
    assert noise_variance(along, values, 10.0) == pytest.approx(sd**2, rel=0.4)
    assert noise_variance(along, values, sd**2 / 4) == sd**2 / 4


def test_samples_far_apart_do_not_tell_noise():
    assert noise_variance(scatter(100, size=1e4), np.zeros(100), 0.7) == 0.7
