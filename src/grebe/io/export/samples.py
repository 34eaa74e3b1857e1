"""Export the samples of a survey for other programs: a table, GeoParquet, or results for WQX.

The plain table (CSV) and GeoParquet 1.1 hold every sample with its flags, one per row. A table of
results (`.wqx.csv`) holds one value per row, under the column names of the Water Quality Portal's
narrow result profile, from which the United States' Water Quality Exchange is filled. It leaves out
values flagged as suspect or failed, and quantities that have no name among its characteristics.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from grebe.core.frames import LocalFrame
from grebe.core.quantities import BUILTIN, Quantities
from grebe.core.samples import Samples
from grebe.io.atomic_write import write_rows_whole, written_whole
from grebe.io.parquet import arrow_for
from grebe.io.store.timestamps import time_texts

if TYPE_CHECKING:
    from numpy.typing import NDArray

# The names and unit codes in the exchange's lists of characteristics and measure units.
CHARACTERISTICS = {
    "temperature_degc": ("Temperature, water", "deg C"),
    "dissolved_oxygen_mgl": ("Dissolved oxygen (DO)", "mg/l"),
    "oxygen_saturation_percent": ("Dissolved oxygen saturation", "%"),
    "ph": ("pH", "std units"),
    "conductivity_uscm": ("Conductivity", "uS/cm"),
    "specific_conductance_uscm": ("Specific conductance", "uS/cm"),
    "turbidity_ntu": ("Turbidity", "NTU"),
    "orp_mv": ("Oxidation reduction potential (ORP)", "mV"),
    "salinity_psu": ("Salinity", "PSU"),
    "total_dissolved_solids_mgl": ("Total dissolved solids", "mg/l"),
    "water_depth_m": ("Depth, bottom", "m"),
}
RESULT_COLUMNS = (
    "ActivityIdentifier", "ActivityTypeCode", "ActivityMediaName", "ActivityStartDate",
    "ActivityStartTime/Time", "ActivityStartTime/TimeZoneCode",
    "ActivityLocation/LatitudeMeasure", "ActivityLocation/LongitudeMeasure",
    "ActivityDepthHeightMeasure/MeasureValue",
    "ActivityDepthHeightMeasure/MeasureUnitCode",
    "CharacteristicName", "ResultMeasureValue", "ResultMeasure/MeasureUnitCode",
    "ResultStatusIdentifier", "ResultValueTypeName",
)  # fmt: skip
# How deep the sonde hung: part of the activity, not a result.
SONDE_DEPTH = "sonde_depth_m"
# Seven decimals of a degree are a centimetre.
DECIMALS = 7


@dataclass(frozen=True, kw_only=True)
class Measured:
    """The samples of a survey: their `frame`, the `name` of the survey, and their `quantities`."""

    samples: Samples
    frame: LocalFrame
    name: str
    quantities: Quantities = BUILTIN

    @cached_property
    def lonlat(self) -> NDArray[np.float64]:
        """Longitudes and latitudes (n, 2) [deg]."""
        return np.round(self.frame.to_wgs84(self.samples.positions), DECIMALS)

    @property
    def keys(self) -> list[str]:
        """The quantities that have any value."""
        return [key for key in self.samples.values if self.samples.measured(key)]

    def text(self, key: str, value: float) -> str:
        """Return a value with the digits that its sensor resolves, and one more."""
        resolution = self.quantities.known(key).resolution
        if resolution <= 0:
            return f"{value:.6g}"
        return f"{value:.{max(0, math.ceil(-math.log10(resolution))) + 1}f}"

    def unnamed(self) -> list[str]:
        """Return the quantities that the exchange has no name for."""
        return [key for key in self.keys if key not in CHARACTERISTICS and key != SONDE_DEPTH]


def writer_of(path: Path) -> Callable[[Measured, Path], int] | None:
    """Return the function that writes samples to a file of that name; None if a plan is meant.

    The function returns the number of rows.
    """
    name = path.name.lower()
    for ending, writer in WRITERS.items():
        if name.endswith(ending):
            return writer
    return None


def write_table(measured: Measured, path: Path) -> int:
    """Write every sample with its flags as CSV, one per row."""
    columns = _columns(measured, time_texts(measured.samples.times))
    return write_rows_whole(path, list(columns), zip(*map(_texts, columns.values()), strict=True))


def write_geoparquet(measured: Measured, path: Path) -> int:
    """Write every sample with its flags as GeoParquet, as points in WGS 84."""
    pa, pq = arrow_for("Samples as GeoParquet")
    times = [datetime.fromtimestamp(float(t), UTC) for t in measured.samples.times]
    lonlat = measured.lonlat
    columns = _columns(measured, pa.array(times, pa.timestamp("ms", tz="UTC")))
    points = [shapely.to_wkb(shapely.Point(*place)) for place in lonlat.tolist()]
    table: Any = pa.table({**columns, "geometry": pa.array(points, pa.binary())})
    geometry = {
        "encoding": "WKB",
        "geometry_types": ["Point"],
        "bbox": [*lonlat.min(axis=0).tolist(), *lonlat.max(axis=0).tolist()],
    }
    # Without a reference system, the format means WGS 84, longitude first.
    geo = {"version": "1.1.0", "primary_column": "geometry", "columns": {"geometry": geometry}}
    with written_whole(path, pa.ArrowException) as part:
        pq.write_table(table.replace_schema_metadata({"geo": json.dumps(geo)}), part)
    return len(lonlat)


def write_results(measured: Measured, path: Path) -> int:
    """Write each usable value as a result of the Water Quality Portal's narrow profile."""
    return write_rows_whole(path, list(RESULT_COLUMNS), _results(measured))


