"""Maps of one time, of water that drifts during the survey and of sensors that respond late."""

from __future__ import annotations

from dataclasses import dataclass
from multiprocessing import Pool

import numpy as np
import shapely
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.distance import cdist

from benchmarks.common import print_head, print_row
from grebe.core.quantities import BUILTIN
from grebe.core.samples import Flag
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, MapSettings

WATERS = 10
SIDE_M, LANE_M, SPEED_MPS, RESOLUTION_M = 120.0, 10.0, 1.0, 5.0
# Every field has variance 1 and this practical range [m].
RANGE_M, NOISE_SD = 60.0, 0.03
BEGAN = 1.6e9


@dataclass(frozen=True, kw_only=True)
class Case:
    """What changes: the linear and the irregular drift in the survey, as shares of the water's
    standard deviation; the delay of the sensor, and its first-order time constant [s].
    """

    linear_sd: float = 0.0
    irregular_sd: float = 0.0
    delay_s: int = 0
    constant_s: float = 0.0

    def smearing(self, n: int) -> np.ndarray:
        """The sensor's response (n, n): what reading i takes from the water at second j."""
        ages = np.arange(n)[:, None] - np.arange(n)[None, :]
        if self.constant_s:
            weights = np.where(ages >= 0, np.exp(-ages / self.constant_s), 0.0)
        else:
            weights = (np.maximum(np.arange(n) - self.delay_s, 0)[:, None] == np.arange(n)) * 1.0
        return weights / weights.sum(axis=1, keepdims=True)

    def in_time(self, times: np.ndarray) -> np.ndarray:
        """The covariance (n, n) of the drift since the middle of the survey."""
        since = (times - times.mean()) / np.ptp(times)
        lags = since[:, None] - since[None, :]
        linear = self.linear_sd**2 * np.outer(since, since)

        # Relative to the middle, where the drift is none.
        def smooth(gap: np.ndarray) -> np.ndarray:
            return np.exp(-0.5 * (gap / 0.25) ** 2)

        tied = smooth(lags) - smooth(since)[:, None] - smooth(since)[None, :] + 1.0
        return linear + self.irregular_sd**2 * tied


CASES = {
    "nothing": Case(),
    "a linear drift of 1.5 sd": Case(linear_sd=1.5),
    "an irregular drift of 0.75 sd": Case(irregular_sd=0.75),
    "a sensor 10 s late": Case(delay_s=10),
    "a sensor with a time constant of 10 s": Case(constant_s=10.0),
}
FIELDS = ("exponential", "Matern 3/2")


def _correlation(kind: str, metres: np.ndarray) -> np.ndarray:
    if kind == "exponential":
        return np.exp(-3.0 * metres / RANGE_M)
    scaled = 4.744 * metres / RANGE_M
    return (1.0 + scaled) * np.exp(-scaled)


def _path() -> np.ndarray:
    """Places (n, 2) a second apart: lanes there and back, then three lines across."""
    along, path = np.arange(2.0, SIDE_M - 1, SPEED_MPS), []
    for k, east in enumerate(np.arange(LANE_M / 2, SIDE_M, LANE_M)):
        path += [(north, east) for north in along[:: (-1) ** k]]
    for k, north in enumerate((30.0, 60.0, 90.0)):
        path += [(north, east) for east in along[:: -((-1) ** k)]]
    return np.array(path)


def _judged(job: tuple[str, str, int]) -> tuple[float, float, float]:
    """Shares of the water within 50 % and 95 % intervals, and the RMSE over the true model's."""
    kind, name, seed = job
    case, rng = CASES[name], np.random.default_rng([seed, len(name)])
    water = shapely.box(0, 0, SIDE_M, SIDE_M)
    grid, path = make_grid(water, RESOLUTION_M), _path()
    n, times = len(path), np.arange(len(path)) / SPEED_MPS
    places = np.concatenate([path, grid.nodes])
    spatial = _correlation(kind, cdist(places, places))
    root = np.linalg.cholesky(spatial + 1e-9 * np.eye(len(places)))
    truth = root @ rng.normal(size=len(places))
    drift = case.in_time(times)
    # A drift of the stated size to one side or the other, and an irregular one of its covariance.
    since = (times - times.mean()) / np.ptp(times)
    irregular = Case(irregular_sd=case.irregular_sd).in_time(times)
    drifted = rng.choice([-1.0, 1.0]) * case.linear_sd * since + rng.multivariate_normal(
        np.zeros(n), irregular + 1e-12 * np.eye(n), method="eigh"
    )
    smear = case.smearing(n)
    readings = 15.0 + smear @ (truth[:n] + drifted) + rng.normal(0.0, NOISE_SD, n)
    one = Mapper(water, grid, MapSettings(moment="middle")).map_quantity(
        BUILTIN["temperature_degc"], path, readings, np.full(n, Flag.GOOD), BEGAN + times
    )
    found, water_then = one.at(grid.nodes), 15.0 + truth[n:]
    error = found.mean - water_then
    known = smear @ (spatial[:n, :n] + drift) @ smear.T + NOISE_SD**2 * np.eye(n)
    exact = 15.0 + (spatial[n:, :n] @ smear.T) @ cho_solve(cho_factor(known), readings - 15.0)
    least = np.sqrt(np.mean((exact - water_then) ** 2))
    sd = (found.high - found.low) / (2 * 1.96)
    return (
        float(np.mean(np.abs(error) <= 0.674 * sd)),
        float(np.mean((found.low <= water_then) & (water_then <= found.high))),
        float(np.sqrt(np.mean(error**2)) / least),
    )


def changing() -> None:
    """Judge maps of the middle of the survey by the water of that time."""
    print_head(
        f"Maps of the middle of the survey, {WATERS} waters each",
        "field", "what changes", "within 50 %", "within 95 %", "RMSE over the true model's",
        "at worst",
    )  # fmt: skip
    with Pool(2) as pool:
        for kind in FIELDS:
            for name in CASES:
                jobs = [(kind, name, seed) for seed in range(WATERS)]
                half, most, over = np.array(pool.map(_judged, jobs, chunksize=1)).T
                print_row(
                    kind, name, f"{half.mean():.2f}", f"{most.mean():.3f}",
                    f"{np.mean(over):.2f}", f"{over.max():.2f}",
                )  # fmt: skip
