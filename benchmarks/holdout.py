"""Maps of real tracks, judged at places that they were not shown, beside other people's kriging.

A quarter of all 20 m blocks of a track, or of its lines, is left out; what is left is imported and
mapped as a user does, and the values at the left-out places are read from `map.nc` by bilinear
weights. A reading that is flagged is neither mapped nor judged, and the flags are those of the
whole track. The peers get the same readings and the same places. GREBE_TEST_DATA names a folder
with `tracks`.
"""

from __future__ import annotations

import csv
import os
import tempfile
import warnings
from dataclasses import dataclass
from multiprocessing import Pool
from pathlib import Path

import netCDF4
import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.spatial import KDTree

from benchmarks.common import print_head, print_row
from grebe.core.samples import Flag, Samples
from grebe.io.store import SurveyFile
from grebe.mapping.maps import MapSettings, QuantityMap
from grebe.mapping.validation import track_lines
from grebe.report.thresholds import read_profile
from grebe.workflow.maps import map_survey, write_maps
from grebe.workflow.tracks import import_track

BLOCK_M, SHARE = 20.0, 0.25
KEYS = (
    "temperature_degc", "dissolved_oxygen_mgl", "specific_conductance_uscm", "ph",
    "chlorophyll_rfu",
)  # fmt: skip
# What PyKrige and the Gaussian process are given at most.
MOST_FOR_PEERS = 1_500
Z50, Z95 = 0.6745, 1.96


@dataclass(frozen=True, kw_only=True)
class Judged:
    """How one map, and its peers, predict what was left out."""

    track: str
    quantity: str
    left_out: str
    rmse: float
    peers: dict[str, float]
    within50: float
    within95: float
    msdr: float
    peer_msdr: float

    @property
    def ratio(self) -> float:
        """RMSE over that of the best of the peers."""
        return self.rmse / min(self.peers.values())


def tracks() -> list[tuple[Path, Path | None]]:
    """The tracks, with the file that has the names of their columns, if they lack them."""
    folder = Path(os.environ["GREBE_TEST_DATA"]) / "tracks"
    paths = sorted(folder.glob("*.csv"))
    named = next(path for path in paths if path.open().readline()[0].isalpha())
    return [(p, None if p.open().readline()[0].isalpha() else named) for p in paths]


def left_out_rows(positions: np.ndarray, how: str, seed: int) -> np.ndarray:
    """Which rows of a track are left out: a quarter of its blocks, or of its lines."""
    if how == "lines":
        pieces = track_lines(positions)
    else:
        blocks = np.floor(positions / BLOCK_M).astype(np.int64)
        _, pieces = np.unique(blocks, axis=0, return_inverse=True)
        pieces = np.asarray(pieces).ravel()
    count = int(pieces.max()) + 1
    chosen = np.random.default_rng(seed).permutation(count)[: max(1, round(SHARE * count))]
    return np.isin(pieces, chosen)


def judge(case: tuple[Path, Path | None, str, int]) -> list[Judged]:
    """Leave out, import, map, read, and compare; a row for each quantity of a track."""
    path, header, how, seed = case
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        import_track(path, folder / "whole.gpkg", header_from=header)
        with SurveyFile.open(folder / "whole.gpkg") as file:
            samples, frame = file.samples(), file.survey.frame
        out = left_out_rows(samples.positions, how, seed)
        keys = [key for key in KEYS if samples.measured(key)]
        lonlat = frame.to_wgs84(samples.positions)
        _write_rows(folder / "rest.csv", samples, lonlat, ~out, keys)
        import_track(folder / "rest.csv", folder / "rest.gpkg")
        data = map_survey(folder / "rest.gpkg", MapSettings())
        write_maps(data, folder / "maps", read_profile(None))
        judged: list[Judged] = []
        with netCDF4.Dataset(folder / "maps" / "map.nc") as maps:
            for one in data.maps:
                key = one.quantity.key
                usable = np.isin(samples.flags[key], Flag.USABLE)
                at = data.survey.frame.to_local(lonlat[out & usable])
                mean, sd = (_read(maps, name, at) for name in (key, f"{key}_sd"))
                judged.append(
                    _compared(
                        f"{path.stem}", how, one, at, samples.values[key][out & usable], mean, sd
                    )
                )
        return judged


def _write_rows(
    path: Path, samples: Samples, lonlat: np.ndarray, keep: np.ndarray, keys: list[str]
) -> None:
    columns = [samples.times, lonlat[:, 1], lonlat[:, 0], *(samples.values[k] for k in keys)]
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time", "latitude", "longitude", *keys])
        writer.writerows([[repr(float(v)) for v in row] for row in np.column_stack(columns)[keep]])


