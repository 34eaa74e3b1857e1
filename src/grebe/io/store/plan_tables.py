"""Store a plan's settings, its outcome and its cells in a survey file, and read them back."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from grebe.core.dynamics import Weather
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import FleetSettings, PlanOutcome, PlanSettings, SortieSettings
from grebe.core.survey import Target
from grebe.core.vessel import Vessel
from grebe.io.store import geopackage

if TYPE_CHECKING:
    from numpy.typing import NDArray

CELL_COLUMNS = "seq INTEGER NOT NULL UNIQUE"
# Settings that only fleets of unlike boats have, one for each boat.
_BY_BOAT = {"fleet": ("vessels",), "sorties": ("batteries_wh", "minutes_each")}
_WEATHER = ("current_north_mps", "current_east_mps", "wind_force_north_n", "wind_force_east_n")


def settings_text(settings: PlanSettings | None) -> str:
    """Return the complete settings as JSON; empty for a survey that was not planned."""
    if settings is None:
        return ""
    values = asdict(settings)
    for name in ("sorties", "fleet"):
        if values[name] is None:
            del values[name]
    # What one boat, or boats alike, do not have is omitted, so that an older Grebe reads such plans
    # too.
    for part, names in _BY_BOAT.items():
        for name in names if part in values else ():
            if not values[part][name]:
                del values[part][name]
    return json.dumps(values, sort_keys=True)


def parse_settings(text: str) -> PlanSettings | None:
    """Read settings back, exactly; an unknown name raises `TypeError`."""
    if not text:
        return None
    values = json.loads(text)
    sorties, fleet = values.get("sorties"), values.get("fleet")
    if sorties is not None:
        own = {name: tuple(sorties.get(name, ())) for name in _BY_BOAT["sorties"]}
        sorties |= {"harbours": _places(sorties["harbours"]), **own}
        sorties = SortieSettings(**sorties)
    if fleet is not None:
        vessels = tuple(Vessel(**one) for one in fleet.get("vessels", ()))
        fleet |= {"starts": _places(fleet["starts"]), "vessels": vessels}
        fleet = FleetSettings(**fleet)
    weather = Weather(**values["weather"])
    return PlanSettings(**values | {"weather": weather, "sorties": sorties, "fleet": fleet})


def _places(pairs: list[list[float]]) -> tuple[tuple[float, float], ...]:
    return tuple((lon, lat) for lon, lat in pairs)


def outcome_text(outcome: PlanOutcome | None) -> str:
    """Return an outcome as JSON; empty if there is none."""
    return "" if outcome is None else json.dumps(asdict(outcome), sort_keys=True)


def parse_outcome(text: str) -> PlanOutcome | None:
    """Read an outcome back."""
    return PlanOutcome(**json.loads(text)) if text else None


def write_cells(
    connection: sqlite3.Connection, frame: LocalFrame, targets: Sequence[Target]
) -> None:
    """Write the cells that targets stand for."""
    cells = [(target.seq, target.cell) for target in targets if target.cell is not None]
    polygons = np.array([cell for _, cell in cells], dtype=object)
    blobs = geopackage.to_blobs(frame.geometry_to_wgs84(polygons))
    connection.executemany(
        "INSERT INTO cells (geom, seq) VALUES (?, ?)",
        ((blob, seq) for blob, (seq, _) in zip(blobs, cells, strict=True)),
    )


def read_cells(connection: sqlite3.Connection, frame: LocalFrame) -> dict[int, shapely.Polygon]:
    """Return the cell of each target that has one, by the target's number."""
    rows = connection.execute("SELECT seq, geom FROM cells").fetchall()
    polygons = frame.geometry_to_local(geopackage.from_blobs([blob for _, blob in rows]))
    return dict(zip((seq for seq, _ in rows), polygons.tolist(), strict=True))


def type_the_plan(connection: sqlite3.Connection) -> None:
    """Bring the plan of schema 2 to schema 3: complete settings, and each target with its cell.

    Schema 2 stored neither pattern, return nor budgets: they are taken to be the defaults. It
    stored no cells either: a target was its cell drawn in to a share, `core`, about the middle.
    """
    old: dict[str, Any] = json.loads(_meta(connection).get("settings") or "{}")
    texts = {"settings": settings_text(_typed(old)), "outcome": ""}
    connection.execute("DELETE FROM meta WHERE key IN ('settings', 'outcome')")
    connection.executemany("INSERT INTO meta (key, value) VALUES (?, ?)", texts.items())
    geopackage.create_layer(connection, "cells", CELL_COLUMNS, geometry="POLYGON")
    rows = connection.execute(
        "SELECT seq, geom FROM targets WHERE kind = 'cell' ORDER BY seq"
    ).fetchall()
    cells = _undrawn(geopackage.from_blobs([blob for _, blob in rows]), old.get("core", 1.0))
    connection.executemany(
        "INSERT INTO cells (geom, seq) VALUES (?, ?)",
        zip(geopackage.to_blobs(cells), (seq for seq, _ in rows), strict=True),
    )


def _meta(connection: sqlite3.Connection) -> dict[str, str]:
    return dict(connection.execute("SELECT key, value FROM meta").fetchall())


def _typed(old: Mapping[str, Any]) -> PlanSettings | None:
    if not old:
        return None
    plain = {name: value for name, value in old.items() if name not in _WEATHER}
    weather = Weather(**{name: old[name] for name in _WEATHER if name in old})
    return PlanSettings(**plain, weather=weather)


def _undrawn(footprints: NDArray[np.object_], core: float) -> NDArray[np.object_]:
    """Return the cells whose cores some footprints are.

    A share is the same in degrees as in metres.
    """
    if core == 1.0 or not len(footprints):
        return footprints
    corners, cell = shapely.get_coordinates(footprints, return_index=True)
    middle = shapely.get_coordinates(shapely.centroid(footprints))[cell]
    return shapely.set_coordinates(footprints.copy(), middle + (corners - middle) / core)
