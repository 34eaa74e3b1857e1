"""grebe map: draw the maps of what was measured."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from grebe.cli import options, output
from grebe.core.errors import InputError
from grebe.core.quantities import BUILTIN
from grebe.core.survey import Survey
from grebe.io.readers.depth import read_depth
from grebe.io.store import SurveyFile
from grebe.mapping.drift import DriftFunction, combined, inflow, linear
from grebe.mapping.maps import MapSettings
from grebe.mapping.methods.choice import COVARIANCE_FITS, KRIGING, METHODS, ByShore, with_settings
from grebe.mapping.variogram import ESTIMATORS, Estimator
from grebe.report.thresholds import read_profile
from grebe.workflow.files import make_folder
from grebe.workflow.maps import NETCDF_NAME, map_numbers, map_survey, write_maps


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
    help="The covariance: rough or smooth by its posterior under priors, by restricted likelihood "
    "alone (reml), or as the variogram has it (wls).  [default: what predicts best]",
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
    make_folder(out)
    if (out / NETCDF_NAME).exists() and not force:
        raise InputError(f"{out} holds maps already; give another folder, or --force.")
    with SurveyFile.open(file) as survey_file:
        functions = _drift(survey_file.survey, drift, inflows, depth)
        mapped = sum(one.mapped for one in survey_file.quantities.values())
        thresholds = read_profile(profile, BUILTIN.extended(survey_file.quantities))
    settings = _settings(method, variogram, estimator, functions, shore_depth_sd_m)
    with output.Countdown("quantities", mapped, quiet=as_json) as countdown:
        data = map_survey(file, settings, resolution_m, countdown.update)
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
    survey: Survey,
    name: str | None,
    inflows: Sequence[tuple[float, float]],
    depth: Path | None,
) -> DriftFunction | None:
    frame = survey.frame
    functions: list[DriftFunction] = [linear] if name == "linear" else []
    functions += [inflow(frame.place_near(survey.water, place, "inflow")) for place in inflows]
    if depth is not None:
        functions.append(read_depth(depth, frame))
    return combined(functions)