def _read(maps: netCDF4.Dataset, name: str, at: np.ndarray) -> np.ndarray:
    """The map's values at places, as a reader of the file interpolates them."""
    field = np.ma.filled(maps[name][:].astype(float), np.nan)
    read = RegularGridInterpolator(
        (maps["y"][:], maps["x"][:]), field, bounds_error=False, fill_value=np.nan
    )
    linear = read(at)
    return np.where(np.isfinite(linear), linear, read(at, method="nearest"))


def _compared(
    track: str, how: str, one: QuantityMap, at: np.ndarray, truth: np.ndarray,
    mean: np.ndarray, sd: np.ndarray,
) -> Judged:  # fmt: skip
    inside = np.isfinite(mean)
    at, truth, mean, sd = at[inside], truth[inside], mean[inside], sd[inside]
    error = mean - truth
    z = np.abs(error) / np.hypot(sd, one.noise_sd)
    peers, peer_msdr = _peers(one.positions, one.values, at, truth)
    return Judged(
        track=track,
        quantity=one.quantity.key,
        left_out=how,
        rmse=_rms(error),
        peers=peers,
        within50=float(np.mean(z <= Z50)),
        within95=float(np.mean(z <= Z95)),
        msdr=float(np.mean(z**2)),
        peer_msdr=peer_msdr,
    )


def _peers(
    positions: np.ndarray, values: np.ndarray, at: np.ndarray, truth: np.ndarray
) -> tuple[dict[str, float], float]:
    """RMSE of the nearest neighbour, the inverse squared distance, PyKrige and a Gaussian process;
    and the mean squared standardised error of PyKrige.
    """
    tree = KDTree(positions)
    distance, index = tree.query(at, k=12)
    weight = 1 / np.maximum(distance, 1e-6) ** 2
    idw = np.sum(weight * values[index], axis=1) / np.sum(weight, axis=1)
    found = {"nearest": _rms(values[index[:, 0]] - truth), "idw": _rms(idw - truth)}
    chosen = np.unique(
        np.linspace(0, len(values) - 1, min(len(values), MOST_FOR_PEERS)).astype(int)
    )
    best, msdr = np.inf, np.nan
    for kind in ("spherical", "exponential"):
        mean, variance, misfit = _pykrige(positions[chosen], values[chosen], at, kind)
        if misfit < best:
            best = misfit
            found["pykrige"] = _rms(mean - truth)
            msdr = float(np.mean((mean - truth) ** 2 / np.maximum(variance, 1e-12)))
    found["sklearn"] = _rms(_gaussian_process(positions[chosen], values[chosen], at) - truth)
    return found, msdr


def _pykrige(
    positions: np.ndarray, values: np.ndarray, at: np.ndarray, kind: str
) -> tuple[np.ndarray, np.ndarray, float]:
    from pykrige.ok import OrdinaryKriging

    kriging = OrdinaryKriging(
        positions[:, 1], positions[:, 0], values, variogram_model=kind, nlags=15
    )
    mean, variance = kriging.execute("points", at[:, 1], at[:, 0])
    model = kriging.variogram_function(kriging.variogram_model_parameters, kriging.lags)
    return (
        np.asarray(mean), np.asarray(variance), float(np.sum((model - kriging.semivariance) ** 2))
    )  # fmt: skip


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


def _rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


def holdout(seeds: int = 1) -> None:
    """Every track, blocks and lines left out, `seeds` times."""
    cases = [
        (path, header, how, seed)
        for path, header in tracks()
        for how in ("blocks", "lines")
        for seed in range(seeds)
    ]
    print_head(
        "Left-out places of real tracks",
        "track, quantity", "left out", "RMSE over best peer", "over nearest", "over PyKrige",
        "within 50 %", "within 95 %", "MSDR (PyKrige's)",
    )  # fmt: skip
    rows: list[Judged] = []
    with Pool(2) as pool:
        for found in pool.imap(judge, cases):
            for one in found:
                print_row(
                    f"{one.track}, {one.quantity}", one.left_out, f"{one.ratio:.2f}",
                    f"{one.rmse / one.peers['nearest']:.2f}",
                    f"{one.rmse / one.peers['pykrige']:.2f}",
                    f"{one.within50:.2f}", f"{one.within95:.2f}",
                    f"{one.msdr:.2f} ({one.peer_msdr:.2f})",
                )  # fmt: skip
            rows += found
    for how in ("blocks", "lines"):
        some = [one for one in rows if one.left_out == how]
        if some:
            ratios = [one.ratio for one in some]
            print_row(
                f"all {how}", f"{len(some)}",
                f"median {np.median(ratios):.2f}, max {max(ratios):.2f}",
                f"max {max(one.rmse / one.peers['nearest'] for one in some):.2f}", "",
                f"{np.mean([0.40 <= o.within50 <= 0.65 for o in some]):.0%} in .40-.65",
                f"{np.mean([0.90 <= o.within95 <= 0.99 for o in some]):.0%} in .90-.99",
                f"{np.mean([0.6 <= o.msdr <= 1.5 for o in some]):.0%} in .6-1.5",
            )  # fmt: skip
