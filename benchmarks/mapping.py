"""Maps against other packages' kriging, and against the truth.

A Matern-3/2 field of 1 km2 with a range parameter of 60 m and variance 1, sampled along straight
legs between random places with a noise variance of 0.05; parameters known to all; 40,000 targets.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import shapely

from benchmarks.common import print_head, print_row
from grebe.core.quantities import LIMNOLOGICAL
from grebe.core.samples import Flag
from grebe.mapping.covariance.models import CovarianceModel
from grebe.mapping.fields.kriging import Estimate, krige
from grebe.mapping.fields.simulation import circulant_fields
from grebe.mapping.fields.spde import Mesh, ShoreField, ShoreModel, coarse_mesh, fit_spde
from grebe.mapping.fields.spde import _factor as factorised
from grebe.mapping.fields.spde import _operator as operator_of
from grebe.mapping.grid import Grid, make_grid
from grebe.mapping.maps import Mapper, MapSettings
from grebe.mapping.methods.choice import METHODS

SEA = shapely.box(0, 0, 1000, 1000)
MODEL = CovarianceModel(kind="matern32", sill=1.0, range_m=60.0, nugget=0.05)
TARGETS = make_grid(SEA, 5.0)
FINE = make_grid(SEA, 1.0)
HEAD = ("n", "method", "CPU s", "RMSE", "MSDR", "within 95 %", "MB")


def legs(count: int, seed: int) -> np.ndarray:
    """Samples evenly along straight legs between random places."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(1, 999, (max(int(np.sqrt(count) / 2), 4) + 1, 2))
    along = np.append(0, np.cumsum(np.hypot(*np.diff(corners, axis=0).T)))
    places = np.linspace(0, along[-1], count)
    return np.column_stack([np.interp(places, along, column) for column in corners.T])


