"""Units in a column of their own: `Temperature`, and beside it `TempUnit` with F in each row."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from grebe.core.header_units import parse_unit, split_header

_UNIT = re.compile(r"(.*?)[ _.]*units?", re.IGNORECASE)


def with_units(
    path: Path, header: Sequence[str], rows: Sequence[Sequence[str]]
) -> tuple[list[str], list[str], dict[str, str]]:
    """Return the header with the units that separate columns name, these columns, and messages.

    The messages are for columns whose unit changes from row to row, and are raised if one is used.
    """
    named, used, mixed = list(header), list[str](), dict[str, str]()
    for place, name in enumerate(header):
        about = _about(header, place)
        if about is None:
            continue
        told = {row[place].strip() for row in rows if place < len(row) and row[place].strip()}
        units = sorted(unit for unit in told if parse_unit(unit))
        if len({parse_unit(unit) for unit in units}) > 1:
            mixed[header[about]] = (
                f"{path}: column {name!r} names the units {', '.join(units)} of one quantity; give "
                "a file for each."
            )
        elif units and not split_header(header[about])[1]:
            named[about] = f"{header[about]} ({units[0]})"
            used.append(name)
    return named, used, mixed


def _about(header: Sequence[str], place: int) -> int | None:
    """Return the column whose unit another one gives; None if there is none.

    It begins with the same name, and is the column before or the only such one.
    """
    found = _UNIT.fullmatch(header[place].strip())
    if found is None:
        return None
    stem = _plain(found[1])
    same = [
        k for k, name in enumerate(header) if k != place and stem and _plain(name).startswith(stem)
    ]
    if not stem:
        # Alone it may be the number of a device: it describes a temperature or nothing.
        return place - 1 if place > 0 and "temp" in _plain(header[place - 1]) else None
    if place - 1 in same:
        return place - 1
    return same[0] if len(same) == 1 else None


def _plain(text: str) -> str:
    return re.sub(r"[^a-z0-9]", "", text.lower())
