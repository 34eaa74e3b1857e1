"""Write maps as CF and ACDD NetCDF: all quantities with their standard deviations in one file.

The CF table has no standard names for lake water. If a `sea_water_*` name denotes the same
quantity, it is used, with a comment that says so. A unit that UDUNITS does not know (NTU, RFU) is
in `reported_unit`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import netCDF4
import numpy as np

from grebe.core.frames import LocalFrame
from grebe.core.quantity import Quantity
from grebe.io.atomic_write import written_whole
from grebe.io.export.catalogue import ACDD, CatalogueEntry, acdd
from grebe.mapping.grid import Grid
from grebe.mapping.quantity_map import QuantityMap

Fields = Mapping[str, Mapping[str, np.ndarray]]


def write_netcdf(
    path: Path,
    maps: Sequence[QuantityMap],
    frame: LocalFrame,
    entry: CatalogueEntry,
    probabilities: Fields | None = None,
    draws: Mapping[str, np.ndarray] | None = None,
) -> None:
    """Write `maps`, which share one grid, to `path`; it appears only when complete.

    `probabilities` of concern are by quantity and name (rows, columns). `draws` are by quantity
    (count, rows, columns): equally likely fields given the samples.
    """
    # The library reports a full disk as a RuntimeError, "HDF error".
    with (
        written_whole(path, RuntimeError) as part,
        netCDF4.Dataset(part, "w", format="NETCDF4") as dataset,
    ):
        bounds = write_grid(dataset, maps[0].grid, frame)
        dataset.setncatts({"Conventions": f"CF-1.8, {ACDD}", **acdd(entry, bounds)})
        _write_time(dataset, entry, maps)
        for one in maps:
            key = one.quantity.key
            concerns = (probabilities or {}).get(key, {})
            names = [f"{key}_concern_{k}" for k in range(1, len(concerns) + 1)]
            _write_map(dataset, one, [*(f"{key}_{end}" for end in one.interval95), *names])
            for variable_name, (name, field) in zip(names, concerns.items(), strict=True):
                variable = field_variable(dataset, variable_name, field)
                variable.setncatts({"long_name": f"probability of concern: {name}", "units": "1"})
            if draws and key in draws:
                _write_draws(dataset, one, draws[key])


def write_grid(
    dataset: netCDF4.Dataset, grid: Grid, frame: LocalFrame
) -> tuple[float, float, float, float]:
    """Write the nodes' coordinates; return their bounds, west, south, east, north [deg]."""
    for name, long_name, standard_name, values in (
        ("y", "northing in the survey's frame", "projection_y_coordinate", grid.north),
        ("x", "easting in the survey's frame", "projection_x_coordinate", grid.east),
    ):
        dataset.createDimension(name, len(values))
        variable = dataset.createVariable(name, "f8", (name,))
        variable.setncatts({"standard_name": standard_name, "long_name": long_name, "units": "m"})
        variable.axis = name.upper()
        variable[:] = values
    crs = dataset.createVariable("crs", "i4")
    crs.setncatts(
        {
            "grid_mapping_name": "transverse_mercator",
            "latitude_of_projection_origin": frame.origin_lat_deg,
            "longitude_of_central_meridian": frame.origin_lon_deg,
            "scale_factor_at_central_meridian": 1.0,
            "false_easting": 0.0,
            "false_northing": 0.0,
            "semi_major_axis": 6378137.0,
            "inverse_flattening": 298.257223563,
            "proj4_params": frame.definition,
        }
    )
    north_east = np.stack(np.meshgrid(grid.north, grid.east, indexing="ij"), axis=-1)
    lonlat = frame.to_wgs84(north_east)
    for i, (name, units) in enumerate((("lon", "degrees_east"), ("lat", "degrees_north"))):
        long_name = {"lon": "longitude", "lat": "latitude"}[name]
        variable = dataset.createVariable(name, "f8", ("y", "x"), zlib=True)
        variable.setncatts({"standard_name": long_name, "long_name": long_name, "units": units})
        variable[:] = lonlat[..., i]
    west, south = lonlat.min(axis=(0, 1)).tolist()
    east, north = lonlat.max(axis=(0, 1)).tolist()
    return west, south, east, north


def _write_time(
    dataset: netCDF4.Dataset, entry: CatalogueEntry, maps: Sequence[QuantityMap]
) -> None:
    """Write one time for all fields: their common moment, or else the middle of the survey.

    The survey's ends are global attributes.
    """
    moments = {one.change.moment_s for one in maps if one.is_of_moment}
    of_moment = len(moments) == 1 and all(one.is_of_moment for one in maps)
    time = time_variable(dataset, "moment of the maps" if of_moment else "middle of the survey")
    time[...] = moments.pop() if of_moment else (entry.first_s + entry.last_s) / 2


def time_variable(
    dataset: netCDF4.Dataset, long_name: str, dimensions: tuple[str, ...] = ()
) -> netCDF4.Variable:
    """Create the coordinate of the time [unix s]."""
    time = dataset.createVariable("time", "f8", dimensions)
    time.setncatts(
        {
            "standard_name": "time",
            "long_name": long_name,
            "units": "seconds since 1970-01-01T00:00:00Z",
            "calendar": "standard",
            "axis": "T",
        }
    )
    return time


def _what(quantity: Quantity) -> str:
    return f"{quantity.label} of the surface water" if quantity.on_sonde else quantity.label


