"""grebe export: hand a plan to a ground station, a GPS receiver or a map."""

from __future__ import annotations

from pathlib import Path

import click

from grebe.cli import options, output
from grebe.core.errors import InputError, PlanError
from grebe.io.export.route import write_export
from grebe.io.store import SurveyFile


@click.command(name="export")
@click.argument("file", type=options.EXISTING)
@click.option(
    "-o",
    "--output",
    "path",
    type=options.OUTPUT,
    required=True,
    help="What to write: .plan, .waypoints, .gpx, .kml or .geojson.",
)
@options.force_option
@options.json_option
def command(file: Path, path: Path, force: bool, as_json: bool) -> None:
    """Write the plan of FILE for another program.

    .plan is QGroundControl's, with the shore as a fence, .waypoints Mission Planner's.
    """
    options.refuse_same(file, options.checked_output(path))
    if path.exists() and not force:
        raise InputError(f"{path} exists already; give another name, or --force.")
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
