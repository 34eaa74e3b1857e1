"""Write and read survey files.

Every row is committed, with WAL and full synchronisation, before the call returns: a sample that
the loop has seen is on the disk. Other programs may read the file meanwhile.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing, suppress
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TextIO

import numpy as np
import shapely

from grebe.core.errors import SurveyFileError
from grebe.core.events import LogEntry, Step
from grebe.core.quantities import LIMNOLOGICAL, Quantities
from grebe.core.revision import PlanRevision, begun_anew, survey_of
from grebe.core.samples import Sample, Samples
from grebe.core.survey import Survey
from grebe.io.store import geopackage, locks, rescue, revision_tables, schema, sessions
from grebe.io.store.database import Transaction, connect, make_durable, new_file, unwritten
from grebe.io.store.migrations import migrate
from grebe.io.store.survey_reader import SurveyReader
from grebe.io.store.tables import (
    ROWS_AT_ONCE,
    row_of,
    rows_of,
    sample_columns,
    track_row,
)
from grebe.io.store.timestamps import time_text

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from grebe.mapping.lag import Lag

SCHEMA_VERSION = schema.VERSION


class SurveyFile(SurveyReader):
    """An open survey file; use it in a `with` statement."""

    def __init__(
        self, path: Path, connection: sqlite3.Connection, *, had_journal: bool = True
    ) -> None:
        super().__init__(path, connection)
        # Whether a mission is writing the file, or ended without closing it.
        self._left_open = sessions.is_left_open(connection)
        self._had_journal = had_journal
        self._lock: TextIO | None = None
        self._together = Transaction(path, connection)
        self._in_session = False
        self._identity: rescue.Identity | None = None

    @classmethod
    def create(
        cls,
        path: Path,
        survey: Survey,
        *,
        meta: dict[str, str],
        force: bool,
        quantities: Quantities = LIMNOLOGICAL,
        revision: PlanRevision | None = None,
    ) -> Self:
        """Write a new survey file and open it; see `write`."""
        cls.write(path, survey, meta=meta, force=force, quantities=quantities, revision=revision)
        return cls.open(path)

    @staticmethod
    def write(
        path: Path,
        survey: Survey,
        *,
        meta: dict[str, str],
        force: bool,
        quantities: Quantities = LIMNOLOGICAL,
        revision: PlanRevision | None = None,
    ) -> None:
        """Write a new survey file, which declares some quantities.

        `revision` is its plan's first one if that has sorties. An existing file is left unchanged
        unless `force` is given, and then it is replaced only once the new one is complete. Raises
        `SurveyFileError`.
        """
        with (
            new_file(path, force=force) as part,
            closing(sqlite3.connect(part)) as connection,
            connection,
        ):
            schema.create(connection, survey, meta, quantities, revision)

    @classmethod
    def open(cls, path: Path) -> Self:
        """Open an existing survey file; `SurveyFileError` says why it cannot be used.

        A file that an older version made is brought up to date.
        """
        path = Path(path)
        if path.is_dir():
            raise SurveyFileError(f"{path} is a folder, not a survey file.")
        if not path.is_file():
            raise SurveyFileError(f"{path}: there is no such survey file.")
        if path.stat().st_size == 0:
            raise SurveyFileError(f"{path} is empty: not a survey file.")
        had_journal = sessions.has_journal(path)
        try:
            connection = connect(path)
            try:
                schema.check(path, connection)
                migrate(path, connection, schema.VERSION)
                make_durable(connection)
                return cls(path, connection, had_journal=had_journal)
            except BaseException:
                connection.close()
                raise
        except sqlite3.OperationalError as error:
            raise schema.unavailable(path, error) from None
        except OSError as error:
            raise SurveyFileError(f"{path} cannot be read: {error.strerror}.") from None
        except (sqlite3.Error, LookupError, TypeError, ValueError, shapely.GEOSException) as error:
            raise schema.damaged(path, str(error)) from None

    def stay_safe(self, now: datetime) -> str:
        """Check that the file is still there; if it was taken away, go on in a new one.

        Returns a message if that happened, which is also in the new file's log, and otherwise an
        empty string.
        """
        if self._identity is None or rescue.identity(self.path) == self._identity:
            return ""
        lost = self.path
        self._move(rescue.copy_out(lost, self._connection, now))
        said = f"{lost} was moved, deleted or replaced; the mission goes on in {self.path}"
        self.append_event(LogEntry(time=now, level="error", code="file_replaced", message=said))
        return said

    def _move(self, path: Path) -> None:
        """Write to another file from here on, which holds everything that this one does."""
        connection = connect(path)
        make_durable(connection)
        self._connection.close()
        if self._lock is not None:
            locks.release(self.path, self._lock)
        self.path, self._connection = path, connection
        self._together = Transaction(path, connection)
        self._lock = locks.acquire(path)
        self._identity = rescue.identity(path)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def claim(self) -> None:
        """Keep other missions off this file until it is closed; readers are not disturbed."""
        if self._lock is not None:
            return
        self._lock = locks.acquire(self.path)
        if self._lock is None:
            raise SurveyFileError(f"{self.path} is being written by another mission.")

    def begin_session(self, now: datetime) -> None:
        """Note in the file that a mission is writing it, until it is closed.

        This reveals a copy of the file that was made without the journal beside it.
        """
        self.claim()
        self._in_session = True
        with self._together:
            sessions.enter(self._connection, now)
        with suppress(sqlite3.Error):
            sessions.fold(self._connection)
        self._identity = rescue.identity(self.path)

    def close(self) -> None:
        """Move the write-ahead log into the file and close it."""
        with suppress(sqlite3.Error, OSError):
            if self._in_session:
                sessions.leave(self._connection)
            elif self._left_open and self._had_journal:
                self._note_whole()
            sessions.fold(self._connection)
        self._connection.close()
        if self._lock is not None:
            locks.release(self.path, self._lock)
            self._lock = None

    def _note_whole(self) -> None:
        """Note that nothing is missing, although nobody closed the file.

        The journal of a dead mission is being moved into the file. If a mission is still writing,
        nothing is noted.
        """
        lock = self._lock or locks.acquire(self.path)
        if lock is None:
            return
        sessions.leave(self._connection)
        if lock is not self._lock:
            locks.release(self.path, lock)

    @property
    def journal_missing(self) -> bool:
        """Whether a mission ended without closing the file, and its journal is missing too."""
        return self._left_open and not self._had_journal

    # -- writing ---------------------------------------------------------------------

    def together(self) -> AbstractContextManager[None]:
        """Write everything within the block as one: in the end all is on the disk, or nothing."""
        return self._together

    def declare(self, quantities: Quantities) -> None:
        """Declare more quantities; existing ones are redefined, in the same unit."""
        for key, one in quantities.items():
            before = self._quantities.get(key)
            if before is not None and before.unit != one.unit:
                raise SurveyFileError(
                    f"{self.path} holds {key} in {before.unit or '1'}, but it is now defined in "
                    f"{one.unit or '1'}; give the new one another key."
                )
        try:
            with self._together:
                schema.declare(self._connection, quantities.values())
        except sqlite3.Error as error:
            raise unwritten(self.path, error) from None
        self._quantities = self._quantities.extended(quantities)

    def append_track(self, point: Step, boat: int = 1) -> None:
        """Append one point of a boat's track."""
        self._insert("track", track_row(point, self._point_blob(*point.state[:2]), boat))

    def append_samples(self, samples: Sequence[Sample], boat: int = 1) -> None:
        """Append samples of a boat and count them in their targets, in one transaction.

        Raises `SurveyFileError` for a quantity that the file does not declare; see `declare`.
        """
        for sample in samples:
            self._refuse_undeclared({*sample.values, *sample.flags})
        with self._together:
            for sample in samples:
                row = row_of(sample, self.survey.frame, self._quantities, boat)
                self._execute(self._insert_samples(), row)
                if sample.target_seq is not None:
                    self._execute(
                        "UPDATE targets SET sample_count = sample_count + 1 WHERE seq = ?",
                        (sample.target_seq,),
                    )

    def extend_samples(self, samples: Samples) -> None:
        """Append columns of samples in one transaction, as `append_samples` does with a few."""
        self._refuse_undeclared(set(samples.values))
        sql = self._insert_samples()
        with self._together:
            for first in range(0, len(samples), ROWS_AT_ONCE):
                some = samples.rows(slice(first, first + ROWS_AT_ONCE))
                self._execute_many(sql, rows_of(some, self.survey.frame, self._quantities))
            counts = np.bincount(samples.target_seq)
            self._execute_many(
                "UPDATE targets SET sample_count = sample_count + ? WHERE seq = ?",
                ((int(counts[seq]), int(seq)) for seq in np.flatnonzero(counts) if seq > 0),
            )

    def append_revision(self, revision: PlanRevision) -> None:
        """Store a revision of the plan after the earlier ones; from now on it is the plan.

        Raises `SurveyFileError` for one that does not follow the file's last.
        """
        if revision.number != self.revision.number + 1:
            raise SurveyFileError(
                f"{self.path} holds revision {self.revision.number} of its plan, and revision "
                f"{revision.number} does not follow it; revise the plan that the file holds now."
            )
        new = [t for t in revision.targets if t.seq > self.revision.highest_seq]
        try:
            with self._together:
                schema.write_targets(self._connection, self.survey.frame, new)
                revision_tables.append(self._connection, self.survey.frame, revision)
        except sqlite3.Error as error:
            raise unwritten(self.path, error) from None
        self.revision = revision
        self.survey = survey_of(self.survey, revision)

    def append_event(self, event: LogEntry) -> None:
        """Append an event."""
        self._insert(
            "events",
            {
                "time": time_text(event.time),
                "level": event.level,
                "code": event.code,
                "message": event.message,
            },
        )

    def mark_reached(self, seq: int, time: datetime) -> None:
        """Note when a target was reached; the first time is kept."""
        self._execute(
            "UPDATE targets SET reached_at = ? WHERE seq = ? AND reached_at IS NULL",
            (time_text(time), seq),
        )

    def set_flags(self, flags: Mapping[str, NDArray[np.int64]]) -> None:
        """Store the flags (n,) of each quantity, in the order of `samples`, all or none."""
        keys = list(flags)
        self._refuse_undeclared(set(keys))
        if not keys:
            return
        fids = [row[0] for row in self._query("SELECT fid FROM samples ORDER BY fid")]
        if any(len(column) != len(fids) for column in flags.values()):
            raise ValueError(f"the flags do not match the {len(fids)} samples of the file")
        setters = ", ".join(f'"{key}_qc" = ?' for key in keys)
        with self._together:
            for first in range(0, len(fids), ROWS_AT_ONCE):
                part = slice(first, first + ROWS_AT_ONCE)
                columns = [flags[key][part].tolist() for key in keys]
                self._execute_many(
                    f"UPDATE samples SET {setters} WHERE fid = ?",
                    zip(*columns, fids[part], strict=True),
                )

    def note_lags(self, lags: Mapping[str, Lag]) -> None:
        """Note the lag of some sensors beside those noted before; a lag of 0 removes a note."""
        self._refuse_undeclared(set(lags))
        known = self.lags() | dict(lags)
        kept = {key: asdict(one) for key, one in known.items() if one.delay_s or one.tau_s}
        self.set_meta("lags", json.dumps(kept))

    def set_meta(self, key: str, value: str) -> None:
        """Set one entry of the meta table."""
        with self._together:
            self._execute("DELETE FROM meta WHERE key = ?", (key,))
            self._insert("meta", {"key": key, "value": value})

    def clear_mission(self) -> None:
        """Delete the track, the samples, the events and what was reached.

        The plan is restored to what it was before missions revised it.
        """
        again = begun_anew(self.revisions())
        with self._together:
            if again is not None:
                self.append_revision(again)
            for table in ("track", "samples", "events"):
                self._execute(f"DELETE FROM {table}")
            self._execute("UPDATE targets SET reached_at = NULL, sample_count = 0")

    # -- plumbing --------------------------------------------------------------------

    def _refuse_undeclared(self, keys: set[str]) -> None:
        unknown = sorted(keys - set(self._quantities))
        if unknown:
            raise SurveyFileError(
                f"{self.path} does not declare {', '.join(unknown)}; it declares "
                f"{self._quantities.keys_text}. Declare a new quantity first."
            )

    def _insert_samples(self) -> str:
        columns = sample_columns(self._quantities)
        return (
            f"INSERT INTO samples ({', '.join(columns)}) VALUES ({', '.join('?' * len(columns))})"
        )

    def _point_blob(self, north_m: float, east_m: float) -> bytes:
        lon, lat = self.survey.frame.to_wgs84((north_m, east_m)).tolist()
        return geopackage.to_blob(shapely.Point(lon, lat))

    def _insert(self, table: str, row: dict[str, Any]) -> None:
        names, marks = ", ".join(row), ", ".join("?" * len(row))
        self._execute(f"INSERT INTO {table} ({names}) VALUES ({marks})", tuple(row.values()))

    def _execute(self, sql: str, values: tuple[Any, ...] = ()) -> None:
        try:
            self._connection.execute(sql, values)
        except sqlite3.Error as error:
            raise unwritten(self.path, error) from None

    def _execute_many(self, sql: str, rows: Iterator[tuple[Any, ...]]) -> None:
        try:
            self._connection.executemany(sql, rows)
        except sqlite3.Error as error:
            raise unwritten(self.path, error) from None
