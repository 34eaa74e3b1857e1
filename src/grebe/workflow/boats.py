"""Boats by their URL: `sim:` is the simulated one, `python:FILE.py` one of the user's own; `nmea:`
speaks NMEA 0183, and `replay:FILE` is a recorded one.
"""

from __future__ import annotations

import runpy
from collections.abc import Callable, Mapping
from pathlib import Path

from grebe.core.errors import LinkError
from grebe.workflow.nmea import nmea_boat
from grebe.workflow.replay import replay_boat
from grebe.workflow.run import BoatAt
from grebe.workflow.simulated import SimulatedWorld

# A scheme turns what follows its colon, and the simulated world, into an opener of links.
Scheme = Callable[[str, SimulatedWorld], BoatAt]


def boat_named(url: str, world: SimulatedWorld, more: Mapping[str, Scheme] | None = None) -> BoatAt:
    """Return what opens the link of a URL such as `sim:`; `more` are schemes beside our own.

    `world` is what the simulated boat sails in. Raises `LinkError` for a scheme nobody knows.
    """
    schemes = SCHEMES | dict(more or {})
    scheme, colon, rest = url.partition(":")
    if not colon or scheme not in schemes:
        known = ", ".join(f"{name}:" for name in schemes)
        raise LinkError(f"There is no boat link {url!r}; a link begins with one of {known}.")
    return schemes[scheme](rest, world)


def _simulated(rest: str, world: SimulatedWorld) -> BoatAt:
    if rest:
        raise LinkError(f"The simulated boat is 'sim:' alone; what does {rest!r} mean?")
    return world


def _from_file(rest: str, world: SimulatedWorld) -> BoatAt:  # noqa: ARG001
    """The function `boat_at` that a Python file defines."""
    path = Path(rest)
    if not path.is_file():
        raise LinkError(f"python:{rest}: there is no such file.")
    found: BoatAt | None = runpy.run_path(str(path)).get("boat_at")
    if not callable(found):
        raise LinkError(f"python:{rest}: the file defines no function boat_at(departure).")
    return found


SCHEMES: dict[str, Scheme] = {
    "sim": _simulated,
    "python": _from_file,
    "nmea": nmea_boat,
    "replay": replay_boat,
}
