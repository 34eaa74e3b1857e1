"""Bring survey files of older versions up to the schema of this one.

Each step takes a file from the previous schema to its own. The steps that a file lacks run in
order, in one transaction, when it is opened. A step keeps every value, flag, target and event.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

from grebe.core.errors import SurveyFileError
from grebe.core.quantities import BUILTIN, Quantities, Quantity
from grebe.io.store import geopackage
from grebe.io.store.locks import locked
from grebe.io.store.plan_tables import type_the_plan
from grebe.io.store.revision_tables import keep_revisions

Step = Callable[[sqlite3.Connection], None]

QUANTITY_COLUMNS = (
    "key TEXT NOT NULL UNIQUE, label TEXT NOT NULL, unit TEXT NOT NULL, definition TEXT NOT NULL"
)


def write_quantities(connection: sqlite3.Connection, quantities: Iterable[Quantity]) -> None:
    """Write the complete definition of some quantities into the table that declares them."""
    connection.executemany(
        "INSERT INTO quantities (key, label, unit, definition) VALUES (?, ?, ?, ?) ON CONFLICT "
        "(key) DO UPDATE SET label = excluded.label, definition = excluded.definition",
        (
            (one.key, one.label, one.unit, json.dumps(one.as_table(), ensure_ascii=False))
            for one in quantities
        ),
    )


def declare_quantities(connection: sqlite3.Connection) -> None:
    """Declare the quantities in the columns of the samples.

    Older files had five and did not declare them.
    """
    columns = {row[1] for row in connection.execute("PRAGMA table_info(samples)")}
    held = Quantities(one for one in BUILTIN.values() if {one.key, f"{one.key}_qc"} <= columns)
    geopackage.create_layer(connection, "quantities", QUANTITY_COLUMNS, geometry=None)
    write_quantities(connection, held.values())


def tell_boats_apart(connection: sqlite3.Connection) -> None:
    """Bring a file of schema 4 to schema 5: its track and its samples are those of one boat."""
    for table in ("track", "samples"):
        columns = {row[1] for row in connection.execute(f"PRAGMA table_info({table})")}
        if "boat" not in columns:
            connection.execute(f"ALTER TABLE {table} ADD COLUMN boat INTEGER NOT NULL DEFAULT 1")


# The schema that each step leads to, and the step; several may lead to one.
STEPS: tuple[tuple[int, Step], ...] = (
    (3, declare_quantities),
    (3, type_the_plan),
    (4, keep_revisions),
    (5, tell_boats_apart),
)


def migrate(path: Path, connection: sqlite3.Connection, version: int) -> None:
    """Run the steps that a file lacks, up to `version`, all or none.

    Raises `SurveyFileError` if the file is read-only or another process is writing it.
    """
    has = int(connection.execute("PRAGMA user_version").fetchone()[0])
    if has >= version:
        return
    why = f"{path} was made by an older Grebe and is brought up to date once, when it is opened"
    with locked(path, why):
        try:
            connection.execute("BEGIN IMMEDIATE")
            # Another process may have done it meanwhile.
            has = int(connection.execute("PRAGMA user_version").fetchone()[0])
            for leads_to, step in STEPS:
                if has < leads_to <= version:
                    step(connection)
            connection.execute(f"PRAGMA user_version = {max(has, version)}")
            connection.execute("COMMIT")
        except BaseException as error:
            with suppress(sqlite3.Error):
                connection.execute("ROLLBACK")
            if isinstance(error, sqlite3.OperationalError):
                raise _refused(why, error) from None
            raise


def _refused(why: str, error: sqlite3.OperationalError) -> SurveyFileError:
    if "readonly" in str(error):
        return SurveyFileError(f"{why}, but it is read-only; make it and its folder writable.")
    if "locked" in str(error):
        return SurveyFileError(f"{why}, but another program is writing it; close it there first.")
    return SurveyFileError(f"{why}, and that failed ({error}); it is left as it was.")
