"""Other packages' interpolators, each with its own automatic choices, to compare maps with.

Each takes readings at places and returns its values at others. GSTools, PyKrige and scikit-learn
are imported; gstat runs in R if `Rscript` finds it, and has no row otherwise.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
import warnings
from functools import cache
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

# The most readings for peers that solve one system of all.
MOST = 1_500
LAGS, KINDS = 15, ("spherical", "exponential")

# gstat as in its manual: an automatic variogram, then kriging from the fifty nearest.
GSTAT = """
suppressMessages({library(sp); library(gstat)})
folder <- commandArgs(TRUE)[1]
train <- read.csv(file.path(folder, "train.csv")); at <- read.csv(file.path(folder, "at.csv"))
coordinates(train) <- ~x+y; coordinates(at) <- ~x+y
train <- remove.duplicates(train)
empirical <- variogram(z ~ 1, train)
fitted <- suppressWarnings(fit.variogram(empirical, vgm(c("Sph", "Exp", "Mat"))))
found <- krige(z ~ 1, train, at, fitted, nmax = 50, debug.level = 0)
write.csv(data.frame(z = found$var1.pred), file.path(folder, "found.csv"), row.names = FALSE)
"""


def rms(error: np.ndarray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(error**2)))


def peers(
    positions: np.ndarray, values: np.ndarray, at: np.ndarray, truth: np.ndarray
) -> tuple[dict[str, float], float]:
    """RMSE of each peer at left-out places, and PyKrige's mean squared standardised error."""
    distance, index = KDTree(positions).query(at, k=12)
    weight = 1 / np.maximum(distance, 1e-6) ** 2
    idw = np.sum(weight * values[index], axis=1) / np.sum(weight, axis=1)
    found = {"nearest": rms(values[index[:, 0]] - truth), "idw": rms(idw - truth)}
    few = np.unique(np.linspace(0, len(values) - 1, min(len(values), MOST)).astype(int))
    mean, variance, _ = min(
        (_pykrige(positions[few], values[few], at, kind) for kind in KINDS), key=lambda one: one[2]
    )
    found["pykrige"] = rms(mean - truth)
    found["gstools"] = rms(_gstools(positions[few], values[few], at) - truth)
    found["sklearn"] = rms(_gaussian_process(positions[few], values[few], at) - truth)
    if has_gstat():
        found["gstat"] = rms(_gstat(positions, values, at) - truth)
    return found, float(np.mean((mean - truth) ** 2 / np.maximum(variance, 1e-12)))


@cache
def has_gstat() -> bool:
    """Whether R is installed, with gstat."""
    if shutil.which("Rscript") is None:
        return False
    asked = subprocess.run(
        ["Rscript", "-e", "library(gstat); library(sp)"], capture_output=True, check=False
    )
    return asked.returncode == 0


def _pykrige(
    positions: np.ndarray, values: np.ndarray, at: np.ndarray, kind: str
) -> tuple[np.ndarray, np.ndarray, float]:
    from pykrige.ok import OrdinaryKriging

    kriging = OrdinaryKriging(
        positions[:, 1], positions[:, 0], values, variogram_model=kind, nlags=LAGS
    )
    mean, variance = kriging.execute("points", at[:, 1], at[:, 0])
    model = kriging.variogram_function(kriging.variogram_model_parameters, kriging.lags)
    misfit = float(np.sum((model - kriging.semivariance) ** 2))
    return np.asarray(mean), np.asarray(variance), misfit


def _gstools(positions: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The better fit of two models to GSTools' own bins, and its ordinary kriging."""
    import gstools as gs

    lag, gamma = gs.vario_estimate(positions.T, values)
    best, model = -np.inf, None
    for kind in (gs.Spherical, gs.Exponential):
        tried = kind(dim=2)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            *_, share = tried.fit_variogram(lag, gamma, nugget=True, return_r2=True)
        if share > best:
            best, model = share, tried
    kriging = gs.krige.Ordinary(model, positions.T, values, exact=False)
    return np.asarray(kriging(at.T, return_var=False))


def _gaussian_process(positions: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

    few = np.linspace(0, len(values) - 1, min(len(values), 500)).astype(int)
    scale, shift = values.std() or 1.0, values.mean()
    kernel = ConstantKernel(1.0) * Matern(50.0, (1.0, 2_000.0), nu=1.5) + WhiteKernel(0.05)
    process = GaussianProcessRegressor(kernel, normalize_y=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        process.fit(positions[few], (values[few] - shift) / scale)
        process = GaussianProcessRegressor(process.kernel_, optimizer=None)
        process.fit(positions, (values - shift) / scale)
    return shift + scale * np.asarray(process.predict(at))


def _gstat(positions: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        train = np.column_stack([positions, values])
        np.savetxt(folder / "train.csv", train, delimiter=",", header="x,y,z", comments="")
        np.savetxt(folder / "at.csv", at, delimiter=",", header="x,y", comments="")
        (folder / "run.R").write_text(GSTAT)
        subprocess.run(["Rscript", folder / "run.R", folder], check=True, capture_output=True)
        return np.loadtxt(folder / "found.csv", skiprows=1)
