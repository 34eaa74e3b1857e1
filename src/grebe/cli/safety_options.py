"""The options of a mission's safety, and the settings that they make."""

from __future__ import annotations

import math
from collections.abc import Collection
from datetime import UTC, datetime, timedelta
from typing import Any

import click

from grebe.cli import options
from grebe.core.errors import UsageError
from grebe.mission.safety.settings import CAREFUL, SafetySettings

# Options of a single run, which a resumed mission does not inherit: nobody arms a boat for later.
ONCE = ("returns", "yes", "battery_changed")
# What --battery-changed says without a number.
ALL = "all"
ASKED = "the operator has asked for the way home"


safety_options = options.together(
    click.option(
        "--home",
        type=options.LON_LAT,
        help="Where the boat comes home to.  [default: the survey's start]",
    ),
    click.option(
        "--max-minutes",
        type=click.FloatRange(min=0, min_open=True),
        help="The boat must be home after so many minutes.",
    ),
    click.option("--until", metavar="HH:MM", help="The boat must be home by then, in UTC."),
    click.option(
        "--battery-reserve",
        type=click.FloatRange(0, 1, max_open=True),
        default=CAREFUL.battery_reserve,
        show_default=True,
        help="Share of the battery that must be left at home.",
    ),
    click.option(
        "--battery-wh",
        type=click.FloatRange(min=0, min_open=True),
        help="What the battery holds, for a boat that does not say what is left [Wh].",
    ),
    click.option(
        "--battery-changed",
        is_flag=False,
        flag_value=ALL,
        multiple=True,
        metavar="[BOAT]",
        help="With --resume: the battery was changed since, and is full; of a fleet every boat's, "
        "or that of the boat of this number.",
    ),
    click.option(
        "--no-fence",
        is_flag=True,
        help="Do not brake the boat where it could not stop inside the survey's water any more.",
    ),
    click.option(
        "--sonde-silence",
        "mute_s",
        type=click.FloatRange(min=0, min_open=True),
        default=CAREFUL.mute_s,
        show_default=True,
        metavar="SECONDS",
        help="Hold the place once an --instrument has been silent for so long; inf: never.",
    ),
    click.option(
        "--return",
        "returns",
        is_flag=True,
        help="Bring the boat home from where its recorded mission ends, and do nothing else.",
    ),
)


def safety_of(run: dict[str, Any], now: datetime) -> SafetySettings:
    """The settings of a run's options, at an instant."""
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
    """The boats, of so many, whose batteries were changed."""
    changed: set[int] = set()
    for one in given:
        if one == ALL:
            changed |= set(range(1, boats + 1))
        elif one.isdecimal() and 1 <= int(one) <= boats:
            changed.add(int(one))
        else:
            raise UsageError(
                f"--battery-changed {one} is the number of no boat; there "
                f"{'is one' if boats == 1 else f'are {boats}'}."
            )
    return frozenset(changed)


def next_instant(clock: str, now: datetime) -> datetime:
    """The next instant after `now` at which a clock in UTC shows HH:MM."""
    try:
        time = datetime.strptime(clock, "%H:%M").replace(tzinfo=UTC)
    except ValueError:
        raise click.BadParameter(f"{clock!r} is not a time of day such as 19:30.") from None
    today = now.astimezone(UTC).replace(hour=time.hour, minute=time.minute, second=0, microsecond=0)
    return today if today > now else today + timedelta(days=1)