def _results(measured: Measured) -> Iterator[list[str]]:
    samples = measured.samples
    usable = {key: samples.usable(key) for key in measured.keys if key in CHARACTERISTICS}
    depths = _depths(measured)
    for i, (lon, lat) in enumerate(measured.lonlat.tolist()):
        when = samples.moment(i)
        for key, good in usable.items():
            if good[i]:
                name, unit = CHARACTERISTICS[key]
                yield [
                    f"{measured.name}:{i + 1}", "Field Msr/Obs", "Water", f"{when:%Y-%m-%d}",
                    f"{when:%H:%M:%S}", "UTC", f"{lat:.{DECIMALS}f}", f"{lon:.{DECIMALS}f}",
                    depths[i], "m" if depths[i] else "",
                    name, measured.text(key, float(samples.values[key][i])), unit,
                    "Preliminary", "Actual",
                ]  # fmt: skip


def _depths(measured: Measured) -> list[str]:
    """Return how deep the sonde hung at each sample, empty where that is not known."""
    samples = measured.samples
    if SONDE_DEPTH not in samples.values:
        return [""] * len(samples)
    known = samples.usable(SONDE_DEPTH) & np.isfinite(samples.values[SONDE_DEPTH])
    rows = zip(samples.values[SONDE_DEPTH].tolist(), known.tolist(), strict=True)
    return [f"{depth:.2f}" if is_known else "" for depth, is_known in rows]


def _columns(measured: Measured, times: Any) -> dict[str, Any]:
    """Return the columns of the plain table; the `times` are in the format's own form."""
    samples, lonlat = measured.samples, measured.lonlat
    columns: dict[str, Any] = {
        "time": times,
        "longitude": lonlat[:, 0],
        "latitude": lonlat[:, 1],
        "speed_mps": samples.speed_mps,
        "target": samples.target_seq,
    }
    if samples.boat is not None:
        columns["boat"] = samples.boat
    for key in measured.keys:
        columns[key] = samples.values[key]
        columns[f"{key}_flag"] = samples.flags[key]
    return columns


def _texts(column: Any) -> list[str]:
    """Return a column as CSV has it, with NaN as empty."""
    if isinstance(column, np.ndarray) and column.dtype.kind == "f":
        return ["" if np.isnan(value) else f"{value:.12g}" for value in column]
    return [str(value) for value in column]


WRITERS: dict[str, Callable[[Measured, Path], int]] = {
    ".wqx.csv": write_results,
    ".csv": write_table,
    ".parquet": write_geoparquet,
}
