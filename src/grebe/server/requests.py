"""What a request holds, read so that nothing in it can break what follows: sizes are capped while
they stream, numbers are finite and text can be written.
"""

from __future__ import annotations

import contextlib
import json
import math
import tempfile
from collections.abc import AsyncGenerator
from pathlib import Path
from typing import Any, cast

from starlette.requests import Request

from grebe.core.errors import GrebeError, InputError, UsageError

JSON_MOST = 8_000_000
UPLOAD_MOST = 500_000_000
# No length, speed, time or degree that is meant is larger.
NUMBER_MOST = 1e12
# What may be uploaded, by the ends of names.
TAKEN = (".gpkg", ".csv", ".geojson", ".json", ".kml", ".kmz", ".gpx", ".zip", ".shp")


class TooLargeError(GrebeError):
    """More was sent than is taken."""


def tab_of(request: Request) -> str:
    """The name that a page gave itself; scripts have one in common."""
    name = request.headers.get("x-grebe-tab") or request.query_params.get("tab") or "script"
    return name[:64]


def number(text: str, name: str) -> float:
    """A number of a query."""
    try:
        value = float(text)
    except ValueError:
        raise UsageError(f"{name} is {text[:40]!r}, not a number.", settings=(name,)) from None
    if math.isnan(value) or abs(value) > NUMBER_MOST:
        raise UsageError(f"{name} is {text[:40]!r}; give a finite number.", settings=(name,))
    return value


def setting_number(given: dict[str, Any], name: str, otherwise: float | None = None) -> float:
    """A number of the settings that were sent."""
    value = given.get(name, otherwise)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not abs(value) <= NUMBER_MOST:
        shown = str(value)[:40]
        raise UsageError(f"{name} is {shown}; give a finite number.", settings=(name,))
    return float(value)


def line(text: str) -> list[tuple[float, float]]:
    """The corners of a line of a query, longitude and latitude [deg]."""
    points = [point.split(",") for point in text.split(";")[:100]]
    if len(points) < 2 or any(len(point) != 2 for point in points):
        raise UsageError("line is written lon,lat;lon,lat;…", settings=("line",))
    return [(number(lon, "line"), number(lat, "line")) for lon, lat in points]


async def body_of(request: Request) -> dict[str, Any]:
    """The JSON object that is sent; capped while it streams."""
    data = bytearray()
    async for chunk in request.stream():
        data += chunk
        if len(data) > JSON_MOST:
            raise TooLargeError(f"The request is larger than {JSON_MOST // 1_000_000} MB.")
    return parsed(bytes(data) or b"{}")


def parsed(data: bytes) -> dict[str, Any]:
    """A JSON object of finite numbers and of text that can be written.

    JSON as Python reads it holds more than that: `NaN`, integers that no float holds, and halves
    of characters, each of which fails somewhere behind.
    """
    try:
        found = json.loads(data, parse_float=_float, parse_int=_int, parse_constant=_constant)
        json.dumps(found, ensure_ascii=False).encode()
    except (ValueError, RecursionError):
        raise InputError("The request is not JSON.") from None
    if not isinstance(found, dict):
        raise InputError("The request is not a JSON object.")
    return cast("dict[str, Any]", found)


def _float(text: str) -> float:
    value = float(text)
    if abs(value) > NUMBER_MOST:
        raise InputError(f"The number {text[:40]} is too large.")
    return value


def _int(text: str) -> int:
    if len(text) > 16 or abs(int(text)) > NUMBER_MOST:
        raise InputError(f"The number {text[:40]} is too large.")
    return int(text)


def _constant(text: str) -> float:
    raise InputError(f"{text} is not a number of JSON.")


@contextlib.asynccontextmanager
async def uploaded(request: Request, folder: Path) -> AsyncGenerator[Path]:
    """What is sent, in a file of a name of ours in the folder; capped while it streams."""
    suffix = Path(request.query_params.get("name", "")).suffix.lower()
    if suffix not in TAKEN:
        raise InputError(f"A file {suffix or 'without an ending'} is not read; {', '.join(TAKEN)}.")
    with tempfile.TemporaryDirectory(prefix=".incoming-", dir=folder) as inside:
        path = Path(inside) / f"upload{suffix}"
        size = 0
        with path.open("wb") as file:
            async for chunk in request.stream():
                size += len(chunk)
                if size > UPLOAD_MOST:
                    raise TooLargeError(f"A file of more than {UPLOAD_MOST // 1_000_000} MB.")
                file.write(chunk)
        try:
            yield path
        except GrebeError as error:
            # Where the file lay on this computer is nobody's business, and no help.
            shown = Path(request.query_params["name"]).name
            text = str(error).replace(str(path), shown).replace(path.name, shown)
            raise type(error)(text, settings=error.settings) from None
