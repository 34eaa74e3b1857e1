"""The link to a MAVLink boat: ArduPilot in GUIDED or under our sticks, PX4 in OFFBOARD.

By default the autopilot's inner loops are used: an order's surge and yaw rate are sent as
SET_POSITION_TARGET_LOCAL_NED in the body frame. With `drive="sticks"` its thrusts are sent as RC
overrides in MANUAL, for a boat whose hull we know better than its autopilot does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from grebe.core.errors import LinkError, StoppedError
from grebe.core.frames import LocalFrame
from grebe.core.inner_loop import braking_share, under_speed_control
from grebe.core.vessel import Vessel
from grebe.links.base import IDLE, NOT_A_STATE, AsDriven, BoatStatus, Observation, Order
from grebe.links.emergency import EmergencyStop
from grebe.links.mavlink.navigation import Fix, Navigator
from grebe.links.mavlink.orders import motion_order, sticks_order, sticks_released
from grebe.links.mavlink.settings import MavlinkSettings
from grebe.links.mavlink.station import Station
from grebe.links.wires import Wire

# Messages by their number, and the rates at which they are requested [Hz].
STREAMS = {
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 10.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 10.0,
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: 5.0,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 2.0,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 2.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: 2.0,
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 2.0,
}
# The messages without which there is no state to steer by.
VITAL = (mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, mavlink.MAVLINK_MSG_ID_ATTITUDE)
# An order is repeated after this long, because a message may be lost [s].
SEND_AGAIN_S = 0.2
# After this long without an estimate an earlier order is no longer repeated [s].
BLIND_S = 1.5


class MavlinkLink:
    """`BoatLink` over a station that has found its autopilot; `open_link` makes one."""

    def __init__(
        self, station: Station, frame: LocalFrame | None, hull: Vessel, settings: MavlinkSettings
    ) -> None:
        self._station = station
        self._navigator = Navigator(frame)
        self._hull = hull
        self._settings = settings
        self._wire = station.wire
        self._opened_s = self._wire.now_s()
        self._order, self._sent_s = IDLE, -math.inf
        self._seen_s = -math.inf
        self._in_charge = self._engaged = self._closed = False

    @property
    def station(self) -> Station:
        """The line to the autopilot, for the preflight checks."""
        return self._station

    @property
    def source(self) -> str:
        """See `BoatLink`."""
        vehicle = self._station.vehicle
        how = (
            "speed and yaw rate held by the autopilot"
            if self.drives_motion
            else "thrusts by stick commands"
        )
        return f"MAVLink, {vehicle.dialect.name}, system {vehicle.system}, {how}"

    @property
    def drives_motion(self) -> bool:
        """Whether orders are sent as speed and yaw rate rather than as thrusts."""
        return self._settings.drive == "motion"

    @property
    def speed_limit_mps(self) -> float:
        """The speed to which the autopilot clamps an order [m/s]; infinite without a limit."""
        vehicle = self._station.vehicle
        known = (vehicle.parameters.get(name) for name in vehicle.dialect.speed_limits)
        return next((value for value in known if value), math.inf)

    @property
    def emergency(self) -> EmergencyStop | None:
        """See `StopsInEmergency`; None on a wire that no other process can use."""
        address, vehicle = self._wire.for_others, self._station.vehicle
        if not address:
            return None
        return EmergencyStop(
            action="grebe.links.mavlink.emergency:stop",
            settings={
                "address": address,
                "system": float(vehicle.system),
                "component": float(vehicle.component),
                "drive": self._settings.drive,
            },
        )

    @property
    def model(self) -> Vessel:
        """The boat to plan for: under inner loops the hull is another plant."""
        if not self.drives_motion:
            return self._hull
        kept = self._settings
        return under_speed_control(
            self._hull,
            speed_max_mps=self.speed_limit_mps,
            surge_lag_s=kept.surge_lag_s,
            yaw_lag_s=kept.yaw_lag_s,
        )

    @property
    def as_driven(self) -> AsDriven:
        """See `DrivenLink`."""
        model, holds = self.model, self.drives_motion
        return AsDriven(
            model=model,
            holds_motion=holds,
            braking_share=braking_share(self._hull, model) if holds else 1.0,
        )

    def prepare(self) -> None:
        """Request the streams, match the clocks, and learn the autopilot's origin.

        Raises `LinkError` if the autopilot does not send what is needed.
        """
        for number, rate_hz in STREAMS.items():
            refused = self._station.command(
                mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, (number, 1e6 / rate_hz)
            )
            if refused and number in VITAL:
                name = mavlink.mavlink_map[number].msgname
                raise LinkError(f"The autopilot does not send {name} ({refused}).")
        self._station.match_clocks()
        self._find_origin()
        for name in self._station.vehicle.dialect.speed_limits:
            if self._station.parameter(name):
                break

    def engage(self, confirm: Callable[[str], bool]) -> None:
        """Arm the boat and take it over, once somebody has confirmed it.

        Raises `StoppedError` without a confirmation, and `LinkError` if the autopilot refuses.
        """
        vehicle = self._station.vehicle
        dialect = vehicle.dialect
        mode = dialect.follows if self.drives_motion else dialect.manual
        if not confirm(
            f"This arms the boat ({dialect.name}, system {vehicle.system}), changes its mode from "
            f"{vehicle.mode_name} to {dialect.mode_name(mode)}, and lets it drive by itself."
        ):
            raise StoppedError("The boat was not armed: nobody confirmed the start.")
        self._in_charge = True
        if dialect.asks_orders_first:
            self._repeat_idle(1.0)
        self._switch(mode)
        if not vehicle.armed:
            self._arm()
        self._engaged = True

    def observe(self) -> Observation:
        """See `BoatLink`; a position that the autopilot does not trust becomes not a number."""
        if self._closed:
            raise LinkError("The line to the autopilot has been closed.")
        while True:
            self._repeat()
            fix: Fix | None = None
            for message in self._station.messages(0.05):
                fix = self._learn(message) or fix
            if self._station.restarted:
                return self._after_restart()
            if fix is not None:
                return self._handed_over(fix)
            silent_s = self._wire.now_s() - max(self._station.vehicle.heard_s, self._opened_s)
            if silent_s > self._settings.silence_s:
                raise LinkError(f"The autopilot has been silent for {silent_s:.0f} s.")

    def command(self, order: Order) -> None:
        """See `BoatLink`."""
        self._order = order
        self._send(order)

    def measure(self) -> Mapping[str, float]:
        """Return nothing: an autopilot has no sonde."""
        return {}

    def status(self) -> BoatStatus:
        """See `BoatLink`."""
        vehicle = self._station.vehicle
        return BoatStatus(
            mode=vehicle.mode_name,
            armed=vehicle.armed,
            battery_share=vehicle.battery_share,
            fix=vehicle.fix_name,
            age_s=max(0.0, self._wire.now_s() - vehicle.heard_s),
            stop_request=self._why_to_stop() if self._engaged else "",
        )

    def stop(self) -> None:
        """See `BoatLink`: order no motion, and let the autopilot hold without thrust.

        A boat that somebody else has taken over stays in the mode of their choice.
        """
        self.command(IDLE)
        if self._in_command:
            self._ask_mode(self._station.vehicle.dialect.holds)

    def close(self) -> None:
        """See `BoatLink`; leave the boat in its hold mode, and armed if it is."""
        if self._closed:
            return
        self._closed = True
        try:
            if self._engaged and self._in_command:
                self.command(IDLE)
                self._mode_taken(self._station.vehicle.dialect.holds, timeout_s=3.0)
            self._release_sticks()
        except LinkError:
            pass
        finally:
            self._wire.close()

    @property
    def _in_command(self) -> bool:
        dialect = self._station.vehicle.dialect
        mode = dialect.follows if self.drives_motion else dialect.manual
        return self._station.vehicle.mode == mode

    def _why_to_stop(self) -> str:
        vehicle = self._station.vehicle
        if self._station.restarted:
            return "the autopilot has restarted; check it, then resume"
        if not self._in_command:
            last = f' ("{vehicle.texts[-1]}")' if vehicle.texts else ""
            return f"the pilot or a fail-safe took over: mode {vehicle.mode_name}{last}"
        return "" if vehicle.armed else "the boat was disarmed"

    def _learn(self, message: Any) -> Fix | None:
        """Pass a message to the navigator, except a place that the autopilot does not trust."""
        is_place = message.get_type() == "GLOBAL_POSITION_INT"
        if is_place and not self._station.vehicle.position_good:
            return None
        return self._navigator.take(message)

    def _handed_over(self, fix: Fix) -> Observation:
        now_s = self._wire.now_s()
        self._seen_s = now_s
        age_s = max(0.0, now_s - self._station.clock.ours(fix.boot_s))
        state = NOT_A_STATE if self._station.vehicle.position_good is False else fix.state
        return Observation(time_s=now_s - self._opened_s, state=state, age_s=age_s)

    def _after_restart(self) -> Observation:
        """Return an estimate without a state, so that the mission can ask why it should stop."""
        self._navigator.restart()
        return Observation(time_s=self._wire.now_s() - self._opened_s, state=NOT_A_STATE)

    def _find_origin(self) -> None:
        def learned(message: Any) -> bool:
            self._learn(message)
            return self._navigator.has_origin

        wanted = mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN
        vehicle = self._station.vehicle
        found = self._station.ask(
            lambda: mavlink.MAVLink_command_long_message(
                vehicle.system, vehicle.component, mavlink.MAV_CMD_REQUEST_MESSAGE, 0,
                wanted, 0, 0, 0, 0, 0, 0,
            ),
            learned,
            self._settings.settle_s,
        )  # fmt: skip
        if found is None:
            raise LinkError(
                "The autopilot does not know its position yet (no origin); wait for a fix and "
                "for its filter to settle, then try again."
            )

    def _switch(self, mode: int) -> None:
        refused = self._mode_taken(mode, timeout_s=5.0)
        vehicle = self._station.vehicle
        if refused:
            last = f' It said: "{vehicle.texts[-1]}".' if vehicle.texts else ""
            raise LinkError(
                f"The autopilot stays in {vehicle.mode_name} and does not enter "
                f"{vehicle.dialect.mode_name(mode)} ({refused}).{last}"
            )

    def _mode_taken(self, mode: int, timeout_s: float) -> str:
        """Change the mode and wait until a heartbeat confirms it; return why it was not changed, or
        an empty string.
        """
        vehicle = self._station.vehicle
        if vehicle.mode == mode:
            return ""
        refusal = self._station.command(
            mavlink.MAV_CMD_DO_SET_MODE,
            (mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, *vehicle.dialect.mode_command(mode)),
            timeout_s,
        )
        end_s = self._wire.now_s() + timeout_s
        while vehicle.mode != mode and not refusal and self._wire.now_s() < end_s:
            self._repeat()
            for _ in self._station.messages(0.1):
                pass
        return refusal or ("" if vehicle.mode == mode else "it accepted, but did not change")

    def _ask_mode(self, mode: int) -> None:
        """Request a mode without waiting, more than once because a message may be lost."""
        vehicle = self._station.vehicle
        custom = float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
        main, sub = vehicle.dialect.mode_command(mode)
        for again in range(3):
            self._station.send(
                mavlink.MAVLink_command_long_message(
                    vehicle.system, vehicle.component, mavlink.MAV_CMD_DO_SET_MODE, again,
                    custom, main, sub, 0, 0, 0, 0,
                )
            )  # fmt: skip

    def _arm(self) -> None:
        vehicle = self._station.vehicle
        refused = self._station.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,))
        end_s = self._wire.now_s() + 3.0
        while not vehicle.armed and not refused and self._wire.now_s() < end_s:
            self._repeat()
            for _ in self._station.messages(0.1):
                pass
        if not vehicle.armed:
            last = f' It said: "{vehicle.texts[-1]}".' if vehicle.texts else ""
            raise LinkError(f"The boat does not arm ({refused or 'no reason given'}).{last}")

    def _repeat_idle(self, seconds: float) -> None:
        end_s = self._wire.now_s() + seconds
        while self._wire.now_s() < end_s:
            self._repeat()
            for _ in self._station.messages(0.05):
                pass

    def _repeat(self) -> None:
        """Repeat the order, which may have been lost; a blind boat gets an idle order instead."""
        now_s = self._wire.now_s()
        if not self._in_charge or now_s - self._sent_s < SEND_AGAIN_S:
            return
        if now_s - self._seen_s > BLIND_S:
            self._order = IDLE
        self._send(self._order)

    def _send(self, order: Order) -> None:
        self._sent_s = self._wire.now_s()
        boat = self._station.vehicle.numbers
        if self.drives_motion:
            time_ms = round(1e3 * (self._sent_s - self._opened_s)) % 2**32
            self._station.send(motion_order(boat, order, time_ms))
        else:
            self._station.send(sticks_order(boat, order, self._hull))

    def _release_sticks(self) -> None:
        if not self.drives_motion and self._station.vehicle.system:
            self._station.send(sticks_released(self._station.vehicle.numbers))


def open_link(
    wire: Wire, frame: LocalFrame | None, hull: Vessel, settings: MavlinkSettings | None = None
) -> MavlinkLink:
    """Find an autopilot on a wire and request what a survey needs; it is not armed yet.

    The wire is closed if that fails.
    """
    kept = settings or MavlinkSettings()
    station = Station(wire, kept.system)
    try:
        station.find(kept.find_s)
        link = MavlinkLink(station, frame, hull, kept)
        link.prepare()
    except BaseException:
        wire.close()
        raise
    return link
