"""Orders as MAVLink messages: a motion to follow, or the sticks of a remote control."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from grebe.core.vessel import Vessel
from grebe.links.base import Order

# Use vx and the yaw rate in the body frame; ignore everything else.
MOTION_MASK = 1479
STICK_SPAN_US, STICK_MIDDLE_US = 400, 1500
STICK_STEERING, STICK_THROTTLE = 1, 3
UNTOUCHED, RELEASED = 65_535, 0

# An autopilot's numbers: system and component.
Boat = tuple[int, int]


def motion_order(boat: Boat, order: Order, time_ms: int) -> Any:
    """Return a message with the order's surge and yaw rate over ground, in the body frame."""
    return mavlink.MAVLink_set_position_target_local_ned_message(
        time_ms, *boat, mavlink.MAV_FRAME_BODY_NED, MOTION_MASK,
        0, 0, 0, order.surge_mps, 0, 0, 0, 0, 0, 0, order.yaw_rate_radps,
    )  # fmt: skip


def sticks_order(boat: Boat, order: Order, vessel: Vessel) -> Any:
    """Return a message with the throttle and steering that mix to each thruster's command."""
    port, starboard = (vessel.throttle_of(one) for one in order.thrusts)
    channels = [UNTOUCHED] * 8
    channels[STICK_STEERING - 1] = _pulse((port - starboard) / 2)
    channels[STICK_THROTTLE - 1] = _pulse((port + starboard) / 2)
    return mavlink.MAVLink_rc_channels_override_message(*boat, *channels)


def sticks_released(boat: Boat) -> Any:
    """Return a message that returns the sticks to the pilot."""
    return mavlink.MAVLink_rc_channels_override_message(*boat, *[RELEASED] * 8)


def _pulse(share: float) -> int:
    return STICK_MIDDLE_US + round(STICK_SPAN_US * min(max(share, -1.0), 1.0))
