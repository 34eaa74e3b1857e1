"""Maps of plume-like quantities, positive and skewed, on their own scale and on the logarithm's."""

from __future__ import annotations

from multiprocessing import Pool

import numpy as np
import shapely

from benchmarks.common import print_head, print_row
from grebe.core.quantities import BUILTIN
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, MapSettings
from grebe.mapping.scale import LINEAR, SCALES

WATERS, SIDE_M, LANE_M, EACH_M = 20, 200.0, 20.0, 3.0
# Standard deviation of the logarithm, and of a reading's error as a share of the water's value.
SPREADS, ERROR_SHARE = (0.1, 0.5, 1.0), 0.03
MEDIAN_NTU = 5.0


def _field(seed: int, places: np.ndarray) -> np.ndarray:
    """A normal field of variance 1 and a range of some 60 m, by random waves (Matern-like)."""
    rng = np.random.default_rng(seed)
    waves = rng.standard_t(3, (400, 2)) / 60.0
    return np.sqrt(2 / 400) * np.cos(places @ waves.T + rng.uniform(0, 2 * np.pi, 400)).sum(axis=1)


def _lanes() -> np.ndarray:
    along = np.arange(0.0, SIDE_M + 1, EACH_M)
    lanes = np.arange(LANE_M / 2, SIDE_M, LANE_M)
    rows = [(lane, x) for k, lane in enumerate(lanes) for x in along[:: (-1) ** k]]
    return np.array(rows)


def _judged(job: tuple[float, str, int]) -> tuple[float, ...]:
    spread, name, seed = job
    water = shapely.box(0, 0, SIDE_M, SIDE_M)
    grid, at = make_grid(water, 5.0), _lanes()
    rng = np.random.default_rng([seed, 7])
    read = MEDIAN_NTU * np.exp(spread * _field(seed, at) + ERROR_SHARE * rng.normal(size=len(at)))
    settings = MapSettings() if name == "chosen" else MapSettings(scale=SCALES[name])
    one = Mapper(water, grid, settings).map_quantity(
        BUILTIN["turbidity_ntu"], at, read, np.ones(len(at), dtype=np.int64)
    )
    truth = MEDIAN_NTU * np.exp(spread * _field(seed, grid.nodes))
    found = one.at(grid.nodes)
    error, inside = found.mean - truth, (found.low <= truth) & (truth <= found.high)
    clear = truth <= np.quantile(truth, 1 / 3)
    return (
        float(np.sqrt(np.mean(error**2))),
        float(np.mean(error)),
        float(inside.mean()),
        float(inside[clear].mean()),
        float(np.median((found.high - found.low)[clear])),
        float(np.mean(found.low < 0)),
        float(one.scale is not LINEAR),
    )


def skewed() -> None:
    """Maps of positive, skewed water on its own scale and on the logarithm's."""
    print_head(
        f"{WATERS} lognormal waters a row, {SIDE_M:g} m square, lanes {LANE_M:g} m apart",
        "sd of the logarithm", "scale", "RMSE [NTU]", "bias", "within 95 %",
        "of the clearest third", "its interval [NTU]", "intervals below 0", "logarithm taken",
    )  # fmt: skip
    with Pool(2) as pool:
        for spread in SPREADS:
            for name in ("linear", "log", "chosen"):
                jobs = [(spread, name, seed) for seed in range(WATERS)]
                rows = np.array(pool.map(_judged, jobs, chunksize=2)).mean(axis=0)
                rmse, bias, within, clear, width, below, taken = rows.tolist()
                print_row(
                    spread, name, f"{rmse:.3f}", f"{bias:+.3f}", f"{within:.3f}",
                    f"{clear:.3f}", f"{width:.2f}", f"{below:.1%}", f"{taken:.0%}",
                )  # fmt: skip
