"""A user's own background map: raster tiles from one PMTiles or MBTiles file, offline."""

from __future__ import annotations

import sqlite3
import struct
import threading
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

from pmtiles.reader import MmapSource, Reader
from pmtiles.tile import MagicNumberNotFound, SpecVersionUnsupported, TileType

from grebe.core.errors import InputError

# The formats that a browser shows by itself; vector tiles would need a renderer.
IMAGES = {"png": "image/png", "jpg": "image/jpeg", "jpeg": "image/jpeg", "webp": "image/webp"}
DEEPEST = 30
TEXT_MOST = 300


@dataclass(frozen=True, kw_only=True)
class About:
    """The description that a tile file carries; `bounds` are west, south, east, north [deg]."""

    name: str
    min_zoom: int
    max_zoom: int
    bounds: tuple[float, float, float, float] | None
    attribution: str
    media_type: str


class Background(Protocol):
    """Tiles of 256 pixels in the scheme of web maps: y counts from the north."""

    @property
    def about(self) -> About:
        """The description that the file carries."""
        ...

    def tile(self, zoom: int, x: int, y: int) -> bytes | None:
        """One image, or None if the file has none there."""
        ...


def open_background(path: Path) -> Background:
    """Open a tile file, whose ending gives its kind.

    Raises `InputError` if the file is of another kind, is damaged, or holds vector tiles.
    """
    kinds = {".pmtiles": PackedTiles, ".mbtiles": StoredTiles}
    kind = kinds.get(path.suffix.lower())
    if kind is None:
        raise InputError(
            f"{path} is not a background map: its name must end in .pmtiles or .mbtiles."
        )
    try:
        return kind(path)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror or error}).") from None


class PackedTiles:
    """PMTiles, version 3."""

    def __init__(self, path: Path) -> None:
        with path.open("rb") as file:
            self._reader = _reading(path, lambda: Reader(MmapSource(file)))
        header = _reading(path, self._reader.header)
        metadata = _reading(path, self._reader.metadata)
        bounds = [
            header[f"{side}_e7"] / 1e7 for side in ("min_lon", "min_lat", "max_lon", "max_lat")
        ]
        self.about = _about(
            path,
            {str(key): value for key, value in metadata.items()},
            TileType(header["tile_type"]).name.lower(),
            (header["min_zoom"], header["max_zoom"]),
            bounds,
        )

    def tile(self, zoom: int, x: int, y: int) -> bytes | None:
        """See `Background`."""
        try:
            return self._reader.get(zoom, x, y)
        except (ValueError, EOFError, OSError, zlib.error, OverflowError):
            return None


class StoredTiles:
    """MBTiles, version 1.3: an SQLite file, in which y counts from the south."""

    def __init__(self, path: Path) -> None:
        path.open("rb").close()
        self._lock = threading.Lock()
        self._rows = sqlite3.connect(
            f"{path.resolve().as_uri()}?mode=ro", uri=True, check_same_thread=False
        )
        told = _reading(path, lambda: dict(self._rows.execute("SELECT name, value FROM metadata")))
        ends = _reading(
            path,
            lambda: self._rows.execute(
                "SELECT min(zoom_level), max(zoom_level) FROM tiles"
            ).fetchone(),
        )
        if ends[0] is None:
            raise InputError(f"{path} holds no tiles.")
        corners = str(told.get("bounds", "")).split(",")
        try:
            bounds = [float(corner) for corner in corners] if len(corners) == 4 else None
        except ValueError:
            bounds = None
        kind = str(told.get("format", "png")).lower()
        self.about = _about(path, told, kind, (int(ends[0]), int(ends[1])), bounds)

    def tile(self, zoom: int, x: int, y: int) -> bytes | None:
        """See `Background`."""
        with self._lock:
            try:
                row = self._rows.execute(
                    "SELECT tile_data FROM tiles "
                    "WHERE zoom_level = ? AND tile_column = ? AND tile_row = ?",
                    (zoom, x, 2**zoom - 1 - y),
                ).fetchone()
            except sqlite3.Error:
                return None
        return None if row is None else bytes(row[0])


def _reading(path: Path, work: Any) -> Any:
    """Return the result of `work`, which reads a part of the file; any failure becomes an
    `InputError`.
    """
    try:
        return work()
    except (MagicNumberNotFound, SpecVersionUnsupported):
        raise InputError(f"{path} is not a PMTiles file of version 3.") from None
    except (sqlite3.Error, ValueError, EOFError, KeyError, IndexError, zlib.error, struct.error):
        raise InputError(f"{path} is damaged, or not a file of tiles.") from None


def _about(
    path: Path,
    told: Mapping[str, Any],
    kind: str,
    zooms: tuple[int, int],
    bounds: list[float] | None,
) -> About:
    media_type = IMAGES.get(kind)
    if media_type is None:
        raise InputError(
            f"{path} holds tiles of {kind}; give a file of images ({', '.join(sorted(IMAGES))})."
        )
    if not 0 <= zooms[0] <= zooms[1] <= DEEPEST:
        raise InputError(f"{path} is damaged: its zooms are {zooms[0]} to {zooms[1]}.")
    sound = bounds is not None and bounds[0] < bounds[2] and bounds[1] < bounds[3]
    return About(
        name=str(told.get("name") or path.stem)[:TEXT_MOST],
        min_zoom=zooms[0],
        max_zoom=zooms[1],
        bounds=(bounds[0], bounds[1], bounds[2], bounds[3]) if bounds and sound else None,
        attribution=_plain(str(told.get("attribution") or "")),
        media_type=media_type,
    )


def _plain(text: str) -> str:
    """An attribution, which is often HTML, without its tags."""
    kept: list[str] = []
    inside = False
    for sign in text:
        if sign in "<>":
            inside = sign == "<"
        elif not inside:
            kept.append(sign)
    return "".join(kept).strip()[:TEXT_MOST]


def shown(background: Background | None) -> dict[str, Any] | None:
    """A background as the page expects it."""
    if background is None:
        return None
    told = asdict(background.about)
    del told["media_type"]
    return told
