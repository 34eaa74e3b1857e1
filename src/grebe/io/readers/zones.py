"""Time zones as loggers write them: a name of the tz database, an offset, or letters such as EST.

They stand in a header, in every cell of a column, behind each time, or in a line before the table.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, timedelta, timezone, tzinfo
from zoneinfo import ZoneInfo

from grebe.core.errors import InputError

MOST_OFFSET_H = 14
_OFFSET = re.compile(r"(?:GMT|UTC)\s*([+-])(\d\d?)(?::?(\d\d))?(?!\d)", re.IGNORECASE)
_OFFSET_LINE = re.compile(
    r"(?:time|utc|gmt)\s*(?:zone)?\s*offset\s*[=:,]\s*([+-])?(\d\d?):(\d\d)(?::\d\d)?[,;\s]*",
    re.IGNORECASE,
)
# Zones by the letters that loggers write [h]; ambiguous ones, such as CST, are not known.
_LETTERS = {
    "HST": -10, "AKST": -9, "AKDT": -8, "PST": -8, "PDT": -7, "MST": -7, "MDT": -6, "CDT": -5,
    "EST": -5, "EDT": -4, "AST": -4, "ADT": -3, "WET": 0, "WEST": 1, "CET": 1, "CEST": 2, "MEZ": 1,
    "MESZ": 2, "EET": 2, "EEST": 3, "JST": 9, "AEST": 10, "AEDT": 11, "NZST": 12, "NZDT": 13,
}  # fmt: skip
_ZONE_IN_HEADER = re.compile(rf"(?<![A-Za-z])({'|'.join(_LETTERS)})(?![A-Za-z])")
_ZONE_IN_CELL = re.compile(rf"\s*({'|'.join(_LETTERS)})$")
_BARE_OFFSET = re.compile(r"([+-])(\d\d?)(?::?(\d\d))?")


def zone_of(name: str) -> tzinfo:
    """Return the zone of a name such as Europe/Paris; `InputError` if there is none."""
    try:
        return ZoneInfo(name)
    except (KeyError, ValueError, OSError):
        raise InputError(
            f"There is no time zone {name!r}; give one of the tz database, such as Europe/Paris.",
            settings=("zone",),
        ) from None


def zone_in_header(header: str) -> tzinfo | None:
    """Return the offset that a header such as `Date Time, GMT-04:00` names."""
    found = _OFFSET.search(header)
    if found is not None:
        return _offset(*found.groups())
    letters = _ZONE_IN_HEADER.search(header)
    if letters is not None:
        return _of_letters(letters[1])
    return UTC if re.search(r"(?<![a-z])utc(?![a-z])", header, re.IGNORECASE) else None


def _of_letters(name: str) -> tzinfo:
    return timezone(timedelta(hours=_LETTERS[name]))


def zone_in_cells(cells: Sequence[str]) -> tzinfo | None:
    """Return the zone that a column names equally in all rows; None for anything else.

    It is written as `-05:00`, `UTC` or a name of the tz database.
    """
    said = {cell.strip() for cell in cells if cell.strip()}
    if len(said) != 1:
        return None
    text = said.pop()
    bare = _BARE_OFFSET.fullmatch(text)
    if bare is not None:
        return _offset(*bare.groups())
    try:
        return zone_in_header(text) or zone_of(text)
    except InputError:
        return None


def zone_in_preamble(lines: Sequence[str]) -> tuple[tzinfo, str] | None:
    """Return the zone that a line before the header names as the times' offset, and the line.

    An example is `Time Offset = -07:00:00` in an In-Situ export.
    """
    for line in lines:
        found = _OFFSET_LINE.fullmatch(line.strip())
        zone = None if found is None else _offset(found[1] or "+", found[2], found[3])
        if zone is not None:
            return zone, line.strip()
    return None


def _offset(sign: str, hours: str, minutes: str | None) -> tzinfo | None:
    """Return the zone of an offset; None for one that no place on Earth has."""
    if int(hours) > MOST_OFFSET_H or int(minutes or 0) > 59:
        return None
    away = timedelta(hours=int(hours), minutes=int(minutes or 0))
    return timezone(-away if sign == "-" else away)


def without_zone_name(text: str) -> str:
    """Return `2024-07-03 09:15:00 UTC` as ISO 8601 has it."""
    return (
        re.sub(r"\s*(?<![A-Z])(UTC|GMT|Z)$", "+00:00", text.strip()) if text[-1:] in "CTZ" else text
    )


def without_letters(cells: Sequence[str]) -> tuple[Sequence[str], tzinfo | None]:
    """Return times without the letters of the one zone that ends all of them, and the zone."""
    said = {found[1] if (found := _ZONE_IN_CELL.search(cell)) else "" for cell in cells if cell}
    if len(said) != 1 or said == {""}:
        return cells, None
    return [_ZONE_IN_CELL.sub("", cell) for cell in cells], _of_letters(said.pop())
