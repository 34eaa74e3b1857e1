"""Note in a survey file that a mission is writing it, from its beginning until it is closed.

Writes go to a journal beside the file first (`-wal`), which is moved into the file from time to
time. A copy of the file without its journal is sound, but older: the note reveals such a copy.
"""

from __future__ import annotations

import sqlite3
from datetime import datetime
from pathlib import Path

from grebe.io.store.timestamps import time_text

_KEY = "mission_open"


def has_journal(path: Path) -> bool:
    """Return whether there is a journal beside a survey file that holds something."""
    journal = path.with_name(path.name + "-wal")
    return journal.is_file() and journal.stat().st_size > 0


def enter(connection: sqlite3.Connection, now: datetime) -> None:
    """Note that a mission has begun to write."""
    connection.execute("DELETE FROM meta WHERE key = ?", (_KEY,))
    connection.execute("INSERT INTO meta (key, value) VALUES (?, ?)", (_KEY, time_text(now)))


def leave(connection: sqlite3.Connection) -> None:
    """Remove the note."""
    connection.execute("DELETE FROM meta WHERE key = ?", (_KEY,))


def is_left_open(connection: sqlite3.Connection) -> bool:
    """Return whether a mission is writing the file, or ended without closing it."""
    row = connection.execute("SELECT 1 FROM meta WHERE key = ?", (_KEY,)).fetchone()
    return row is not None


def fold(connection: sqlite3.Connection) -> None:
    """Move all of the journal into the file itself."""
    connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
