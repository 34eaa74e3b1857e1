"""Times as loggers write them: unix seconds, ISO 8601, a date and a time, in a zone.

Local times are converted to UTC by a zone of the tz database. The hour that happens twice when
summer time ends is resolved by the order of the record if it is continuous; if it cannot be
resolved, a note says so.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta, tzinfo
from typing import TYPE_CHECKING
from zoneinfo import ZoneInfo

import numpy as np

from grebe.core.counts import counted
from grebe.core.errors import InputError
from grebe.io.readers.counters import in_seconds, is_counted
from grebe.io.readers.table import numbers_of
from grebe.io.readers.zones import without_letters, without_zone_name, zone_in_header

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Surveys with a logger are between these [unix s]: 1990 and 2100.
EARLIEST_S, LATEST_S = 631_152_000.0, 4_102_444_800.0
# From Hawaii to Newfoundland [h].
AMERICAN_H = (-10.0, -2.5)
FIRST_YEAR = 1900
# Spreadsheets count days from 1899-12-30; this is the number of 1970-01-01, and the length of a day
# [s].
EXCEL_EPOCH_DAYS, DAY_S = 25_569.0, 86_400.0
# A time this far from the middle of a record is from before the logger's clock was set [s].
FAR_S = 366 * DAY_S
# Up to this share of a record counts as few.
FEW = 0.1
# A spreadsheet's days increase by less than this from row to row [days].
LARGEST_STEP_DAYS = 0.1
# The clock of a continuous record advances by less than the first from row to row. If day and month
# are read in the wrong order, it advances by more than the second at midnight [s].
GOING_ON_S, LEAP_S = 3_600.0, 20 * DAY_S
# Setting a clock moves it back by less than this [s]; the end of summer time by an hour.
JITTER_S = 600.0
# Formats of dates; the order of day and month is judged by the complete column.
_DAYS_FIRST = ("%d/%m/%Y", "%d.%m.%Y", "%d-%m-%Y", "%d/%m/%y", "%d.%m.%y")
_MONTHS_FIRST = ("%m/%d/%Y", "%m-%d-%Y", "%m/%d/%y", "%m%d%y")
_YEAR_FIRST = ("%Y-%m-%d", "%Y/%m/%d", "%Y%m%d", "%y%m%d")
# Formats with a two-digit year first and separators are tried only if the header says so.
_SHORT_YEAR_FIRST = ("%y/%m/%d", "%y-%m-%d", "%y.%m.%d")
_MONTH_NAMED = ("%d-%b-%Y", "%d %b %Y", "%b %d %Y", "%b %d, %Y", "%d/%b/%Y", "%d-%b-%y")
# Morning and afternoon as Spanish and some English settings of a spreadsheet write them: `a. m.`
_MERIDIAN = re.compile(r"(?<=\d)\s*([ap])\.\s?m\.?", re.IGNORECASE)
_CLOCKS = ("%H:%M:%S.%f", "%H:%M:%S", "%H:%M", "%I:%M:%S %p", "%I:%M %p", "%H%M%S")


def plausible(times: Array) -> tuple[Array, list[str]]:
    """Return times (n,) with NaN for those of a clock that was not set, and notes.

    These are times before 1990 or after 2100 among others, and the times a year or more from all
    others if they are only a few.
    """
    known = np.isfinite(times)
    possible = known & (times > EARLIEST_S) & (times < LATEST_S)
    if not possible.any():
        return times, []
    middle = float(np.median(times[possible]))
    far = possible & (np.abs(times - middle) >= FAR_S)
    if far.sum() <= FEW * known.sum():
        possible &= ~far
    lost = int((known & ~possible).sum())
    when = datetime.fromtimestamp(middle, UTC)
    notes = [f"{counted(lost, 'time')} a year or more from the others ({when:%Y-%m-%d}): not used"]
    return np.where(possible, times, np.nan), notes if lost else []


def read_times(
    cells: Sequence[str], header: str = "", zone: tzinfo | None = None
) -> tuple[Array, list[str]] | None:
    """Return unix seconds (n,), NaN where a cell holds no time, and notes.

    None if less than half of the cells hold a time. `header` may give the order of the date
    (`MM/DD/YYYY`) and an offset. `zone` is that of times that name none, UTC for None; a zone in
    the header takes precedence. Raises `InputError` if days and months cannot be distinguished.
    """
    zone = zone_in_header(header) or zone
    values = numbers_of(cells)
    if np.isfinite(values).mean() >= 0.5:
        return _of_numbers(values, header, zone)
    cells = [_MERIDIAN.sub(r" \1m", cell) for cell in cells]
    cells, own = without_letters([without_zone_name(cell) for cell in cells])
    zone = own or zone
    times, told = [_iso(cell) for cell in cells], list[str]()
    if sum(moment is not None for moment in times) < len(cells) / 2:
        times, told = _written(cells, header, zone)
    if sum(moment is not None for moment in times) < max(len(cells) / 2, 1):
        return None
    seconds, notes = _in_seconds(times, zone)
    return seconds, [*told, *notes]


def _of_numbers(values: Array, header: str, zone: tzinfo | None) -> tuple[Array, list[str]]:
    """Return seconds since 1970, or of a counter.

    The numbers may be such seconds, fractions of them (thousandths or smaller), or a spreadsheet's
    days, which are local time.
    """
    if is_counted(header):
        return in_seconds(values, header), []
    days = values - EXCEL_EPOCH_DAYS
    if _are_days(days):
        naive = [
            datetime.fromtimestamp(one * DAY_S, UTC).replace(tzinfo=None)
            if EARLIEST_S < one * DAY_S < LATEST_S
            else None
            for one in days.tolist()
        ]
        seconds, notes = _in_seconds(naive, zone)
        return seconds, ["times in a spreadsheet's days since 1899: converted", *notes]
    return in_seconds(values, header), []


def _are_days(days: Array) -> bool:
    """Return whether numbers (n,) are days since 1970 of a survey.

    They must be in range and increase as a survey's rows do: seconds from the start of something
    increase by more than a tenth.
    """
    known = days[np.isfinite(days)]
    middle = float(np.median(known)) * DAY_S
    if not EARLIEST_S < middle < LATEST_S or len(known) < 2:
        return False
    step = float(np.median(np.abs(np.diff(known))))
    return step < LARGEST_STEP_DAYS and bool(np.any(known != np.rint(known)))


def _iso(text: str) -> datetime | None:
    try:
        return datetime.fromisoformat(text.strip())
    except ValueError:
        return None


def _written(
    cells: Sequence[str], header: str, zone: tzinfo | None
) -> tuple[list[datetime | None], list[str]]:
    """Return dates and times by the one format that reads most of the column, and notes."""
    texts = [" ".join(cell.split()) for cell in cells]
    probe = texts[:: max(len(texts) // 2000, 1)] + texts[-1:]
    read: dict[str, int] = {}
    for form in _formats(header):
        read[form] = sum(_parsed(text, form) is not None for text in probe)
    best = max(read, key=lambda form: read[form])
    if not read[best]:
        return [None] * len(cells), []
    rivals = [form for form in read if read[form] == read[best] and _other_order(best, form)]
    doubtful = rivals and any(_parsed(text, best) != _parsed(text, rivals[0]) for text in probe)
    if not doubtful:
        return [_parsed(text, best) for text in texts], _short_years(texts, best)
    going_on = _going_on(texts, [best, *rivals])
    if going_on is not None:
        return [_parsed(text, going_on) for text in texts], [
            f"{texts[0]!r} and the like: read in the order of day and month in which the record "
            "continues past midnight"
        ]
    one = _months_first([best, *rivals]) if _is_american(zone) else None
    if one is None:
        raise InputError(
            f"{texts[0]!r} and the like may be day and month or month and day; state the order "
            "in the header, such as 'Date (DD/MM/YYYY)'.",
            settings=("columns",),
        )
    return [_parsed(text, one) for text in texts], [
        f"{texts[0]!r} and the like: taken as month and day, which is usual on American clocks "
        "with AM and PM"
    ]


def _short_years(texts: Sequence[str], form: str) -> list[str]:
    """Return a note on two-digit years after the day that might as well be first."""
    date, _, clock = form.partition(" ")
    read = _parsed(texts[0], form)
    if read is None or date not in _DAYS_FIRST or not date.endswith("%y"):
        return []
    mark = date[2]
    if any(_parsed(text, f"%y{mark}%m{mark}%d {clock}") is None for text in texts):
        return []
    return [
        f"{texts[0]!r} and the like: taken as day, month and year, {read:%d %B %Y}; if the year is "
        "first, say so in the header, such as 'Date (YY/MM/DD)'"
    ]


def _going_on(texts: Sequence[str], forms: Sequence[str]) -> str | None:
    """Return the one format, of those that read a column equally well, by which it is continuous.

    By all others it must jump: at midnight a clock goes on to the next day, not to the next month.
    """
    longest = [_longest_gap(texts, form) for form in forms]
    going = [form for form, gap in zip(forms, longest, strict=True) if gap <= GOING_ON_S]
    jumping = [gap for gap in longest if gap >= LEAP_S]
    if not going or len(going) + len(jumping) < len(forms) or not jumping:
        return None
    return None if any(_other_order(going[0], form) for form in going) else going[0]


def _longest_gap(texts: Sequence[str], form: str) -> float:
    """Return the longest step between two rows that a format reads [s]."""
    read = [moment for text in texts if (moment := _parsed(text, form)) is not None]
    steps = [abs((b - a).total_seconds()) for a, b in itertools.pairwise(read)]
    return max(steps, default=0.0)


def _is_american(zone: tzinfo | None) -> bool:
    """Return whether a zone is one where the month is written first."""
    offset = None if zone is None else zone.utcoffset(datetime(2020, 1, 1))
    return offset is not None and AMERICAN_H[0] <= offset / timedelta(hours=1) <= AMERICAN_H[1]


def _months_first(forms: Sequence[str]) -> str | None:
    """Return the format that has the month first, of those that read a column equally well.

    None unless all of them are of a twelve-hour clock.
    """
    if not all(form.endswith("%p") for form in forms):
        return None
    return next((form for form in forms if form.split(" ", maxsplit=1)[0] in _MONTHS_FIRST), None)


def _formats(header: str) -> list[str]:
    order = re.sub(r"[^dmy]", "", header.lower().replace("hh:mm", ""))
    dates = (*_YEAR_FIRST, *_MONTHS_FIRST, *_DAYS_FIRST)
    year_first = (*_YEAR_FIRST, *_SHORT_YEAR_FIRST)
    for mark, some in (("ddmmyy", _DAYS_FIRST), ("mmddyy", _MONTHS_FIRST), ("yymmdd", year_first)):
        if mark in order or (mark[:4] == "yymm" and "yyyymmdd" in order):
            dates = some
            break
    return [f"{date} {clock}" for date in (*dates, *_MONTH_NAMED) for clock in _CLOCKS]


def _other_order(one: str, other: str) -> bool:
    def group(form: str) -> int:
        first = form.split(" ", maxsplit=1)[0]
        return 0 if first in _DAYS_FIRST else 1 if first in _MONTHS_FIRST else 2

    return group(one) != group(other)


def _parsed(text: str, form: str) -> datetime | None:
    try:
        read = datetime.strptime(text, form)
    except ValueError:
        return None
    # Six digits may be read as a four-digit year, a month and a day, which gives the eighth
    # century.
    return read if read.year >= FIRST_YEAR else None


def _in_seconds(times: Sequence[datetime | None], zone: tzinfo | None) -> tuple[Array, list[str]]:
    local = zone or UTC
    naive = [moment for moment in times if moment is not None and moment.tzinfo is None]
    seconds = np.array(
        [
            np.nan
            if one is None
            else (one if one.tzinfo else one.replace(tzinfo=local)).timestamp()
            for one in times
        ]
    )
    notes: list[str] = []
    if naive and zone is None:
        notes.append("times without a zone: taken as UTC")
    doubtful = 0
    if isinstance(local, ZoneInfo):
        seconds, doubtful, missing = _folded(times, seconds, local)
        if missing:
            notes.append(
                f"{counted(missing, 'time')} in the hour that {local.key} skipped when summer time "
                "began: the logger's clock was not in that zone, or was not put forward"
            )
    if doubtful:
        notes.append(
            f"{counted(doubtful, 'time')} in the hour that {local} had twice when summer time "
            "ended: taken in the order of the record, the first run as summer time"
        )
    return seconds, notes


def _folded(
    times: Sequence[datetime | None], seconds: Array, zone: ZoneInfo
) -> tuple[Array, int, int]:
    """Resolve the times in the hour that came twice.

    The second run begins when the clock goes back within it. Returns the times, how many are in
    that hour, and how many in an hour that was skipped.
    """
    found, doubtful, missing = seconds.copy(), 0, 0
    latest = -np.inf
    for place, one in enumerate(times):
        if one is None or one.tzinfo is not None:
            continue
        summer, winter = (one.replace(tzinfo=zone, fold=fold).timestamp() for fold in (0, 1))
        if winter > summer:
            doubtful += 1
            found[place] = summer if summer >= latest - JITTER_S else winter
        elif winter < summer:
            missing += 1
        latest = max(latest, found[place])
    return found, doubtful, missing
