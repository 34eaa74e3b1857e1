"""Read a drive from a log of an ArduPilot boat: telemetry (.tlog) or DataFlash (.bin).

States come from the autopilot's own filter, commands from the pulses that went to the thrusters,
which are right in any mode of the boat. Both logs contain the boat's parameters, which say which
output drives which thruster and where its neutral is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import InputError
from grebe.core.frames import LocalFrame
from grebe.identification.drive_log import DriveLog, unwrapped
from grebe.io.readers.log_messages import messages_in

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# SERVOn_FUNCTION of a boat that steers by its thrusters.
LEFT, RIGHT = 73, 74
# Outputs of a BlueBoat and of ArduPilot's skid-steering frames, for logs without parameters.
USUAL_OUTPUTS = (1, 3)
OUTPUTS = 16
_TELEMETRY = ["LOCAL_POSITION_NED", "ATTITUDE", "SERVO_OUTPUT_RAW", "PARAM_VALUE"]
_DATAFLASH = ["XKF1", "NKF1", "ATT", "POS", "IMU", "RCOU", "PARM"]


@dataclass
class _Rows:
    """The rows gathered from the messages, by the log's own clock [s]."""

    places: list[tuple[float, ...]] = field(default_factory=list[tuple[float, ...]])
    headings: list[tuple[float, ...]] = field(default_factory=list[tuple[float, ...]])
    pulses: list[tuple[float, ...]] = field(default_factory=list[tuple[float, ...]])
    parameters: dict[str, float] = field(default_factory=dict[str, float])


def read_telemetry(path: Path) -> DriveLog:
    """Read a .tlog; `InputError` says what is missing in it."""
    rows = _Rows()
    source = 0
    for message in messages_in(path, _TELEMETRY):
        kind = message.get_type()
        source = source or message.get_srcSystem()
        if message.get_srcSystem() != source:
            continue
        if kind == "LOCAL_POSITION_NED":
            at = message.time_boot_ms / 1e3
            rows.places.append((at, message.x, message.y, message.vx, message.vy))
        elif kind == "ATTITUDE":
            rows.headings.append((message.time_boot_ms / 1e3, message.yaw, message.yawspeed))
        elif kind == "SERVO_OUTPUT_RAW":
            pulses = [getattr(message, f"servo{i}_raw", 0) for i in range(1, OUTPUTS + 1)]
            # Its clock has 32 bits of microseconds: it starts again every 71 minutes.
            rows.pulses.append((message.time_usec / 1e6, *map(float, pulses)))
        elif kind == "PARAM_VALUE":
            rows.parameters[str(message.param_id)] = float(message.param_value)
    rows.pulses = _without_wraps(rows.pulses, 2**32 / 1e6)
    return _log(path, rows)


def read_dataflash(path: Path) -> DriveLog:
    """Read a .bin; `InputError` says what is missing in it."""
    rows = _Rows()
    filtered: list[tuple[float, ...]] = []
    attitudes: list[tuple[float, ...]] = []
    fixes: list[tuple[float, ...]] = []
    rates: list[tuple[float, float]] = []
    for message in messages_in(path, _DATAFLASH):
        kind = message.get_type()
        if kind == "PARM":
            rows.parameters[str(message.Name)] = float(message.Value)
            continue
        at = message.TimeUS / 1e6
        if kind in ("XKF1", "NKF1") and getattr(message, "C", 0) == 0:
            filtered.append((at, message.PN, message.PE, message.VN, message.VE))
            rows.headings.append((at, math.radians(message.Yaw), math.nan))
        elif kind == "ATT":
            attitudes.append((at, math.radians(message.Yaw), math.nan))
        elif kind == "POS":
            fixes.append((at, message.Lng, message.Lat))
        elif kind == "IMU" and getattr(message, "I", 0) == 0:
            rates.append((at, message.GyrZ))
        elif kind == "RCOU":
            pulses = [float(getattr(message, f"C{i}", 0)) for i in range(1, OUTPUTS + 1)]
            rows.pulses.append((at, *pulses))
    rows.places = filtered or _places(fixes)
    rows.headings = _with_rates(rows.headings or attitudes, rates)
    return _log(path, rows)


def _without_wraps(rows: list[tuple[float, ...]], period_s: float) -> list[tuple[float, ...]]:
    out: list[tuple[float, ...]] = []
    turns, before = 0, -math.inf
    for at, *rest in rows:
        turns += at < before - period_s / 2
        before = at
        out.append((at + turns * period_s, *rest))
    return out


