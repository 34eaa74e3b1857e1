"""A table as loggers export it: the lines before the header, the header, and the rows.

Instruments write lines about themselves before the names of the columns, and some add a line of
units below them. The header is the line that names most of the expected columns.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.counts import counted
from grebe.core.errors import TrackError
from grebe.core.header_units import parse_unit, split_header
from grebe.io.readers.repeated_headers import under_one_header
from grebe.io.readers.separators import BLANKS, rows_of, separator
from grebe.io.readers.text import read_any_text
from grebe.io.readers.unit_columns import with_units

if TYPE_CHECKING:
    from numpy.typing import NDArray

# A header is looked for within this many lines.
LONGEST_PREAMBLE = 120
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+(\.\d+)?")
_DECIMAL_POINT = re.compile(r"[+-]?\d+\.\d+")
# In a line of units: how a date or a time of day is written, such as MMDDYY.
_ORDER_OF_DATE = re.compile(r"(?=.*[DH])[DMYHS/:.-]{6,}", re.IGNORECASE)
# Texts that stand for no value, signs aside.
_NOTHING = {"", "nan", "na", "null", "none", "nodata", "inf"}
MOST_LOOKED_AT = 5_000
_NAMES = re.compile(
    r"\b(date|time|timestamp|lat(itude)?|lon(gitude)?|lng|temp(erature)?|ph|depth|battery|turb\w*|"
    r"cond\w*|spcond|l?do|odo|rdo|dissolved|oxygen|chl\w*|salinity|pressure|q)\b"
)


@dataclass(frozen=True, kw_only=True)
class Table:
    """The names of the columns, and the rows as texts; a row may be shorter than the header.

    `groups`: commas within numbers separate thousands; `clues`: columns that are used because they
    describe others; `mixed`: messages on columns whose unit changes; `preamble`: the lines before
    the header.
    """

    header: list[str]
    rows: list[list[str]]
    notes: tuple[str, ...] = ()
    groups: bool = False
    clues: tuple[str, ...] = ()
    mixed: Mapping[str, str] = field(default_factory=dict[str, str])
    preamble: tuple[str, ...] = ()


def read_table(
    path: Path, header_from: Path | None = None, columns: Sequence[str] | None = None
) -> Table:
    """Read a table; `TrackError` or `InputError` says what is wrong with it.

    A file without a header takes its names from that of `header_from`, or from `columns`; both must
    have as many as its rows.
    """
    text, told = read_any_text(path)
    rows, delimiter = _rows(path, text)
    if not rows:
        raise TrackError(f"{path}: the file holds no values.")
    if columns is not None or header_from is not None:
        source = "the profile" if header_from is None else str(header_from)
        names = list(columns or ()) if header_from is None else _header_of(header_from)
        header = _fitting(path, rows, names, source)
        groups = _groups_thousands(rows, delimiter)
        return Table(header=header, rows=rows, notes=told, groups=groups)
    place = _header_place(rows)
    header = [cell.strip() for cell in rows[place]]
    if sum(map(is_number, header)) > len(header) / 2:
        raise TrackError(
            f"{path}: the first row begins with {', '.join(header[:3])}: values, not the names of "
            "columns; add a header row, or name a file of the same columns that has one.",
            settings=("header_from",),
        )
    body, again = under_one_header(path, header, rows[place + 1 :])
    if delimiter == BLANKS:
        _refuse_unlike(path, header, body)
    if body and _is_units(body[0]):
        units = body[0]
        body = _without_units(path, body, units)
        header = [_with_unit(name, unit.strip()) for name, unit in zip(header, units, strict=False)]
    if not body:
        raise TrackError(f"{path}: the file holds a header, but no rows.")
    header, clues, mixed = with_units(path, header, body)
    header, twice = _told_apart(header)
    before = [f"{counted(place, 'line')} before the header: not used"] if place else []
    return Table(
        header=header,
        rows=body,
        notes=(*told, *before, *again, *twice),
        groups=_groups_thousands(body, delimiter),
        clues=tuple(clues),
        mixed=mixed,
        preamble=tuple(delimiter.join(row) for row in rows[:place]),
    )


def _told_apart(header: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return a header in which no name occurs twice, and notes.

    `Temp #2` is the second column of its name.
    """
    seen: dict[str, int] = {}
    names: list[str] = []
    for name in header:
        seen[name] = seen.get(name, 0) + 1
        names.append(f"{name} #{seen[name]}" if name and seen[name] > 1 else name)
    return names, [
        f"{count} columns are called {name!r}: all but the first become {name + ' #2'!r} and so on"
        for name, count in seen.items()
        if name and count > 1
    ]


