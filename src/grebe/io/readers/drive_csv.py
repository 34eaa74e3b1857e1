"""Read a drive from CSV: one row per instant, columns by name, empty cells for no value.

A row may hold a state, a command, or both; a command holds from its row to the next one.
"""

from __future__ import annotations

import csv
import io
import re
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import InputError
from grebe.core.frames import LocalFrame
from grebe.identification.drive_log import CommandUnit, DriveLog, unwrapped
from grebe.io.readers.text import read_text

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Names of the columns, in lower case with only letters and digits; the first match wins.
COLUMNS: dict[str, str] = {
    "time": r"time(s|stamp|utc)?|t|seconds|elapseds?|unixtimes?",
    "north": r"north(m)?|pn|xnorthm",
    "east": r"east(m)?|pe|yeastm",
    "lat": r"lat(itude)?(deg)?",
    "lon": r"(lon(gitude)?|lng)(deg)?",
    "heading_rad": r"(heading|yaw|psi)rad",
    "heading_deg": r"(heading|yaw|hdg)(deg)?",
    "surge": r"surge(mps|ms)?|u",
    "sway": r"sway(mps|ms)?|v",
    "north_speed": r"(velocitynorth|northspeed|northvelocity|vn|vx)(mps|ms)?",
    "east_speed": r"(velocityeast|eastspeed|eastvelocity|ve|vy)(mps|ms)?",
    "yaw_rate_deg": r"(yawrate|rateofturn|rot|yawspeed)(degps|degs)",
    "yaw_rate": r"(yawrate|yawspeed)(radps|rads)?|r",
    "port_n": r"thrust(port|left)n?|f1n?",
    "starboard_n": r"thrust(starboard|right|stbd)n?|f2n?",
    "port_share": r"throttle(port|left)|(port|left)throttle",
    "starboard_share": r"throttle(starboard|right|stbd)|(starboard|right|stbd)throttle",
    "port_pwm": r"pwm(port|left)(us)?|(port|left)pwm(us)?",
    "starboard_pwm": r"pwm(starboard|right|stbd)(us)?|(starboard|right|stbd)pwm(us)?",
}
# The pulse [us] of a thruster at rest, and the span from there to full thrust.
NEUTRAL_US, SPAN_US = 1500.0, 400.0
# Times larger than this are unix times in milliseconds, not seconds.
LATEST_S = 1e11


def read_drive_csv(path: Path) -> DriveLog:
    """Read a table of states and commands; `InputError` says what is wrong with it."""
    cells = _cells(path)
    if "time" not in cells:
        raise InputError(f"{path}: no column looks like a time; call it time_s.")
    times = _times(path, cells.pop("time"))
    numbers = {key: _numbers(column) for key, column in cells.items()}
    commands, unit = _commands(path, numbers)
    order = np.argsort(times, kind="stable")
    times, commands = times[order], commands[order]
    states = _states(path, numbers)[order]
    shown, told = np.isfinite(states).any(axis=1), np.isfinite(commands).all(axis=1)
    if not shown.any():
        raise InputError(f"{path}: no row holds a state of the boat.")
    first = times[shown][0]
    return DriveLog(
        name=path.name,
        times=times[shown] - first,
        states=_with_whole_heading(states[shown]),
        command_times=times[told] - first,
        commands=commands[told],
        unit=unit,
    )


def _with_whole_heading(states: Array) -> Array:
    states[:, 2] = unwrapped(states[:, 2])
    return states


def _cells(path: Path) -> dict[str, list[str]]:
    """Return the cells of the known columns, by key."""
    text = read_text(path)
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    first = lines[0] if lines else ""
    delimiter = max(",;\t", key=first.count)
    rows = list(csv.reader(io.StringIO("\n".join(lines)), delimiter=delimiter))
    if len(rows) < 2:
        raise InputError(f"{path}: a drive is a row of names and rows of numbers below.")
    names = [re.sub(r"[^a-z0-9]", "", name.lower()) for name in rows[0]]
    found: dict[str, list[str]] = {}
    for key, pattern in COLUMNS.items():
        places = [i for i, name in enumerate(names) if re.fullmatch(pattern, name)]
        if places:
            found[key] = [row[places[0]] if places[0] < len(row) else "" for row in rows[1:]]
    return found


