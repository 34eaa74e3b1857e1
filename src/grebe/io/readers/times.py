"""Which columns of a table say when a row was written, and in which zone."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import tzinfo
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import InputError, TrackError
from grebe.io.readers.clock import (
    EARLIEST_S,
    JITTER_S,
    LATEST_S,
    plausible,
    read_times,
)
from grebe.io.readers.columns import Column
from grebe.io.readers.counters import in_seconds, is_counted
from grebe.io.readers.table import Table, cells_of, number
from grebe.io.readers.zones import zone_in_cells, zone_in_preamble

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Columns that hold only a date, with the time in another column.
_DATE = re.compile(
    r"(local|utc)?(date|datum|fecha)(mmddyyyy|ddmmyyyy|yyyymmdd|mmddyy|ddmmyy|yymmdd)?"
)
_TIME = re.compile(r"(local|utc|gmt)?(time|uhrzeit|zeit|heure|hora)(hhmmss|utc|gmt|hhmmsstt)?")
# A date within a cell.
_DATED = re.compile(r"\d+[-/.]\d+[-/.]\d+")
# Minutes and seconds.
_MINUTES = re.compile(r"\d?\d:\d\d([.,]\d+)?")
# A twelve-hour clock goes back by this at one o'clock.
HALF_DAY_H = 12.0
# The column of a zone.
_ZONE = re.compile(r"(time)?(tz|zone|utcoffset|gmtoffset)")


@dataclass(frozen=True, kw_only=True)
class Times:
    """The times (n,) of a table [unix s], None if it has none.

    `columns` are those that they came from, if not the one named like a time; `clues` are the
    columns that give their zone; `notes` are for the user.
    """

    times: NDArray[np.float64] | None = None
    columns: tuple[str, ...] = ()
    clues: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def read_time_columns(
    path: Path,
    table: Table,
    found: Mapping[str, Column],
    named: str | None,
    zone: tzinfo | None,
    *,
    placed: bool,
    day: str | None = None,
) -> Times:
    """Read the times of a table's rows.

    `named` is the column that the caller says they are in, `zone` that of times that name none, and
    `day` the column of their date, if the caller names one. For a track, which is `placed`, those
    of a clock that was not set are left out.
    """
    told, clues = stated_zone(table)
    before = zone_in_preamble(table.preamble)
    own = told or zone
    from_before = own is None and before is not None
    if from_before and before is not None:
        own = before[0]
    try:
        read, columns = _read(table, found, named, day, own)
        if read is None:
            if named is not None:
                cell = cells_of(table, named)[0]
                raise TrackError(
                    f"column {named!r} holds {cell!r} and the like, which are not times; give "
                    "unix seconds or ISO 8601."
                )
            return Times(notes=tuple(_unread(table, found)))
        times, lost = plausible(read[0]) if placed else (read[0], [])
    except InputError as error:
        raise TrackError(f"{path}: {error}", settings=error.settings) from None
    said = [f"{before[1]}: the zone of the times"] if from_before and before is not None else []
    notes = (*said, *read[1], *lost, *(_goes_backwards(times) if placed else ()))
    return Times(times=times, columns=tuple(columns), clues=tuple(clues), notes=notes)


def _unread(table: Table, found: Mapping[str, Column]) -> list[str]:
    """Return a note on a column that is named like times and holds none."""
    if "time" not in found:
        return []
    name = found["time"].name
    cell = next((cell for cell in cells_of(table, name) if cell.strip()), "")
    why = "no date and time"
    if _MINUTES.fullmatch(cell.strip()):
        why = "minutes and seconds alone, which is all that a spreadsheet saves of times shown so"
    elif number(cell) is not None:
        why = "a count from an unknown start"
    return [f"column {name!r} holds {cell!r} and the like, {why}"]


def _goes_backwards(times: NDArray[np.float64]) -> list[str]:
    """Return a note on a clock that runs back."""
    rows = np.flatnonzero(np.isfinite(times))
    step = np.diff(times[rows])
    back = np.flatnonzero(step < -JITTER_S)
    if not len(back):
        return []
    row, hours = int(rows[back[0]]) + 2, -float(step[back[0]]) / 3600
    why = ""
    if abs(hours - HALF_DAY_H) < 0.1:
        why = ": a clock of twelve hours without AM and PM"
    return [f"the clock runs back by {hours:.1f} h at row {row}{why}"]


def _read(
    table: Table,
    found: Mapping[str, Column],
    named: str | None,
    day: str | None,
    zone: tzinfo | None,
) -> tuple[tuple[NDArray[np.float64], list[str]] | None, list[str]]:
    """Return times and notes, and the two columns they come from if a date and a time are separate.

    Seconds since 1970 take precedence over a date and a time, which may be local, and these over
    counts from an unknown beginning.
    """
    alone = cells_of(table, found["time"].name) if "time" in found else None
    pair = _date_and_time(table.header) if day is None else _beside(day, found)
    by_two = day is not None or (named is None and not _counts_seconds(alone, found))
    if pair is not None and by_two:
        both = [cells_of(table, name) for name in pair]
        texts = [
            # A clock that includes the day needs no other column for it.
            clock if _DATED.match(clock) else f"{day} {clock}"
            for day, clock in zip(*both, strict=True)
        ]
        read = read_times(texts, " ".join(pair), zone)
        if read is not None:
            return read, list(pair)
    if alone is None:
        stamps = _dated(table, None)
        return (None, []) if stamps is None else (_stamps(table, stamps, zone), [stamps])
    name = found["time"].name
    counts = named is None and is_counted(name) and not _counts_seconds(alone, found)
    better = _dated(table, name) if counts else None
    if better is not None:
        return _stamps(table, better, zone), [better]
    return read_times(alone, name, zone), []


def _beside(day: str, found: Mapping[str, Column]) -> tuple[str, str]:
    """Return the column of the date that the caller named, and that of the time of day."""
    if "time" not in found:
        raise InputError(
            f"a column of dates is given, {day!r}, but none of the time of day; name it, as "
            "time=NAME.",
            settings=("columns",),
        )
    return day, found["time"].name


def _counts_seconds(cells: Sequence[str] | None, found: Mapping[str, Column]) -> bool:
    """Return whether the column of times, which holds some cells, counts since 1970."""
    probe = [one for one in map(number, (cells or [])[:50]) if one is not None]
    if not probe:
        return False
    middle = float(np.median(in_seconds(np.array(probe), found["time"].name)))
    return EARLIEST_S < middle < LATEST_S


def _stamps(
    table: Table, name: str, zone: tzinfo | None
) -> tuple[NDArray[np.float64], list[str]] | None:
    return read_times(cells_of(table, name), name, zone)


def _dated(table: Table, counter: str | None) -> str | None:
    """Return a column of dates with times of day; None if there is none.

    If `counter` is given, the column stands beside it, and is called a time or a date; the counts
    begin at an unknown time. Without a counter it may have any name, such as Fecha or Mesure le.
    """
    for name in table.header:
        if name == counter or (counter and not re.search("time|date", name.lower())):
            continue
        cells = list(dict.fromkeys(cell.strip() for cell in cells_of(table, name) if cell.strip()))
        # One time alone is when something else was, such as a calibration.
        if len(cells) > 1 and _DATED.match(cells[0]) and ":" in cells[0]:
            return name
    return None


def stated_zone(table: Table) -> tuple[tzinfo | None, list[str]]:
    """Return the zone that a separate column names, and the column."""
    for name in table.header:
        if _ZONE.fullmatch(re.sub(r"[^a-z]", "", name.lower())):
            zone = zone_in_cells(cells_of(table, name))
            return zone, [name] if zone else []
    return None, []


def _date_and_time(header: Sequence[str]) -> tuple[str, str] | None:
    """Return the columns of the date and of the time of day, if a table has both."""
    plain = {re.sub(r"[^a-z]", "", name.lower()): name for name in header}
    days = [name for text, name in plain.items() if _DATE.fullmatch(text)]
    clocks = [name for text, name in plain.items() if _TIME.fullmatch(text)]
    # Of several, prefer one that says that it is not local time.
    for some in (days, clocks):
        some.sort(key=lambda name: "utc" not in name.lower() and "gmt" not in name.lower())
    return (days[0], clocks[0]) if days and clocks else None
