"""grebe report: one self-contained HTML page about a survey."""

from __future__ import annotations

from pathlib import Path

import click

from grebe.cli import options, output
from grebe.errors import InputError
from grebe.report.page import gather, write_report
from grebe.store import SurveyFile


@click.command(name="report")
@click.argument("file", type=options.EXISTING)
@click.option("-o", "--output", "path", type=options.OUTPUT, help="HTML page [FILE.html].")
@click.option("--resolution", "resolution_m", type=float, help="Spacing of the map's nodes [m].")
@options.force_option
@options.json_option
def command(
    file: Path, path: Path | None, resolution_m: float | None, force: bool, as_json: bool
) -> None:
    """Write one self-contained HTML page about FILE."""
    path = path or file.with_suffix(".html")
    options.refuse_same(file, options.checked_output(path))
    if path.exists() and not force:
        raise InputError(f"{path} exists already; give another name with -o, or --force.")
    with SurveyFile.open(file) as survey_file:
        data = gather(survey_file, resolution_m)
    write_report(path, data)
    output.result(
        {"report": str(path), "maps": len(data.maps), "left_out": list(data.left_out)},
        as_json=as_json,
        next_command=f"open {path} in a browser",
    )
