"""A stand-in autopilot for rehearsals, which a ground station or a survey can talk to over UDP."""

from __future__ import annotations

from collections.abc import Callable

from grebe.core.dynamics import CALM, Weather
from grebe.core.errors import LinkError
from grebe.core.events import State
from grebe.core.frames import LocalFrame
from grebe.core.vessel import Vessel
from grebe.links.mavlink.rehearsal import serve
from grebe.links.mavlink.standin import StandIn
from grebe.links.wires import UdpWire
from grebe.simulation.autopilot import Autopilot, AutopilotSettings
from grebe.simulation.plant import Plant


def stand_in(
    vessel: Vessel,
    frame: LocalFrame,
    start: State,
    weather: Weather = CALM,
    settings: AutopilotSettings | None = None,
) -> StandIn:
    """Return a boat at `start` whose autopilot was switched on there."""
    autopilot = Autopilot(Plant(vessel, start, weather), settings or AutopilotSettings())
    lon, lat = frame.to_wgs84(start[:2]).tolist()
    return StandIn(autopilot, frame, (lon, lat))


def serve_stand_in(
    boat: StandIn, address: str, stopped: Callable[[], bool], speed: float = 1.0
) -> None:
    """Run a boat in real time, speaking to HOST:PORT, until it is stopped."""
    host, _, port = address.rpartition(":")
    if not (host and port.isdigit()):
        raise LinkError(f"{address!r} is not a HOST:PORT to send to, such as 127.0.0.1:14550.")
    wire = UdpWire(host, int(port), speaks_first=True)
    try:
        serve(boat, wire, stopped, speed)
    finally:
        wire.close()
