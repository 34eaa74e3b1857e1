"""The safety options of a mission, and the settings that they make."""

from __future__ import annotations

import math
from collections.abc import Collection
from datetime import UTC, datetime, timedelta
from typing import Any

import click

from grebe.cli import options
from grebe.core.errors import UsageError
from grebe.mission.safety.settings import CAREFUL, SafetySettings

# Options that a resumed mission does not inherit: nobody agrees to arm a boat in advance.
ONCE = ("returns", "yes", "battery_changed")
# The value of --battery-changed without a number.
ALL = "all"
ASKED = "the operator has called the boat home"


safety_options = options.together(
    click.option(
        "--home",
        type=options.LON_LAT,
        help="Where the boat returns to.  [default: the survey's start]",
    ),
    click.option(
        "--max-minutes",
        type=click.FloatRange(min=0, min_open=True),
        help="The boat must be home after this many minutes.",
    ),
    click.option("--until", metavar="HH:MM", help="The boat must be home by this time (UTC)."),
    click.option(
        "--battery-reserve",
        type=click.FloatRange(0, 1, max_open=True),
        default=CAREFUL.battery_reserve,
        show_default=True,
        help="Share of the battery that must be left when the boat is home.",
    ),
    click.option(
        "--battery-wh",
        type=click.FloatRange(min=0, min_open=True),
        help="Capacity of the battery, for a boat that does not report its charge [Wh].",
    ),
    click.option(
        "--battery-changed",
        is_flag=False,
        flag_value=ALL,
        multiple=True,
        metavar="[BOAT]",
        help="With --resume: a full battery has been put in since; for a fleet, in every boat, or "
        "in the boat of this number.",
    ),
    click.option(
        "--no-fence",
        is_flag=True,
        help="Turn off the fence, which brakes the boat in time to stop inside the survey's water.",
    ),
    click.option(
        "--sonde-silence",
        "mute_s",
        type=click.FloatRange(min=0, min_open=True),
        default=CAREFUL.mute_s,
        show_default=True,
        metavar="SECONDS",
        help="Hold position once an --instrument has been silent for this long; inf: never.",
    ),
    click.option(
        "--return",
        "returns",
        is_flag=True,
        help="Bring the boat home from where its recorded mission ended, and do nothing else.",
    ),
)


def safety_of(run: dict[str, Any], now: datetime) -> SafetySettings:
    """The safety settings given by a run's options at the time `now`."""
    minutes, home = run.get("max_minutes"), run.get("home")
    until = run.get("until")
    return SafetySettings(
        fence=not run.get("no_fence"),
        home=None if home is None else (float(home[0]), float(home[1])),
        max_s=math.inf if minutes is None else 60.0 * minutes,
        until=None if until is None else next_instant(until, now),
        battery_reserve=run.get("battery_reserve", CAREFUL.battery_reserve),
        battery_wh=run.get("battery_wh"),
        mute_s=run.get("mute_s", CAREFUL.mute_s),
        comes_home=ASKED if run.get("returns") else "",
    )


def boats_changed(given: Collection[str], boats: int) -> frozenset[int]:
    """The numbers of the boats whose batteries were changed, in a fleet of `boats`."""
    changed: set[int] = set()
    for one in given:
        if one == ALL:
            changed |= set(range(1, boats + 1))
        elif one.isdecimal() and 1 <= int(one) <= boats:
            changed.add(int(one))
        else:
            raise UsageError(
                f"--battery-changed {one} is not the number of a boat; there "
                f"{'is one' if boats == 1 else f'are {boats}'}."
            )
    return frozenset(changed)


def next_instant(clock: str, now: datetime) -> datetime:
    """The next time after `now` at which a UTC clock shows HH:MM."""
    try:
        time = datetime.strptime(clock, "%H:%M").replace(tzinfo=UTC)
    except ValueError:
        raise click.BadParameter(f"{clock!r} is not a time of day such as 19:30.") from None
    today = now.astimezone(UTC).replace(hour=time.hour, minute=time.minute, second=0, microsecond=0)
    return today if today > now else today + timedelta(days=1)
