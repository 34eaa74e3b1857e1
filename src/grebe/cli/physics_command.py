"""grebe physics: simulate Grebe's hull, current and wind for ArduPilot's real firmware."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from grebe.cli import options, output
from grebe.core.errors import UsageError
from grebe.core.vessel import PRESETS, vessel_named
from grebe.io.store import SurveyFile
from grebe.links.physics import PORT
from grebe.simulation.physics import PhysicsSettings
from grebe.workflow.physics import Rehearsal, boat_of, serve_physics


class Servos(options.Pair):
    """The numbers of two outputs: PORT,STARBOARD."""

    def __init__(self) -> None:
        super().__init__("PORT", "STARBOARD")

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[float, float]:
        """Parse; anything but two whole numbers is a usage error."""
        first, second = super().convert(value, param, ctx)
        if first % 1 or second % 1:
            self.fail(f"{value!r} is not of the form {self.name}.", param, ctx)
        return int(first), int(second)


@click.command(name="physics")
@click.option("--vessel", "name", help=f"The hull: {', '.join(PRESETS)}.  [default: the survey's]")
@click.option(
    "--survey", "file", type=options.EXISTING, help="Take hull and start from this survey."
)
@click.option(
    "--current",
    type=options.NORTH_EAST,
    default="0,0",
    show_default=True,
    help="Current, towards north and east [m/s].",
)
@click.option(
    "--wind",
    type=options.NORTH_EAST,
    default="0,0",
    show_default=True,
    help="Wind force, towards north and east [N].",
)
@click.option(
    "--origin",
    type=options.LON_LAT,
    help="Where the boat is at first, and the firmware's home.  [default: the survey's start]",
)
@click.option("--heading", "heading_deg", type=float, help="Heading of the boat at first [deg].")
@click.option(
    "--rate",
    "rate_hz",
    type=float,
    help="Simulation steps per second.  [default: the firmware's SIM_RATE_HZ]",
)
@click.option(
    "--servos",
    type=Servos(),
    default="1,3",
    show_default=True,
    help="Outputs of the port and the starboard thruster (functions 73 and 74).",
)
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option(
    "--port", type=click.IntRange(0, 65535), default=PORT, show_default=True, help="UDP port."
)
@options.json_option
def command(
    name: str | None,
    file: Path | None,
    origin: tuple[float, float] | None,
    heading_deg: float | None,
    host: str,
    port: int,
    as_json: bool,
    **how: Any,
) -> None:
    """Simulate hull and water for ArduPilot's firmware, until Ctrl-C.

    Start the firmware as the first lines of output say; it then sails this hull as if on water.
    """
    if name is None and file is None:
        raise UsageError("No boat is given; give --vessel, or --survey to take it from.")
    vessel = None if name is None else vessel_named(name)
    if file is not None:
        with SurveyFile.open(file) as survey_file:
            planned, start, bow_deg = boat_of(survey_file.survey, str(file))
        vessel = vessel or planned
        origin = origin or start
        heading_deg = bow_deg if heading_deg is None else heading_deg
    assert vessel is not None
    rehearsal = Rehearsal(
        vessel=vessel,
        weather=options.weather_of(how["current"], how["wind"]),
        origin=origin,
        heading_deg=heading_deg or 0.0,
        settings=PhysicsSettings(servos=how["servos"], rate_hz=how["rate_hz"]),
    )
    home = f" --home {rehearsal.home}" if rehearsal.home else ""
    output.note(f"{vessel.name}; start the firmware: ardurover --model JSON:{host}{home}")
    came = serve_physics(rehearsal, host=host, port=port, tell=output.note)
    output.result(came, as_json=as_json, next_command="")
