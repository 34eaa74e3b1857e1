"""Units that stand in a column of their own: `Temperature`, and beside it `TempUnit` with F in each
row.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from grebe.core.errors import TrackError
from grebe.core.header_units import parse_unit, split_header

_UNIT = re.compile(r"(.*?)[ _.]*units?", re.IGNORECASE)


def with_units(
    path: Path, header: Sequence[str], rows: Sequence[Sequence[str]]
) -> tuple[list[str], list[str]]:
    """The header with the units that columns of their own name, and these columns. `TrackError`
    where such a column names more than one.
    """
    named, used = list(header), list[str]()
    for place, name in enumerate(header):
        about = _about(header, place)
        if about is None:
            continue
        told = {row[place].strip() for row in rows if place < len(row) and row[place].strip()}
        units = sorted(unit for unit in told if parse_unit(unit))
        if len({parse_unit(unit) for unit in units}) > 1:
            raise TrackError(
                f"{path}: column {name!r} names the units {', '.join(units)} of one quantity; give "
                "a file for each."
            )
        if units and not split_header(header[about])[1]:
            named[about] = f"{header[about]} ({units[0]})"
            used.append(name)
    return named, used


def _about(header: Sequence[str], place: int) -> int | None:
    """The column of whose unit another one speaks: it begins with the same name, the one before or
    the only one; None where there is none.
    """
    found = _UNIT.fullmatch(header[place].strip())
    if found is None:
        return None
    stem = _plain(found[1])
    same = [
        k for k, name in enumerate(header) if k != place and stem and _plain(name).startswith(stem)
    ]
    if place - 1 in same or (not stem and place > 0):
        return place - 1
    return same[0] if len(same) == 1 else None


def _plain(text: str) -> str:
    return re.sub(r"[^a-z0-9]", "", text.lower())