def _numbers(cells: list[str]) -> Array:
    return np.array([_number(cell) for cell in cells])


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")


def _times(path: Path, cells: list[str]) -> Array:
    """Return seconds: numbers are taken as they are, and texts are read as ISO 8601."""
    times = _numbers(cells)
    if np.isnan(times).all():
        times = np.array([_iso_seconds(cell) for cell in cells])
    missing = np.flatnonzero(~np.isfinite(times))
    if len(missing):
        raise InputError(
            f"{path}: row {missing[0] + 1} of the values has the time {cells[missing[0]]!r}; give "
            "seconds or ISO 8601 in every row."
        )
    return times / 1000.0 if times.max() > LATEST_S else times


def _iso_seconds(text: str) -> float:
    try:
        moment = datetime.fromisoformat(text.strip())
    except ValueError:
        return float("nan")
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def _commands(path: Path, numbers: dict[str, Array]) -> tuple[Array, CommandUnit]:
    units: dict[str, CommandUnit] = {"share": "throttle", "pwm": "throttle", "n": "newton"}
    for kind, unit in units.items():
        sides = [f"port_{kind}", f"starboard_{kind}"]
        if all(side in numbers for side in sides):
            both = np.column_stack([numbers[side] for side in sides])
            if kind == "pwm":
                both = np.clip((both - NEUTRAL_US) / SPAN_US, -1.0, 1.0)
            return both, unit
    raise InputError(
        f"{path}: no columns look like commands of both thrusters; call them throttle_port and "
        "throttle_starboard (-1 to 1), or thrust_port_n and thrust_starboard_n."
    )


def _states(path: Path, numbers: dict[str, Array]) -> Array:
    """Return the states (n, 6), NaN where a row has none."""
    nothing = np.full(len(next(iter(numbers.values()))), np.nan)
    heading = numbers.get("heading_rad")
    if heading is None:
        heading = np.radians(numbers.get("heading_deg", nothing))
    if not np.isfinite(heading).any():
        raise InputError(f"{path}: no column looks like a heading; call it heading_deg.")
    north, east = _positions(numbers, nothing)
    surge, sway = numbers.get("surge", nothing), numbers.get("sway", nothing)
    if "north_speed" in numbers and "east_speed" in numbers and "surge" not in numbers:
        vn, ve = numbers["north_speed"], numbers["east_speed"]
        cos, sin = np.cos(heading), np.sin(heading)
        surge, sway = cos * vn + sin * ve, cos * ve - sin * vn
    yaw_rate = numbers.get("yaw_rate")
    if yaw_rate is None:
        yaw_rate = np.radians(numbers.get("yaw_rate_deg", nothing))
    return np.column_stack([north, east, heading, surge, sway, yaw_rate])


def _positions(numbers: dict[str, Array], nothing: Array) -> tuple[Array, Array]:
    if "north" in numbers and "east" in numbers:
        return numbers["north"], numbers["east"]
    if "lat" not in numbers or "lon" not in numbers:
        return nothing, nothing
    lonlat = np.column_stack([numbers["lon"], numbers["lat"]])
    return _local(lonlat)


def _local(lonlat: Array) -> tuple[Array, Array]:
    """Return north and east [m] relative to the first known place; NaN stays."""
    known = np.isfinite(lonlat).all(axis=1)
    out = np.full(lonlat.shape, np.nan)
    if known.any():
        lon, lat = lonlat[known][0].tolist()
        frame = LocalFrame(origin_lon_deg=lon, origin_lat_deg=lat)
        out[known] = frame.to_local(lonlat[known])
    return out[:, 0], out[:, 1]
