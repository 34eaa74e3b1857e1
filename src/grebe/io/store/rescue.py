"""Rescue a survey file that disappears while a mission writes it: deleted, moved, or replaced.

The system lets a program go on writing into a file that no name leads to any more, and all of it is
lost when the program ends. So the writer checks whether the file and its journal are still the ones
that were opened, and copies everything into a new file if they are not.
"""

from __future__ import annotations

import sqlite3
import tempfile
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

from grebe.core.errors import SurveyFileError
from grebe.io.atomic_write import written_whole

Identity = tuple[tuple[int, int] | None, ...]


def identity(path: Path) -> Identity:
    """Return which files the names of a survey file and of its journal lead to; None for none."""
    return tuple(_inode(path.with_name(path.name + suffix)) for suffix in ("", "-wal"))


def _inode(path: Path) -> tuple[int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino


def copy_out(path: Path, connection: sqlite3.Connection, now: datetime) -> Path:
    """Copy everything that a connection holds into a new file beside `path`, and return its name.

    If that folder is gone or full too, the copy goes to the working folder, the home folder or the
    system's folder for temporary files. Raises `SurveyFileError` if none of them takes it.
    """
    stamp = now.astimezone(UTC).strftime("%Y%m%dT%H%M%S")
    name = f"{path.stem}.rescued-{stamp}{path.suffix}"
    failure = SurveyFileError(f"{path} was removed, and there is nowhere to save its records.")
    for folder in (path.parent, Path.cwd(), Path.home(), Path(tempfile.gettempdir())):
        try:
            with (
                written_whole(folder / name, sqlite3.Error, error=SurveyFileError) as part,
                closing(sqlite3.connect(part)) as copy,
            ):
                connection.backup(copy)
        except SurveyFileError as error:
            failure = error
        else:
            return folder / name
    raise failure
