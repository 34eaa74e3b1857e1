"""Requests of a page or a script to sail a survey."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, cast

from grebe.core.dynamics import Weather
from grebe.core.errors import UsageError
from grebe.server.requests import setting_number
from grebe.workflow.own_files import OWN


@dataclass(frozen=True, kw_only=True)
class Voyage:
    """How to sail a survey: the `link` to the boat and the controller's `rule`. For simulated boats
    also the `weather`, a current [m/s] and a wind force [N] towards north and east, and the `rate`,
    a multiple of the clock's speed. `resume` continues a mission, `force` begins anew.
    """

    link: str = "sim:"
    rule: str = "lookahead"
    rate: float = 1.0
    weather: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    resume: bool = False
    force: bool = False


def voyage_asked(given: dict[str, Any]) -> Voyage:
    """Read a voyage from a request; raises `UsageError` if something in it is wrong."""
    link = given.get("link", "simulated")
    rate = given.get("rate", 1.0)
    if not isinstance(link, str) or len(link) > 200:
        raise UsageError(
            "The link must be an address of at most 200 characters.", settings=("link",)
        )
    if link.startswith(OWN):
        raise UsageError(
            "A link of your own can only be used from the command line.", settings=("link",)
        )
    rule = str(given.get("rule", "lookahead"))
    if rule.startswith(OWN):
        raise UsageError(
            "A rule of your own can only be used from the command line.", settings=("rule",)
        )
    if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0.1 <= rate <= 200:
        raise UsageError("The rate must be a number from 0.1 to 200.", settings=("rate",))
    given_weather = given.get("weather") or {}
    if not isinstance(given_weather, dict):
        raise UsageError(
            "The weather must be an object with a current and a wind.", settings=("weather",)
        )
    resume = given.get("resume") is True
    return Voyage(
        link="sim:" if link == "simulated" else link,
        rule=rule,
        rate=float(rate),
        weather=weather(cast("dict[str, Any]", given_weather)).as_tuple(),
        resume=resume,
        force=given.get("force") is True and not resume,
    )


def weather(given: dict[str, Any]) -> Weather:
    """The weather of a request, which gives the direction that the current [m/s] flows towards and
    the direction that the wind, by its force [N], blows from.
    """
    north, east = _vector(given.get("current"), "current", "speed_mps", "towards_deg")
    from_north, from_east = _vector(given.get("wind"), "wind", "force_n", "from_deg")
    return Weather(
        current_north_mps=north,
        current_east_mps=east,
        wind_force_north_n=-from_north,
        wind_force_east_n=-from_east,
    )


def _vector(given: Any, what: str, size: str, direction: str) -> tuple[float, float]:
    if given is None:
        return 0.0, 0.0
    if not isinstance(given, dict):
        raise UsageError(
            f"The {what} must be an object with {size} and {direction}.", settings=(what,)
        )
    table = cast("dict[str, Any]", given)
    length, angle = setting_number(table, size), math.radians(setting_number(table, direction))
    return round(length * math.cos(angle), 9), round(length * math.sin(angle), 9)
