"""Safe reading of requests: sizes are capped while the data stream, numbers are finite, and text
can be encoded.
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
# Larger than any meaningful length, speed, time or angle.
NUMBER_MOST = 1e12
# Endings of the files that may be uploaded.
TAKEN = (".gpkg", ".csv", ".geojson", ".json", ".kml", ".kmz", ".gpx", ".zip", ".shp")


class TooLargeError(GrebeError):
    """The request is larger than the server accepts."""


def tab_of(request: Request) -> str:
    """The name that a page gave itself; scripts share one."""
    name = request.headers.get("x-grebe-tab") or request.query_params.get("tab") or "script"
    return name[:64]


def number(text: str, name: str) -> float:
    """A number in a query."""
    try:
        value = float(text)
    except ValueError:
        raise UsageError(f"{name} is {text[:40]!r}, not a number.", settings=(name,)) from None
    if math.isnan(value) or abs(value) > NUMBER_MOST:
        raise UsageError(f"{name} is {text[:40]!r}; give a finite number.", settings=(name,))
    return value


def setting_number(given: dict[str, Any], name: str, otherwise: float | None = None) -> float:
    """A number in the settings of a request."""
    value = given.get(name, otherwise)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not abs(value) <= NUMBER_MOST:
        shown = str(value)[:40]
        raise UsageError(f"{name} is {shown}; give a finite number.", settings=(name,))
    return float(value)


def line(text: str) -> list[tuple[float, float]]:
    """The corners of a line in a query, longitude and latitude [deg]."""
    points = [point.split(",") for point in text.split(";")[:100]]
    if len(points) < 2 or any(len(point) != 2 for point in points):
        raise UsageError("line must be written as lon,lat;lon,lat;…", settings=("line",))
    return [(number(lon, "line"), number(lat, "line")) for lon, lat in points]


async def body_of(request: Request) -> dict[str, Any]:
    """The JSON object in a request's body, whose size is capped while it streams."""
    data = bytearray()
    async for chunk in request.stream():
        data += chunk
        if len(data) > JSON_MOST:
            raise TooLargeError(f"The request is larger than {JSON_MOST // 1_000_000} MB.")
    return parsed(bytes(data) or b"{}")


def parsed(data: bytes) -> dict[str, Any]:
    """A JSON object of finite numbers and of text that can be encoded.

    Python's parser also accepts `NaN`, integers too large for a float, and halves of surrogate
    pairs, each of which would fail somewhere later.
    """
    try:
        found = json.loads(data, parse_float=_float, parse_int=_int, parse_constant=_constant)
        json.dumps(found, ensure_ascii=False).encode()
    except (ValueError, RecursionError):
        raise InputError("The request is not valid JSON.") from None
    if not isinstance(found, dict):
        raise InputError("The request must be a JSON object.")
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
    raise InputError(f"{text} is not a JSON number.")


@contextlib.asynccontextmanager
async def uploaded(request: Request, folder: Path) -> AsyncGenerator[Path]:
    """The uploaded file, stored in the folder under a name of the server's choice. Its size is
    capped while it streams, and it is deleted at the end of the context.
    """
    suffix = Path(request.query_params.get("name", "")).suffix.lower()
    if suffix not in TAKEN:
        raise InputError(
            f"A file {suffix or 'without an ending'} cannot be read; send {', '.join(TAKEN)}."
        )
    with tempfile.TemporaryDirectory(prefix=".incoming-", dir=folder) as inside:
        path = Path(inside) / f"upload{suffix}"
        size = 0
        with path.open("wb") as file:
            async for chunk in request.stream():
                size += len(chunk)
                if size > UPLOAD_MOST:
                    raise TooLargeError(f"The file is larger than {UPLOAD_MOST // 1_000_000} MB.")
                file.write(chunk)
        try:
            yield path
        except GrebeError as error:
            # Replace the temporary path, which is private and does not help the user.
            given = Path(request.query_params["name"])
            text = str(error).replace(str(path), given.name).replace(path.name, given.name)
            # A region without a name of its own has that of its file.
            text = text.replace(repr(path.stem), repr(given.stem))
            raise type(error)(text, settings=error.settings) from None
