"""Boats behind MAVLink for the tests: a stand-in autopilot at the other end of a line in memory."""

from __future__ import annotations

from conftest import square_survey

from grebe.control.controller import Controller
from grebe.core.dynamics import CALM
from grebe.links.mavlink.link import MavlinkSettings, open_link
from grebe.links.mavlink.rehearsal import CLEAR, MemoryWire
from grebe.links.mavlink.standin import StandIn
from grebe.mission.loop import Mission
from grebe.mission.recorders import MemoryRecorder
from grebe.simulation.autopilot import NO_FAULTS, Autopilot, AutopilotSettings
from grebe.simulation.plant import Plant

SURVEY = square_survey(side_m=30.0)
EXACT = {"position_error_m": 0.0, "heading_error_rad": 0.0, "velocity_error_mps": 0.0}
# The autopilot was switched on here, 30 m from the survey's own origin.
SWITCHED_ON = (-30.0, 5.0)


def standin(survey=SURVEY, weather=CALM, faults=NO_FAULTS, parameters=None, **settings):
    """A stand-in at the survey's start."""
    plant = Plant(survey.vessel, survey.start.at_rest(), weather)
    lon, lat = survey.frame.to_wgs84(SWITCHED_ON).tolist()
    autopilot = Autopilot(plant, AutopilotSettings(**settings), faults)
    return StandIn(autopilot, survey.frame, (lon, lat), parameters)


def line_to(boat, air=CLEAR, watch=lambda _: None):
    """A line to a stand-in whose position has become good."""
    wire = MemoryWire(boat, air, watch)
    while not boat.autopilot.knows_position and boat.autopilot.time_s < 60:
        wire.sail()
    return wire


def linked(boat=None, air=CLEAR, survey=SURVEY, drive="motion", watch=lambda _: None, **settings):
    """A link that has taken its boat over."""
    wire = line_to(boat or standin(survey), air, watch)
    link = open_link(wire, survey.frame, survey.vessel, MavlinkSettings(drive=drive, **settings))
    link.engage(lambda _: True)
    return link


def sail(link, survey=SURVEY):
    """A whole mission; returns its report and its recorder."""
    recorder = MemoryRecorder()
    helm = Controller(link.model, survey.sets, corridors=survey.corridors)
    return Mission(survey, helm, link, recorder).run(), recorder
