"""grebe export: hand a plan to a ground station, a GPS receiver or a map; or samples to a table."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click

from grebe.cli import options, output
from grebe.core.errors import InputError, PlanError
from grebe.io.export.route import write_export
from grebe.io.export.samples import Measured, write_results, writer_of
from grebe.io.store import SurveyFile


@click.command(name="export")
@click.argument("file", type=options.EXISTING)
@click.option(
    "-o",
    "--output",
    "path",
    type=options.OUTPUT,
    required=True,
    help="What to write: .plan, .waypoints, .gpx, .kml or .geojson of the plan; .csv, .parquet or "
    ".wqx.csv of the samples.",
)
@options.force_option
@options.json_option
def command(file: Path, path: Path, force: bool, as_json: bool) -> None:
    """Write the plan, or the samples, of FILE for another program.

    .plan is QGroundControl's, with the shore as a fence, .waypoints Mission Planner's. .csv and
    .parquet (GeoParquet) hold every sample with its flags, .wqx.csv the good values as results for
    the Water Quality Exchange.
    """
    options.refuse_same(file, options.checked_output(path))
    if path.exists() and not force:
        raise InputError(f"{path} exists already; give another name, or --force.")
    write = writer_of(path)
    if write is not None:
        _export_samples(write, file, path, as_json=as_json)
        return
    with SurveyFile.open(file) as survey_file:
        survey = survey_file.survey
    if not survey.targets:
        raise PlanError(f"{file} has no targets to export; make a plan with grebe plan.")
    write_export(survey, path)
    output.result(
        {"waypoints": len(survey.targets), "file": str(path)},
        as_json=as_json,
        next_command=f"grebe run {file}",
    )


def _export_samples(
    write: Callable[[Measured, Path], int], file: Path, path: Path, *, as_json: bool
) -> None:
    with SurveyFile.open(file) as survey_file:
        samples, survey = survey_file.samples(), survey_file.survey
    if not len(samples):
        raise InputError(f"{file} has no samples to export; sail it with grebe run, or import.")
    measured = Measured(samples=samples, frame=survey.frame, name=survey.name)
    rows = write(measured, path)
    left_out = measured.unnamed() if write is write_results else []
    if left_out:
        output.note(f"without a name in the exchange, and left out: {', '.join(left_out)}")
    found = {"samples": len(samples), "rows": rows, "left_out": left_out, "file": str(path)}
    output.result(found, as_json=as_json, next_command=f"grebe map {file} --out maps")
