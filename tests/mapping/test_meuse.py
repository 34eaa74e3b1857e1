"""gstat's published numbers for the meuse data, log(zinc), from gstat 2.1-0 and sp 1.6-0.

The data (Rikken and Van Rijn 1993; from the R package sp) come with the package scikit-gstat.
The numbers for the grid meuse.grid are not tested: no package holds that grid.
"""

import csv
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from grebe.mapping.covariance.likelihood import fit_reml
from grebe.mapping.covariance.models import CovarianceModel
from grebe.mapping.covariance.variogram import default_cutoff_m, empirical_variogram, fit_model
from grebe.mapping.fields.kriging import Drift, krige

HOME = Path(find_spec("skgstat").submodule_search_locations[0])
SPHERICAL = CovarianceModel(kind="spherical", sill=0.59060780, range_m=897.0209, nugget=0.05066243)
EXPONENTIAL = CovarianceModel(kind="exponential", sill=0.17642, range_m=340.32, nugget=0.05712)


@pytest.fixture(scope="module")
def meuse():
    with (HOME / "data" / "samples" / "meuse.txt").open() as file:
        rows = list(csv.DictReader(file))
    positions = np.array([(float(row["y"]), float(row["x"])) for row in rows])
    logzinc = np.log([float(row["zinc"]) for row in rows])
    return positions, logzinc, np.sqrt([[float(row["dist"])] for row in rows])


def test_the_variogram_s_first_classes(meuse):
    positions, values, _ = meuse
    found = empirical_variogram(positions, values)
    assert found.pairs[:3].tolist() == [57, 299, 419]
    assert found.distance_m[:3] == pytest.approx([79.2924, 163.9737, 267.3648], rel=1e-6)
    assert found.semivariance[:3] == pytest.approx([0.1234479, 0.2162185, 0.3027859], rel=1e-6)


@pytest.mark.parametrize(
    ("kind", "weighting", "nugget", "sill", "reach"),
    [
        ("spherical", "n/h2", 0.05066243, 0.59060780, 897.0209),
        ("spherical", "1", 0.05336737, 0.57944014, 890.1694),
        ("exponential", "n/h2", 0.0, 0.71866, 449.758),
    ],
)
def test_the_fitted_models(meuse, kind, weighting, nugget, sill, reach):
    positions, values, _ = meuse
    model, _, _ = fit_model(empirical_variogram(positions, values), kind, weighting=weighting)
    assert model.nugget == pytest.approx(nugget, rel=1e-3, abs=1e-6)
    assert model.sill == pytest.approx(sill, rel=1e-3)
    assert model.range_m == pytest.approx(reach, rel=1e-3)


def left_out(positions, values, model, functions=None):
    """Errors and variances of observations when each sample is left out in turn."""
    errors, variances = [], []
    for i in range(len(values)):
        keep = np.arange(len(values)) != i
        drift = None
        if functions is not None:
            drift = Drift(at_samples=functions[keep], at_targets=functions[[i]])
        found = krige(positions[keep], values[keep], positions[[i]], model, drift=drift)
        errors.append(found.mean[0] - values[i])
        variances.append(found.variance[0] + model.nugget)
    return np.array(errors), np.array(variances)


def test_leave_one_out_by_ordinary_kriging(meuse):
    positions, values, _ = meuse
    errors, variances = left_out(positions, values, SPHERICAL)
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(0.391804, abs=1e-6)
    assert np.mean(np.abs(errors)) == pytest.approx(0.292152, abs=1e-6)
    assert np.mean(errors) == pytest.approx(0.000021, abs=1e-6)
    assert np.mean(errors**2 / variances) == pytest.approx(0.818546, abs=1e-6)


def test_leave_one_out_by_universal_kriging(meuse):
    positions, values, distance = meuse
    errors, variances = left_out(positions, values, EXPONENTIAL, distance)
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(0.377651, abs=1e-6)
    assert np.mean(errors**2 / variances) == pytest.approx(1.082123, abs=1e-5)


def test_the_likeliest_model_is_likelier_than_the_fitted_one(meuse):
    """Within one kind, it maximises the restricted likelihood; the range has a standard error."""
    positions, values, _ = meuse
    fit = fit_reml(positions, values)
    assert 0.3 < fit.model.sill < 3.0
    assert 0 < fit.standard_errors["range_m"] < fit.model.range_m
    assert "restricted log-likelihood" in fit.reason
    assert default_cutoff_m(positions) == pytest.approx(1596.6, abs=0.1)
