"""grebe map: draw maps of the measurements."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from grebe.campaigns.engine import Engine, engine_of
from grebe.campaigns.maps import MapTask, map_many
from grebe.cli import options, output
from grebe.cli.mapping_options import asked_again, map_settings, mapping_options, settings_with
from grebe.core.errors import InputError, UsageError
from grebe.core.quantities import BUILTIN
from grebe.io.store import SurveyFile
from grebe.mapping.covariance.drift import linear
from grebe.report.thresholds import read_profile
from grebe.workflow.files import filled_folder, make_folder
from grebe.workflow.garbage_collection import no_long_pauses
from grebe.workflow.helpers import WorkerPool
from grebe.workflow.map_notes import change_notes, sample_notes, together_notes
from grebe.workflow.maps import (
    NETCDF_NAME,
    helpers_for,
    map_numbers,
    map_survey,
    movie_note,
    write_maps,
)


@click.command(name="map")
@click.argument("files", type=options.EXISTING, nargs=-1, required=True, metavar="FILE...")
@click.option("--out", type=options.FOLDER, required=True, help="Folder for the maps.")
@click.option("--many", is_flag=True, help="Map several surveys, each to a folder below --out.")
@click.option(
    "--workers",
    type=click.IntRange(min=1),
    help="Processes that share the quantities, or with --many the surveys.  [default: one per "
    "core]",
)
@click.option("--scheduler", metavar="ADDRESS", help="With --many: a Dask cluster's scheduler.")
@mapping_options
@click.option(
    "--draws",
    type=click.IntRange(0, 1000),
    default=0,
    show_default=True,
    help="Number of conditional simulations to add.",
)
@click.option(
    "--profile", type=options.EXISTING, help="TOML file of thresholds.  [default: fresh water]"
)
@click.option(
    "--credits",
    "credits_file",
    type=options.EXISTING,
    help="TOML file for the maps' metadata: who made the survey, and on what terms.",
)
@options.force_option
@options.json_option
@click.pass_context
def command(
    ctx: click.Context,
    files: tuple[Path, ...],
    out: Path,
    many: bool,
    workers: int | None,
    scheduler: str | None,
    force: bool,
    as_json: bool,
    **asked: Any,
) -> None:
    """Map every quantity of FILE.

    Writes map.nc (CF NetCDF), contours.gpkg and, for each quantity, a Cloud Optimized GeoTIFF and a
    picture; with --every also movie.nc.

    With --many each FILE is mapped to a folder of its own name. Surveys that are mapped already are
    skipped, so an interrupted command continues when it is run again.
    """
    if many:
        if asked["inflows"] or asked["depth"] is not None:
            raise UsageError(
                "--inflow and --depth belong to one lake; map that survey without --many."
            )
        task = MapTask(
            out=out,
            settings=settings_with(asked, linear if asked["drift"] else None),
            resolution_m=asked["resolution_m"],
            draws=asked["draws"],
            profile=asked["profile"],
            credits_file=asked["credits_file"],
            every_s=asked["every_s"],
        )
        _map_many(files, task, engine_of(workers, scheduler), force=force, as_json=as_json)
        return
    if len(files) != 1:
        raise UsageError(
            f"{len(files)} surveys were given; only one can be mapped at a time without --many."
        )
    if (out / NETCDF_NAME).exists() and not force:
        raise InputError(f"{out} contains maps already; give another folder, or --force.")
    with filled_folder(out):
        _map_one(files[0], out, asked | {"workers": workers}, asked_again(ctx), as_json=as_json)


@no_long_pauses()
def _map_one(file: Path, out: Path, asked: dict[str, Any], again: str, *, as_json: bool) -> None:
    with SurveyFile.open(file) as survey_file:
        settings = map_settings(asked, survey_file.survey)
        mapped = sum(one.mapped for one in survey_file.quantities.values())
        thresholds = read_profile(asked["profile"], BUILTIN.extended(survey_file.quantities))
        helpers = helpers_for(survey_file, asked["resolution_m"], asked["workers"])
    with WorkerPool(helpers) as pool:
        with output.Countdown("quantities", mapped, quiet=as_json) as countdown:
            data = map_survey(
                file, settings, asked["resolution_m"], countdown.update, asked["every_s"], pool.map
            )
        written = write_maps(data, out, thresholds, asked["draws"], asked["credits_file"], pool.map)
    for text in data.left_out:
        output.note(f"left out: {text}")
    together = together_notes(data.maps, settings.together)
    for text in (*sample_notes(data), *change_notes(data.maps), *together):
        output.note(f"note: {text}")
    if (text := movie_note(data)) is not None:
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
        next_command=f"grebe report {output.quoted(file)} -o report.html{again}",
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
