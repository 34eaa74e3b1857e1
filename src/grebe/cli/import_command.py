"""grebe import: turn a hand-driven track into a survey file."""

from __future__ import annotations

from pathlib import Path

import click

from grebe.cli import options, output
from grebe.core.quantities import LIMNOLOGICAL
from grebe.core.samples import Flag
from grebe.workflow.tracks import import_track


@click.command(name="import")
@click.argument("track", type=options.EXISTING)
@click.option("-o", "--output", "path", type=options.OUTPUT, required=True, help="Survey file.")
@options.column_options
@options.quantities_option
@options.force_option
@options.json_option
def command(
    track: Path,
    path: Path,
    columns: tuple[str, ...],
    header_from: Path | None,
    quantities_file: Path | None,
    force: bool,
    as_json: bool,
    **named: str | None,
) -> None:
    """Import the data of TRACK (CSV); its convex hull becomes the region."""
    options.refuse_same(track, options.checked_output(path))
    done = import_track(
        track,
        path,
        columns=options.track_columns(columns, named),
        header_from=header_from,
        quantities_file=quantities_file,
        force=force,
    )
    missing = [one.label for key, one in LIMNOLOGICAL.items() if key not in done.quantities]
    for text in (*done.raw.notes, *(f"no column for {label}: left out" for label in missing)):
        output.note(f"{track}: {text}")
    for key in done.without_good:
        output.note(f"{track}: no good value of {key}: missing, text, or flagged")
    flags = done.quality.flags
    output.result(
        {
            "name": done.survey.name,
            "samples": done.samples,
            "origin": options.place_text(done.survey.frame),
            "area_m2": round(done.survey.water.area, 1),
            "columns": [f"{key}: {name}" for key, name in done.raw.columns.items()],
            "good": {key: int((flags[key] == Flag.GOOD).sum()) for key in done.raw.values},
            "left_out": missing,
            "file": str(path),
        },
        as_json=as_json,
        next_command=f"grebe map {path} --out maps",
    )
