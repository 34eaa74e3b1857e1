"""Read an open survey file: the plan, the track, the samples, the events."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grebe.core.events import LogEntry
from grebe.core.quantities import Quantities
from grebe.core.revision import PlanRevision
from grebe.core.samples import Samples
from grebe.io.store import schema
from grebe.io.store.tables import (
    ROWS_AT_ONCE,
    Progress,
    TrackEnd,
    TrackTable,
    sample_columns,
    samples_of,
    track_of,
)
from grebe.io.store.timestamps import parse_time

if TYPE_CHECKING:
    from grebe.mapping.lag import Lag


class SurveyReader:
    """Reads a survey file over a connection that somebody else opens and closes.

    `survey` and `revision` are those of the plan's last revision.
    """

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self.path = path
        self._connection = connection
        self.survey, self.revision = schema.read_survey(connection)
        self._quantities = schema.read_quantities(connection)

    @property
    def quantities(self) -> Quantities:
        """The quantities that the file declares: its samples have a column for each."""
        return self._quantities

    def meta(self) -> dict[str, str]:
        """Return the meta table."""
        return dict(self._query("SELECT key, value FROM meta"))

    def progress(self) -> Progress:
        """Return which targets of the plan's last revision are reached, in its order."""
        rows = self._query("SELECT seq, reached_at, sample_count FROM targets")
        of = {seq: (when, count) for seq, when, count in rows}
        found = [of[target.seq] for target in self.survey.targets]
        return Progress(
            reached_at=tuple(None if when is None else parse_time(when) for when, _ in found),
            sample_counts=tuple(count for _, count in found),
        )

    def revisions(self) -> tuple[PlanRevision, ...]:
        """Return all revisions of the plan, the first one first."""
        try:
            return schema.read_revisions(self._connection)
        except sqlite3.Error as error:
            raise schema.damaged(self.path, str(error)) from None

    def track(self) -> TrackTable:
        """Return the track in the order in which it was written."""
        columns = ", ".join(schema.STATE_COLUMNS)
        rows = self._query(
            f"SELECT time, status, target_seq, boat, {columns}, thrust_port_n, thrust_starboard_n, "
            "solve_ms FROM track ORDER BY fid"
        )
        return track_of(rows)

    def track_ends(self, boat: int | None = None) -> tuple[TrackEnd, TrackEnd] | None:
        """Return the first and the last row of the track, or of one boat's; None if it is empty."""
        columns = ", ".join(schema.STATE_COLUMNS)
        some = "track" if boat is None else f"track WHERE boat = {int(boat)}"
        rows = self._query(
            f"SELECT time, {columns} FROM track WHERE fid IN "
            f"((SELECT min(fid) FROM {some}), (SELECT max(fid) FROM {some})) ORDER BY fid"
        )
        if not rows:
            return None
        first, last = (
            TrackEnd(time=parse_time(row[0]), state=row[1:]) for row in (rows[0], rows[-1])
        )
        return first, last

    def last_target(self, boat: int | None = None) -> int | None:
        """Return the number of the target that was steered to last; None if there is none.

        It is that of one boat, or of any.
        """
        whose = "" if boat is None else f"AND boat = {int(boat)} "
        rows = self._query(
            f"SELECT target_seq FROM track WHERE target_seq IS NOT NULL {whose}"
            "ORDER BY fid DESC LIMIT 1"
        )
        return int(rows[0][0]) if rows else None

    def last_time(self) -> datetime | None:
        """Return the latest time in the recorded mission; None if there is none.

        With several boats, the one that wrote last need not be the one with the latest time.
        """
        rows = self._query(
            "SELECT max(reached_at) FROM targets UNION ALL SELECT max(time) FROM events UNION ALL "
            + " UNION ALL ".join(
                f"SELECT time FROM {table} WHERE fid IN (SELECT max(fid) FROM {table} "
                "GROUP BY boat)"
                for table in ("track", "samples")
            )
        )
        return max((parse_time(text) for (text,) in rows if text), default=None)

    def samples(self) -> Samples:
        """Return all samples in the order in which they were written."""
        columns = ", ".join(sample_columns(self._quantities))
        blocks = self._blocks(f"SELECT {columns} FROM samples ORDER BY fid")
        return samples_of(blocks, self.survey.frame, self._quantities)

    def lags(self) -> dict[str, Lag]:
        """Return the lags that are noted, by quantity."""
        from grebe.mapping.lag import Lag

        noted = json.loads(self.meta().get("lags", "{}"))
        return {key: Lag(**one) for key, one in noted.items()}

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

    def _blocks(self, sql: str) -> Iterator[list[Any]]:
        """Yield the rows of a query in blocks."""
        try:
            cursor = self._connection.execute(sql)
            while rows := cursor.fetchmany(ROWS_AT_ONCE):
                yield rows
        except sqlite3.Error as error:
            raise schema.damaged(self.path, str(error)) from None

    def _query(self, sql: str) -> list[Any]:
        try:
            return self._connection.execute(sql).fetchall()
        except sqlite3.Error as error:
            raise schema.damaged(self.path, str(error)) from None
