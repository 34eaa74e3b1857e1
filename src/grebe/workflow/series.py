"""Map a series of surveys of the same water, and how it changes over the years."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.core.errors import InputError
from grebe.core.quantity import Quantity, inline
from grebe.core.survey import Survey
from grebe.io.export.catalogue import CatalogueEntry
from grebe.io.export.geotiff import write_bands
from grebe.io.export.netcdf_series import SeriesFields, write_series_netcdf
from grebe.mapping.grid import Grid, make_grid
from grebe.mapping.maps import Mapper
from grebe.mapping.quantity_map import QuantityMap
from grebe.mapping.series.difference import refuse_other_unit
from grebe.mapping.series.surveys import QuantitySeries
from grebe.mapping.series.trend import (
    FEWEST_SURVEYS,
    Trend,
    adjusted_for_family,
    check_times,
    days_of,
    fit_trend,
)
from grebe.report import canvas, series_figures
from grebe.workflow.differences import common_water, maps_in, sailed
from grebe.workflow.files import make_folder

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

NETCDF_NAME = "series.nc"


@dataclass(frozen=True, kw_only=True)
class Series:
    """Maps of several surveys on one grid, in the frame of the earliest, and what is left out."""

    survey: Survey
    grid: Grid
    spans_s: Array
    by_quantity: Mapping[str, QuantitySeries]
    left_out: tuple[str, ...]


def map_series(
    paths: Sequence[Path],
    resolution_m: float | None = None,
    *,
    seasonal: bool = False,
    on_done: Callable[[int, int], None] | None = None,
) -> Series:
    """Map the surveys, in the order of their times, where all of them cover the water.

    A quantity that `FEWEST_SURVEYS` of them measured has a trend. `on_done` is called after each
    survey with the number mapped so far and the total.
    """
    surveys = sorted(sailed(paths), key=lambda one: one.middle_s)
    days = days_of(np.array([one.middle_s for one in surveys]))
    check_times(np.array([float(day.mean()) for day in days]), seasonal=seasonal)
    base = surveys[0].survey
    water = common_water([one.survey for one in surveys])
    mapper = Mapper(water, make_grid(water, resolution_m))
    maps: dict[str, list[tuple[float, Array, Array]]] = {}
    firsts: dict[str, QuantityMap] = {}
    left_out: list[str] = []
    for done, one in enumerate(surveys, start=1):
        found, missing = maps_in(one.path, base, mapper)
        left_out += [f"{one.path}: {text}" for text in missing]
        for key, mapped in found.items():
            refuse_other_unit(firsts.setdefault(key, mapped).quantity, mapped.quantity)
            inside = mapper.grid.inside
            maps.setdefault(key, []).append((one.middle_s, mapped.mean[inside], mapped.sd[inside]))
        if on_done is not None:
            on_done(done, len(surveys))
    by_day = {key: _by_day(rows) for key, rows in maps.items()}
    enough = {key: rows for key, rows in by_day.items() if len(rows) >= FEWEST_SURVEYS}
    left_out += [
        f"{firsts[key].quantity.label}: surveys of {len(rows)} days; a trend needs {FEWEST_SURVEYS}"
        for key, rows in by_day.items()
        if key not in enough
    ]
    if seasonal:
        enough = _with_season(enough, firsts, left_out)
    if not enough:
        raise InputError(f"No quantity was mapped in {FEWEST_SURVEYS} of the surveys.")
    return Series(
        survey=base,
        grid=mapper.grid,
        spans_s=np.array([one.span_s for one in surveys]),
        by_quantity=_with_trends(enough, firsts, water.area, seasonal=seasonal),
        left_out=tuple(dict.fromkeys(left_out)),
    )


def _by_day(rows: list[tuple[float, Array, Array]]) -> list[tuple[float, Array, Array]]:
    """Return maps (time, mean, sd) with those of one day merged into one.

    The maps of a day share the day's conditions and the calibration of the sensors.
    """
    found: list[tuple[float, Array, Array]] = []
    first = 0
    for times in days_of(np.array([time for time, *_ in rows])):
        of_day = rows[first : first + len(times)]
        mean = np.mean([mean for _, mean, _ in of_day], axis=0)
        sd = np.sqrt(np.mean([sd**2 for *_, sd in of_day], axis=0))
        found.append((float(times.mean()), mean, sd))
        first += len(times)
    return found


def _with_season(
    rows: Mapping[str, list[tuple[float, Array, Array]]],
    firsts: Mapping[str, QuantityMap],
    left_out: list[str],
) -> dict[str, list[tuple[float, Array, Array]]]:
    """Return the quantities whose surveys separate a season from a trend.

    The reasons for the others are added to `left_out`.
    """
    kept: dict[str, list[tuple[float, Array, Array]]] = {}
    for key, several in rows.items():
        try:
            check_times(np.array([time for time, *_ in several]), seasonal=True)
            kept[key] = several
        except InputError as error:
            left_out.append(f"{firsts[key].quantity.label}: {str(error).rstrip('.')}")
    return kept


def _with_trends(
    rows: Mapping[str, list[tuple[float, Array, Array]]],
    firsts: Mapping[str, QuantityMap],
    area_m2: float,
    *,
    seasonal: bool,
) -> dict[str, QuantitySeries]:
    found: dict[str, tuple[Array, Array, Array, Trend]] = {}
    for key, several in rows.items():
        times, means, sds = (np.array(column) for column in zip(*several, strict=True))
        patches = _patches(firsts[key], area_m2)
        trend = fit_trend(times, means, sds, seasonal=seasonal, patches=patches)
        found[key] = times, means, sds, trend
    together = adjusted_for_family(np.array([one[3].of_mean.p for one in found.values()]))
    return {
        key: QuantitySeries(
            first=firsts[key], times_s=times, means=means, sds=sds, trend=trend, mean_p=float(p)
        )
        for (key, (times, means, sds, trend)), p in zip(found.items(), together, strict=True)
    }


def _patches(one: QuantityMap, area_m2: float) -> float:
    """Return the number of independent places of the water, by the map's own covariance."""
    far = one.model.practical_range_m
    return 1.0 if far is None or far <= 0 else max(1.0, area_m2 / far**2)


