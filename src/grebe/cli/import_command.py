"""grebe import: turn a hand-driven track into a survey file."""

from __future__ import annotations

from pathlib import Path

import click

from grebe.cli import options, output
from grebe.cli.files import write_survey_file
from grebe.core.quantities import QUANTITIES
from grebe.core.samples import Flag
from grebe.io.readers.track import read_track
from grebe.io.store import SurveyFile
from grebe.workflow.checked import check_samples
from grebe.workflow.imported import samples_of_track, survey_of_track


@click.command(name="import")
@click.argument("track", type=options.EXISTING)
@click.option("-o", "--output", "path", type=options.OUTPUT, required=True, help="Survey file.")
@options.column_options
@options.force_option
@options.json_option
def command(
    track: Path,
    path: Path,
    force: bool,
    as_json: bool,
    header_from: Path | None,
    **columns: str | None,
) -> None:
    """Import the data of TRACK (CSV); its convex hull becomes the region."""
    options.refuse_same(track, options.checked_output(path))
    raw = read_track(track, options.track_columns(columns), header_from)
    missing = [q.label for q in QUANTITIES if q.key in raw.missing]
    for text in (*raw.notes, *(f"no column for {label}: left out" for label in missing)):
        output.note(f"{track}: {text}")
    survey = survey_of_track(raw, track.stem)
    write_survey_file(path, survey, force=force, note=f"Imported from {track.name}.")
    with SurveyFile.open(path) as file:
        file.append_samples(samples_of_track(raw, survey))
        file.set_meta("water", f"measured, {track.name}")
        quality = check_samples(file)
        count = file.count("samples")
    for key in raw.values:
        if not (quality.flags[key] == Flag.GOOD).any():
            output.note(f"{track}: no good value of {key}: missing, text, or flagged")
    output.result(
        {
            "name": survey.name,
            "samples": count,
            "origin": options.place_text(survey.frame),
            "area_m2": round(survey.water.area, 1),
            "columns": [f"{key}: {name}" for key, name in raw.columns.items()],
            "good": {key: int((quality.flags[key] == 1).sum()) for key in raw.values},
            "left_out": missing,
            "file": str(path),
        },
        as_json=as_json,
        next_command=f"grebe map {path} --out maps",
    )