def _write_map(dataset: netCDF4.Dataset, one: QuantityMap, beside: Sequence[str]) -> None:
    """Write a map and how far it can be trusted; `beside` names its other variables."""
    quantity, model = one.quantity, one.model
    mean = field_variable(dataset, quantity.key, one.mean)
    mean.setncatts(
        {
            **standard_named(quantity.standard_name),
            "long_name": f"{_what(quantity)}, interpolated ({one.method.key})",
            "units": quantity.cf_unit,
            "ancillary_variables": " ".join((f"{quantity.key}_sd", *beside)),
            "variogram_model": model.kind,
            "variogram_text": model.text,
            "variogram_nugget": model.nugget,
            **{
                name: value
                for name, value in (
                    ("variogram_partial_sill", model.sill),
                    ("variogram_range_m", model.range_m),
                    ("variogram_practical_range_m", model.practical_range_m),
                )
                if value is not None
            },
            "variogram_reason": model.reason,
            "interpolation": f"{one.method.key}: {one.reason}",
            "interpolation_scale": one.scale.name,
            "sample_count": np.int32(one.samples),
            "moment": _moment(one),
            **_companions(one),
            **_worth(one),
        }
    )
    if quantity.standard_name:
        mean.comment = "Lake water; the sea_water_* names are the nearest in the CF table."
    if quantity.unit and quantity.cf_unit == "1":
        mean.reported_unit = quantity.unit
    sd = field_variable(dataset, f"{quantity.key}_sd", one.sd, content="qualityInformation")
    sd.setncatts(
        {
            **standard_named(quantity.standard_name, " standard_error"),
            "long_name": f"standard deviation of the signal of {quantity.inline}",
            "units": quantity.cf_unit,
        }
    )

    for name, ends in one.interval95.items():
        end = field_variable(dataset, f"{quantity.key}_{name}", ends, content="qualityInformation")
        text = {"low95": "lower", "high95": "upper"}[name]
        end.setncatts(
            {
                "long_name": f"{text} end of the 95 % interval of {quantity.inline}",
                "units": quantity.cf_unit,
            }
        )


def _worth(one: QuantityMap) -> dict[str, float]:
    """Return attributes on the noise, the direction, and the reliability of the map."""
    found = {
        "sensor_noise_sd": one.noise_sd,
        "sd_factor_on_the_way": one.calibration.on_way,
        "sd_factor_off_the_way": one.calibration.off_way,
        "anisotropy_ratio": one.model.ratio,
        "anisotropy_angle_deg": one.model.angle_deg,
    }
    if one.validation is not None:
        proof = one.validation
        found |= {
            "validation_samples": float(proof.samples),
            "validation_rmse": proof.rmse,
            "validation_bias": proof.bias,
            "validation_mean_squared_standardised_error": proof.msdr,
            "validation_share_within_50_percent": proof.coverage50,
            "validation_share_within_95_percent": proof.coverage95,
        }
    return found


def _moment(one: QuantityMap) -> str:
    """Return the time that the values are of."""
    change = one.change
    if one.is_of_moment:
        return datetime.fromtimestamp(change.moment_s, UTC).isoformat()
    if change.is_significant:
        return (
            "each place as it was measured; all of the water seems to have changed by "
            f"{one.changed_by:.3g} during the survey"
        )
    return "each place as it was measured"


def _companions(one: QuantityMap) -> dict[str, str]:
    """Return the quantities that a map was made together with."""
    told = one.model.companions
    if told is None or not told.heeded:
        return {}
    pairs = zip(told.names, told.correlations, strict=True)
    return {"together_with": ", ".join(f"{name} (correlation {r:.2f})" for name, r in pairs)}


def standard_named(standard_name: str, modifier: str = "") -> dict[str, str]:
    """Return the attribute of a standard name, if there is one."""
    return {"standard_name": standard_name + modifier} if standard_name else {}


def _write_draws(dataset: netCDF4.Dataset, one: QuantityMap, draws: np.ndarray) -> None:
    if "realization" not in dataset.dimensions:
        dataset.createDimension("realization", len(draws))
        number = dataset.createVariable("realization", "i4", ("realization",))
        number.setncatts({"standard_name": "realization", "long_name": "number of the draw",
                          "units": "1"})  # fmt: skip
        number[:] = np.arange(len(draws))
    label = one.quantity.inline
    variable = field_variable(dataset, f"{one.quantity.key}_draw", draws, ("realization", "y", "x"))
    variable.setncatts(
        {
            **standard_named(one.quantity.standard_name),
            "long_name": f"conditional simulations of {label}: equally likely given the samples",
            "units": one.quantity.cf_unit,
        }
    )


def field_variable(
    dataset: netCDF4.Dataset,
    name: str,
    values: np.ndarray,
    dimensions: tuple[str, ...] = ("y", "x"),
    content: str = "modelResult",
) -> netCDF4.Variable:
    """Create a compressed variable on the grid, with NaN as missing."""
    variable = dataset.createVariable(
        name, "f4", dimensions, zlib=True, fill_value=np.float32(-9999)
    )
    variable.setncatts(
        {"grid_mapping": "crs", "coordinates": "time lat lon", "coverage_content_type": content}
    )
    variable[:] = np.ma.masked_invalid(values)
    return variable
