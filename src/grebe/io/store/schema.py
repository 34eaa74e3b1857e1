"""The layers of a survey file, and how the plan is written to them and read back.

The layers and their columns are a public format: docs/survey-file.md describes them, and a change
raises `VERSION`.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.core.dynamics import STATE_NAMES
from grebe.core.errors import InputError, SurveyFileError
from grebe.core.frames import LocalFrame
from grebe.core.quantities import Quantities, Quantity, quantities_of
from grebe.core.revision import PlanRevision, first_revision, survey_of
from grebe.core.sets import footprints_of, rings_of, sets_of
from grebe.core.survey import Pose, Survey, Target
from grebe.core.vessel import Vessel
from grebe.io.store import geopackage, revision_tables
from grebe.io.store.migrations import QUANTITY_COLUMNS, write_quantities
from grebe.io.store.plan_tables import (
    CELL_COLUMNS,
    outcome_text,
    parse_outcome,
    parse_settings,
    read_cells,
    settings_text,
    write_cells,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

VERSION = 5
# SQLite's errors when there is no room, even for the journal's index in memory.
NO_ROOM = ("SQLITE_FULL", "SQLITE_IOERR_WRITE", "SQLITE_IOERR_SHM", "SQLITE_IOERR_FSYNC")
STATE_COLUMNS = STATE_NAMES

_LAYERS: dict[str, tuple[str | None, str]] = {
    "region": ("POLYGON", "role TEXT NOT NULL, name TEXT"),
    "targets": (
        "POLYGON",
        "seq INTEGER NOT NULL UNIQUE, kind TEXT NOT NULL, speed_min_mps DOUBLE NOT NULL, "
        "speed_max_mps DOUBLE NOT NULL, reached_at DATETIME, "
        "sample_count INTEGER NOT NULL DEFAULT 0",
    ),
    "cells": ("POLYGON", CELL_COLUMNS),
    "corridors": ("POLYGON", "seq INTEGER NOT NULL UNIQUE"),
    "track": (
        "POINT",
        "time DATETIME NOT NULL, "
        + "".join(f"{name} DOUBLE, " for name in STATE_COLUMNS)
        + "thrust_port_n DOUBLE, thrust_starboard_n DOUBLE, target_seq INTEGER, "
        "split_stage INTEGER, solve_ms DOUBLE, status TEXT, current_north_mps DOUBLE, "
        "current_east_mps DOUBLE, boat INTEGER NOT NULL DEFAULT 1",
    ),
    # Two columns per quantity follow, for those that the file declares.
    "samples": (
        "POINT",
        "time DATETIME NOT NULL, target_seq INTEGER, speed_mps DOUBLE, "
        "boat INTEGER NOT NULL DEFAULT 1",
    ),
    "quantities": (None, QUANTITY_COLUMNS),
    "events": (None, "time DATETIME NOT NULL, level TEXT, code TEXT, message TEXT"),
    "meta": (None, "key TEXT NOT NULL UNIQUE, value TEXT"),
}


def create(
    connection: sqlite3.Connection,
    survey: Survey,
    meta: dict[str, str],
    quantities: Quantities,
    revision: PlanRevision | None = None,
) -> None:
    """Write the layers and the plan into an empty database.

    `revision` is the plan's first one, with its sorties, if it has any.
    """
    first = revision or first_revision(survey)
    if [t.seq for t in first.targets] != list(range(1, len(survey.targets) + 1)):
        raise InputError("A plan's targets must be numbered 1 to K in their order.")
    geopackage.create_core(connection, VERSION)
    water = survey.frame.geometry_to_wgs84(survey.water)
    for table, (geometry, columns) in _LAYERS.items():
        geopackage.create_layer(connection, table, columns, geometry=geometry, bounds=water.bounds)
    revision_tables.create_tables(connection, water.bounds)
    declare(connection, quantities.values())
    _write_region(connection, survey)
    write_targets(connection, survey.frame, survey.targets)
    revision_tables.write_first(connection, survey.frame, first)
    _write_corridors(connection, survey)
    entries = {
        "name": survey.name,
        "frame_origin_lon_deg": repr(survey.frame.origin_lon_deg),
        "frame_origin_lat_deg": repr(survey.frame.origin_lat_deg),
        "vessel": json.dumps(asdict(survey.vessel)) if survey.vessel else "",
        "start": json.dumps(asdict(survey.start)) if survey.start else "",
        "settings": settings_text(survey.settings),
        "outcome": outcome_text(survey.outcome),
        **meta,
    }
    connection.executemany("INSERT INTO meta (key, value) VALUES (?, ?)", entries.items())


def declare(connection: sqlite3.Connection, quantities: Iterable[Quantity]) -> None:
    """Declare quantities and add their columns to the samples; existing ones are redefined."""
    columns = {row[1] for row in connection.execute("PRAGMA table_info(samples)")}
    declared = list(quantities)
    for one in declared:
        if one.key not in columns:
            connection.execute(f'ALTER TABLE samples ADD COLUMN "{one.key}" DOUBLE')
            connection.execute(f'ALTER TABLE samples ADD COLUMN "{one.key}_qc" INTEGER')
    write_quantities(connection, declared)


def read_quantities(connection: sqlite3.Connection) -> Quantities:
    """Read the quantities that a file declares, in their order."""
    rows = connection.execute("SELECT key, definition FROM quantities ORDER BY fid").fetchall()
    try:
        tables = {key: json.loads(definition) for key, definition in rows}
        return quantities_of(tables, {}, "its quantities")
    except InputError as error:
        raise ValueError(str(error)) from None


def _write_region(connection: sqlite3.Connection, survey: Survey) -> None:
    for role, polygon in [("water", survey.water), *(("no_go", p) for p in survey.no_go)]:
        blob = geopackage.to_blob(survey.frame.geometry_to_wgs84(polygon))
        connection.execute(
            "INSERT INTO region (geom, role, name) VALUES (?, ?, ?)", (blob, role, survey.name)
        )


def write_targets(
    connection: sqlite3.Connection, frame: LocalFrame, targets: Sequence[Target]
) -> None:
    """Write targets and the cells that they stand for."""
    blobs = _blobs(frame, footprints_of([target.set for target in targets]))
    connection.executemany(
        "INSERT INTO targets (geom, seq, kind, speed_min_mps, speed_max_mps) "
        "VALUES (?, ?, ?, ?, ?)",
        (
            (blob, target.seq, target.kind, target.set.speed_min_mps, target.set.speed_max_mps)
            for blob, target in zip(blobs, targets, strict=True)
        ),
    )
    write_cells(connection, frame, targets)


def _write_corridors(connection: sqlite3.Connection, survey: Survey) -> None:
    blobs = _blobs(survey.frame, np.array(survey.corridors, dtype=object))
    connection.executemany(
        "INSERT INTO corridors (geom, seq) VALUES (?, ?)",
        ((blob, seq) for seq, blob in enumerate(blobs, start=1)),
    )


def _blobs(frame: LocalFrame, polygons: NDArray[np.object_]) -> list[bytes]:
    return geopackage.to_blobs(frame.geometry_to_wgs84(polygons))


def read_survey(connection: sqlite3.Connection) -> tuple[Survey, PlanRevision]:
    """Read back the plan, in the order of its last revision, and that revision."""
    planned, corridors = _read_plan(connection)
    pool = {target.seq: target for target in planned.targets}
    last = revision_tables.read_all(connection, planned.frame, pool, corridors, last_only=True)
    return survey_of(planned, last[-1]), last[-1]


def read_revisions(connection: sqlite3.Connection) -> tuple[PlanRevision, ...]:
    """Read all revisions of the plan, the first one first."""
    planned, corridors = _read_plan(connection)
    pool = {target.seq: target for target in planned.targets}
    return revision_tables.read_all(connection, planned.frame, pool, corridors)


def _read_plan(connection: sqlite3.Connection) -> tuple[Survey, tuple[shapely.Polygon, ...]]:
    """Read the survey with all targets of all revisions, and the corridors of the first."""
    meta = dict(connection.execute("SELECT key, value FROM meta").fetchall())
    frame = LocalFrame(
        origin_lon_deg=float(meta["frame_origin_lon_deg"]),
        origin_lat_deg=float(meta["frame_origin_lat_deg"]),
    )
    parts: dict[str, list[shapely.Polygon]] = {"water": [], "no_go": []}
    for role, blob in connection.execute("SELECT role, geom FROM region ORDER BY fid"):
        parts[role] += _polygons(frame, [blob])
    survey = Survey(
        name=meta["name"],
        frame=frame,
        water=parts["water"][0],
        no_go=tuple(parts["no_go"]),
        targets=_read_targets(connection, frame),
        vessel=Vessel(**json.loads(meta["vessel"])) if meta["vessel"] else None,
        start=Pose(**json.loads(meta["start"])) if meta["start"] else None,
        settings=parse_settings(meta["settings"]),
        outcome=parse_outcome(meta["outcome"]),
    )
    return survey, _read_corridors(connection, frame)


def _read_targets(connection: sqlite3.Connection, frame: LocalFrame) -> tuple[Target, ...]:
    rows = connection.execute(
        "SELECT seq, kind, speed_min_mps, speed_max_mps, geom FROM targets ORDER BY seq"
    ).fetchall()
    rings = rings_of(_polygons(frame, [row[-1] for row in rows]))
    cells = read_cells(connection, frame)
    sets = sets_of(rings, [(low, high) for _, _, low, high, _ in rows])
    return tuple(
        Target(seq=seq, kind=kind, set=one, cell=cells.get(seq))
        for (seq, kind, *_), one in zip(rows, sets, strict=True)
    )


def _read_corridors(
    connection: sqlite3.Connection, frame: LocalFrame
) -> tuple[shapely.Polygon, ...]:
    """Read the corridors in the order of their targets; a file of schema 1 has none."""
    if not connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'corridors'").fetchone():
        return ()
    rows = connection.execute("SELECT geom FROM corridors ORDER BY seq")
    return tuple(_polygons(frame, [blob for (blob,) in rows]))


def _polygons(frame: LocalFrame, blobs: list[bytes]) -> list[shapely.Polygon]:
    polygons = frame.geometry_to_local(geopackage.from_blobs(blobs)).tolist()
    if not all(isinstance(polygon, shapely.Polygon) for polygon in polygons):
        raise SurveyFileError("A region or a target of the survey file is not a polygon.")
    return polygons


def check(path: Path, connection: sqlite3.Connection) -> None:
    """Refuse a file that is not a survey file, damaged, or newer than this program."""
    # Everything goes through SQLite: a process that opens and closes the file itself loses all its
    # locks on it, including those of a mission that is writing it.
    try:
        version = int(connection.execute("PRAGMA user_version").fetchone()[0])
    except sqlite3.DatabaseError as error:
        if error.sqlite_errorname != "SQLITE_NOTADB":
            raise
        raise SurveyFileError(
            f"{path} is not a survey file: it is not an SQLite database."
        ) from None
    problem = connection.execute("PRAGMA quick_check(1)").fetchone()[0]
    if problem != "ok":
        raise damaged(path, problem)
    tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master")}
    if not {"gpkg_contents", "meta", "targets"} <= tables:
        raise SurveyFileError(f"{path} is a database, but not a survey file of Grebe.")
    if version > VERSION:
        raise SurveyFileError(
            f"{path} has schema {version}, and this Grebe reads up to {VERSION}; update Grebe."
        )


def unavailable(path: Path, error: sqlite3.OperationalError) -> SurveyFileError:
    """Return the error for a file that is sound but unavailable: locked, or read-only."""
    if "locked" in str(error):
        return SurveyFileError(f"{path} is being written by another program; close it there first.")
    if error.sqlite_errorname.startswith(NO_ROOM):
        return SurveyFileError(
            f"{path} cannot be opened: the disk is full or failing ({error}); make room on it."
        )
    if "readonly" in str(error):
        return SurveyFileError(f"{path} is read-only; make it and its folder writable.")
    return damaged(path, str(error))


def damaged(path: Path, detail: str) -> SurveyFileError:
    """Return the error for a file that SQLite cannot read completely."""
    return SurveyFileError(
        f"{path} is damaged or cut off ({' '.join(detail.split())[:120]}); restore it from a "
        f"backup, or save what is left with: sqlite3 {path.name} .recover"
    )
