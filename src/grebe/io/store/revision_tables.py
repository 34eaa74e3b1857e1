"""Store the revisions of a plan in a survey file and read them back: appended, never overwritten.

The first revision's order is that of the layers `targets` and `corridors`; each later one has a row
in `legs` for every place of its order.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import shapely

from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import PlanSettings
from grebe.core.revision import PlanRevision, Sortie
from grebe.core.survey import Pose, Target
from grebe.io.store import geopackage
from grebe.io.store.plan_tables import parse_settings, settings_text
from grebe.io.store.timestamps import parse_time, time_text

LAYERS: dict[str, tuple[str | None, str]] = {
    "revisions": (
        None,
        "number INTEGER NOT NULL UNIQUE, reason TEXT NOT NULL, note TEXT NOT NULL, "
        "made_at DATETIME, target_count INTEGER NOT NULL",
    ),
    "sorties": (
        "POINT",
        "revision INTEGER NOT NULL, sortie INTEGER NOT NULL, boat INTEGER NOT NULL, "
        "first_place INTEGER NOT NULL, last_place INTEGER NOT NULL, heading_rad DOUBLE NOT NULL, "
        "time_s DOUBLE NOT NULL, energy_wh DOUBLE NOT NULL",
    ),
    "legs": (
        "POLYGON",
        "revision INTEGER NOT NULL, place INTEGER NOT NULL, seq INTEGER NOT NULL",
    ),
}


# The metadata key of the settings of the first order. A later order that was made with others
# appends its number.
SETTINGS = "settings"


def create_tables(
    connection: sqlite3.Connection, bounds: tuple[float, float, float, float] | None = None
) -> None:
    """Create the layers of the revisions, empty."""
    for table, (geometry, columns) in LAYERS.items():
        geopackage.create_layer(connection, table, columns, geometry=geometry, bounds=bounds)


def keep_revisions(connection: sqlite3.Connection) -> None:
    """Bring a file of schema 3 to schema 4: its plan is the first revision."""
    meta = dict(connection.execute("SELECT key, value FROM meta").fetchall())
    create_tables(connection)
    count = int(connection.execute("SELECT count(*) FROM targets").fetchone()[0])
    _write_head(connection, 1, "planned", "", meta.get("created") or None, count)


def write_first(connection: sqlite3.Connection, frame: LocalFrame, revision: PlanRevision) -> None:
    """Write the parts of a plan's first revision that its layers do not hold."""
    _write_revision(connection, frame, revision)


def append(connection: sqlite3.Connection, frame: LocalFrame, revision: PlanRevision) -> None:
    """Write a later revision; its new targets must be in the layer `targets` already."""
    before = _settings(connection)
    if revision.settings != before[max(before)]:
        entry = (f"{SETTINGS}_{revision.number}", settings_text(revision.settings))
        connection.execute("INSERT INTO meta (key, value) VALUES (?, ?)", entry)
    _write_revision(connection, frame, revision)
    corridors: list[bytes | None] = [None] * len(revision.targets)
    if revision.corridors:
        polygons = np.array(revision.corridors, dtype=object)
        corridors = list(geopackage.to_blobs(frame.geometry_to_wgs84(polygons)))
    connection.executemany(
        "INSERT INTO legs (geom, revision, place, seq) VALUES (?, ?, ?, ?)",
        (
            (blob, revision.number, place, target.seq)
            for place, (target, blob) in enumerate(
                zip(revision.targets, corridors, strict=True), start=1
            )
        ),
    )


def _write_revision(
    connection: sqlite3.Connection, frame: LocalFrame, revision: PlanRevision
) -> None:
    made_at = None if revision.made_at is None else time_text(revision.made_at)
    count = len(revision.targets)
    _write_head(connection, revision.number, revision.reason, revision.note, made_at, count)
    for one in revision.sorties:
        lon, lat = frame.to_wgs84((one.start.north_m, one.start.east_m)).tolist()
        connection.execute(
            "INSERT INTO sorties (geom, revision, sortie, boat, first_place, last_place, "
            "heading_rad, time_s, energy_wh) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
            (
                geopackage.to_blob(shapely.Point(lon, lat)),
                *(revision.number, one.number, one.boat, one.first, one.last),
                *(one.start.heading_rad, one.time_s, one.energy_wh),
            ),
        )


