"""Read the positions of an ArduPilot log as a table, with the depths of its sounder."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from grebe.core.errors import TrackError
from grebe.io.readers.log_messages import messages_in
from grebe.io.readers.table import Table

HEADER = ["time", "latitude", "longitude", "water depth (m)", "temperature (degC)"]
# Filters log up to fifty positions a second; no sensor needs as many [s].
CLOSEST_S = 0.2
_TELEMETRY = ["GLOBAL_POSITION_INT", "SYSTEM_TIME", "WATER_DEPTH"]
_DATAFLASH = ["POS", "GPS", "DPTH"]


@dataclass(frozen=True, kw_only=True)
class _Fix:
    """A position [deg] at a time [unix s]."""

    time: float
    lat: float
    lon: float


@dataclass(frozen=True, kw_only=True)
class _Sounding:
    """What a sounder read: depth [m] and temperature [degC], NaN if it has none."""

    depth: float
    temperature: float


def read_autopilot_track(path: Path) -> Table:
    """Read where a boat was from its .tlog or .bin.

    Positions are its filter's, or else its receiver's fixes, at most five a second; `TrackError` if
    it holds neither.
    """
    logged = _dataflash(path) if path.suffix.lower() == ".bin" else _telemetry(path)
    rows: list[list[str]] = []
    before = -1.0
    depth = temperature = ""
    for one in logged:
        if isinstance(one, _Sounding):
            depth, temperature = _text(one.depth), _text(one.temperature)
        elif one.time >= before + CLOSEST_S or one.time < before:
            rows.append([f"{one.time:.3f}", f"{one.lat:.7f}", f"{one.lon:.7f}", depth, temperature])
            before, depth, temperature = one.time, "", ""
    if not rows:
        raise TrackError(
            f"{path}: holds no positions (GLOBAL_POSITION_INT, or POS or GPS); did the receiver "
            "have a fix?"
        )
    return Table(header=HEADER, rows=rows)


def _telemetry(path: Path) -> Iterator[_Fix | _Sounding]:
    """Yield the fixes and soundings of a .tlog.

    Times are the autopilot's if it knows them from its receiver, and otherwise those of the station
    that wrote the log.
    """
    booted: float | None = None
    for message in messages_in(path, _TELEMETRY):
        kind = message.get_type()
        if kind == "SYSTEM_TIME":
            if message.time_unix_usec:
                booted = message.time_unix_usec / 1e6 - message.time_boot_ms / 1e3
        elif kind == "WATER_DEPTH":
            if message.healthy:
                yield _Sounding(depth=message.distance, temperature=message.temperature)
        elif message.lat or message.lon:
            stamp = float(message._timestamp)
            time = stamp if booted is None else booted + message.time_boot_ms / 1e3
            yield _Fix(time=time, lat=message.lat / 1e7, lon=message.lon / 1e7)


def _dataflash(path: Path) -> Iterator[_Fix | _Sounding]:
    """Return the fixes and soundings of a .bin.

    Pymavlink dates each message with the receiver's week and time, in UTC.
    """
    logged: list[tuple[str, _Fix | _Sounding]] = []
    for message in messages_in(path, _DATAFLASH):
        kind = message.get_type()
        if kind == "DPTH":
            temperature = getattr(message, "Temp", math.nan)
            logged.append((kind, _Sounding(depth=message.Depth, temperature=temperature)))
        elif getattr(message, "Status", 3) >= 3:
            fix = _Fix(time=float(message._timestamp), lat=message.Lat, lon=message.Lng)
            logged.append((kind, fix))
    # The receiver's own fixes are used only if the filter's are missing.
    other = "GPS" if any(kind == "POS" for kind, _ in logged) else "POS"
    return (one for kind, one in logged if kind != other)


def _text(value: float) -> str:
    """Return a cell; empty for what was not read."""
    return f"{value:.3f}" if math.isfinite(value) else ""
