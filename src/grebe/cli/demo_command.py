"""grebe demo: every step for a small region, with nothing but the package."""

from __future__ import annotations

import time
from datetime import UTC, datetime
from pathlib import Path

import click

from grebe.cli import options, output
from grebe.control.rules.lookahead import Lookahead
from grebe.core.errors import IncompleteError
from grebe.io.store import SurveyFile
from grebe.mission.events.statistics import ProgressMeter
from grebe.report import canvas, mission_figures
from grebe.report.page import write_report
from grebe.report.thresholds import read_profile
from grebe.workflow.demo import NOTE, demo_survey
from grebe.workflow.files import make_folder, write_survey
from grebe.workflow.maps import map_survey, write_maps
from grebe.workflow.quality import check_samples
from grebe.workflow.run import run_survey, steered_by
from grebe.workflow.simulated import SimulatedWorld


@click.command(name="demo")
@click.option(
    "--out",
    type=options.FOLDER,
    default=Path("demo"),
    show_default=True,
    help="Folder for the results.",
)
@options.json_option
def command(out: Path, as_json: bool) -> None:
    """Plan, steer, sample, map and report a hectare of Lac du Heron in simulation."""
    began = time.monotonic()
    make_folder(out)
    file = out / "survey.gpkg"
    survey = demo_survey()
    canvas.save(mission_figures.plan_figure(survey), out / "plan.png")
    output.note(f"{NOTE} {len(survey.targets)} target sets of 25 m2; steering through them:")
    output.compile_once()
    write_survey(file, survey, force=True, note=NOTE)
    with (
        SurveyFile.open(file) as survey_file,
        output.MissionBar(quiet=as_json) as bar,
    ):
        report = run_survey(
            survey_file,
            SimulatedWorld(),
            steered_by(Lookahead()),
            datetime.now(UTC),
            listeners=[ProgressMeter(bar.update)],
        )
        output.note("checking and mapping the samples")
        check_samples(survey_file)
    data = map_survey(file)
    write_maps(data, out / "maps", read_profile(None))
    write_report(out / "report.html", data)
    output.result(
        {
            **report.numbers(),
            "wall_s": round(time.monotonic() - began, 1),
            "survey": str(file),
            "plan": str(out / "plan.png"),
            "maps": str(out / "maps"),
            "report": str(out / "report.html"),
        },
        as_json=as_json,
        next_command=f"open {out / 'report.html'} in a browser; then grebe plan YOUR_LAKE.geojson "
        "-o survey.gpkg",
    )
    if not report.complete:
        raise IncompleteError(f"{report.targets - report.reached} target sets were not reached.")