def _write_head(
    connection: sqlite3.Connection, number: int, reason: str, note: str, made_at: str | None,
    count: int,
) -> None:  # fmt: skip
    connection.execute(
        "INSERT INTO revisions (number, reason, note, made_at, target_count) "
        "VALUES (?, ?, ?, ?, ?)",
        (number, reason, note, made_at, count),
    )


def read_all(
    connection: sqlite3.Connection,
    frame: LocalFrame,
    pool: Mapping[int, Target],
    corridors: Sequence[shapely.Polygon],
    *,
    last_only: bool = False,
) -> tuple[PlanRevision, ...]:
    """Return the revisions in their order, or only the last one.

    `pool` holds all targets by their numbers, `corridors` those of the first revision.
    """
    heads = connection.execute(
        "SELECT number, reason, note, made_at, target_count FROM revisions ORDER BY number"
    ).fetchall()
    highest = max(pool, default=0) if last_only else 0
    made_with = _settings(connection)
    found: list[PlanRevision] = []
    for i, (number, reason, note, made_at, count) in enumerate(heads):
        if last_only and i + 1 < len(heads):
            continue
        if number == 1:
            order, legs = list(range(1, count + 1)), tuple(corridors[:count])
        else:
            order, legs = _legs(connection, frame, number)
        highest = max([highest, *order])
        found.append(
            PlanRevision(
                number=number,
                reason=reason,
                note=note,
                made_at=None if made_at is None else parse_time(made_at),
                targets=tuple(pool[seq] for seq in order),
                corridors=legs,
                sorties=_sorties(connection, frame, number),
                highest_seq=highest,
                settings=made_with[max(since for since in made_with if since <= number)],
            )
        )
    return tuple(found)


def _settings(connection: sqlite3.Connection) -> dict[int, PlanSettings | None]:
    """Return the settings of the orders, by the number of the first revision made with them."""
    rows = connection.execute(
        "SELECT key, value FROM meta WHERE key = ? OR key GLOB ?", (SETTINGS, f"{SETTINGS}_[0-9]*")
    ).fetchall()
    return {int(key.partition("_")[2] or 1): parse_settings(text) for key, text in rows}


def _legs(
    connection: sqlite3.Connection, frame: LocalFrame, number: int
) -> tuple[list[int], tuple[shapely.Polygon, ...]]:
    """Return the order of a revision and its corridors."""
    rows: list[Any] = connection.execute(
        "SELECT seq, geom FROM legs WHERE revision = ? ORDER BY place", (number,)
    ).fetchall()
    order = [seq for seq, _ in rows]
    if not rows or any(blob is None for _, blob in rows):
        return order, ()
    polygons = frame.geometry_to_local(geopackage.from_blobs([blob for _, blob in rows]))
    return order, tuple(polygons.tolist())


def _sorties(connection: sqlite3.Connection, frame: LocalFrame, number: int) -> tuple[Sortie, ...]:
    rows = connection.execute(
        "SELECT geom, sortie, boat, first_place, last_place, heading_rad, time_s, energy_wh "
        "FROM sorties WHERE revision = ? ORDER BY first_place",
        (number,),
    ).fetchall()
    places = frame.to_local(geopackage.point_coordinates([row[0] for row in rows]))
    return tuple(
        Sortie(
            number=row[1],
            boat=row[2],
            first=row[3],
            last=row[4],
            start=Pose(north_m=north, east_m=east, heading_rad=row[5]),
            time_s=row[6],
            energy_wh=row[7],
        )
        for row, (north, east) in zip(rows, places.tolist(), strict=True)
    )
