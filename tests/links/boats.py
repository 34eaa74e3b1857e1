"""MAVLink boats for the tests: a stand-in autopilot at the other end of a line in memory."""

from __future__ import annotations

import struct

from conftest import square_survey
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from grebe.control.controller import Controller
from grebe.core.dynamics import CALM
from grebe.links.mavlink.link import open_link
from grebe.links.mavlink.rehearsal import NO_RADIO_FAULTS, MemoryWire
from grebe.links.mavlink.settings import MavlinkSettings
from grebe.links.mavlink.standin import StandIn
from grebe.mission.events.recorders import MemoryRecorder
from grebe.mission.loop import Mission
from grebe.simulation.autopilot import NO_UPSETS, Autopilot, AutopilotSettings, Mode
from grebe.simulation.plant import Plant

SURVEY = square_survey(side_m=30.0)
EXACT = {"position_error_m": 0.0, "heading_error_rad": 0.0, "velocity_error_mps": 0.0}
# The autopilot was switched on here, 30 m from the survey's own origin.
SWITCHED_ON = (-30.0, 5.0)


def standin(survey=SURVEY, weather=CALM, faults=NO_UPSETS, parameters=None, **settings):
    """A stand-in at the survey's start."""
    plant = Plant(survey.vessel, survey.start.at_rest(), weather)
    lon, lat = survey.frame.to_wgs84(SWITCHED_ON).tolist()
    autopilot = Autopilot(plant, AutopilotSettings(**settings), faults)
    return StandIn(autopilot, survey.frame, (lon, lat), parameters)


PX4_MODES = {Mode.GUIDED: 6 << 16, Mode.HOLD: 4 << 16 | 3 << 24, Mode.MANUAL: 1 << 16}


class Px4StandIn(StandIn):
    """The stand-in with the behaviour of PX4: modes of two numbers, OFFBOARD only while orders
    come, and integers sent as a float's bytes.
    """

    def __init__(self, boat):
        super().__init__(boat.autopilot, boat._frame, boat._origin_lonlat)
        self.parameters["COM_LOW_BAT_ACT"] = struct.unpack("<f", struct.pack("<i", 2))[0]
        self.refused = 0

    def _heartbeat(self):
        message = super()._heartbeat()
        message.autopilot = mavlink.MAV_AUTOPILOT_PX4
        message.custom_mode = PX4_MODES[self.autopilot.mode]
        return message

    def _change_mode(self, message):
        number = int(message.param2) << 16 | int(message.param3) << 24
        mode = next(mode for mode, one in PX4_MODES.items() if one == number)
        fresh = self.autopilot.time_s - self.autopilot._asked.at_s < 0.5
        if mode is Mode.GUIDED and not fresh:
            self.refused += 1
            return mavlink.MAV_RESULT_DENIED
        asked = self.autopilot._asked
        self.autopilot.set_mode(mode)
        self.autopilot._asked = asked
        return mavlink.MAV_RESULT_ACCEPTED

    def _send_parameter(self, name):
        if name != "COM_LOW_BAT_ACT":
            super()._send_parameter(name)
            return
        self._send(
            mavlink.MAVLink_param_value_message(
                name.encode(), self.parameters[name], mavlink.MAV_PARAM_TYPE_INT32, 1, 0
            )
        )


def line_to(boat, radio=NO_RADIO_FAULTS, watch=lambda _: None):
    """A line to a stand-in whose position has become good."""
    wire = MemoryWire(boat, radio, watch)
    while not boat.autopilot.knows_position and boat.autopilot.time_s < 60:
        wire.sail()
    return wire


def linked(
    boat=None,
    radio=NO_RADIO_FAULTS,
    survey=SURVEY,
    drive="motion",
    watch=lambda _: None,
    **settings,
):
    """A link that has taken its boat over."""
    wire = line_to(boat or standin(survey), radio, watch)
    link = open_link(wire, survey.frame, survey.vessel, MavlinkSettings(drive=drive, **settings))
    link.engage(lambda _: True)
    return link


def sail(link, survey=SURVEY):
    """Sail a complete mission; return its report and its recorder."""
    recorder = MemoryRecorder()
    helm = Controller(link.model, survey.sets, corridors=survey.corridors)
    return Mission(survey, helm, link, recorder).run(), recorder
