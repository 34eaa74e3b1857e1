"""grebe map: draw the maps of what was measured."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from grebe.campaigns.engine import Engine, engine_of
from grebe.campaigns.maps import MapTask, map_many
from grebe.cli import options, output
from grebe.core.errors import InputError, UsageError
from grebe.core.quantities import BUILTIN
from grebe.core.survey import Survey
from grebe.io.readers.depth import read_depth
from grebe.io.store import SurveyFile
from grebe.mapping.drift import DriftFunction, combined, inflow, linear
from grebe.mapping.maps import MapSettings
from grebe.mapping.methods.choice import (
    AVERAGED,
    COVARIANCE_FITS,
    KRIGING,
    METHODS,
    ByShore,
    Straight,
    with_settings,
)
from grebe.mapping.scale import SCALES
from grebe.mapping.variogram import ESTIMATORS
from grebe.report.thresholds import read_profile
from grebe.workflow.files import filled_folder, make_folder
from grebe.workflow.maps import NETCDF_NAME, change_notes, map_numbers, map_survey, write_maps


@click.command(name="map")
@click.argument("files", type=options.EXISTING, nargs=-1, required=True, metavar="FILE...")
@click.option("--out", type=options.FOLDER, required=True, help="Folder for the maps.")
@click.option("--many", is_flag=True, help="Map several surveys, each to a folder below --out.")
@click.option(
    "--workers", type=click.IntRange(min=1), help="For --many: processes.  [default: one a core]"
)
@click.option("--scheduler", metavar="ADDRESS", help="For --many: a Dask cluster's scheduler.")
@click.option("--resolution", "resolution_m", type=float, help="Spacing of the map's nodes [m].")
@click.option(
    "--method",
    type=click.Choice(tuple(METHODS)),
    help="How to interpolate.  [default: by the shore]",
)
@click.option(
    "--variogram",
    type=click.Choice(tuple(COVARIANCE_FITS)),
    help="The covariance of place alone: rough or smooth by its posterior under priors, by "
    "restricted likelihood alone (reml), or as the variogram has it (wls).  [default: the mean of "
    "a rough one and of a smooth one that knows of passes]",
)
@click.option(
    "--moment",
    type=options.MOMENT,
    help="Map the water of one moment of the survey (ISO 8601, or middle): what changed everywhere "
    "meanwhile, and the sensors' lag, are estimated and taken out.  [default: each place as it was "
    "measured]",
)
@click.option(
    "--scale",
    type=click.Choice(tuple(SCALES)),
    help="Map the quantity itself, or its logarithm with asymmetric intervals.  [default: the "
    "logarithm of what is positive and skewed]",
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
@click.option(
    "--credits",
    "credits_file",
    type=options.EXISTING,
    help="TOML: who made the survey, and on what terms, for the files' metadata.",
)
@options.force_option
@options.json_option
def command(
    files: tuple[Path, ...],
    out: Path,
    many: bool,
    workers: int | None,
    scheduler: str | None,
    force: bool,
    as_json: bool,
    **asked: Any,
) -> None:
    """Map every quantity of FILE: map.nc (CF NetCDF), contours.gpkg, and a Cloud Optimized
    GeoTIFF and a picture each.

    With --many each FILE is mapped to a folder of its own name; what is mapped already is passed
    over, so that the same command goes on where it was cut off.
    """
    if many:
        if asked["inflows"] or asked["depth"] is not None:
            raise UsageError("Inflows and a raster of depths are one lake's own; map it by itself.")
        task = MapTask(
            out=out,
            settings=_settings(asked, linear if asked["drift"] else None),
            resolution_m=asked["resolution_m"],
            draws=asked["draws"],
            profile=asked["profile"],
            credits_file=asked["credits_file"],
        )
        _map_many(files, task, engine_of(workers, scheduler), force=force, as_json=as_json)
        return
    if len(files) != 1:
        raise UsageError(
            f"{len(files)} surveys were given; only one can be mapped at a time without --many.",
            settings=("many",),
        )
    if (out / NETCDF_NAME).exists() and not force:
        raise InputError(f"{out} holds maps already; give another folder, or --force.")
    with filled_folder(out):
        _map_one(files[0], out, asked, as_json=as_json)


def _map_one(file: Path, out: Path, asked: dict[str, Any], *, as_json: bool) -> None:
    with SurveyFile.open(file) as survey_file:
        functions = _drift(survey_file.survey, asked["drift"], asked["inflows"], asked["depth"])
        mapped = sum(one.mapped for one in survey_file.quantities.values())
        thresholds = read_profile(asked["profile"], BUILTIN.extended(survey_file.quantities))
    settings = _settings(asked, functions)
    with output.Countdown("quantities", mapped, quiet=as_json) as countdown:
        data = map_survey(file, settings, asked["resolution_m"], countdown.update)
    written = write_maps(data, out, thresholds, asked["draws"], asked["credits_file"])
    for text in data.left_out:
        output.note(f"left out: {text}")
    for text in change_notes(data.maps):
        output.note(f"note: {text}")
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


def _map_many(
    files: Sequence[Path], task: MapTask, engine: Engine, *, force: bool, as_json: bool
) -> None:
    make_folder(task.out)
    with output.Countdown("surveys", len(files), quiet=as_json) as countdown:
        mapped = map_many(files, task, engine, force=force, watch=countdown.update)
    failed = [f"{one.file.name}: {one.error}" for one in mapped if one.error]
    for text in failed:
        output.note(f"not mapped: {text}")
    output.result(
        {
            "surveys": len(mapped),
            "mapped": [str(one.folder) for one in mapped if not (one.error or one.known)],
            "mapped_before": [str(one.folder) for one in mapped if one.known],
            "not_mapped": failed,
        },
        as_json=as_json,
        next_command=f"look at {task.out}",
    )
    if failed:
        raise InputError(f"{len(failed)} of {len(files)} surveys could not be mapped.")


def _settings(asked: dict[str, Any], drift: DriftFunction | None) -> MapSettings:
    """The methods by their names in the table, with the settings that are given."""
    method, variogram = asked["method"], asked["variogram"]
    more: dict[str, Any] = {
        "shore_depth_sd_m": asked["shore_depth_sd_m"],
        "moment": asked["moment"],
        "scale": SCALES.get(asked["scale"]),
    }
    given = {"estimator": asked["estimator"], "drift": drift}
    if variogram is not None:
        given["fit_covariance"] = COVARIANCE_FITS[variogram]
    if method not in (None, AVERAGED.key):
        return MapSettings(method=with_settings(METHODS[method], **given), **more)
    straight: tuple[Straight, ...] = (AVERAGED,) if variogram is None else KRIGING[:1]
    straight = with_settings(straight, **given)
    if method is None:
        return MapSettings(choice=ByShore(straight=straight), **more)
    return MapSettings(method=straight, **more)


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
