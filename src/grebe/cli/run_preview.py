"""What `grebe run` would do, and notes on the sortie that sets out."""

from __future__ import annotations

import json
from datetime import datetime
from pathlib import Path
from typing import Any

from grebe.cli import output
from grebe.cli.adaptive_options import wish_again
from grebe.cli.rule_options import typed_again
from grebe.cli.safety_options import safety_of
from grebe.io.store import SurveyFile
from grebe.mission.departure import Departure, prepare
from grebe.workflow.boats import SIMULATED, simulates
from grebe.workflow.one_water import refuse_other_water
from grebe.workflow.preview import fleet_preview, preview_of, route_home_of


def say_which(departure: Departure, survey_file: SurveyFile) -> None:
    """Print which sortie sets out."""
    one = departure.sortie
    if one is not None:
        lon, lat = survey_file.survey.frame.to_wgs84(departure.state[:2]).tolist()
        count = len(survey_file.revision.sorties)
        whose = survey_file.survey.whose(one.boat)
        which = f"sortie {one.number} of {count}{', ' * bool(whose)}{whose}"
        output.note(f"{which}, from latitude {lat:.5f}, longitude {lon:.5f}")


def say_spent(departure: Departure) -> None:
    """Print how much energy and time a sortie's boat has spent already."""
    survey, spent, one = departure.survey, departure.spent, departure.sortie
    if spent.energy_wh >= 1 and survey.settings is not None and survey.settings.sorties is not None:
        whose = survey.whose(one.boat) if one is not None else ""
        output.note(
            f"{whose or 'the boat'} has spent {spent.energy_wh:.0f} Wh and "
            f"{spent.seconds / 60:.0f} min since its harbour, which count against this battery; "
            "if the battery has been changed, give --battery-changed"
        )


def _again(urls: tuple[str, ...], run: dict[str, Any], survey_file: SurveyFile) -> str:
    """The links and the options of the controller and of --adaptive, as they were typed.

    A simulated boat goes without saying, unless another one began the mission.
    """
    before = set(json.loads(survey_file.meta().get("links", "[]")))
    named = [url for url in urls if url != SIMULATED or before - {SIMULATED}]
    links = "".join(f" --link {output.quoted(url)}" for url in named)
    return links + typed_again(run) + wish_again(run)


def show_preview(
    file: Path,
    sortie: int | None,
    urls: tuple[str, ...],
    run: dict[str, Any],
    now: datetime,
    *,
    resume: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Print what a run would do, and the command for it.

    Raises `SurveyFileError` if simulated and measured readings would share the file.
    """
    with SurveyFile.open(file) as survey_file:
        simulated = {simulates(url) for url in urls}
        if not force and None not in simulated:
            refuse_other_water(survey_file, simulated=True in simulated)
        options = _again(urls, run, survey_file)
        fleet = survey_file.survey.fleet if sortie is None and not force else None
        if fleet is not None and not run["returns"]:
            go = f"grebe run {output.quoted(file)}{' --resume' if resume else ''}{options}"
            numbers = fleet_preview(survey_file, now)
            output.result(numbers, as_json=as_json, next_command=go)
            return
        departure = prepare(survey_file, now, resume=resume, force=force, sortie=sortie)
    if run["returns"]:
        numbers = route_home_of(departure, safety_of(run, now))
        ahead = f"grebe run {output.quoted(file)} --return"
        output.result(numbers, as_json=as_json, next_command=ahead)
        return
    which = "" if sortie is None else f" --sortie {sortie}"
    again = "".join(f" --{name}" for name, on in (("resume", resume), ("force", force)) if on)
    go = f"grebe run {output.quoted(file)}{which}{again}{options}"
    say_which(departure, survey_file)
    say_spent(departure)
    output.result(preview_of(departure).numbers(), as_json=as_json, next_command=go)
