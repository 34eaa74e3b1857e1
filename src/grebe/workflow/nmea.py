"""A boat that speaks NMEA 0183, by its URL."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from typing import TYPE_CHECKING

from grebe.core.errors import LinkError, StoppedError
from grebe.mission.departure import Departure

if TYPE_CHECKING:
    from grebe.links.nmea.link import NmeaLink
    from grebe.workflow.run import BoatAt


def nmea_boat(rest: str, confirm: Callable[[str], bool]) -> BoatAt:
    """Return the function that opens the boat of a URL.

    The URL has a form such as `nmea:udp:HOST:PORT?out=udp:HOST:PORT`.

    The URL is read at once. The lines are opened when the mission departs, and no thrust is sent
    before somebody has confirmed it.
    """
    from grebe.links.nmea.link import open_nmea
    from grebe.links.nmea.settings import settings_of

    if importlib.util.find_spec("pynmea2") is None:
        raise LinkError("NMEA needs pynmea2; install it with: pip install 'grebe[nmea]'")
    settings = settings_of(rest)

    def boat_at(departure: Departure) -> NmeaLink:
        link = open_nmea(settings, departure.survey.frame, departure.vessel)
        said = f"This sends thrusts to the boat at {settings.source}, which then drives by itself."
        if not confirm(said):
            link.close()
            raise StoppedError("No command was sent: nobody confirmed the start.")
        return link

    return boat_at
