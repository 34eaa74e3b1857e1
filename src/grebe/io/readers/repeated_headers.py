"""Find headers that are repeated among the rows.

This happens when a logger is restarted or files are appended. The columns may have changed places,
and each value after it would then be under another name.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from grebe.core.counts import counted
from grebe.core.errors import TrackError

# A row that has more than this share of the header's names is a header.
SHARE = 0.5
# Characters around a name: blanks, and the byte order mark of a file that was appended.
BLANK = " \t\ufeff"


def under_one_header(
    path: Path, header: Sequence[str], rows: list[list[str]]
) -> tuple[list[list[str]], list[str]]:
    """Return the rows without the headers among them, each value under its name, and notes.

    The rows have `header`'s columns. Raises `TrackError` if a later header names other columns.
    """
    header = _plain(header)
    names = {name for name in header if name}
    kept: list[list[str]] = []
    places: list[int] | None = None
    again = moved = 0
    for number, row in enumerate(rows, start=1):
        if _is_header(row, names):
            found = _plain(row)
            if Counter(filter(None, found)) != Counter(filter(None, header)):
                other = [name for name in found if name and name not in names]
                raise TrackError(
                    f"{path}: row {number} of the values is another header, "
                    f"{'with ' + ', '.join(other) if other else 'without some of the columns'}; "
                    "give a file for each."
                )
            places = None if found == header else _places(header, found)
            again += 1
            continue
        moved += places is not None
        kept.append(row if places is None else [row[k] if k < len(row) else "" for k in places])
    notes = [f"{counted(again, 'header')} among the rows: not used"] if again else []
    if moved:
        rows_moved = counted(moved, "row")
        notes.append(
            f"{rows_moved} below a header in another order: put in the order of the first one"
        )
    return kept, notes


def _is_header(row: Sequence[str], names: set[str]) -> bool:
    # Almost no row of values holds one of the names, so a quick look comes first.
    if not any(cell.strip(BLANK) in names for cell in row[:3]):
        return False
    cells = [cell for cell in _plain(row) if cell]
    return sum(cell in names for cell in cells) > SHARE * len(names)


def _plain(row: Sequence[str]) -> list[str]:
    """Return the cells of a header without blanks, and without empty ones after the last name."""
    cells = [cell.strip(BLANK) for cell in row]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _places(header: Sequence[str], found: list[str]) -> list[int]:
    """Return where each column of the first header is in a row below another one."""
    left = list(enumerate(found))
    places: list[int] = []
    for name in header:
        place = next(one for one in left if one[1] == name)
        left.remove(place)
        places.append(place[0])
    return places
