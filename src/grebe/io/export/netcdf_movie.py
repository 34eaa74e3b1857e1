"""Write movies as CF and ACDD NetCDF with a time axis: each moment with its own uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import netCDF4

from grebe.core.frames import LocalFrame
from grebe.io.atomic_write import written_whole
from grebe.io.export.catalogue import ACDD, CatalogueEntry, acdd
from grebe.io.export.netcdf import field_variable, standard_named, time_variable, write_grid
from grebe.mapping.movie import Movie

IN_TIME = ("time", "y", "x")


def write_movie_netcdf(
    path: Path, movies: Sequence[Movie], frame: LocalFrame, entry: CatalogueEntry
) -> None:
    """Write `movies`, which share one grid and their moments, to `path`.

    The file appears only when complete.
    """
    with (
        written_whole(path, RuntimeError) as part,
        netCDF4.Dataset(part, "w", format="NETCDF4") as dataset,
    ):
        times = movies[0].times_s
        first, last = float(times[0]), float(times[-1])
        every_s = (last - first) / (len(times) - 1)
        entry = replace(entry, first_s=first, last_s=last, every_s=every_s)
        bounds = write_grid(dataset, movies[0].still.grid, frame)
        dataset.setncatts({"Conventions": f"CF-1.8, {ACDD}", **acdd(entry, bounds)})
        dataset.createDimension("time", len(times))
        time_variable(dataset, "moment of each map", ("time",))[:] = times
        for one in movies:
            _write_movie(dataset, one)


def _write_movie(dataset: netCDF4.Dataset, one: Movie) -> None:
    still = one.still
    quantity, key = still.quantity, still.quantity.key
    mean = field_variable(dataset, key, one.means, IN_TIME)
    mean.setncatts(
        {
            **standard_named(quantity.standard_name),
            "long_name": f"{quantity.inline} of the surface water, interpolated "
            f"({still.method.key})",
            "units": quantity.cf_unit,
            "ancillary_variables": f"{key}_sd",
            "interpolation": f"{still.method.key}: {still.reason}",
            "interpolation_scale": still.scale.name,
            "variogram_text": still.model.text,
            "sample_count": still.samples,
            "changed_by": still.changed_by,
            "movement": "the change common to all the water; the pattern is the whole survey's",
        }
    )
    sd = field_variable(dataset, f"{key}_sd", one.sds, IN_TIME, "qualityInformation")
    sd.setncatts(
        {
            **standard_named(quantity.standard_name, " standard_error"),
            "long_name": f"standard deviation of the signal of {quantity.inline}",
            "units": quantity.cf_unit,
        }
    )
    if quantity.unit and quantity.cf_unit == "1":
        mean.reported_unit = sd.reported_unit = quantity.unit
