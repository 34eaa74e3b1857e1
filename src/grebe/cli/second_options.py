"""Options for the boats of a follow-up survey, and for how far each may go."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from grebe.cli import options
from grebe.cli.sortie_options import fleet_settings, sortie_options, sortie_settings
from grebe.core.plan_settings import FleetSettings, PlanSettings, SortieSettings
from grebe.workflow.vessels import vessel_of

if TYPE_CHECKING:
    from grebe.io.store import SurveyFile
    from grebe.workflow.second_survey import Place

second_options = options.together(
    sortie_options,
    click.option(
        "--vessel",
        "vessels",
        multiple=True,
        help="The boat; for a fleet of different boats, once for each.  [default: as planned]",
    ),
    click.option(
        "--start",
        "starts",
        type=options.LON_LAT,
        multiple=True,
        help="Where a boat of a fleet sets out; give it once for each.  [default: where it is now; "
        "for boats that have not sailed yet, where their parts begin]",
    ),
)


def settings_as_asked(
    asked: dict[str, Any], before: PlanSettings, boats: int | None
) -> PlanSettings:
    """The settings of the follow-up survey: those `before`, overridden by the options. `boats` is
    None if --boats was not given.
    """
    fleet = _fleet(asked, before.fleet, boats)
    sorties = _sorties(asked, before.sorties)
    if fleet is not None and asked["harbours"] and not asked["starts"]:
        # The boats' starts served as harbours; --harbour replaces them.
        fleet = replace(fleet, starts=())
    return replace(before, fleet=fleet, sorties=sorties)


def _fleet(
    asked: dict[str, Any], before: FleetSettings | None, boats: int | None
) -> FleetSettings | None:
    vessels, starts, apart_m = asked["vessels"], asked["starts"], asked["apart_m"]
    if before is None or boats not in (None, before.boats):
        kept_m = before.apart_m if before is not None and boats != 1 else None
        own = [vessel_of(one) for one in vessels]
        return fleet_settings(boats or 1, apart_m or kept_m, starts, own)
    given: dict[str, Any] = {"starts": starts, "apart_m": apart_m}
    given["vessels"] = tuple(vessel_of(one) for one in vessels)
    return replace(before, **{name: value for name, value in given.items() if value})


def _sorties(asked: dict[str, Any], before: SortieSettings | None) -> SortieSettings | None:
    batteries_wh, minutes = asked["sortie_battery_wh"], asked["sortie_minutes"]
    reserve, harbours = asked["reserve"], asked["harbours"]
    if before is None:
        return sortie_settings(batteries_wh, minutes, reserve, harbours)
    reserve = before.reserve if reserve is None else reserve
    harbours = harbours or before.harbours
    if batteries_wh or minutes:
        return sortie_settings(batteries_wh, minutes, reserve, harbours)
    return replace(before, reserve=reserve, harbours=harbours)


def where_they_lie(
    survey_file: SurveyFile, settings: PlanSettings, starts: tuple[tuple[float, float], ...]
) -> list[Place]:
    """Where boats without a harbour set out: at the given `starts`, or else where their tracks end.
    Empty for a plan in sorties, and if one of the boats has not sailed yet.
    """
    survey = survey_file.survey
    if settings.sorties is not None:
        return []
    if starts:
        return [survey.frame.place_near(survey.water, one, "start") for one in starts]
    boats = 1 if settings.fleet is None else settings.fleet.boats
    ends = [survey_file.track_ends(boat) for boat in range(1, boats + 1)]
    states = [end[1].state for end in ends if end is not None]
    return [(one[0], one[1]) for one in states] if len(states) == boats else []
