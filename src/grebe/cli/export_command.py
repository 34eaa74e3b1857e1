"""grebe export: write a plan, or samples, for other programs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click

from grebe.cli import options, output
from grebe.core.errors import InputError, PlanError, UsageError
from grebe.core.revision import survey_of
from grebe.core.survey import Survey, is_simulated
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
    help="Output file, whose ending chooses the format: .plan, .waypoints, .gpx, .kml or .geojson "
    "for the plan; .csv, .parquet or .wqx.csv for the samples.",
)
@click.option(
    "--sortie",
    type=click.IntRange(min=1),
    help="Number of the sortie to export, or of the boat's part in a fleet's plan.",
)
@options.force_option
@options.json_option
def command(file: Path, path: Path, sortie: int | None, force: bool, as_json: bool) -> None:
    """Write the plan, or the samples, of FILE for other programs.

    .plan is for QGroundControl, with the shore as a fence, and .waypoints for Mission Planner. .csv
    and .parquet (GeoParquet) hold every sample with its flags; .wqx.csv holds the good values, as
    results for the Water Quality Exchange.
    """
    options.refuse_same(file, options.checked_output(path))
    if path.exists() and not force:
        raise InputError(f"{path} exists already; give another name, or --force.")
    write = writer_of(path)
    if write is not None:
        _export_samples(write, file, path, as_json=as_json)
        return
    with SurveyFile.open(file) as survey_file:
        survey = _part(survey_file, sortie)
    if not survey.targets:
        raise PlanError(f"{file} has no targets to export; make a plan with grebe plan.")
    write_export(survey, path)
    output.result(
        {"waypoints": len(survey.targets), "file": str(path)},
        as_json=as_json,
        next_command=f"grebe run {output.quoted(file)}",
    )


def _part(survey_file: SurveyFile, sortie: int | None) -> Survey:
    """The part that is sailed in one go: the complete survey, or one sortie. Several sorties strung
    together would exceed any battery and cross the land between their ends.
    """
    revision = survey_file.revision
    if sortie is not None:
        return survey_of(survey_file.survey, revision, revision.sortie(sortie))
    if len(revision.sorties) > 1:
        raise UsageError(
            f"{survey_file.path} is planned in {len(revision.sorties)} sorties; choose one, such "
            "as --sortie 1."
        )
    return survey_file.survey


def _export_samples(
    write: Callable[[Measured, Path], int], file: Path, path: Path, *, as_json: bool
) -> None:
    with SurveyFile.open(file) as survey_file:
        samples, survey = survey_file.samples(), survey_file.survey
        quantities, water = survey_file.quantities, survey_file.meta().get("water", "")
    if not len(samples):
        raise InputError(f"{file} has no samples to export; sail it with grebe run, or import.")
    if write is write_results and is_simulated(water):
        raise InputError(
            f"{file} was sailed in simulation: its values are not results for the exchange; "
            "export a plain table, .csv or .parquet."
        )
    if is_simulated(water):
        output.note(f"note: {file} was sailed in simulation: its values were not measured")
    measured = Measured(
        samples=samples, frame=survey.frame, name=survey.name, quantities=quantities
    )
    rows = write(measured, path)
    left_out = measured.unnamed() if write is write_results else []
    if left_out:
        output.note(f"left out, as the exchange has no name for them: {', '.join(left_out)}")
    found = {"samples": len(samples), "rows": rows, "left_out": left_out, "file": str(path)}
    ahead = f"grebe map {output.quoted(file)} --out maps"
    output.result(found, as_json=as_json, next_command=ahead)
