"""Rehearse with real firmware: a survey's boat, or a preset's, is the physics under it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from grebe.core.dynamics import CALM, Weather
from grebe.core.errors import PlanError, UsageError
from grebe.core.frames import LocalFrame
from grebe.core.survey import Survey
from grebe.core.vessel import Vessel
from grebe.links.physics import PORT, PhysicsServer
from grebe.simulation.physics import Physics, PhysicsSettings

USUAL = PhysicsSettings()


@dataclass(frozen=True, kw_only=True)
class Rehearsal:
    """A boat for the firmware.

    It consists of its hull, the weather, its place (longitude, latitude [deg]; the firmware's home)
    and its heading [deg]. Raises `UsageError` for an impossible place.
    """

    vessel: Vessel
    weather: Weather = CALM
    origin: tuple[float, float] | None = None
    heading_deg: float = 0.0
    settings: PhysicsSettings = USUAL

    def __post_init__(self) -> None:
        if self.origin is not None:
            LocalFrame(origin_lon_deg=self.origin[0], origin_lat_deg=self.origin[1])
        if not math.isfinite(self.heading_deg):
            raise UsageError(f"A heading of {self.heading_deg} is not a number of degrees.")

    @property
    def home(self) -> str:
        """The firmware's home in the form of its own option; empty if no place is given."""
        if self.origin is None:
            return ""
        lon, lat = self.origin
        return f"{lat:.7f},{lon:.7f},0,{self.heading_deg % 360:.0f}"


def boat_of(survey: Survey, name: str) -> tuple[Vessel, tuple[float, float], float]:
    """Return a survey's vessel, its start (longitude, latitude [deg]) and heading there [deg].

    Raises `PlanError` if the survey was never planned.
    """
    if survey.vessel is None or survey.start is None:
        raise PlanError(f"{name} has no vessel and no start; plan a survey first.")
    start = survey.start
    lon, lat = survey.frame.to_wgs84((start.north_m, start.east_m)).tolist()
    return survey.vessel, (lon, lat), math.degrees(start.heading_rad)


def serve_physics(
    rehearsal: Rehearsal,
    *,
    host: str = "127.0.0.1",
    port: int = PORT,
    tell: Callable[[str], None] = lambda _: None,
    stopped: Callable[[], bool] = lambda: False,
) -> dict[str, Any]:
    """Simulate the physics under a firmware, until `stopped` returns True or Ctrl-C is pressed.

    Returns counts of what was served. Raises `LinkError` if the port is taken.
    """
    physics = Physics(
        rehearsal.vessel,
        rehearsal.weather,
        rehearsal.settings,
        heading_rad=math.radians(rehearsal.heading_deg),
    )
    server = PhysicsServer(physics, host, port, tell)
    tell("listening at {}:{}".format(*server.address))
    try:
        server.serve(stopped)
    except KeyboardInterrupt:
        tell("interrupted")
    return {
        "starts": physics.starts,
        "frames": physics.frames,
        "frames_lost": physics.lost,
        "foreign_packets": server.foreign,
        "boat_time_s": round(physics.plant.time_s, 3),
    }
