"""Stop a boat behind MAVLink without the mission that steered it.

What is sent holds back nobody else: an order to stand still counts only while the boat follows
orders, and sticks that are let go of are the pilot's again. An autopilot stops by itself too, three
seconds after the last order; this is sooner, and for those that do not.
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
    """Tell the boat at an address to stand still, often enough that one is heard."""
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