def write_series(series: Series, out: Path) -> dict[str, Path]:
    """Write `series.nc`, and a GeoTIFF of its trend and a picture for each quantity.

    Returns the GeoTIFFs by quantity.
    """
    make_folder(out)
    written: dict[str, Path] = {}
    spread = series.grid.spread
    fields: list[SeriesFields] = []
    for key, one in series.by_quantity.items():
        trend = one.trend
        fields.append(
            SeriesFields(
                quantity=one.first.quantity,
                times_s=one.times_s,
                means=np.array([spread(mean) for mean in one.means]),
                sds=np.array([spread(sd) for sd in one.sds]),
                slope=spread(trend.slope),
                slope_sd=spread(trend.sd),
                adjusted_p=spread(trend.adjusted_p),
            )
        )
        bands = {
            "trend per year": fields[-1].slope,
            "sd": fields[-1].slope_sd,
            "P(adjusted)": fields[-1].adjusted_p,
        }
        written[key] = out / f"{key}_trend.tif"
        unit = f"{one.first.quantity.unit or '1'} / year"
        write_bands(written[key], one.first, series.survey.frame, bands, unit)
        canvas.save(series_figures.trend_figure(series.survey, one), out / f"{key}_trend.png")
    entry = _entry(series, [one.quantity for one in fields])
    write_series_netcdf(out / NETCDF_NAME, series.grid, series.survey.frame, entry, fields)
    return written


def _entry(series: Series, quantities: Sequence[Quantity]) -> CatalogueEntry:
    spans = series.spans_s
    begun, ended = (datetime.fromtimestamp(float(s), UTC) for s in (spans.min(), spans.max()))
    names = [one.label for one in quantities]
    return CatalogueEntry(
        title=f"Surface water of {series.survey.name}, {len(spans)} surveys",
        identifier="",
        outline=shapely.transform(series.survey.water, series.survey.frame.to_wgs84),
        quantities=names,
        resolution_m=series.grid.step_m,
        created_s=datetime.now(UTC).timestamp(),
        first_s=float(spans.min()),
        last_s=float(spans.max()),
        every_s=float(np.ptp(spans.mean(axis=1))) / (len(spans) - 1),
        credits={
            "summary": f"Maps of {', '.join(map(inline, names))} in the surface water by "
            f"{len(spans)} surveys from {begun:%Y-%m-%d} to {ended:%Y-%m-%d}, each with its "
            "standard deviation, and the trend of each place."
        },
    )
