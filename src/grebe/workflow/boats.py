"""Open boats by their URL.

`sim:` is the simulated boat, `mavlink:ADDRESS` one with an autopilot, `nmea:ADDRESS` one that
speaks NMEA 0183, `replay:FILE` a recorded one, `python:FILE.py` one of the user's own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qsl

from grebe.core.errors import LinkError
from grebe.links.base import BoatLink
from grebe.links.mavlink.settings import MavlinkSettings
from grebe.mission.departure import Departure
from grebe.workflow.own_files import function_of
from grebe.workflow.run import BoatAt
from grebe.workflow.simulated import SimulatedWorld

if TYPE_CHECKING:
    from grebe.core.frames import LocalFrame
    from grebe.core.vessel import Vessel
    from grebe.links.mavlink.link import MavlinkLink

# A real boat is armed only if this, given what is about to happen, returns True.
# The URL of the simulated boat, which is the default.
SIMULATED = "sim:"

Confirm = Callable[[str], bool]


def nobody(_: str) -> bool:
    """Confirm nothing: with nobody to ask, no real boat is armed."""
    return False


@dataclass(frozen=True, kw_only=True)
class Harbour:
    """What a boat may need before it sails.

    `world` is the world that a simulated boat sails in; `confirm` decides whether a real one may
    sail.
    """

    world: SimulatedWorld = field(default_factory=SimulatedWorld)
    confirm: Confirm = nobody


# A scheme turns the text after its colon into a function that opens links.
Scheme = Callable[[str, Harbour], BoatAt]


def boat_named(
    url: str, harbour: Harbour | None = None, more: Mapping[str, Scheme] | None = None
) -> BoatAt:
    """Return the function that opens the link of a URL such as `sim:`.

    `more` are schemes in addition to our own. Raises `LinkError` for an unknown scheme.
    """
    schemes = SCHEMES | dict(more or {})
    scheme, colon, rest = url.partition(":")
    if not colon or scheme not in schemes:
        known = ", ".join(f"{name}:" for name in schemes)
        raise LinkError(f"There is no boat link {url!r}; a link begins with one of {known}.")
    return schemes[scheme](rest, harbour or Harbour())


def simulates(url: str) -> bool | None:
    """Return whether the boat of a URL is simulated; None if only its link can tell."""
    return {"sim": True, "mavlink": False, "nmea": False}.get(url.partition(":")[0])


def _simulated(rest: str, harbour: Harbour) -> BoatAt:
    if rest:
        raise LinkError(f"'sim:' takes nothing after the colon; remove {rest!r}.")
    return harbour.world


def _from_file(rest: str, harbour: Harbour) -> BoatAt:  # noqa: ARG001
    """Return the function `boat_at` that a Python file defines."""
    return function_of(Path(rest), "boat_at", LinkError)


def _nmea(rest: str, harbour: Harbour) -> BoatAt:
    """Return a boat that speaks NMEA 0183, once somebody has confirmed it."""
    from grebe.workflow.nmea import nmea_boat

    return nmea_boat(rest, harbour.confirm)


def _replay(rest: str, harbour: Harbour) -> BoatAt:  # noqa: ARG001
    """Return a recorded survey played back; no boat moves."""
    from grebe.workflow.replay import replay_boat

    return replay_boat(rest)


def _mavlink(rest: str, harbour: Harbour) -> BoatAt:
    """Return an autopilot's link, which is opened, confirmed by somebody, and armed."""
    address, settings = mavlink_address(rest)

    def boat_at(departure: Departure) -> BoatLink:
        link = open_mavlink(address, settings, departure.survey.frame, departure.vessel)
        try:
            link.engage(harbour.confirm)
        except BaseException:
            link.close()
            raise
        return link

    return boat_at


def mavlink_address(rest: str) -> tuple[str, MavlinkSettings]:
    """Split what follows `mavlink:` into the wire's address and the settings after its `?`."""
    if find_spec("pymavlink") is None:
        raise LinkError("MAVLink needs pymavlink; install it with: pip install 'grebe[mavlink]'")
    address, _, query = rest.partition("?")
    given: dict[str, Any] = {}
    for name, value in parse_qsl(query, keep_blank_values=True):
        if name not in MAVLINK_SETTINGS:
            known = ", ".join(MAVLINK_SETTINGS)
            raise LinkError(f"mavlink:{rest}: there is no setting {name!r} (known: {known}).")
        field, kind = MAVLINK_SETTINGS[name]
        try:
            given[field] = kind(value)
        except ValueError:
            raise LinkError(f"mavlink:{rest}: {name} is {value!r}, not a number.") from None
    return address, MavlinkSettings(**given)


def open_mavlink(
    address: str, settings: MavlinkSettings, frame: LocalFrame | None, hull: Vessel
) -> MavlinkLink:
    """Find the autopilot at an address; it is neither armed nor commanded yet.

    Without a frame, places are relative to the autopilot's own origin.
    """
    from grebe.links.mavlink.link import open_link
    from grebe.links.wires import wire_at

    return open_link(wire_at(address), frame, hull, settings)


# Settings of a MAVLink URL: the name in the URL, the field that it sets, and how it is read.
MAVLINK_SETTINGS: dict[str, tuple[str, Callable[[str], Any]]] = {
    "drive": ("drive", str),
    "system": ("system", int),
    "silence": ("silence_s", float),
    "find": ("find_s", float),
    "settle": ("settle_s", float),
    "surge-lag": ("surge_lag_s", float),
    "yaw-lag": ("yaw_lag_s", float),
}
MAVLINK_SCHEME = "mavlink"
SCHEMES: dict[str, Scheme] = {
    "sim": _simulated,
    MAVLINK_SCHEME: _mavlink,
    "nmea": _nmea,
    "replay": _replay,
    "python": _from_file,
}
