"""The database below a survey file: durable, transactional, with errors that name the file."""

from __future__ import annotations

import sqlite3
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType

from grebe.core.errors import SurveyFileError
from grebe.io.atomic_write import written_whole
from grebe.io.store import locks

JOURNAL_BYTES = 8_000_000


class UnwrittenError(SurveyFileError):
    """The disk did not accept a write; `strerror` says why, as in the system's own errors."""

    def __init__(self, path: Path, reason: str) -> None:
        super().__init__(f"{path} cannot be written ({reason}); what was recorded before is kept.")
        self.strerror = reason


def unwritten(path: Path, error: sqlite3.Error) -> UnwrittenError:
    """Return the error to raise when the disk does not accept a write."""
    return UnwrittenError(path, str(error))


class Transaction:
    """A transaction that raises `UnwrittenError` if the disk fails; one within another joins it."""

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self._path = path
        self._connection = connection
        self._depth = 0

    def __enter__(self) -> None:
        if self._depth == 0:
            self._begin()
        self._depth += 1

    def _begin(self) -> None:
        try:
            if self._connection.in_transaction:  # left open by an interruption
                self._connection.execute("ROLLBACK")
            self._connection.execute("BEGIN IMMEDIATE")
        except sqlite3.Error as failure:
            raise unwritten(self._path, failure) from None

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._depth -= 1
        if self._depth > 0:
            return
        if error is not None:
            with suppress(sqlite3.Error):
                self._connection.execute("ROLLBACK")
            return
        try:
            self._connection.execute("COMMIT")
        except sqlite3.Error as failure:
            with suppress(sqlite3.Error):
                self._connection.execute("ROLLBACK")
            raise unwritten(self._path, failure) from None


# How long to wait for another process that writes to the same file [s].
TIMEOUT_S = 10.0


def connect(path: Path) -> sqlite3.Connection:
    """Open for one thread at a time.

    A mission writes in another thread than the one that opened the file.
    """
    return sqlite3.connect(path, isolation_level=None, timeout=TIMEOUT_S, check_same_thread=False)


def make_durable(connection: sqlite3.Connection) -> None:
    """Keep commits on the disk even after a power cut, without readers getting in the way."""
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA synchronous = FULL")
    # The journal grows while another program holds a read, and shrinks to this afterwards.
    connection.execute(f"PRAGMA journal_size_limit = {JOURNAL_BYTES}")


@contextmanager
def new_file(path: Path, *, force: bool) -> Generator[Path]:
    """Yield a temporary path for a new survey file that takes `path`'s place once it is complete.

    Raises `SurveyFileError` if that cannot be written, or exists already and is not forced.
    """
    if path.exists() and not force:
        raise SurveyFileError(
            f"{path} exists already; give another name, or replace it by force.",
            settings=("force",),
        )
    if path.exists() and locks.is_locked(path):
        raise SurveyFileError(f"{path} is being written by a mission; give another name.")
    with written_whole(path, sqlite3.Error, UnwrittenError, error=SurveyFileError) as part:
        try:
            yield part
        except UnwrittenError:
            raise
        except SurveyFileError as error:
            named = str(error).replace(str(part), str(path))
            raise SurveyFileError(named, settings=error.settings) from None
        for suffix in ("-wal", "-shm"):
            path.with_name(path.name + suffix).unlink(missing_ok=True)
