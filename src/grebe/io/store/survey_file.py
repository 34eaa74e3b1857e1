"""Write and read survey files.

Every row is committed, with WAL and full synchronisation, before the call returns: a sample
that the loop has seen is on the disk. Other programs may read the file meanwhile.
"""

from __future__ import annotations

import fcntl
import sqlite3
from collections.abc import Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TextIO

import numpy as np
import shapely

from grebe.core.errors import SurveyFileError
from grebe.core.events import LogEntry, Step
from grebe.core.quantities import QUANTITY_KEYS
from grebe.core.samples import Flag, Sample
from grebe.core.survey import Survey
from grebe.io.store import geopackage, schema
from grebe.io.store.timestamps import parse_time, time_text
from grebe.io.whole import written_whole

if TYPE_CHECKING:
    from numpy.typing import NDArray

SCHEMA_VERSION = schema.VERSION


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far a survey has come: when each target was reached (None: not yet)."""

    reached_at: tuple[datetime | None, ...]
    sample_counts: tuple[int, ...]

    @property
    def reached(self) -> int:
        """Number of reached targets."""
        return sum(moment is not None for moment in self.reached_at)


@dataclass(frozen=True, kw_only=True)
class SampleTable:
    """All samples as columns: `positions` (n, 2) north, east [m]; NaN stands for missing."""

    times: tuple[datetime, ...]
    positions: NDArray[np.float64]
    target_seq: NDArray[np.int64]
    speed_mps: NDArray[np.float64]
    values: dict[str, NDArray[np.float64]]
    flags: dict[str, NDArray[np.int64]]

    def __len__(self) -> int:
        return len(self.positions)


@dataclass(frozen=True, kw_only=True)
class TrackTable:
    """The whole track as columns: `seconds` since the first row, `states` (n, 6),
    `thrusts` (n, 2) [N], `solve_ms` (n,), `status` (n,).
    """

    times: tuple[datetime, ...]
    seconds: NDArray[np.float64]
    states: NDArray[np.float64]
    thrusts: NDArray[np.float64]
    solve_ms: NDArray[np.float64]
    status: tuple[str, ...]
    target_seq: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.states)


class SurveyFile:
    """An open survey file; use it in a `with` statement."""

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self.path = path
        self._connection = connection
        self._lock: TextIO | None = None
        self.survey = schema.read_survey(connection)

    @classmethod
    def create(cls, path: Path, survey: Survey, *, meta: dict[str, str], force: bool) -> Self:
        """Write a new survey file and open it; see `write`."""
        cls.write(path, survey, meta=meta, force=force)
        return cls.open(path)

    @staticmethod
    def write(path: Path, survey: Survey, *, meta: dict[str, str], force: bool) -> None:
        """Write a new survey file.

        An existing file is left alone unless `force`; then it is replaced only once the new
        one is complete. Raises `SurveyFileError`.
        """
        if path.exists() and not force:
            raise SurveyFileError(
                f"{path} exists already; give another name, or replace it by force.",
                settings=("force",),
            )
        with written_whole(path, sqlite3.Error, error=SurveyFileError) as part:
            with closing(sqlite3.connect(part)) as connection, connection:
                schema.create(connection, survey, meta)
            for suffix in ("-wal", "-shm"):
                path.with_name(path.name + suffix).unlink(missing_ok=True)

    @classmethod
    def open(cls, path: Path) -> Self:
        """Open an existing survey file; `SurveyFileError` says why it cannot be used."""
        if path.is_dir():
            raise SurveyFileError(f"{path} is a folder, not a survey file.")
        if not path.is_file():
            raise SurveyFileError(f"{path}: there is no such survey file.")
        if path.stat().st_size == 0:
            raise SurveyFileError(f"{path} is empty: not a survey file.")
        try:
            connection = sqlite3.connect(path, isolation_level=None, timeout=10.0)
            try:
                schema.check(path, connection)
                connection.execute("PRAGMA journal_mode = WAL")
                connection.execute("PRAGMA synchronous = FULL")
                return cls(path, connection)
            except BaseException:
                connection.close()
                raise
        except sqlite3.OperationalError as error:
            raise schema.unavailable(path, error) from None
        except OSError as error:
            raise SurveyFileError(f"{path} cannot be read: {error.strerror}.") from None
        except (sqlite3.Error, LookupError, TypeError, ValueError, shapely.GEOSException) as error:
            raise schema.damaged(path, str(error)) from None

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
        """Keep other missions off this file until it is closed; readers are not disturbed.

        A lock on a file of its own beside it, which the system lifts when the process ends.
        """
        if self._lock is not None:
            return
        lock = self.path.with_name(self.path.name + ".lock")
        self._lock = lock.open("w")
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock.close()
            self._lock = None
            raise SurveyFileError(f"{self.path} is being written by another mission.") from None

    def close(self) -> None:
        """Fold the write-ahead log into the file and close it."""
        with suppress(sqlite3.Error):
            self._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        self._connection.close()
        if self._lock is not None:
            self.path.with_name(self.path.name + ".lock").unlink(missing_ok=True)
            self._lock.close()
            self._lock = None

    # -- writing ---------------------------------------------------------------------

    def append_track(self, point: Step) -> None:
        """Append one point of the track."""
        state = point.state
        self._insert(
            "track",
            {
                "geom": self._point_blob(state[0], state[1]),
                "time": time_text(point.time),
                **dict(zip(schema.STATE_COLUMNS, state, strict=True)),
                "thrust_port_n": point.thrusts[0],
                "thrust_starboard_n": point.thrusts[1],
                "target_seq": point.target_seq,
                "split_stage": point.split_stage,
                "solve_ms": point.solve_ms,
                "status": point.status,
                "current_north_mps": point.current_north_mps,
                "current_east_mps": point.current_east_mps,
            },
        )

    def append_samples(self, samples: Sequence[Sample]) -> None:
        """Append samples and count them in their targets, in one transaction."""
        with self._transaction():
            for sample in samples:
                self._insert("samples", self._sample_row(sample))
                if sample.target_seq is not None:
                    self._execute(
                        "UPDATE targets SET sample_count = sample_count + 1 WHERE seq = ?",
                        (sample.target_seq,),
                    )

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
        """Note when a target was reached; the first time stands."""
        self._execute(
            "UPDATE targets SET reached_at = ? WHERE seq = ? AND reached_at IS NULL",
            (time_text(time), seq),
        )

    def set_flags(self, flags: Mapping[str, NDArray[np.int64]]) -> None:
        """Store the flags (n,) of each quantity, in the order of `samples`, all or none."""
        keys = list(flags)
        fids = [row[0] for row in self._query("SELECT fid FROM samples ORDER BY fid")]
        setters = ", ".join(f"{key}_qc = ?" for key in keys)
        columns = [flags[key].tolist() for key in keys]
        with self._transaction():
            for row in zip(*columns, fids, strict=True):
                self._execute(f"UPDATE samples SET {setters} WHERE fid = ?", row)

    def set_meta(self, key: str, value: str) -> None:
        """Set one entry of the meta table."""
        with self._transaction():
            self._execute("DELETE FROM meta WHERE key = ?", (key,))
            self._insert("meta", {"key": key, "value": value})

    def clear_mission(self) -> None:
        """Forget track, samples, events and what was reached; the plan stays."""
        with self._transaction():
            for table in ("track", "samples", "events"):
                self._execute(f"DELETE FROM {table}")
            self._execute("UPDATE targets SET reached_at = NULL, sample_count = 0")

    # -- reading ---------------------------------------------------------------------

    def meta(self) -> dict[str, str]:
        """Return the meta table."""
        return dict(self._query("SELECT key, value FROM meta"))

    def progress(self) -> Progress:
        """Return which targets are reached."""
        rows = self._query("SELECT reached_at, sample_count FROM targets ORDER BY seq")
        return Progress(
            reached_at=tuple(None if when is None else parse_time(when) for when, _ in rows),
            sample_counts=tuple(count for _, count in rows),
        )

    def track(self) -> TrackTable:
        """Return the track in the order in which it was written."""
        columns = ", ".join(schema.STATE_COLUMNS)
        rows = self._query(
            f"SELECT time, status, target_seq, {columns}, thrust_port_n, thrust_starboard_n, "
            "solve_ms FROM track ORDER BY fid"
        )
        times = tuple(parse_time(row[0]) for row in rows)
        numbers = np.array([row[3:] for row in rows], dtype=float).reshape(-1, 9)
        return TrackTable(
            times=times,
            seconds=np.array([(t - times[0]).total_seconds() for t in times]),
            states=numbers[:, :6],
            thrusts=numbers[:, 6:8],
            solve_ms=numbers[:, 8],
            status=tuple(row[1] or "" for row in rows),
            target_seq=np.array([row[2] or 0 for row in rows], dtype=np.int64),
        )

    def samples(self) -> SampleTable:
        """Return all samples in the order in which they were written."""
        values = ", ".join(f"{key}, {key}_qc" for key in QUANTITY_KEYS)
        rows = self._query(
            f"SELECT geom, time, target_seq, speed_mps, {values} FROM samples ORDER BY fid"
        )
        lonlat = shapely.get_coordinates([geopackage.from_blob(row[0]) for row in rows])
        numbers = np.array([row[4:] for row in rows], dtype=float).reshape(
            len(rows), 2 * len(QUANTITY_KEYS)
        )
        flags = np.nan_to_num(numbers[:, 1::2], nan=Flag.MISSING).astype(np.int64)
        return SampleTable(
            times=tuple(parse_time(row[1]) for row in rows),
            positions=self.survey.frame.to_local(lonlat.reshape(-1, 2)),
            target_seq=np.array([row[2] or 0 for row in rows], dtype=np.int64),
            speed_mps=np.array([row[3] for row in rows], dtype=float),
            values={key: numbers[:, 2 * i] for i, key in enumerate(QUANTITY_KEYS)},
            flags={key: flags[:, i] for i, key in enumerate(QUANTITY_KEYS)},
        )

    def events(self) -> list[LogEntry]:
        """Return all events."""
        return [
            LogEntry(time=parse_time(time), level=level, code=code, message=message)
            for time, level, code, message in self._query(
                "SELECT time, level, code, message FROM events ORDER BY fid"
            )
        ]

    def count(self, table: str) -> int:
        """Return the number of rows of one of the layers."""
        return int(self._query(f"SELECT count(*) FROM {table}")[0][0])

    # -- plumbing --------------------------------------------------------------------

    def _sample_row(self, sample: Sample) -> dict[str, Any]:
        row: dict[str, Any] = {
            "geom": self._point_blob(sample.north_m, sample.east_m),
            "time": time_text(sample.time),
            "target_seq": sample.target_seq,
            "speed_mps": sample.speed_mps,
        }
        for key in QUANTITY_KEYS:
            row[key] = sample.values.get(key)
            row[f"{key}_qc"] = sample.flags.get(key, Flag.MISSING)
        return row

    def _point_blob(self, north_m: float, east_m: float) -> bytes:
        lon, lat = self.survey.frame.to_wgs84((north_m, east_m)).tolist()
        return geopackage.to_blob(shapely.Point(lon, lat))

    def _insert(self, table: str, row: dict[str, Any]) -> None:
        names, marks = ", ".join(row), ", ".join("?" * len(row))
        self._execute(f"INSERT INTO {table} ({names}) VALUES ({marks})", tuple(row.values()))

    def _transaction(self) -> _Transaction:
        return _Transaction(self.path, self._connection)

    def _execute(self, sql: str, values: tuple[Any, ...] = ()) -> None:
        try:
            self._connection.execute(sql, values)
        except sqlite3.Error as error:
            raise _unwritten(self.path, error) from None

    def _query(self, sql: str) -> list[Any]:
        try:
            return self._connection.execute(sql).fetchall()
        except sqlite3.Error as error:
            raise schema.damaged(self.path, str(error)) from None


class _Transaction:
    """All or nothing, with the disk's complaints turned into ours."""

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self._path = path
        self._connection = connection

    def __enter__(self) -> None:
        try:
            self._connection.execute("BEGIN IMMEDIATE")
        except sqlite3.Error as failure:
            raise _unwritten(self._path, failure) from None

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is not None:
            with suppress(sqlite3.Error):
                self._connection.execute("ROLLBACK")
            return
        try:
            self._connection.execute("COMMIT")
        except sqlite3.Error as failure:
            with suppress(sqlite3.Error):
                self._connection.execute("ROLLBACK")
            raise _unwritten(self._path, failure) from None


def _unwritten(path: Path, error: sqlite3.Error) -> SurveyFileError:
    return SurveyFileError(f"{path} cannot be written ({error}); what was recorded before is kept.")
