"""grebe report: one self-contained HTML page about a survey."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from grebe.cli import options, output
from grebe.cli.mapping_options import map_settings, mapping_options
from grebe.core.errors import InputError
from grebe.core.quantities import BUILTIN
from grebe.io.store import SurveyFile
from grebe.report.data import gather
from grebe.report.page import write_report
from grebe.report.pdf import print_pdf
from grebe.report.texts import LANGUAGES
from grebe.report.thresholds import read_profile
from grebe.workflow.garbage_collection import no_long_pauses
from grebe.workflow.helpers import WorkerPool
from grebe.workflow.maps import helpers_for


@click.command(name="report")
@click.argument("file", type=options.EXISTING)
@click.option(
    "-o", "--output", "path", type=options.OUTPUT, help="HTML page.  [default: FILE.html]"
)
@mapping_options
@click.option(
    "--language",
    type=click.Choice(LANGUAGES),
    default="en",
    show_default=True,
    help="Language of the page.",
)
@click.option(
    "--profile", type=options.EXISTING, help="TOML file of thresholds.  [default: fresh water]"
)
@click.option(
    "--pdf", is_flag=True, help="Also print a PDF beside the page, with an installed browser."
)
@options.force_option
@options.json_option
@no_long_pauses()
def command(
    file: Path,
    path: Path | None,
    language: str,
    profile: Path | None,
    pdf: bool,
    force: bool,
    as_json: bool,
    **asked: Any,
) -> None:
    """Write one self-contained HTML page about FILE, with the maps that grebe map makes."""
    path = path or file.with_suffix(".html")
    options.refuse_same(file, options.checked_output(path))
    if path.suffix.lower() == ".pdf":
        raise InputError(f"{path}: give the page a name in .html; --pdf prints it beside it.")
    for made in (path, *([path.with_suffix(".pdf")] if pdf else [])):
        if made.exists() and not force:
            raise InputError(f"{made} exists already; give another name with -o, or --force.")
    with SurveyFile.open(file) as survey_file:
        thresholds = read_profile(profile, BUILTIN.extended(survey_file.quantities))
        settings = map_settings(asked, survey_file.survey)
        with WorkerPool(helpers_for(survey_file, asked["resolution_m"])) as pool:
            data = gather(
                survey_file, asked["resolution_m"], settings, None, asked["every_s"], pool.map
            )
            write_report(path, data, thresholds, language, pool.map)
    printed: dict[str, str] = {}
    if pdf:
        print_pdf(path, path.with_suffix(".pdf"))
        printed = {"pdf": str(path.with_suffix(".pdf"))}
    output.result(
        {
            "report": str(path),
            **printed,
            "maps": len(data.maps),
            "left_out": list(data.left_out),
        },
        as_json=as_json,
        next_command=f"open {path} in a browser",
    )
