"""Maps of real tracks, judged at places left out of them, compared with other kriging packages.

A quarter of all 20 m blocks of a track, or of its lines, is left out, each of the four quarters in
turn, because one quarter alone depends on luck. The rest is imported and mapped as a user does it,
and the values at the left-out places are read from `map.nc` by bilinear weights. The errors of all
four quarters are judged together; the best of the peers is the best over all four. A flagged
reading is neither mapped nor judged, and the flags are those of the complete track. The peers get
the same readings and the same places. GREBE_TEST_DATA names a folder with `tracks`.
"""

from __future__ import annotations

import csv
import os
import tempfile
from dataclasses import dataclass, replace
from multiprocessing import Pool
from pathlib import Path

import netCDF4
import numpy as np
from scipy.interpolate import RegularGridInterpolator

from benchmarks.common import print_head, print_row
from benchmarks.interpolators import peers, rms
from grebe.core.samples import Flag, Samples
from grebe.io.store import SurveyFile
from grebe.mapping.maps import MapSettings
from grebe.mapping.proof.validation import track_lines
from grebe.mapping.quantity_map import QuantityMap
from grebe.report.thresholds import read_profile
from grebe.workflow.maps import map_survey, write_maps
from grebe.workflow.tracks import import_track

BLOCK_M, QUARTERS = 20.0, 4
KEYS = (
    "temperature_degc", "dissolved_oxygen_mgl", "specific_conductance_uscm", "ph",
    "chlorophyll_rfu",
)  # fmt: skip
Z50, Z95 = 0.6745, 1.96


@dataclass(frozen=True, kw_only=True)
class Judged:
    """How one map, and its peers, predict the left-out readings, `count` of them."""

    track: str
    quantity: str
    left_out: str
    count: int
    rmse: float
    peers: dict[str, float]
    within50: float
    within95: float
    msdr: float
    peer_msdr: float

    def over(self, peer: str | None = None) -> float:
        """RMSE over that of one peer, or of the best of them."""
        return self.rmse / (min(self.peers.values()) if peer is None else self.peers[peer])


def together(some: list[Judged]) -> Judged:
    """The joint result of several quarters of one track and quantity."""

    def mean(values: list[float]) -> float:
        return float(np.average(values, weights=[one.count for one in some]))

    def combined(values: list[float]) -> float:
        return float(np.sqrt(mean([value**2 for value in values])))

    return replace(
        some[0],
        count=sum(one.count for one in some),
        rmse=combined([one.rmse for one in some]),
        peers={name: combined([one.peers[name] for one in some]) for name in some[0].peers},
        within50=mean([one.within50 for one in some]),
        within95=mean([one.within95 for one in some]),
        msdr=mean([one.msdr for one in some]),
        peer_msdr=mean([one.peer_msdr for one in some]),
    )


def tracks() -> list[tuple[Path, Path | None]]:
    """The tracks, each with the file that names its columns, if the track lacks the names."""
    folder = Path(os.environ["GREBE_TEST_DATA"]) / "tracks"
    paths = sorted(folder.glob("*.csv"))
    named = next(path for path in paths if path.open().readline()[0].isalpha())
    return [(p, None if p.open().readline()[0].isalpha() else named) for p in paths]


def left_out_rows(positions: np.ndarray, how: str, quarter: int) -> np.ndarray:
    """The rows of a track that are left out: one of four quarters of its blocks or lines."""
    if how == "lines":
        pieces = track_lines(positions)
    else:
        blocks = np.floor(positions / BLOCK_M).astype(np.int64)
        _, pieces = np.unique(blocks, axis=0, return_inverse=True)
        pieces = np.asarray(pieces).ravel()
    shuffled = np.random.default_rng(0).permutation(int(pieces.max()) + 1)
    return shuffled[pieces] % QUARTERS == quarter


def judge(case: tuple[Path, Path | None, str, int]) -> list[Judged]:
    """Leave out, import, map, read and compare; one row for each quantity of a track."""
    path, header, how, quarter = case
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        import_track(path, folder / "whole.gpkg", header_from=header)
        with SurveyFile.open(folder / "whole.gpkg") as file:
            samples, frame = file.samples(), file.survey.frame
        out = left_out_rows(samples.positions, how, quarter)
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
    found, peer_msdr = peers(one.positions, one.values, at, truth)
    return Judged(
        track=track,
        quantity=one.quantity.key,
        left_out=how,
        count=len(truth),
        rmse=rms(error),
        peers=found,
        within50=float(np.mean(z <= Z50)),
        within95=float(np.mean(z <= Z95)),
        msdr=float(np.mean(z**2)),
        peer_msdr=peer_msdr,
    )


def holdout() -> None:
    """Judge every track, with blocks and lines left out, all four quarters."""
    cases = [
        (path, header, how, quarter)
        for path, header in tracks()
        for how in ("blocks", "lines")
        for quarter in range(QUARTERS)
    ]
    print_head(
        "Left-out places of real tracks",
        "track, quantity", "left out", "RMSE over best peer", "over nearest",
        "the worst quarter over nearest", "over PyKrige", "gstat", "GSTools", "best peer",
        "within 50 %", "within 95 %",
        "MSDR (PyKrige's)",
    )  # fmt: skip
    rows: list[Judged] = []
    with Pool(2) as pool:
        found = pool.imap(judge, cases)
        for _ in range(len(cases) // QUARTERS):
            rows += _shown([one for _ in range(QUARTERS) for one in next(found)])
    for how in ("blocks", "lines"):
        _sum_up(how, [one for one in rows if one.left_out == how])


def _shown(quarters: list[Judged]) -> list[Judged]:
    """Print the rows of one track, and return them."""
    rows: list[Judged] = []
    for quantity in dict.fromkeys(one.quantity for one in quarters):
        some = [one for one in quarters if one.quantity == quantity]
        one = together(some)
        print_row(
            f"{one.track}, {quantity}", one.left_out, f"{one.over():.2f}",
            f"{one.over('nearest'):.2f}", f"{max(each.over('nearest') for each in some):.2f}",
            f"{one.over('pykrige'):.2f}", _over_gstat(one),
            f"{one.over('gstools'):.2f}", min(one.peers, key=one.peers.__getitem__),
            f"{one.within50:.2f}", f"{one.within95:.2f}",
            f"{one.msdr:.2f} ({one.peer_msdr:.2f})",
        )  # fmt: skip
        rows.append(one)
    return rows


def _over_gstat(one: Judged) -> str:
    return f"{one.over('gstat'):.2f}" if "gstat" in one.peers else "-"


def _sum_up(how: str, rows: list[Judged]) -> None:
    ratios = [one.over() for one in rows]
    print_row(
        f"all {how}", f"{len(rows)}", f"median {np.median(ratios):.2f}, max {max(ratios):.2f}",
        f"max {max(one.over('nearest') for one in rows):.2f}", "", "", "", "", "",
        f"{np.mean([0.40 <= o.within50 <= 0.65 for o in rows]):.0%} in .40-.65",
        f"{np.mean([0.90 <= o.within95 <= 0.99 for o in rows]):.0%} in .90-.99",
        f"{np.mean([0.6 <= o.msdr <= 1.5 for o in rows]):.0%} in .6-1.5",
    )  # fmt: skip
