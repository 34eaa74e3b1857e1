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
from grebe.mapping.methods import METHODS, Method
from grebe.mapping.variogram import ESTIMATORS, Estimator
from grebe.report import canvas, map_figures
from grebe.report.data import ReportData, gather
from grebe.report.thresholds import Profile, read_profile

NETCDF_NAME = "map.nc"


@click.command(name="map")
@click.argument("file", type=options.EXISTING)
@click.option("--out", type=options.FOLDER, required=True, help="Folder for the maps.")
@click.option("--resolution", "resolution_m", type=float, help="Spacing of the map's nodes [m].")
@click.option(
    "--method", type=click.Choice(METHODS), help="How to interpolate.  [default: by the shore]"
)
@click.option(
    "--variogram",
    type=click.Choice(("reml", "wls")),
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
    method: Method | None,
    variogram: Any,
    drift: str | None,
    inflows: tuple[tuple[float, float], ...],
    depth: Path | None,
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
        settings = MapSettings(
            method=method,
            variogram=variogram,
            estimator=estimator,
            drift=_drift(survey_file, drift, inflows, depth),
        )
        data = gather(survey_file, resolution_m, settings, countdown.update)
    written = write_maps(data, out, thresholds, draws)
    for text in data.left_out:
        output.note(f"left out: {text}")
    output.result(
        {
            "maps": [map_numbers(one) for one in data.maps]
            if as_json
            else [f"{one.quantity.label} ({one.method})" for one in data.maps],
            "left_out": list(data.left_out),
            "files": [str(path) for path in written],
        },
        as_json=as_json,
        next_command=f"grebe report {file} -o report.html",
    )


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
    model, validation = one.interpolator.model, one.validation
    return {
        "quantity": one.quantity.key,
        "samples": one.samples,
        "flagged": one.flagged,
        "method": one.method,
        "reason": one.reason,
        "sd_widened_by": one.widening,
        "variogram": {
            "kind": model.kind,
            "nugget": model.nugget,
            "partial_sill": model.sill,
            "range_m": model.range_m,
            "practical_range_m": model.practical_range_m,
            "reason": one.fit.reason,
            "standard_errors": {
                name: value if np.isfinite(value) else None
                for name, value in one.fit.standard_errors.items()
            },
        },
        "validation": vars(validation) if validation else None,
    }
