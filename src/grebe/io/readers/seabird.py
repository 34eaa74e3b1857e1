"""Read a Sea-Bird .cnv file, as SBE Data Processing converts the data of its instruments.

Lines of `*` and `#`, up to `*END*`, describe the columns, when the record began and which number
stands for no value. The columns are separated by blanks. Times are recognised by the short names of
their columns, as the manual of SBE Data Processing lists them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from grebe.core.counts import counted
from grebe.core.errors import TrackError
from grebe.io.readers.table import Table, number
from grebe.io.readers.text import read_any_text

END = "*END*"
_BEGINS = re.compile(r"\s*\*\s*Sea-?Bird\s", re.IGNORECASE)
_NAME = re.compile(r"#\s*name\s+\d+\s*=\s*([^:]*?)\s*:\s*(.*?)\s*")
_SETTING = re.compile(r"#\s*(nvalues|bad_flag|start_time|interval|file_type)\s*=\s*(.*?)\s*")
_START = re.compile(r"(\w{3}\s+\d+\s+\d{4}\s+\d+:\d\d:\d\d)(.*)")
_INTERVAL_S = re.compile(r"seconds\s*:\s*([\d.eE+-]+)")
# The source of the start: a clock that runs in UTC, or the computer that read the instrument out.
_OF_UTC, _OF_UPLOAD = re.compile(r"NMEA|UTC"), re.compile(r"upload", re.IGNORECASE)
# A quantity, what measured it, and its unit: `Oxygen, SBE 43 [ml/l]`.
_SENSED = re.compile(r"(temperature|oxygen|salinity|turbidity|depth),([^\[]*)(\[.*)", re.IGNORECASE)
_FLAG = "flag"


@dataclass(frozen=True, kw_only=True)
class _Clock:
    """A column of times, by its short name.

    It counts in units of `unit_s` seconds since `epoch`; without one, since the record's start or,
    with `of_year`, since the day before its year. `utc` if it is not local time.
    """

    name: str
    unit_s: float = 1.0
    epoch: datetime | None = None
    of_year: bool = False
    utc: bool = False


# The first that a file has is used: those in UTC first, then those with an absolute time.
_CLOCKS = (
    _Clock(name="timeQ", epoch=datetime(2000, 1, 1), utc=True),
    _Clock(name="timeN", epoch=datetime(1970, 1, 1), utc=True),
    _Clock(name="timeY", epoch=datetime(1970, 1, 1), utc=True),
    _Clock(name="timeK", epoch=datetime(2000, 1, 1)),
    _Clock(name="timeJV2", unit_s=86_400.0, of_year=True),
    _Clock(name="timeJ", unit_s=86_400.0, of_year=True),
    _Clock(name="timeS"),
    _Clock(name="timeM", unit_s=60.0),
    _Clock(name="timeH", unit_s=3_600.0),
)


@dataclass(frozen=True, kw_only=True)
class _Header:
    """The header of a .cnv file, which ends at `*END*`.

    It holds the short and the long name of each column, and the settings by their names; `begins`
    is None if no start is given, and `by` is the source of the start.
    """

    names: tuple[tuple[str, str], ...]
    settings: dict[str, str]
    begins: datetime | None
    by: str

    @property
    def shorts(self) -> list[str]:
        """The short names of the columns."""
        return [short for short, _ in self.names]


def is_seabird(path: Path, beginning: str) -> bool:
    """Return whether a file is Sea-Bird's, by its name or its beginning."""
    return path.suffix.lower() == ".cnv" or _BEGINS.match(beginning) is not None


def read_seabird(path: Path) -> Table:
    """Read a .cnv file as a table; `TrackError` or `InputError` says what is wrong with it.

    The first column is the time, if the file gives it. Scans that are marked as bad are left out,
    and numbers that stand for no value are empty.
    """
    text, told = read_any_text(path)
    before, end, after = text.partition(END)
    if not end:
        raise TrackError(f"{path}: a Sea-Bird file without a line {END} below its header.")
    header = _header(path, before)
    rows, lost = _rows(path, header, after.split("\n")[1:])
    good = _not_marked(header, rows)
    times, place, by = _times(header, rows)
    names = _names(header)
    if times:
        names = [by, *_without(names, place)]
        rows = [[at, *_without(row, place)] for at, row in zip(times, rows, strict=True)]
    bad = (f"{counted(good.count(False), 'scan')} marked as bad in the file: left out",)
    return Table(
        header=names,
        rows=[row for row, is_good in zip(rows, good, strict=True) if is_good],
        notes=(*told, *(_of_start(header) if times else ()), *lost, *(() if all(good) else bad)),
    )


