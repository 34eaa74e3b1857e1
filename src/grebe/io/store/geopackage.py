"""The part of the GeoPackage standard that Grebe writes: its tables and its geometry blobs.

It uses plain SQLite and nothing else, so that a mission depends on no GIS library. The layers have
no spatial index: its triggers call functions that plain SQLite lacks, and appending to a layer live
would fail. The application id is that of GeoPackage 1.1, whose `user_version` is free to number our
own schema.
"""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

if TYPE_CHECKING:
    from numpy.typing import NDArray

APPLICATION_ID = 0x47503131  # "GP11"
WGS84_SRS_ID = 4326

_WGS84_WKT = (
    'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,'
    'AUTHORITY["EPSG","7030"]],AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,'
    'AUTHORITY["EPSG","8901"]],UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],'
    'AUTHORITY["EPSG","4326"]]'
)

_CORE_TABLES = """
CREATE TABLE gpkg_spatial_ref_sys (
  srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY,
  organization TEXT NOT NULL, organization_coordsys_id INTEGER NOT NULL,
  definition TEXT NOT NULL, description TEXT);
CREATE TABLE gpkg_contents (
  table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE,
  description TEXT DEFAULT '',
  last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
  min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER,
  CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (
  table_name TEXT NOT NULL, column_name TEXT NOT NULL, geometry_type_name TEXT NOT NULL,
  srs_id INTEGER NOT NULL, z TINYINT NOT NULL, m TINYINT NOT NULL,
  CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name),
  CONSTRAINT fk_gc_tn FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name),
  CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys (srs_id));
"""


def create_core(connection: sqlite3.Connection, schema_version: int) -> None:
    """Write the standard's own tables into an empty database."""
    connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
    connection.execute(f"PRAGMA user_version = {schema_version}")
    connection.executescript(_CORE_TABLES)
    connection.executemany(
        "INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, ?)",
        [
            ("WGS 84 geodetic", WGS84_SRS_ID, "EPSG", 4326, _WGS84_WKT, "longitude, latitude"),
            ("Undefined cartesian SRS", -1, "NONE", -1, "undefined", None),
            ("Undefined geographic SRS", 0, "NONE", 0, "undefined", None),
        ],
    )


def create_layer(
    connection: sqlite3.Connection,
    table: str,
    columns: str,
    *,
    geometry: str | None,
    bounds: tuple[float, float, float, float] | None = None,
) -> None:
    """Create a feature layer (`geometry` names its type) or an attribute table (None)."""
    geom = f"geom {geometry}, " if geometry else ""
    connection.execute(f"CREATE TABLE {table} (fid INTEGER PRIMARY KEY, {geom}{columns})")
    kind = "features" if geometry else "attributes"
    srs = WGS84_SRS_ID if geometry else None
    connection.execute(
        "INSERT INTO gpkg_contents (table_name, data_type, identifier, min_x, min_y, max_x, "
        "max_y, srs_id) VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
        (table, kind, table, *(bounds or (None,) * 4), srs),
    )
    if geometry:
        connection.execute(
            "INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, 0, 0)",
            (table, geometry, WGS84_SRS_ID),
        )


def to_blob(geometry: BaseGeometry) -> bytes:
    """Encode a WGS 84 geometry as a GeoPackage blob (header without an envelope, then WKB)."""
    return to_blobs([geometry])[0]


def to_blobs(geometries: Sequence[BaseGeometry] | NDArray[np.object_]) -> list[bytes]:
    """Encode many geometries, as `to_blob` does one."""
    header = struct.pack("<2sBBi", b"GP", 0, 0b1, WGS84_SRS_ID)
    return [header + wkb for wkb in shapely.to_wkb(geometries, byte_order=1).tolist()]


def from_blob(blob: bytes) -> BaseGeometry:
    """Decode a GeoPackage blob; envelopes that another program added are skipped."""
    return from_blobs([blob])[0]


def from_blobs(blobs: Sequence[bytes]) -> NDArray[np.object_]:
    """Decode many blobs, as `from_blob` does one."""
    return np.asarray(shapely.from_wkb([_wkb(blob) for blob in blobs]), dtype=object)


# A point as `to_blobs` writes it: the header, then little-endian WKB.
_POINT = np.dtype(
    [("magic", "S2"), ("version", "u1"), ("flags", "u1"), ("srs", "<i4"), ("order", "u1"),
     ("kind", "<u4"), ("x", "<f8"), ("y", "<f8")]
)  # fmt: skip


def point_coordinates(blobs: Sequence[bytes]) -> NDArray[np.float64]:
    """Decode many points to x, y (n, 2), all at once if they are as `to_blobs` writes them."""
    joined = b"".join(blobs)
    if len(joined) == _POINT.itemsize * len(blobs):
        raw = np.frombuffer(joined, _POINT)
        plain = (raw["flags"] == 1) & (raw["order"] == 1) & (raw["kind"] == 1)
        if np.all(plain & (raw["magic"] == b"GP")):
            return np.column_stack([raw["x"], raw["y"]])
    return shapely.get_coordinates(from_blobs(blobs)).reshape(-1, 2)


def _wkb(blob: bytes) -> bytes:
    if len(blob) < 8 or blob[:2] != b"GP":
        raise ValueError("not a GeoPackage geometry")
    envelope_doubles = (0, 4, 6, 6, 8)[(blob[3] >> 1) & 0b111]
    return blob[8 + 8 * envelope_doubles :]
