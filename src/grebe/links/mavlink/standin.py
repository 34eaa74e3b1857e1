"""The MAVLink interface of the stand-in autopilot, which behaves as ArduRover's.

Streams run at 1 Hz until another rate is requested. Commands that are not understood are refused as
the protocol prescribes, so that other ground stations can use it too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from grebe.core.frames import LocalFrame
from grebe.simulation.autopilot import Autopilot

SYSTEM, COMPONENT = 1, mavlink.MAV_COMP_ID_AUTOPILOT1
USUAL_S = 1.0
CUSTOM = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
GOOD_FILTER = 0x33F
BLIND_FILTER = 0xA7
USUAL_PARAMETERS = {
    "FRAME_CLASS": 2.0,
    "WP_SPEED": 2.0,
    "FENCE_ENABLE": 1.0,
    "BATT_FS_LOW_ACT": 1.0,
    "FS_EKF_ACTION": 1.0,
    **{f"RC{channel}_DZ": 0.0 for channel in (1, 3)},
    **{f"RC{channel}_MIN": 1100.0 for channel in (1, 3)},
    **{f"RC{channel}_TRIM": 1500.0 for channel in (1, 3)},
    **{f"RC{channel}_MAX": 1900.0 for channel in (1, 3)},
    "SYSID_THISMAV": 1.0,
    "MAV_GCS_SYSID": 255.0,
}


class StandIn:
    """Speaks MAVLink for an `Autopilot` whose plant is in `frame`.

    `origin_lonlat` [deg] is the origin of its filter: the place where the autopilot would be
    switched on, which is not that of any survey.
    """

    def __init__(
        self,
        autopilot: Autopilot,
        frame: LocalFrame,
        origin_lonlat: tuple[float, float],
        parameters: dict[str, float] | None = None,
    ) -> None:
        self.autopilot = autopilot
        self.parameters = USUAL_PARAMETERS | {"WP_SPEED": autopilot.settings.speed_max_mps}
        self.parameters |= parameters or {}
        self._frame = frame
        self._origin_lonlat = origin_lonlat
        north, east = frame.to_local(origin_lonlat).tolist()
        self._origin = (north, east)
        self._codec: Any = mavlink.MAVLink(None, SYSTEM, COMPONENT)
        self._codec.robust_parsing = True
        self._out: list[bytes] = []
        self._told = 0
        self._restart()

    def _restart(self) -> None:
        self._started_s = self.autopilot.started_s
        self._periods = dict.fromkeys(self._streams(), USUAL_S)
        self._next_s = dict.fromkeys(self._periods, self.autopilot.time_s)

    def _streams(self) -> dict[int, Callable[[], Any]]:
        return {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: self._heartbeat,
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._local_position,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: self._attitude,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._global_position,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: self._gps,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: self._sys_status,
            mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: self._filter_status,
            mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: self._servos,
            mavlink.MAVLINK_MSG_ID_FENCE_STATUS: self._fence,
        }

    def receive(self, data: bytes) -> None:
        """Take messages from a ground station."""
        for message in self._codec.parse_buffer(data) or ():
            answer = getattr(self, f"_on_{message.get_type().lower()}", None)
            if answer is not None:
                answer(message)

    def due_messages(self) -> list[bytes]:
        """Return the messages that are due by now, one per entry."""
        autopilot = self.autopilot
        if autopilot.started_s != self._started_s:
            self._restart()
        makers = self._streams()
        for number, period_s in self._periods.items():
            if period_s > 0 and autopilot.time_s >= self._next_s[number] - 1e-9:
                late_s = autopilot.time_s - self._next_s[number]
                self._next_s[number] += period_s * (1 + math.floor(late_s / period_s))
                self._send(makers[number]())
        for text in autopilot.texts[self._told :]:
            self._send(mavlink.MAVLink_statustext_message(4, text.encode()[:50]))
        self._told = len(autopilot.texts)
        said, self._out = self._out, []
        return said

    def _send(self, message: Any) -> None:
        self._out.append(message.pack(self._codec))

    @property
    def _boot_ms(self) -> int:
        return round(1e3 * self.autopilot.boot_s)

    def _heartbeat(self) -> Any:
        armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.autopilot.armed else 0
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_SURFACE_BOAT, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
            CUSTOM | armed, int(self.autopilot.mode), mavlink.MAV_STATE_ACTIVE, 3,
        )  # fmt: skip

    def _estimate(self) -> tuple[float, float, float, float, float, float]:
        """Return north and east of the origin, heading, velocity north and east, and yaw rate."""
        north, east, heading, surge, sway, yaw_rate = self.autopilot.estimate()
        cos, sin = math.cos(heading), math.sin(heading)
        return (
            north - self._origin[0],
            east - self._origin[1],
            math.remainder(heading, 2 * math.pi),
            cos * surge - sin * sway,
            sin * surge + cos * sway,
            yaw_rate,
        )

    def _local_position(self) -> Any:
        north, east, _, v_north, v_east, _ = self._estimate()
        return mavlink.MAVLink_local_position_ned_message(
            self._boot_ms, north, east, 0.0, v_north, v_east, 0.0
        )

    def _attitude(self) -> Any:
        _, _, heading, _, _, yaw_rate = self._estimate()
        return mavlink.MAVLink_attitude_message(
            self._boot_ms, 0.0, 0.0, heading, 0.0, 0.0, yaw_rate
        )

    def _lonlat_e7(self) -> tuple[int, int]:
        north, east, *_ = self._estimate()
        place = (north + self._origin[0], east + self._origin[1])
        lon, lat = self._frame.to_wgs84(place).tolist()
        return round(lon * 1e7), round(lat * 1e7)

    def _global_position(self) -> Any:
        lon, lat = self._lonlat_e7()
        _, _, heading, v_north, v_east, _ = self._estimate()
        return mavlink.MAVLink_global_position_int_message(
            self._boot_ms, lat, lon, 0, 0, round(100 * v_north), round(100 * v_east), 0,
            round(math.degrees(heading) * 100) % 36_000,
        )  # fmt: skip

    def _gps(self) -> Any:
        lon, lat = self._lonlat_e7()
        fix, seen = (3, 14) if self.autopilot.has_fix else (1, 0)
        return mavlink.MAVLink_gps_raw_int_message(
            1000 * self._boot_ms, fix, lat, lon, 0, 90, 120, 0, 65_535, seen
        )

    def _sys_status(self) -> Any:
        share = round(100 * self.autopilot.battery_share)
        return mavlink.MAVLink_sys_status_message(
            0, 0, 0, 100, 14_800, 500, share, 0, 0, 0, 0, 0, 0
        )

    def _filter_status(self) -> Any:
        flags = GOOD_FILTER if self.autopilot.knows_position else BLIND_FILTER
        return mavlink.MAVLink_ekf_status_report_message(flags, 0.1, 0.1, 0.1, 0.1, 0.1)

    def _servos(self) -> Any:
        vessel = self.autopilot.plant.vessel
        port, starboard = (
            1500 + round(400 * vessel.throttle_of(one)) for one in self.autopilot.plant.thrusts
        )
        return mavlink.MAVLink_servo_output_raw_message(
            1000 * self._boot_ms % 2**32, 0, port, 0, starboard, 0, 0, 0, 0, 0
        )

    def _fence(self) -> Any:
        breached = int(self.autopilot.breached)
        return mavlink.MAVLink_fence_status_message(breached, breached, 3 * breached, 0)

    def _on_timesync(self, message: Any) -> None:
        if message.tc1 == 0:
            boot_ns = round(1e9 * self.autopilot.boot_s)
            self._send(mavlink.MAVLink_timesync_message(boot_ns, message.ts1))

    def _on_command_long(self, message: Any) -> None:
        number = message.command
        handlers: dict[int, Callable[[Any], int]] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm,
            mavlink.MAV_CMD_DO_SET_MODE: self._change_mode,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._send_once,
        }
        handler = handlers.get(number)
        result = handler(message) if handler else mavlink.MAV_RESULT_UNSUPPORTED
        self._send(mavlink.MAVLink_command_ack_message(number, result))

    def _arm(self, message: Any) -> int:
        refusal = self.autopilot.arm(arms=message.param1 == 1)
        if refusal:
            self.autopilot.texts.append(refusal)
        return mavlink.MAV_RESULT_FAILED if refusal else mavlink.MAV_RESULT_ACCEPTED

    def _change_mode(self, message: Any) -> int:
        done = self.autopilot.set_mode(int(message.param2))
        return mavlink.MAV_RESULT_ACCEPTED if done else mavlink.MAV_RESULT_FAILED

    def _set_interval(self, message: Any) -> int:
        number, microseconds = int(message.param1), message.param2
        if number not in self._periods:
            return mavlink.MAV_RESULT_DENIED
        self._periods[number] = USUAL_S if microseconds == 0 else max(0.0, 1e-6 * microseconds)
        self._next_s[number] = self.autopilot.time_s
        return mavlink.MAV_RESULT_ACCEPTED

    def _send_once(self, message: Any) -> int:
        number = int(message.param1)
        if number == mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN:
            if not self.autopilot.knows_position:
                return mavlink.MAV_RESULT_FAILED
            lon, lat = (round(1e7 * one) for one in self._origin_lonlat)
            self._send(mavlink.MAVLink_gps_global_origin_message(lat, lon, 0))
        elif number == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            self._send(
                mavlink.MAVLink_autopilot_version_message(
                    0, 0x04_06_00_FF, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0
                )
            )
        elif number in self._periods:
            self._send(self._streams()[number]())
        else:
            return mavlink.MAV_RESULT_DENIED
        return mavlink.MAV_RESULT_ACCEPTED

    def _on_set_mode(self, message: Any) -> None:
        self.autopilot.set_mode(message.custom_mode)

    def _on_set_position_target_local_ned(self, message: Any) -> None:
        uses_motion = not message.type_mask & (8 | 2048)
        if uses_motion and message.coordinate_frame == mavlink.MAV_FRAME_BODY_NED:
            self.autopilot.follow(message.vx, message.yaw_rate)

    def _on_rc_channels_override(self, message: Any) -> None:
        if message.get_srcSystem() != self.parameters["MAV_GCS_SYSID"]:
            return
        steering, throttle = message.chan1_raw, message.chan3_raw
        if 0 < steering < 65_535 and 0 < throttle < 65_535:
            self.autopilot.take_sticks((steering - 1500) / 400, (throttle - 1500) / 400)

    def _on_request_data_stream(self, message: Any) -> None:
        """Set all streams to one rate, the older kind of request."""
        if message.start_stop and message.req_message_rate:
            period_s = 1.0 / message.req_message_rate
            self._periods = {number: min(period_s, USUAL_S) for number in self._periods}

    def _on_param_request_read(self, message: Any) -> None:
        names = list(self.parameters)
        name = message.param_id
        if message.param_index >= 0 and message.param_index < len(names):
            name = names[message.param_index]
        if name in self.parameters:
            self._send_parameter(name)

    def _on_param_request_list(self, message: Any) -> None:  # noqa: ARG002
        for name in self.parameters:
            self._send_parameter(name)

    def _on_param_set(self, message: Any) -> None:
        if message.param_id in self.parameters:
            self.parameters[message.param_id] = message.param_value
            self._send_parameter(message.param_id)

    def _send_parameter(self, name: str) -> None:
        self._send(
            mavlink.MAVLink_param_value_message(
                name.encode(), self.parameters[name], mavlink.MAV_PARAM_TYPE_REAL32,
                len(self.parameters), list(self.parameters).index(name),
            )
        )  # fmt: skip

    def _on_mission_request_list(self, message: Any) -> None:
        self._send(
            mavlink.MAVLink_mission_count_message(
                message.get_srcSystem(), message.get_srcComponent(), 0
            )
        )
