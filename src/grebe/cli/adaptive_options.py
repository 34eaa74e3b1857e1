"""Options of `grebe run --adaptive`: sail on where readings improve a map most."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from grebe.cli import options
from grebe.core.errors import UsageError
from grebe.workflow.wish import GOALS, Wish

if TYPE_CHECKING:
    from collections.abc import Callable

    from grebe.io.store import SurveyFile
    from grebe.workflow.adaptive_run import Onward, Sailing


adaptive_options = options.together(
    click.option(
        "--adaptive",
        "adaptive_key",
        metavar="QUANTITY",
        help="After the planned targets, sail on where readings improve this quantity's map most.",
    ),
    click.option(
        "--more-minutes", type=float, help="With --adaptive (required): for how long [min]."
    ),
    click.option(
        "--goal",
        type=click.Choice(GOALS),
        help="With --adaptive: improve the map everywhere, where the quantity crosses a threshold, "
        "or where it is highest.  [default: accuracy]",
    ),
    click.option(
        "--threshold", type=float, help="With --goal threshold: its value, in the quantity's unit."
    ),
    click.option(
        "--until-sd",
        type=click.FloatRange(min=0, min_open=True),
        help="With --adaptive: end early once the map's standard deviation is this small, in the "
        "quantity's unit.",
    ),
)


def wish_again(run: dict[str, Any]) -> str:
    """The adaptive options as they were typed, for the next command."""
    names = {"adaptive_key": "adaptive", "more_minutes": "more-minutes", "goal": "goal"}
    names |= {"threshold": "threshold", "until_sd": "until-sd"}
    given = ((flag, run[name]) for name, flag in names.items())
    return "".join(f" --{flag} {value}" for flag, value in given if value is not None)


def wish_of(run: dict[str, Any]) -> Wish | None:
    """The goal of the adaptive part of a mission; None without --adaptive."""
    key = run["adaptive_key"]
    flags = ("--more-minutes", "--goal", "--threshold", "--until-sd")
    given = [flag for flag in flags if run[flag[2:].replace("-", "_")] is not None]
    if key is None:
        if given:
            raise UsageError(f"{given[0]} requires --adaptive.")
        return None
    if run["more_minutes"] is None:
        raise UsageError("--adaptive needs --more-minutes: how long to sail on.")
    if not run["more_minutes"] > 0:
        raise UsageError(
            f"--more-minutes {run['more_minutes']:g} is impossible; give a positive number."
        )
    return Wish(
        quantity=key,
        minutes=run["more_minutes"],
        goal=run["goal"] or "accuracy",
        threshold=run["threshold"],
        sd=run["until_sd"],
    )


def onward_of(
    run: dict[str, Any], survey_file: SurveyFile, *, force: bool
) -> Callable[[Sailing | None], Onward] | None:
    """Return a function that makes the planner of the adaptive part of a mission, given the boats
    that still sail (None if there are no others); None without --adaptive.

    Raises `UsageError` before anything moves if the survey file cannot serve the goal.
    """
    wish = wish_of(run)
    if wish is None:
        return None
    survey = survey_file.survey
    if not force and survey_file.progress().reached == len(survey.targets):
        more = f"plan more with: grebe adapt {survey_file.path}"
        raise UsageError(
            f"Every target of {survey_file.path} is reached already; "
            + (more if survey.fleet is None else "sail it again with --force.")
        )
    settings = survey.settings
    if settings is not None and settings.sorties is not None:
        raise UsageError(
            "--adaptive sails on from where the boats are; this plan has them come home."
        )
    if wish.quantity not in survey_file.quantities:
        known = ", ".join(survey_file.quantities)
        raise UsageError(
            f"--adaptive {wish.quantity}: {survey_file.path} has no such quantity; it has {known}."
        )
    # The mapping half of the package takes a second to import, which other runs can do without.
    from grebe.workflow.adaptive_run import Onward

    return lambda sailing: Onward(path=survey_file.path, wish=wish, sailing=sailing)