def _places(fixes: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """Return fixes in degrees as metres relative to the first; their velocities are unknown."""
    if not fixes:
        return []
    table = np.array(fixes)
    frame = LocalFrame(origin_lon_deg=float(table[0, 1]), origin_lat_deg=float(table[0, 2]))
    local = frame.to_local(table[:, 1:])
    return [
        (float(at), float(north), float(east), math.nan, math.nan)
        for at, (north, east) in zip(table[:, 0], local, strict=True)
    ]


def _with_rates(
    headings: list[tuple[float, ...]], rates: list[tuple[float, float]]
) -> list[tuple[float, ...]]:
    """Return headings with the gyroscope's yaw rate, averaged around each of them."""
    if not headings or len(rates) < 2:
        return headings
    table = np.array(rates)
    turned = np.concatenate(
        [[0.0], np.cumsum(np.diff(table[:, 0]) * (table[1:, 1] + table[:-1, 1]) / 2)]
    )
    at = np.array([row[0] for row in headings])
    half = float(np.median(np.diff(at))) / 2 if len(at) > 1 else 0.05
    begins = np.clip(at - half, table[0, 0], table[-1, 0])
    ends = np.clip(at + half, table[0, 0], table[-1, 0])
    turn = np.interp(ends, table[:, 0], turned) - np.interp(begins, table[:, 0], turned)
    means = turn / np.where(ends > begins, ends - begins, np.nan)
    return [(row[0], row[1], float(mean)) for row, mean in zip(headings, means, strict=True)]


def _log(path: Path, rows: _Rows) -> DriveLog:
    for what, found in (
        ("positions (LOCAL_POSITION_NED, or XKF1 or POS)", rows.places),
        ("attitudes (ATTITUDE, or XKF1 or ATT)", rows.headings),
        ("outputs to the thrusters (SERVO_OUTPUT_RAW, or RCOU)", rows.pulses),
    ):
        if not found:
            raise InputError(f"{path} holds no {what}; set the autopilot to log them at 10 Hz.")
    places, headings = _in_order(rows.places), _in_order(rows.headings)
    pulses = _in_order(rows.pulses)
    first = max(places[0, 0], headings[0, 0])
    # Headings and pulses share one clock: the autopilot's time since its start.
    times, states = _states(places, headings)
    later = times >= first
    return DriveLog(
        name=path.name,
        times=times[later] - first,
        states=states[later],
        command_times=pulses[:, 0] - first,
        commands=_throttles(pulses[:, 1:], rows.parameters),
        unit="throttle",
    )


def _in_order(rows: list[tuple[float, ...]]) -> Array:
    table = np.array(rows, dtype=float)
    return table[np.argsort(table[:, 0], kind="stable")]


def _states(places: Array, headings: Array) -> tuple[Array, Array]:
    """Return states (n, 6) at the times of either, with NaN for the columns of the other."""
    yaw = unwrapped(headings[:, 1])
    there = np.interp(places[:, 0], headings[:, 0], yaw)
    cos, sin = np.cos(there), np.sin(there)
    north_speed, east_speed = places[:, 3], places[:, 4]
    moves = np.full((len(places), 6), np.nan)
    moves[:, :2] = places[:, 1:3]
    moves[:, 3] = cos * north_speed + sin * east_speed
    moves[:, 4] = cos * east_speed - sin * north_speed
    turns = np.full((len(headings), 6), np.nan)
    turns[:, 2], turns[:, 5] = yaw, headings[:, 2]
    times = np.concatenate([places[:, 0], headings[:, 0]])
    order = np.argsort(times, kind="stable")
    return times[order], np.vstack([moves, turns])[order]


def _throttles(pulses: Array, parameters: dict[str, float]) -> Array:
    """Return the throttles (m, 2) of port and starboard from the pulses (m, outputs) [us]."""
    functions = {int(parameters.get(f"SERVO{i}_FUNCTION", 0)): i for i in range(OUTPUTS, 0, -1)}
    outputs = (functions.get(LEFT, USUAL_OUTPUTS[0]), functions.get(RIGHT, USUAL_OUTPUTS[1]))
    return np.column_stack([_throttle(pulses[:, i - 1], i, parameters) for i in outputs])


def _throttle(pulses: Array, output: int, parameters: dict[str, float]) -> Array:
    def of(name: str, usual: float) -> float:
        return parameters.get(f"SERVO{output}_{name}", usual)

    low, middle, high = of("MIN", 1100.0), of("TRIM", 1500.0), of("MAX", 1900.0)
    above = (pulses - middle) / max(high - middle, 1.0)
    below = (pulses - middle) / max(middle - low, 1.0)
    throttle = np.clip(np.where(pulses >= middle, above, below), -1.0, 1.0)
    # An output without pulses is off.
    throttle = np.where(pulses == 0, 0.0, throttle)
    return -throttle if of("REVERSED", 0.0) else throttle
