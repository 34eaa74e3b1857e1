"""Stop a MAVLink boat without the mission that steered it.

The messages do not hinder a pilot: an order to stand still counts only while the boat follows
orders, and released sticks are the pilot's again. An autopilot may also stop by itself, three
seconds after the last order; this stop is sooner, and also works for autopilots that do not.
"""

from __future__ import annotations

import time

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from grebe.links.base import IDLE
from grebe.links.mavlink.orders import motion_order, sticks_released
from grebe.links.mavlink.station import OUR_COMPONENT, OUR_SYSTEM
from grebe.links.wires import wire_at

TIMES, BETWEEN_S = 10, 0.1


def stop(address: str, system: float, component: float, drive: str) -> None:
    """Order the boat at an address to stand still, several times in case messages are lost."""
    wire = wire_at(address)
    codec = mavlink.MAVLink(None, OUR_SYSTEM, OUR_COMPONENT)
    boat = (int(system), int(component))
    message = motion_order(boat, IDLE, 0) if drive == "motion" else sticks_released(boat)
    try:
        for _ in range(TIMES):
            wire.send(message.pack(codec))
            time.sleep(BETWEEN_S)
    finally:
        wire.close()
