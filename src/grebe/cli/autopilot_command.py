"""grebe autopilot: stand in for a boat's autopilot, to rehearse a survey without a boat."""

from __future__ import annotations

from pathlib import Path

import click

from grebe.cli import options, output
from grebe.core.errors import PlanError
from grebe.io.store import SurveyFile
from grebe.simulation.autopilot import AutopilotSettings


@click.command(name="autopilot")
@click.argument("file", type=options.EXISTING)
@click.option(
    "--to",
    "address",
    default="127.0.0.1:14550",
    show_default=True,
    help="HOST:PORT to send to, as a boat's telemetry does.",
)
@click.option(
    "--current",
    type=options.NORTH_EAST,
    default="0,0",
    show_default=True,
    help="True current, towards north and east [m/s].",
)
@click.option(
    "--wind",
    type=options.NORTH_EAST,
    default="0,0",
    show_default=True,
    help="True wind force, towards north and east [N].",
)
@click.option(
    "--speed-limit",
    type=click.FloatRange(min=0, min_open=True),
    default=2.0,
    show_default=True,
    help="The autopilot's WP_SPEED [m/s].",
)
@click.option(
    "--ready",
    "ready_s",
    type=click.FloatRange(min=0),
    default=38.0,
    show_default=True,
    help="Time until its position estimate is good [s].",
)
def command(
    file: Path,
    address: str,
    current: tuple[float, float],
    wind: tuple[float, float],
    speed_limit: float,
    ready_s: float,
) -> None:
    """Stand in for the autopilot of FILE's boat, at the survey's start, and speak MAVLink over UDP.

    It behaves like ArduRover in everything that a survey depends on. In another terminal: grebe run
    FILE --link mavlink:udp:127.0.0.1:14550. Ctrl-C ends it.
    """
    from grebe.workflow.standin import serve_stand_in, stand_in

    with SurveyFile.open(file) as survey_file:
        survey = survey_file.survey
    if survey.vessel is None or survey.start is None:
        raise PlanError(f"{file} has no boat and no start; plan a survey first.")
    settings = AutopilotSettings(speed_max_mps=speed_limit, ready_s=ready_s)
    weather = options.weather_of(current, wind)
    boat = stand_in(survey.vessel, survey.frame, survey.start.at_rest(), weather, settings)
    output.note(f"A stand-in for {survey.vessel.name} speaks to {address}; Ctrl-C ends it.")
    serve_stand_in(boat, address, lambda: False)
