"""grebe show: say what a survey file holds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import click

from grebe.cli import options, output
from grebe.io.store import SurveyFile
from grebe.workflow.sorties import sortie_states


@click.command(name="show")
@click.argument("file", type=options.EXISTING)
@options.json_option
def command(file: Path, as_json: bool) -> None:
    """Say what FILE holds."""
    with SurveyFile.open(file) as survey_file:
        survey, meta = survey_file.survey, survey_file.meta()
        progress = survey_file.progress()
        samples = survey_file.samples()
        values = {
            "name": survey.name,
            "created": meta.get("created", ""),
            "software_version": meta.get("software_version", ""),
            "vessel": survey.vessel.name if survey.vessel else None,
            "area_m2": round(survey.water.area, 1),
            "targets": len(survey.targets),
            "reached": progress.reached,
            "revision": survey_file.revision.number,
            "revised_for": [one.note for one in survey_file.revisions()[1:]],
            "sorties": [str(one) for one in sortie_states(survey_file)],
            "samples": len(samples),
            "quantities": [key for key in samples.values if samples.measured(key)],
            "track_points": survey_file.count("track"),
            "events": survey_file.count("events"),
        }
    output.result(values, as_json=as_json, next_command=_next(file, values))


def _next(file: Path, values: Mapping[str, object]) -> str:
    if values["targets"] != values["reached"]:
        resume = " --resume" if values["track_points"] and not values["sorties"] else ""
        return f"grebe run {file}{resume}"
    return f"grebe map {file} --out maps" if values["samples"] else ""
