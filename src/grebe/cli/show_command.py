"""grebe show: summarise a survey file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import click

from grebe.cli import options, output
from grebe.core.survey import Survey
from grebe.io.store import SurveyFile
from grebe.workflow.sorties import SortieState, sortie_states


@click.command(name="show")
@click.argument("file", type=options.EXISTING)
@options.json_option
def command(file: Path, as_json: bool) -> None:
    """Summarise FILE: its plan, its progress and its samples."""
    with SurveyFile.open(file) as survey_file:
        survey, meta = survey_file.survey, survey_file.meta()
        progress = survey_file.progress()
        samples = survey_file.samples()
        values = {
            "name": survey.name,
            "created": meta.get("created", ""),
            "software_version": meta.get("software_version", ""),
            "vessel": _vessels(survey),
            "area_m2": round(survey.water.area, 1),
            "targets": len(survey.targets),
            "reached": progress.reached,
            "revision": survey_file.revision.number,
            "revised_for": [one.note for one in survey_file.revisions()[1:]],
            "sorties": [_sortie(one, survey) for one in sortie_states(survey_file)],
            "samples": len(samples),
            "quantities": [key for key in samples.values if samples.measured(key)],
            "track_points": survey_file.count("track"),
            "events": survey_file.count("events"),
        }
    output.result(values, as_json=as_json, next_command=_next(file, values))


def _vessels(survey: Survey) -> str | None:
    """The survey's vessel, or all vessels if the boats differ."""
    boats = survey.fleet.boats if survey.fleet else 1
    of_boats = [survey.vessel_of(boat) for boat in range(1, boats + 1)]
    names = [one.name for one in of_boats if one is not None]
    return ", ".join(names if len(set(names)) > 1 else names[:1]) or None


def _sortie(state: SortieState, survey: Survey) -> str:
    """A sortie in words: its progress, its boat, and where it sets out."""
    one = state.sortie
    lon, lat = survey.frame.to_wgs84((one.start.north_m, one.start.east_m)).tolist()
    whose = survey.whose(one.boat)
    return f"{state}{', ' * bool(whose)}{whose}, from {lon:.5f},{lat:.5f}"


def _next(file: Path, values: Mapping[str, object]) -> str:
    if values["targets"] != values["reached"]:
        resume = " --resume" if values["track_points"] and not values["sorties"] else ""
        return f"grebe run {output.quoted(file)}{resume}"
    return f"grebe map {output.quoted(file)} --out maps" if values["samples"] else ""
