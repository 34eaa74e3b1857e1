"""Options that divide a plan into sorties or among boats, and the settings that they make."""

from __future__ import annotations

from collections.abc import Sequence

import click

from grebe.cli import options
from grebe.core.errors import UsageError
from grebe.core.plan_settings import FleetSettings, SortieSettings
from grebe.core.vessel import Vessel

RESERVE = 0.2


sortie_options = options.together(
    click.option(
        "--battery",
        "sortie_battery_wh",
        type=click.FloatRange(min=0, min_open=True),
        multiple=True,
        help="Divide the survey into sorties, each on one battery of this capacity [Wh]; for a "
        "fleet of different boats, once for each.",
    ),
    click.option(
        "--sortie-minutes",
        type=click.FloatRange(min=0, min_open=True),
        multiple=True,
        help="Divide the survey into sorties of at most this length [min]; for a fleet of "
        "different boats, once for each.",
    ),
    click.option(
        "--reserve",
        type=click.FloatRange(0, 1, max_open=True),
        help="Share of the battery or the minutes that a sortie leaves unused.  [default: 0.2]",
    ),
    click.option(
        "--harbour",
        "harbours",
        type=options.LON_LAT,
        multiple=True,
        help="Where sorties begin and end; may be repeated.  [default: the start]",
    ),
    click.option(
        "--boats",
        type=int,
        default=1,
        show_default=True,
        help="Number of boats that share the survey.",
    ),
    click.option(
        "--apart",
        "apart_m",
        type=float,
        help="Distance that the boats of a fleet keep from each other [m].  [default: 8]",
    ),
)


def sortie_settings(
    batteries_wh: tuple[float, ...],
    minutes: tuple[float, ...],
    reserve: float | None,
    harbours: tuple[tuple[float, float], ...],
) -> SortieSettings | None:
    """The sortie settings given by the options; None if the survey is one mission. A single value
    of --battery or --sortie-minutes applies to all boats.
    """
    if not (batteries_wh or minutes):
        if harbours or reserve is not None:
            raise UsageError(
                "--harbour and --reserve apply to sorties; give --battery or --sortie-minutes too."
            )
        return None
    return SortieSettings(
        battery_wh=_for_all(batteries_wh),
        minutes=_for_all(minutes),
        reserve=RESERVE if reserve is None else reserve,
        harbours=harbours,
        batteries_wh=batteries_wh if len(batteries_wh) > 1 else (),
        minutes_each=minutes if len(minutes) > 1 else (),
    )


def _for_all(given: tuple[float, ...]) -> float | None:
    return given[0] if len(given) == 1 else None


def fleet_settings(
    boats: int,
    apart_m: float | None,
    starts: tuple[tuple[float, float], ...],
    vessels: Sequence[Vessel],
) -> FleetSettings | None:
    """The fleet settings given by the options; None for one boat."""
    if boats == 1:
        if apart_m is not None or len(starts) > 1 or len(vessels) > 1:
            raise UsageError(
                "--apart, several --start and several --vessel are for fleets; give --boats too."
            )
        return None
    unlike = tuple(vessels) if len(vessels) > 1 else ()
    apart = {} if apart_m is None else {"apart_m": apart_m}
    return FleetSettings(boats=boats, starts=starts, vessels=unlike, **apart)
