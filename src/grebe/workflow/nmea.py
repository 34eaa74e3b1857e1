"""A boat that speaks NMEA 0183, by its URL."""

from __future__ import annotations

from typing import TYPE_CHECKING

from grebe.links.nmea.link import NmeaLink, open_nmea
from grebe.links.nmea.settings import settings_of
from grebe.mission.departure import Departure

if TYPE_CHECKING:
    from grebe.workflow.run import BoatAt
    from grebe.workflow.simulated import SimulatedWorld


def nmea_boat(rest: str, world: SimulatedWorld) -> BoatAt:  # noqa: ARG001
    """Return what opens the boat of `nmea:udp:HOST:PORT?out=udp:HOST:PORT` and its like.

    The URL is read at once, and the lines are opened when the mission departs.
    """
    settings = settings_of(rest)

    def boat_at(departure: Departure) -> NmeaLink:
        return open_nmea(settings, departure.survey.frame, departure.vessel)

    return boat_at