def _groups_thousands(rows: list[list[str]], delimiter: str) -> bool:
    """Return whether commas within numbers separate thousands.

    They do if each is before three digits, other numbers have decimal points, and commas separate
    the values. If something else separates the values, they are decimal commas.
    """
    if delimiter != ",":
        return False
    commas = points = 0
    for row in rows[:: max(len(rows) // MOST_LOOKED_AT, 1)]:
        for cell in row:
            if _GROUPED.fullmatch(cell.strip()):
                commas += 1
            elif _DECIMAL_COMMA.fullmatch(cell.strip()):
                return False
            points += _DECIMAL_POINT.fullmatch(cell.strip()) is not None
    return commas > 0 and points > 0


def _refuse_unlike(path: Path, header: list[str], rows: list[list[str]]) -> None:
    """Refuse a header with another length than the rows.

    A blank within a name would shift the values after it.
    """
    unlike = sum(len(row) != len(header) for row in rows)
    if rows and unlike > len(rows) / 2:
        raise TrackError(
            f"{path}: separated by blanks, its header has {len(header)} names and its rows "
            f"{len(rows[0])} values: put names that hold a blank in quotes, or name the columns by "
            "a profile.",
            settings=("profile",),
        )


def _header_of(path: Path) -> list[str]:
    rows, _ = _rows(path, read_any_text(path)[0])
    return [cell.strip() for cell in rows[_header_place(rows)]]


def _fitting(path: Path, rows: list[list[str]], names: list[str], source: str) -> list[str]:
    """Return the names, if each row has as many values.

    Otherwise a name would be over another column.
    """
    widths = {len(row) for row in rows}
    usual = max(widths, key=[len(row) for row in rows].count)
    if usual != len(names):
        raise TrackError(
            f"{path}: its rows have {usual} columns, and {source} names {len(names)}: the names "
            "would be over the wrong values; give names for exactly this format.",
            settings=("header_from",),
        )
    return names


def _header_place(rows: list[list[str]]) -> int:
    """Return the row that names most columns; the first if none names two."""

    def score(row: list[str]) -> int:
        texts = [cell for cell in row if cell.strip() and not is_number(cell)]
        named = sum(bool(_NAMES.search(re.sub(r"[_&.]", " ", cell.lower()))) for cell in texts)
        return named if named >= 2 else 0

    first = score(rows[0])
    scores = [score(row) for row in rows[:LONGEST_PREAMBLE]]
    best = max(scores)
    place = 0 if best in {0, first} else scores.index(best)
    # A row of names above rows of values is the header, however many names a later row has.
    earlier = (k for k in range(place) if scores[k] and _holds_values(rows[k + 1 : k + 3]))
    return next(earlier, place)


def _holds_values(rows: Sequence[Sequence[str]]) -> bool:
    """Return whether one of some rows is more than half numbers."""
    return any(sum(map(is_number, row)) > len(row) / 2 for row in rows if len(row) > 1)


def _is_units(row: list[str]) -> bool:
    texts = [cell.strip() for cell in row if cell.strip()]
    units = [parse_unit(text.strip("()[]")) for text in texts]
    return bool(texts) and not any(map(is_number, texts)) and any(units)


def _without_units(path: Path, rows: list[list[str]], units: list[str]) -> list[list[str]]:
    """Return the rows without the line of units, which may be repeated.

    Raises `TrackError` for another line of units.
    """
    kept: list[list[str]] = []
    for row in rows:
        if row == units:
            continue
        if not any(map(str.isdigit, row[0])) and _is_units(row):
            raise TrackError(
                f"{path}: the units {', '.join(filter(None, units))} become "
                f"{', '.join(filter(None, row))} further down; give a file for each."
            )
        kept.append(row)
    return kept


def _with_unit(name: str, unit: str) -> str:
    bare = unit.strip("()[]")
    told = parse_unit(bare) or _ORDER_OF_DATE.fullmatch(bare)
    return f"{name} ({bare})" if told and not split_header(name)[1] else name


def _rows(path: Path, text: str) -> tuple[list[list[str]], str]:
    """Return the rows of a text that are not empty, and what separates their values."""
    lines = text.lstrip().split("\n", LONGEST_PREAMBLE)[:LONGEST_PREAMBLE]
    if lines[0].lower().startswith("sep="):
        text, lines = text.lstrip().split("\n", 1)[1], lines[1:]
    if lines[0].lstrip().lower().startswith(("<?xml", "<gpx", "<kml")):
        raise TrackError(
            f"{path}: this is an XML file, and not a table of separated values; export the track "
            "as CSV, with a time, a latitude and a longitude in each row."
        )
    separates = separator(lines)
    try:
        return rows_of(text, separates, lines), separates
    except csv.Error as error:
        raise TrackError(f"{path}: not a table of separated values ({error}).") from None


def cells_of(table: Table, column: str) -> list[str]:
    """Return the cells of a column, empty where a row is too short."""
    place = table.header.index(column)
    cells = [row[place] if place < len(row) else "" for row in table.rows]
    return [_ungrouped(cell) for cell in cells] if table.groups else cells


def numbers_of(cells: Sequence[str]) -> NDArray[np.float64]:
    """Return numbers (n,), NaN for anything else; all at once if all are plain."""
    try:
        values = np.array([float(cell or "nan") for cell in cells])
    except ValueError:
        numbers = map(number, cells)
        values = np.array([np.nan if one is None else one for one in numbers])
    values[~np.isfinite(values)] = np.nan
    return values


def no_numbers(name: str, cells: Sequence[str], values: NDArray[np.float64]) -> list[str]:
    """Return a note on a column whose cells (n,) include some that are not numbers.

    Texts that stand for no value do not count. `values` (n,) are what was read.
    """
    strange = [
        cells[k] for k in np.flatnonzero(np.isnan(values)).tolist() if not _is_empty(cells[k])
    ]
    if not strange:
        return []
    few = ", ".join(repr(one.strip()) for one in list(dict.fromkeys(strange))[:3])
    are = "is not a number" if len(strange) == 1 else "are not numbers"
    return [f"{name}: {len(strange)} of {len(cells)} cells {are} ({few}): left out"]


def _is_empty(cell: str) -> bool:
    return re.sub(r"[^a-z]", "", cell.lower()) in _NOTHING and not any(map(str.isdigit, cell))


def _ungrouped(text: str) -> str:
    """Return a number without the commas between its thousands; anything else unchanged."""
    return text.replace(",", "") if _GROUPED.fullmatch(text.strip()) else text


def is_number(text: str) -> bool:
    """Return whether a cell holds a number."""
    return number(text) is not None


def number(text: str) -> float | None:
    """Return a number, with a decimal point or comma; None for anything else."""
    try:
        return float(text.replace(",", ".") if _DECIMAL_COMMA.fullmatch(text.strip()) else text)
    except ValueError:
        return None