def sampled(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, values, and the truth at the targets."""
    positions = legs(count, 2)
    both = np.vstack([TARGETS.nodes, positions])
    _, truth = circulant_fields(MODEL, FINE, both, 1, np.random.default_rng(1))
    noise = np.random.default_rng(3).normal(0, np.sqrt(MODEL.nugget), count)
    m = len(TARGETS.nodes)
    return positions, truth[0, m:] + noise, truth[0, :m]


def mapping() -> None:
    peers()
    many()
    islands()
    calibration()


def peers() -> None:
    print_head("Kriging, all samples or all that the package can, 40,000 targets", *HEAD, "time")
    for count in (500, 2_000, 10_000):
        positions, values, truth = sampled(count)
        krige(positions[:50], values[:50], TARGETS.nodes[:50], MODEL)
        ours = _timed(count, "Grebe", truth, partial(_grebe, positions, values), None)
        for name, method in _PEERS.items():
            if count <= _LARGEST[name]:
                _timed(count, name, truth, partial(method, positions, values), ours)


def many() -> None:
    print_head("Many samples", *HEAD, "time")
    for count in (10_000, 100_000, 1_000_000):
        positions, values, truth = sampled(count)
        call = partial(_grebe, positions, values)
        ours = _timed(count, "Grebe, tiles", truth, call, None)
        model = fit_spde(coarse_mesh(SEA), positions, values)
        for step in (10.0, 5.0):
            call = partial(_spde, step, positions, values, model)
            _timed(count, f"Grebe, SPDE {step:g} m", truth, call, ours)


def _grebe(positions: np.ndarray, values: np.ndarray) -> Estimate:
    return krige(positions, values, TARGETS.nodes, MODEL)


def _spde(step: float, positions: np.ndarray, values: np.ndarray, model: ShoreModel) -> Estimate:
    mesh = Mesh(make_grid(SEA, step), SEA)
    field = ShoreField(mesh, positions, values, model)
    weights = mesh.interpolation(TARGETS.nodes)
    return Estimate(mean=weights @ field.mean(), variance=weights @ field.variance())


def _timed(
    count: int, name: str, truth: np.ndarray, call: Callable[[], Estimate], base: float | None
) -> float:
    began = time.process_time()
    found = call()
    seconds = time.process_time() - began
    error = found.mean - truth
    print_row(
        f"{count:,}", name, f"{seconds:.2f}", f"{np.sqrt(np.mean(error**2)):.4f}",
        f"{np.mean(error**2 / found.variance):.2f}",
        f"{np.mean(np.abs(error) <= 1.96 * found.sd):.3f}",
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
        "1" if base is None else f"{seconds / base:.1f}",
    )  # fmt: skip
    return seconds


def _pykrige(positions, values) -> Estimate:
    from pykrige.ok import OrdinaryKriging

    def model(_parameters, h):
        return MODEL.variogram(np.asarray(h))

    problem = OrdinaryKriging(
        *positions.T, values, variogram_model="custom", variogram_parameters=[],
        variogram_function=model, exact_values=False,
    )  # fmt: skip
    window = {"backend": "loop", "n_closest_points": 32} if len(values) > 5_000 else {}
    mean, variance = problem.execute("points", *TARGETS.nodes.T, **window)
    # Its variance includes the nugget.
    return Estimate(mean=np.asarray(mean), variance=np.asarray(variance) - MODEL.nugget)


def _gstools(positions, values) -> Estimate:
    import gstools as gs

    model = gs.Matern(dim=2, nu=1.5, var=1.0, len_scale=60 / np.sqrt(2), nugget=MODEL.nugget)
    mean, variance = gs.krige.Ordinary(model, positions.T, values, exact=False)(TARGETS.nodes.T)
    return Estimate(mean=mean, variance=variance - MODEL.nugget)


def _sklearn(positions, values) -> Estimate:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import Matern

    kernel = Matern(length_scale=60.0, nu=1.5)
    fitted = GaussianProcessRegressor(kernel, alpha=MODEL.nugget, optimizer=None)
    fitted.fit(positions, values - values.mean())
    mean, sd = fitted.predict(TARGETS.nodes, return_std=True)
    return Estimate(mean=mean + values.mean(), variance=sd**2)


_PEERS = {"PyKrige": _pykrige, "GSTools": _gstools, "scikit-learn": _sklearn}
_LARGEST = {"PyKrige": 10_000, "GSTools": 500, "scikit-learn": 2_000}


def islands() -> None:
    """RMSE of both methods for a smooth truth that does not pass through land."""
    print_head("Islands: RMSE of the two methods, five lakes with walls", "samples", "kriging",
               "SPDE", "ratio", "MSDR of SPDE")  # fmt: skip
    for count in (60, 120, 250):
        found = np.array([_walled(seed, count) for seed in range(5)])
        kriged, shore, msdr = found.mean(axis=0)
        print_row(count, f"{kriged:.4f}", f"{shore:.4f}", f"{shore / kriged:.2f}", f"{msdr:.2f}")


def _walled(seed: int, count: int) -> tuple[float, float, float]:
    water = shapely.box(0, 0, 300, 200).difference(shapely.box(-1, 95, 220, 105))
    mesh = Mesh(make_grid(water, 4.0), water)
    rng = np.random.default_rng(seed)
    operator = factorised(operator_of(mesh, 4 / 150))
    truth = operator.solve(operator.solve(rng.normal(size=len(mesh.nodes))))
    truth /= truth.std()
    chosen = rng.choice(len(truth), count, replace=False)
    values = truth[chosen] + rng.normal(0, 0.1, count)
    inside, errors = mesh.grid.inside, []
    for method in ("kriging", "spde"):
        mapper = Mapper(water, mesh.grid, MapSettings(method=METHODS[method]))
        one = mapper.map_quantity(
            LIMNOLOGICAL["temperature_degc"], mesh.nodes[chosen], values, np.ones(count)
        )
        error = one.mean[inside] - truth
        errors.append(float(np.sqrt(np.mean(error**2))))
    return errors[0], errors[1], float(np.mean(error**2 / one.sd[inside] ** 2))


def calibration() -> None:
    """Everything fitted, as a user maps: intervals against the truth, twenty fields a row."""
    print_head("Calibration of whole maps, all parameters fitted, 20 fields of 200 m x 200 m",
               "track", "truth", "RMSE", "MSDR", "within 50 %", "within 95 %")  # fmt: skip
    water = shapely.box(0, 0, 200, 200)
    grid = make_grid(water, 4.0)
    for kind in ("exponential", "matern32"):
        for track in ("rows", "random"):
            model = CovarianceModel(kind=kind, sill=1.0, range_m=25.0, nugget=0.05)
            found = np.array([_calibrated(model, track, seed, water, grid) for seed in range(20)])
            rmse, msdr, half, most = found.mean(axis=0)
            print_row(track, kind, f"{rmse:.3f}", f"{msdr:.2f}", f"{half:.3f}", f"{most:.3f}")


def _calibrated(
    model: CovarianceModel, track: str, seed: int, water: shapely.Polygon, grid: Grid
) -> tuple[float, float, float, float]:
    rng = np.random.default_rng(seed)
    if track == "rows":
        north = np.arange(10.0, 200, 20)
        line = np.arange(1.0, 200, 3)
        positions = np.array([(n, e if i % 2 == 0 else 200 - e)
                              for i, n in enumerate(north) for e in line])  # fmt: skip
    else:
        positions = rng.uniform(0, 200, (400, 2))
    # Drawn on a grid fine enough that the field is as rough between its nodes as at them.
    both = np.vstack([grid.nodes, positions])
    _, (drawn,) = circulant_fields(model, make_grid(water, 0.25), both, 1, rng)
    truth, seen = np.split(drawn, [len(grid.nodes)])
    values = seen + rng.normal(0, np.sqrt(model.nugget), len(seen))
    one = Mapper(water, grid).map_quantity(
        LIMNOLOGICAL["temperature_degc"], positions, values, np.full(len(values), Flag.GOOD)
    )
    error, sd = one.mean[grid.inside] - truth, one.sd[grid.inside]
    return (
        float(np.sqrt(np.mean(error**2))),
        float(np.mean(error**2 / sd**2)),
        float(np.mean(np.abs(error) <= 0.6745 * sd)),
        float(np.mean(np.abs(error) <= 1.96 * sd)),
    )
