"""grebe adapt: a survey that was sailed goes on where it pays."""

from __future__ import annotations

from pathlib import Path

import click

from grebe.cli import options, output
from grebe.core.errors import PlanError, UsageError
from grebe.io.store import SurveyFile
from grebe.planning.revisions.revise import Halfway
from grebe.workflow.adaptive import adapted
from grebe.workflow.wish import GOALS, Wish


@click.command(name="adapt")
@click.argument("file", type=options.EXISTING)
@click.option("--quantity", required=True, help="Whose map is to become surer, by its key.")
@click.option("--minutes", type=float, required=True, help="How much longer the boat may sail.")
@click.option(
    "--goal",
    type=click.Choice(GOALS),
    default="accuracy",
    show_default=True,
    help="The map's accuracy everywhere; where the quantity crosses a threshold; where it is "
    "highest.",
)
@click.option("--threshold", type=float, help="With --goal threshold: which, in its unit.")
@options.json_option
def command(
    file: Path, quantity: str, minutes: float, goal: str, threshold: float | None, as_json: bool
) -> None:
    """Plan where a survey goes on, by what it has measured, and keep that as a new revision.

    Nothing that was planned or measured is changed. Run it with --resume.
    """
    wish = Wish(
        quantity=quantity,
        minutes=minutes,
        goal=next(one for one in GOALS if one == goal),
        threshold=threshold,
    )
    with SurveyFile.open(file) as survey_file:
        if survey_file.revision.sorties:
            raise UsageError(
                f"{file} is planned in sorties, or for several boats; only a survey of one mission "
                "goes on where it pays."
            )
        ends, reached = survey_file.track_ends(), survey_file.progress().reached
        if ends is None:
            raise PlanError(f"{file} holds no mission; run it first.")
        if reached < len(survey_file.survey.targets):
            raise PlanError(
                f"{file} is not sailed to its end ({reached} of {len(survey_file.survey.targets)} "
                f"targets); go on with: grebe run {file} --resume"
            )
        survey_file.claim()
        north, east = ends[1].state[:2]
        found = adapted(
            survey_file.survey,
            survey_file.revision,
            survey_file.samples(),
            survey_file.quantities,
            Halfway(reached=reached, place=(north, east)),
            wish,
        )
        survey_file.append_revision(found.revision)
        unit = survey_file.quantities.known(quantity).unit
        unit = f" [{unit}]" if unit else ""
        # Of a threshold and a hot spot the places count that may be it.
        where = "" if goal == "accuracy" else "_where_it_matters"
    output.result(
        {
            "revision": found.revision.number,
            "places": found.places,
            f"sd_now{where}{unit}": float(f"{found.before_sd:.4g}"),
            f"sd_expected{where}{unit}": float(f"{found.expected_sd:.4g}"),
            "note": found.revision.note,
        },
        as_json=as_json,
        next_command=f"grebe run {output.quoted(file)} --resume",
    )