def _header(path: Path, before: str) -> _Header:
    names: list[tuple[str, str]] = []
    settings: dict[str, str] = {}
    for line in before.split("\n"):
        if found := _NAME.fullmatch(line.strip()):
            names.append((found[1], found[2]))
        elif found := _SETTING.fullmatch(line.strip()):
            settings[found[1]] = found[2]
    if not names:
        raise TrackError(f"{path}: its header names no column (# name 0 = ...).")
    if settings.get("file_type", "ascii").lower() != "ascii":
        raise TrackError(f"{path}: a binary .cnv; convert it to ASCII in SBE Data Processing.")
    start = _START.fullmatch(settings.get("start_time", ""))
    return _Header(
        names=tuple(names),
        settings=settings,
        begins=None if start is None else _moment(start[1]),
        by="" if start is None else start[2],
    )


def _moment(text: str) -> datetime | None:
    try:
        return datetime.strptime(" ".join(text.split()), "%b %d %Y %H:%M:%S")
    except ValueError:
        return None


def _rows(
    path: Path, header: _Header, lines: Sequence[str]
) -> tuple[list[list[str]], tuple[str, ...]]:
    """Return the complete rows, with empty cells for numbers that stand for no value, and notes."""
    there = [row for row in map(str.split, lines) if row]
    rows = [row for row in there if len(row) == len(header.names)]
    if len(rows) <= len(there) / 2:
        raise TrackError(
            f"{path}: its header names {len(header.names)} columns, but most of its "
            f"{len(there)} rows have another number of values."
        )
    said = [f"{counted(len(there) - len(rows), 'row')} cut short: left out"]
    told = number(header.settings.get("nvalues", ""))
    short = told is not None and len(there) < told
    cut = [f"the header announces {told:.0f} rows, but there are {len(there)}"] if short else []
    bad = header.settings.get("bad_flag")
    values = [["" if cell == bad else cell for cell in row] for row in rows]
    return values, (*cut, *(said if len(rows) < len(there) else ()))


def _without(row: list[str], place: int | None) -> list[str]:
    return row if place is None else [*row[:place], *row[place + 1 :]]


def _names(header: _Header) -> list[str]:
    """Return the columns' long names, without the make for the first sensor of a quantity.

    A second sensor keeps its make, and is another column.
    """
    names: list[str] = []
    for _, name in header.names:
        found = _SENSED.fullmatch(name)
        second = found is not None and re.search(r"(^|,)\s*\d+\s*(,|$)", found[2])
        plain = name if found is None or second else f"{found[1]} {found[3]}"
        names.append(name if plain in names else plain)
    return names


def _not_marked(header: _Header, rows: list[list[str]]) -> list[bool]:
    """Return which rows (n,) the column of flags does not mark as bad."""
    if _FLAG not in header.shorts:
        return [True] * len(rows)
    place = header.shorts.index(_FLAG)
    return [bool(row[place]) for row in rows]


def _times(header: _Header, rows: list[list[str]]) -> tuple[list[str], int | None, str]:
    """Return the rows' times as ISO 8601, the place of their column, and their name.

    A row without a time is empty. The place is None if they come from the interval between rows.
    """
    for clock in _CLOCKS:
        origin = clock.epoch
        if origin is None and header.begins is not None:
            january = datetime(header.begins.year, 1, 1)
            origin = january - timedelta(days=1) if clock.of_year else header.begins
        if clock.name in header.shorts and origin is not None:
            place = header.shorts.index(clock.name)
            counts = [number(row[place]) for row in rows]
            seconds = [None if one is None else one * clock.unit_s for one in counts]
            if clock.utc or (clock.epoch is None and _OF_UTC.search(header.by)):
                origin = origin.replace(tzinfo=UTC)
            return [_at(origin, one) for one in seconds], place, f"time by {clock.name}"
    step = _INTERVAL_S.fullmatch(header.settings.get("interval", ""))
    if step is None or header.begins is None:
        return [], None, ""
    origin = header.begins.replace(tzinfo=UTC) if _OF_UTC.search(header.by) else header.begins
    step_s = number(step[1]) or 0.0
    return [_at(origin, k * step_s) for k in range(len(rows))], None, "time by start and interval"


def _at(origin: datetime, seconds: float | None) -> str:
    """Return a time as ISO 8601; empty for None, and for one that no calendar has."""
    try:
        return "" if seconds is None else (origin + timedelta(seconds=seconds)).isoformat()
    except OverflowError:
        return ""


def _of_start(header: _Header) -> tuple[str, ...]:
    if header.begins is None or not _OF_UPLOAD.search(header.by):
        return ()
    return (
        "start_time is when the instrument was read out: the times are not those of the record",
    )
