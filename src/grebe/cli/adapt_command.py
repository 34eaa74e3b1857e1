"""grebe adapt: extend a finished survey where more readings improve its map most."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from grebe.cli import options, output
from grebe.cli.second_options import second_options, settings_as_asked, where_they_lie
from grebe.cli.sortie_numbers import sortie_numbers
from grebe.core.errors import PlanError
from grebe.core.plan_settings import PlanSettings
from grebe.io.store import SurveyFile
from grebe.planning.revisions.revise import Halfway
from grebe.workflow.adaptive import Adapted, adapted
from grebe.workflow.second_survey import Place, SecondSurvey, second_survey
from grebe.workflow.wish import GOALS, Wish


@click.command(name="adapt")
@click.argument("file", type=options.EXISTING)
@click.option("--quantity", required=True, help="Key of the quantity whose map is to improve.")
@click.option(
    "--minutes", type=float, required=True, help="How much longer each boat may sail [min]."
)
@click.option(
    "--goal",
    type=click.Choice(GOALS),
    default="accuracy",
    show_default=True,
    help="Improve the map everywhere, where the quantity crosses a threshold, or where it is "
    "highest.",
)
@click.option(
    "--threshold", type=float, help="With --goal threshold: its value, in the quantity's unit."
)
@second_options
@click.option("--preview", is_flag=True, help="Print what would be planned, and store nothing.")
@options.json_option
@click.pass_context
def command(
    ctx: click.Context,
    file: Path,
    quantity: str,
    minutes: float,
    goal: str,
    threshold: float | None,
    preview: bool,
    as_json: bool,
    **asked: Any,
) -> None:
    """Plan more targets for a finished survey, based on its measurements, as a new revision.

    Earlier plans and measurements stay unchanged. A survey by several boats continues with several,
    each for --minutes, and a plan in sorties continues in sorties; --boats, --battery and the like
    change that. Sail the revision with grebe run FILE --resume.
    """
    wish = Wish(
        quantity=quantity,
        minutes=minutes,
        goal=next(one for one in GOALS if one == goal),
        threshold=threshold,
    )
    boats = asked["boats"] if _typed(ctx, "boats") else None
    with SurveyFile.open(file) as survey_file:
        place = _where_it_ended(survey_file)
        before = survey_file.survey.settings
        if before is None:
            raise PlanError("Only a planned survey can be extended; plan it first.")
        if not preview:
            survey_file.claim()
        settings = settings_as_asked(asked, before, boats)
        if settings.fleet is None and settings.sorties is None and not survey_file.revision.sorties:
            found = _alone(survey_file, place, wish)
        else:
            lies = where_they_lie(survey_file, settings, asked["starts"])
            found = _shared(survey_file, wish, settings, lies, quiet=as_json)
        if not preview:
            survey_file.append_revision(found.revision)
        unit = survey_file.quantities.known(quantity).unit
    again = f"grebe run {output.quoted(file)} --resume"
    output.result(
        _numbers(found, wish, unit), as_json=as_json, next_command="" if preview else again
    )


def _where_it_ended(survey_file: SurveyFile) -> Place:
    """The last position of the boat. Raises `PlanError` unless the survey is sailed to its end."""
    file = survey_file.path
    ends, reached = survey_file.track_ends(), survey_file.progress().reached
    if ends is None:
        raise PlanError(f"{file} holds no mission yet; run it first.")
    if reached < len(survey_file.survey.targets):
        raise PlanError(
            f"{file} is not finished ({reached} of {len(survey_file.survey.targets)} targets); "
            f"go on with: grebe run {file} --resume"
        )
    north, east = ends[1].state[:2]
    return north, east


def _alone(survey_file: SurveyFile, place: Place, wish: Wish) -> Adapted:
    """Extend the single mission of one boat, from where the boat is."""
    return adapted(
        survey_file.survey,
        survey_file.revision,
        survey_file.samples(),
        survey_file.quantities,
        Halfway(reached=survey_file.progress().reached, place=place),
        wish,
    )


def _shared(
    survey_file: SurveyFile,
    wish: Wish,
    settings: PlanSettings,
    lies: Sequence[Place],
    *,
    quiet: bool,
) -> SecondSurvey:
    """Plan a further survey for several boats, or for one boat in sorties."""
    searches = settings.sorties is not None
    with output.Countdown("rounds", 1, quiet=quiet) if searches else nullcontext() as bar:
        return second_survey(
            survey_file.survey, survey_file.revision, survey_file.samples(), survey_file.quantities,
            wish, settings, lies, None if bar is None else bar.update,
        )  # fmt: skip


def _numbers(found: Adapted | SecondSurvey, wish: Wish, unit: str) -> dict[str, Any]:
    """The numbers of the extension that the command prints."""
    unit = f" [{unit}]" if unit else ""
    # For a threshold or a hot spot, only the places that may be one count.
    where = "" if wish.goal == "accuracy" else "_where_it_matters"
    return {
        "revision": found.revision.number,
        "places": found.places,
        f"sd_now{where}{unit}": float(f"{found.before_sd:.4g}"),
        f"sd_expected{where}{unit}": float(f"{found.expected_sd:.4g}"),
        "note": found.revision.note,
        **(_numbers_of_sorties(found) if isinstance(found, SecondSurvey) else {}),
    }


def _numbers_of_sorties(found: SecondSurvey) -> dict[str, Any]:
    """The numbers of the sorties that follow those of the earlier survey."""
    before = len(found.revision.sorties) - len(found.planned.revision.sorties)
    return sortie_numbers(found.planned, found.revision.sorties[before:])


def _typed(ctx: click.Context, name: str) -> bool:
    return ctx.get_parameter_source(name) is not ParameterSource.DEFAULT
