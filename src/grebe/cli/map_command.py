"""grebe map: draw the maps of what was measured."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np

from grebe.cli import options, output
from grebe.cli.files import make_folder
from grebe.core.errors import InputError
from grebe.core.quantities import QUANTITIES
from grebe.io.export.contours import write_contours
from grebe.io.export.geotiff import write_geotiff
from grebe.io.export.netcdf import write_netcdf
from grebe.io.readers.depth import read_depth
from grebe.io.store import SurveyFile
from grebe.mapping.drift import DriftFunction, combined, inflow, linear
from grebe.mapping.maps import MapSettings, QuantityMap
from grebe.mapping.methods.choice import COVARIANCE_FITS, KRIGING, METHODS, ByShore, with_settings
from grebe.mapping.variogram import ESTIMATORS, Estimator
from grebe.report import canvas, map_figures
from grebe.report.bathymetry import bathymetry_of, hypsographic_figure, write_hypsography
from grebe.report.data import ReportData, gather
from grebe.report.thresholds import Profile, read_profile

NETCDF_NAME = "map.nc"


@click.command(name="map")
@click.argument("file", type=options.EXISTING)
@click.option("--out", type=options.FOLDER, required=True, help="Folder for the maps.")
@click.option("--resolution", "resolution_m", type=float, help="Spacing of the map's nodes [m].")
@click.option(
    "--method",
    type=click.Choice(tuple(METHODS)),
    help="How to interpolate.  [default: by the shore]",
)
@click.option(
    "--variogram",
    type=click.Choice(tuple(COVARIANCE_FITS)),
    help="Fit the covariance by restricted likelihood or to the variogram.  "
    "[default: what predicts left-out samples better]",
)
@click.option("--drift", type=click.Choice(("linear",)), help="What the mean depends on.")
@click.option(
    "--inflow",
    "inflows",
    type=options.LON_LAT,
    multiple=True,
    help="An inflow from whose distance the mean depends; may be given several times.",
)
@click.option(
    "--depth", type=options.EXISTING, help="Raster of depths on which the mean depends (GeoTIFF)."
)
@click.option(
    "--shore-depth-sd",
    "shore_depth_sd_m",
    type=float,
    help="Take the depth of the water as zero along the shore, within this standard deviation [m].",
)
@click.option(
    "--estimator",
    type=click.Choice(ESTIMATORS),
    default="matheron",
    show_default=True,
    help="Of the variogram; cressie and dowd bear outliers.",
)
@click.option("--draws", type=click.IntRange(0, 1000), default=0, help="Conditional simulations.")
@click.option("--profile", type=options.EXISTING, help="TOML: thresholds.  [default: fresh water]")
@options.force_option
@options.json_option
def command(
    file: Path,
    out: Path,
    resolution_m: float | None,
    method: str | None,
    variogram: str | None,
    drift: str | None,
    inflows: tuple[tuple[float, float], ...],
    depth: Path | None,
    shore_depth_sd_m: float | None,
    estimator: Estimator,
    draws: int,
    profile: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    """Map every quantity of FILE: map.nc (CF NetCDF), contours.gpkg, and a Cloud Optimized
    GeoTIFF and a picture each.
    """
    thresholds = read_profile(profile)
    make_folder(out)
    if (out / NETCDF_NAME).exists() and not force:
        raise InputError(f"{out} holds maps already; give another folder, or --force.")
    with (
        SurveyFile.open(file) as survey_file,
        output.Countdown("quantities", len(QUANTITIES), quiet=as_json) as countdown,
    ):
        functions = _drift(survey_file, drift, inflows, depth)
        settings = _settings(method, variogram, estimator, functions, shore_depth_sd_m)
        data = gather(survey_file, resolution_m, settings, countdown.update)
    written = write_maps(data, out, thresholds, draws)
    for text in data.left_out:
        output.note(f"left out: {text}")
    output.result(
        {
            "maps": [map_numbers(one) for one in data.maps]
            if as_json
            else [f"{one.quantity.label} ({one.method.key})" for one in data.maps],
            "left_out": list(data.left_out),
            "files": [str(path) for path in written],
        },
        as_json=as_json,
        next_command=f"grebe report {file} -o report.html",
    )


def _settings(
    method: str | None,
    variogram: str | None,
    estimator: Estimator,
    drift: DriftFunction | None,
    shore_depth_sd_m: float | None,
) -> MapSettings:
    """The methods by their names in the table, with the settings that are given."""
    fit = None if variogram is None else COVARIANCE_FITS[variogram]
    if method is None:
        straight = with_settings(KRIGING, fit_covariance=fit, estimator=estimator, drift=drift)
        return MapSettings(choice=ByShore(straight=straight), shore_depth_sd_m=shore_depth_sd_m)
    asked = with_settings(METHODS[method], fit_covariance=fit, estimator=estimator, drift=drift)
    return MapSettings(method=asked, shore_depth_sd_m=shore_depth_sd_m)


def _drift(
    survey_file: SurveyFile,
    name: str | None,
    inflows: Sequence[tuple[float, float]],
    depth: Path | None,
) -> DriftFunction | None:
    frame = survey_file.survey.frame
    functions: list[DriftFunction] = [linear] if name == "linear" else []
    water = survey_file.survey.water
    functions += [inflow(frame.place_near(water, place, "inflow")) for place in inflows]
    if depth is not None:
        functions.append(read_depth(depth, frame))
    return combined(functions)


def write_maps(data: ReportData, out: Path, profile: Profile, draws: int = 0) -> list[Path]:
    """Write everything that maps are given in; `InputError` when there is nothing to map."""
    if not data.maps:
        raise InputError(f"No quantity can be mapped: {'; '.join(data.left_out)}.")
    make_folder(out)
    frame = data.survey.frame
    concerns = {
        one.quantity.key: {each.name: each.probability(one) for each in profile.of(one)}
        for one in data.maps
    }
    drawn: dict[str, np.ndarray] = {
        one.quantity.key: one.draws(draws) for one in data.maps if draws
    }
    written = [out / NETCDF_NAME, out / "contours.gpkg"]
    write_netcdf(written[0], data.maps, frame, _attributes(data), concerns, drawn)
    write_contours(written[1], data.maps, frame)
    for one in data.maps:
        key = one.quantity.key
        write_geotiff(out / f"{key}.tif", one, frame, concerns[key])
        canvas.save(map_figures.map_figure(data.survey, one, data.samples), out / f"{key}.png")
        written += [out / f"{key}.tif", out / f"{key}.png"]
        lake = bathymetry_of(one, data.survey)
        if lake is not None:
            write_hypsography(out / "hypsography.csv", lake)
            canvas.save(hypsographic_figure(lake), out / "hypsography.png")
            written += [out / "hypsography.csv", out / "hypsography.png"]
    return written


def _attributes(data: ReportData) -> dict[str, str]:
    return {
        "title": f"Surface water of {data.survey.name}",
        "source": f"Grebe {data.meta['software_version']}, {data.meta.get('water', 'measured')}",
        "history": f"mapped from survey {data.meta.get('survey_id', '')}",
        "comment": data.meta.get("note", ""),
    }


def map_numbers(one: QuantityMap) -> dict[str, Any]:
    """What there is to say of a map, for JSON."""
    model, validation = one.model, one.validation
    return {
        "quantity": one.quantity.key,
        "samples": one.samples,
        "flagged": one.flagged,
        "method": one.method.key,
        "reason": one.reason,
        "sd_widened_by": one.widening,
        "variogram": {
            "kind": model.kind,
            "nugget": model.nugget,
            "partial_sill": model.sill,
            "range_m": model.range_m,
            "practical_range_m": model.practical_range_m,
            "reason": model.reason,
            "standard_errors": {
                name: value if np.isfinite(value) else None
                for name, value in model.standard_errors.items()
            },
        },
        "validation": vars(validation) if validation else None,
    }
