"""Write a series of maps as CF and ACDD NetCDF with a time axis, and each place's trend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import netCDF4
import numpy as np

from grebe.core.frames import LocalFrame
from grebe.core.quantity import Quantity
from grebe.io.atomic_write import written_whole
from grebe.io.export.catalogue import ACDD, CatalogueEntry, acdd
from grebe.io.export.netcdf import (
    field_variable,
    standard_named,
    time_variable,
    write_grid,
)
from grebe.mapping.grid import Grid

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

IN_TIME = ("time", "y", "x")


@dataclass(frozen=True, kw_only=True)
class SeriesFields:
    """A quantity's maps over n surveys on one grid, NaN on land.

    `times_s` (n,) [unix s], `means` and `sds` (n, rows, columns); `slope` [unit / year], its
    standard error and its adjusted probability (rows, columns).
    """

    quantity: Quantity
    times_s: Array
    means: Array
    sds: Array
    slope: Array
    slope_sd: Array
    adjusted_p: Array


def write_series_netcdf(
    path: Path,
    grid: Grid,
    frame: LocalFrame,
    entry: CatalogueEntry,
    several: Sequence[SeriesFields],
) -> None:
    """Write the maps of `several` quantities over the times that any of them has.

    A quantity is missing at the times when it was not mapped. The file appears only when complete.
    """
    times = np.unique(np.concatenate([one.times_s for one in several]))
    with (
        written_whole(path, RuntimeError) as part,
        netCDF4.Dataset(part, "w", format="NETCDF4") as dataset,
    ):
        bounds = write_grid(dataset, grid, frame)
        dataset.setncatts({"Conventions": f"CF-1.8, {ACDD}", **acdd(entry, bounds)})
        dataset.createDimension("time", len(times))
        time_variable(dataset, "middle of each survey", ("time",))[:] = times
        for one in several:
            _write_quantity(dataset, one, np.searchsorted(times, one.times_s), len(times))


def _write_quantity(
    dataset: netCDF4.Dataset, one: SeriesFields, rows: NDArray[np.intp], count: int
) -> None:
    quantity, key = one.quantity, one.quantity.key
    name = quantity.inline

    def in_time(fields: Array) -> Array:
        whole = np.full((count, *fields.shape[1:]), np.nan)
        whole[rows] = fields
        return whole

    described = [
        (key, in_time(one.means), f"{name} of the surface water, interpolated",
         standard_named(quantity.standard_name), quantity.cf_unit),
        (f"{key}_sd", in_time(one.sds), f"standard deviation of the signal of {name}",
         standard_named(quantity.standard_name, " standard_error"), quantity.cf_unit),
        (f"{key}_trend", one.slope, f"trend of {name} by a line over the surveys", {},
         f"{quantity.cf_unit} year-1"),
        (f"{key}_trend_sd", one.slope_sd, f"standard error of the trend of {name}", {},
         f"{quantity.cf_unit} year-1"),
        (f"{key}_trend_p", one.adjusted_p,
         f"probability of such a trend of {name} by chance, adjusted for the number of places "
         "(Benjamini-Hochberg)", {}, "1"),
    ]  # fmt: skip
    for label, fields, text, named, unit in described:
        dimensions = IN_TIME if fields.ndim == 3 else ("y", "x")
        content = "modelResult" if label in (key, f"{key}_trend") else "qualityInformation"
        variable = field_variable(dataset, label, fields, dimensions, content)
        if label in (key, f"{key}_trend"):
            variable.ancillary_variables = f"{label}_sd"
        if quantity.unit and quantity.cf_unit == "1" and not label.endswith("_p"):
            per = " / year" if "_trend" in label.removeprefix(key) else ""
            variable.reported_unit = f"{quantity.unit}{per}"
        if fields.ndim == 2:  # a trend has no single time
            variable.coordinates = "lat lon"
        variable.setncatts({**named, "long_name": text, "units": unit})
