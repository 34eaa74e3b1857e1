"""Times as loggers write them: unix seconds, ISO 8601, a date and a time, in a zone.

Local times are brought to UTC by a zone of the tz database. The hour that happens twice when
summer time ends is told apart by the record's order where it runs through; where it cannot be
told, that is said.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from typing import TYPE_CHECKING
from zoneinfo import ZoneInfo

import numpy as np

from grebe.core.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Milliseconds since 1970 are beyond any survey's seconds.
LATEST_S = 1e11
# A clock that is set goes back by less than this [s]; the end of summer time by an hour.
JITTER_S = 600.0
# Dates as they are written; the order of day and month is judged by the whole column.
_DAYS_FIRST = ("%d/%m/%Y", "%d.%m.%Y", "%d-%m-%Y", "%d/%m/%y", "%d.%m.%y")
_MONTHS_FIRST = ("%m/%d/%Y", "%m-%d-%Y", "%m/%d/%y", "%m%d%y")
_YEAR_FIRST = ("%Y-%m-%d", "%Y/%m/%d", "%Y%m%d", "%y%m%d")
_CLOCKS = ("%H:%M:%S.%f", "%H:%M:%S", "%H:%M", "%I:%M:%S %p", "%I:%M %p", "%H%M%S")
_OFFSET = re.compile(r"(GMT|UTC)\s*([+-])(\d\d):?(\d\d)", re.IGNORECASE)


def zone_of(name: str) -> tzinfo:
    """The zone of a name such as Europe/Paris; `InputError` where there is none."""
    try:
        return ZoneInfo(name)
    except (KeyError, ValueError, OSError):
        raise InputError(
            f"There is no time zone {name!r}; give one of the tz database, such as Europe/Paris.",
            settings=("zone",),
        ) from None


def zone_in_header(header: str) -> tzinfo | None:
    """The offset that a header such as `Date Time, GMT-04:00` names."""
    found = _OFFSET.search(header)
    if found is None:
        return None
    sign = -1 if found[2] == "-" else 1
    return timezone(sign * timedelta(hours=int(found[3]), minutes=int(found[4])))


def read_times(
    cells: Sequence[str], header: str = "", zone: tzinfo | None = None
) -> tuple[Array, list[str]] | None:
    """Unix seconds (n,), NaN where a cell holds no time, and notes; None where less than half do.

    `header` may say the order of the date (`MM/DD/YYYY`) and an offset; `zone` is that of times
    that name none, UTC for None. Raises `InputError` where days and months cannot be told apart.
    """
    values = _numbers(cells)
    if np.isfinite(values).mean() >= 0.5:
        return np.where(values > LATEST_S, values / 1000.0, values), []
    moments = [_iso(cell) for cell in cells]
    if sum(moment is not None for moment in moments) < len(cells) / 2:
        moments = _written(cells, header)
    if sum(moment is not None for moment in moments) < max(len(cells) / 2, 1):
        return None
    return _in_seconds(moments, zone or zone_in_header(header))


def _numbers(cells: Sequence[str]) -> Array:
    values = np.full(len(cells), np.nan)
    for place, cell in enumerate(cells):
        try:
            values[place] = float(cell)
        except ValueError:
            continue
    values[~np.isfinite(values)] = np.nan
    return values


def _iso(text: str) -> datetime | None:
    try:
        return datetime.fromisoformat(text.strip())
    except ValueError:
        return None


def _written(cells: Sequence[str], header: str) -> list[datetime | None]:
    """Dates and times in the one format that reads most of the column."""
    texts = [" ".join(cell.split()) for cell in cells]
    probe = texts[:: max(len(texts) // 2000, 1)] + texts[-1:]
    read: dict[str, int] = {}
    for form in _formats(header):
        read[form] = sum(_parsed(text, form) is not None for text in probe)
    best = max(read, key=lambda form: read[form])
    if not read[best]:
        return [None] * len(cells)
    rivals = [form for form in read if read[form] == read[best] and _other_order(best, form)]
    if rivals and any(_parsed(text, best) != _parsed(text, rivals[0]) for text in probe):
        raise InputError(
            f"{texts[0]!r} and the like may be day and month or month and day; write the order "
            "into the header, such as 'Date (DD/MM/YYYY)'.",
            settings=("columns",),
        )
    return [_parsed(text, best) for text in texts]


def _formats(header: str) -> list[str]:
    order = re.sub(r"[^dmy]", "", header.lower().replace("hh:mm", ""))
    dates = (*_YEAR_FIRST, *_MONTHS_FIRST, *_DAYS_FIRST)
    for mark, some in (("ddmmyy", _DAYS_FIRST), ("mmddyy", _MONTHS_FIRST), ("yymmdd", _YEAR_FIRST)):
        if mark in order or (mark[:4] == "yymm" and "yyyymmdd" in order):
            dates = some
            break
    return [f"{date} {clock}" for date in dates for clock in _CLOCKS]


def _other_order(one: str, other: str) -> bool:
    def group(form: str) -> int:
        first = form.split(" ", maxsplit=1)[0]
        return 0 if first in _DAYS_FIRST else 1 if first in _MONTHS_FIRST else 2

    return group(one) != group(other)


def _parsed(text: str, form: str) -> datetime | None:
    try:
        return datetime.strptime(text, form)
    except ValueError:
        return None


def _in_seconds(moments: Sequence[datetime | None], zone: tzinfo | None) -> tuple[Array, list[str]]:
    local = zone or UTC
    naive = [moment for moment in moments if moment is not None and moment.tzinfo is None]
    seconds = np.array(
        [
            np.nan
            if one is None
            else (one if one.tzinfo else one.replace(tzinfo=local)).timestamp()
            for one in moments
        ]
    )
    notes: list[str] = []
    if naive and zone is None:
        notes.append("times without a zone: taken as UTC")
    doubtful = 0
    if isinstance(local, ZoneInfo):
        seconds, doubtful, missing = _folded(moments, seconds, local)
        if missing:
            notes.append(
                f"{missing} times in the hour that {local.key} skipped when summer time began: "
                "the logger's clock was not in that zone, or was not put forward"
            )
    if doubtful:
        notes.append(
            f"{doubtful} times in the hour that {local} had twice when summer time ended: taken in "
            "the order of the record, the first run as summer time"
        )
    return seconds, notes


def _folded(
    moments: Sequence[datetime | None], seconds: Array, zone: ZoneInfo
) -> tuple[Array, int, int]:
    """Times in the hour that came twice, the second once the clock has gone back within it; how
    many there are, and how many in an hour that never was.
    """
    found, doubtful, missing = seconds.copy(), 0, 0
    latest = -np.inf
    for place, one in enumerate(moments):
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
