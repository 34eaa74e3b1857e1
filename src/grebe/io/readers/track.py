"""Read the track of a survey boat from CSV: positions, times and what the sonde said.

Columns are found by their names, or named by the caller. Rows whose position is missing,
zero, not on Earth or a jump are left out and reported; nothing is repaired silently.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import TrackError
from grebe.core.quantities import BUILTIN, Quantities
from grebe.io.readers.text import read_text

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Faster than any survey boat: a step that needs more than this speed is a glitch of the GPS.
JUMP_SPEED_MPS = 10.0
# Without times, a step this many times the median step is a jump.
JUMP_FACTOR = 50.0
LATEST_S = 1e11

_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")
# Columns that speak about another one.
_NOT_A_VALUE = re.compile(r"(_|\b)(qc|flag|quality|zone|unit|units)$")
# What the columns of time and place may be called, first match wins; those of the quantities are
# named in the registry. Matched on lower-case letters, digits and the signs of units alone.
_PATTERNS: dict[str, tuple[str, ...]] = {
    "time": (r"gpstimestamp", r"timestamp", r"time.*", r"datetime.*", r"unix.*"),
    "lat": (r"lat(itude)?(deg|dd)?", r".*latitude.*"),
    "lon": (r"lon(gitude)?(deg|dd)?", r"lng", r".*longitude.*"),
}

# Columns that the caller knows, by `time`, `lat`, `lon` or the key of a quantity; the others are
# found by their names.
TrackColumns = Mapping[str, str]


@dataclass(frozen=True, kw_only=True)
class RawTrack:
    """A track without glitches.

    `lonlat` (n, 2) degrees; `times` (n,) unix seconds, or None; `values` one (n,) array
    with NaN for gaps for each quantity that the file has; `columns` which column each came
    from; `notes` what was left out.
    """

    lonlat: NDArray[np.float64]
    times: NDArray[np.float64] | None
    values: dict[str, NDArray[np.float64]]
    columns: dict[str, str]
    notes: tuple[str, ...]


def read_track(
    path: Path,
    columns: TrackColumns | None = None,
    header_from: Path | None = None,
    quantities: Quantities = BUILTIN,
) -> RawTrack:
    """Read and clean a track; `TrackError` or `InputError` says what is wrong with it.

    `header_from` names a file whose first row holds the columns' names where this one has
    none; `quantities` are those that are looked for.
    """
    given = dict(columns or {})
    header, rows = _read_csv(path, header_from)
    found = _find_columns(path, header, given, quantities)
    cells = _columns(rows, {key: header.index(name) for key, name in found.items()})
    times = _times(cells["time"]) if "time" in found else None
    if times is None and "time" in given:
        example = cells["time"][0]
        raise TrackError(
            f"{path}: column {given['time']!r} holds {example!r} and the like, which are not "
            "times; give unix seconds or ISO 8601."
        )
    lonlat = np.column_stack([_numbers(cells["lon"]), _numbers(cells["lat"])])
    keep, notes = _find_glitches(lonlat, times)
    _refuse_if_hopeless(path, lonlat, keep)
    return RawTrack(
        lonlat=lonlat[keep],
        times=None if times is None else times[keep],
        values={
            key: _present(_numbers(cells[key])[keep], one.missing)
            for key, one in quantities.items()
            if key in found
        },
        columns=found,
        notes=tuple(notes),
    )


def _present(values: NDArray[np.float64], missing: tuple[float, ...]) -> NDArray[np.float64]:
    """Values with NaN for the numbers that stand for none."""
    return np.where(np.isin(values, missing), np.nan, values) if missing else values


def _read_csv(path: Path, header_from: Path | None) -> tuple[list[str], list[list[str]]]:
    rows = _rows(path)
    if not rows:
        raise TrackError(f"{path}: the file holds no values.")
    header = [cell.strip() for cell in rows[0]]
    if header_from is not None:
        return [cell.strip() for cell in _rows(header_from)[0]], rows
    if sum(map(_is_number, header)) > len(header) / 2:
        raise TrackError(
            f"{path}: the first row begins with {', '.join(header[:3])}: values, not the names of "
            "columns; add a header row, or name a file of the same columns that has one.",
            settings=("header_from",),
        )
    if len(rows) < 2:
        raise TrackError(f"{path}: a header and no rows.")
    return header, rows[1:]


def _rows(path: Path) -> list[list[str]]:
    text = read_text(path)
    first_line = text.lstrip().split("\n", 1)[0]
    delimiter = max(",;\t", key=first_line.count)
    try:
        return [row for row in csv.reader(io.StringIO(text), delimiter=delimiter) if any(row)]
    except csv.Error as error:
        raise TrackError(f"{path}: not a table of separated values ({error}).") from None


def _is_number(text: str) -> bool:
    return _number(text) is not None


def _number(text: str) -> float | None:
    """A number, with a point or a comma before its decimals; None for anything else."""
    try:
        return float(text.replace(",", ".") if _DECIMAL_COMMA.fullmatch(text.strip()) else text)
    except ValueError:
        return None


def _find_columns(
    path: Path, header: list[str], given: dict[str, str], quantities: Quantities
) -> dict[str, str]:
    """The name of the column of each key that the table has."""
    patterns = {**_PATTERNS, **{key: one.columns for key, one in quantities.items()}}
    for key, name in given.items():
        if key not in patterns:
            raise TrackError(
                f"{path}: a column is given for {key!r}, which is neither time, lat, lon nor a "
                f"quantity ({quantities.keys_text})."
            )
        if name not in header:
            raise TrackError(f"{path}: there is no column {name!r}; it has {', '.join(header)}.")
    plain = _plain_names(header)
    found: dict[str, str] = {}
    for key, expressions in patterns.items():
        name = given.get(key) or _first_match(expressions, plain)
        if name is not None:
            found[key] = name
    for key, what in (("lat", "latitude"), ("lon", "longitude")):
        if key not in found:
            raise TrackError(
                f"{path}: no column looks like a {what}; say which one it is, as "
                f"{key}=NAME (columns: {', '.join(header)}).",
                settings=("columns",),
            )
    return found


def _plain_names(header: list[str]) -> dict[str, str]:
    """Columns by their plain name, alone and with that of the column before: `before/this`."""
    plain: dict[str, str] = {}
    before = ""
    for name in header:
        this = re.sub(r"[^a-z0-9°µμ]", "", name.lower())
        if not _NOT_A_VALUE.search(name.lower()):
            plain.setdefault(this, name)
            plain.setdefault(f"{before}/{this}", name)
        before = this
    return plain


def _first_match(expressions: Sequence[str], plain: dict[str, str]) -> str | None:
    for expression in expressions:
        for name, column in plain.items():
            if ("/" in name) == ("/" in expression) and re.fullmatch(expression, name):
                return column
    return None


def _columns(rows: Sequence[Sequence[str]], places: dict[str, int]) -> dict[str, list[str]]:
    """The cells of some columns by key; empty where a row is too short."""
    least = max(places.values()) + 1
    if all(len(row) >= least for row in rows):
        return {key: [row[i] for row in rows] for key, i in places.items()}
    return {key: [row[i] if i < len(row) else "" for row in rows] for key, i in places.items()}


def _numbers(cells: list[str]) -> NDArray[np.float64]:
    """Numbers (n,), NaN for anything else; all at once where all are plain."""
    try:
        values = np.array([float(cell or "nan") for cell in cells])
    except ValueError:
        numbers = map(_number, cells)
        values = np.array([np.nan if one is None else one for one in numbers])
    values[~np.isfinite(values)] = np.nan
    return values


def _times(cells: list[str]) -> NDArray[np.float64] | None:
    """Unix seconds from numbers or ISO 8601; None where less than half can be read."""
    values = _numbers(cells)
    if np.isnan(values).all():
        values = np.array([_iso_seconds(cell) for cell in cells])
    # Milliseconds since 1970 are beyond any survey's seconds.
    values = np.where(values > LATEST_S, values / 1000.0, values)
    return values if np.isfinite(values).mean() >= 0.5 else None


def _iso_seconds(text: str) -> float:
    try:
        moment = datetime.fromisoformat(text.strip())
    except ValueError:
        return float("nan")
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def _find_glitches(
    lonlat: NDArray[np.float64], times: NDArray[np.float64] | None
) -> tuple[NDArray[np.bool_], list[str]]:
    """Mark the rows to keep and count what is wrong with the others."""
    finite = np.isfinite(lonlat).all(axis=1)
    zero = finite & (np.abs(lonlat) < 1e-9).all(axis=1)
    off_earth = finite & ((np.abs(lonlat[:, 0]) > 180) | (np.abs(lonlat[:, 1]) > 90))
    keep = finite & ~zero & ~off_earth
    jumps = _find_jumps(lonlat, times, keep)
    keep[jumps] = False
    untimed = np.zeros(len(keep), dtype=bool) if times is None else keep & ~np.isfinite(times)
    keep &= ~untimed
    where = _jump_text(jumps, lonlat)
    counts = {
        "have no position": int((~finite).sum()),
        "are at 0, 0": int(zero.sum()),
        "are off the Earth": int(off_earth.sum()),
        f"jump away from their neighbours{where}": len(jumps),
        "have no time": int(untimed.sum()),
    }
    return keep, [f"{count} rows {what}: left out" for what, count in counts.items() if count]


def _jump_text(jumps: Sequence[int], lonlat: NDArray[np.float64]) -> str:
    """Where the first jump is and what to do, by the number of its row of values."""
    if not jumps:
        return ""
    lon, lat = lonlat[jumps[0]].tolist()
    return (
        f" (first row {jumps[0] + 1} of the values, at {lat:g} N {lon:g} E; if the boat was there, "
        "give a file for each stretch)"
    )


def _find_jumps(
    lonlat: NDArray[np.float64], times: NDArray[np.float64] | None, keep: NDArray[np.bool_]
) -> list[int]:
    """Indices of kept rows that no boat could have reached from the last good row.

    A row is judged against the last good one; the first is judged by the median position,
    so that a glitch at the start does not condemn all that follows.
    """
    index = np.flatnonzero(keep)
    if len(index) < 3:
        return []
    scale = np.array([np.cos(np.radians(np.median(lonlat[index, 1]))), 1.0]) * 111_320.0
    places = lonlat[index] * scale
    steps = np.hypot(*np.diff(places, axis=0).T)
    reach = JUMP_FACTOR * max(float(np.median(steps)), 0.2)
    middle = np.median(places, axis=0)
    spread = np.hypot(*(places - middle).T)
    good = int(np.flatnonzero(spread <= 10 * np.median(spread) + reach)[0])
    jumps = [int(i) for i in index[:good]]
    # Where a step can be made from the row before, that row is the last good one: only the others
    # are looked at one by one.
    waited = np.full(len(steps), np.nan) if times is None else np.diff(times[index])
    doubtful = np.flatnonzero(steps > _allowed(waited, reach)) + 1
    k = good + 1
    while True:
        ahead = doubtful[np.searchsorted(doubtful, k) :]
        if not len(ahead):
            return jumps
        k = int(ahead[0])
        good = k - 1
        while k < len(index):
            gap = np.hypot(*(places[k] - places[good]))
            since = np.nan if times is None else times[index[k]] - times[index[good]]
            if gap <= _allowed(since, reach):
                break
            jumps.append(int(index[k]))
            k += 1
        k += 1


def _allowed(waited: NDArray[np.float64] | float, reach: float) -> NDArray[np.float64]:
    """How far a boat can have come in a time [s], NaN for unknown."""
    far = JUMP_SPEED_MPS * np.fmax(waited, 1.0) + 5.0
    return np.where(np.isfinite(waited), far, reach)


def _refuse_if_hopeless(path: Path, lonlat: NDArray[np.float64], keep: NDArray[np.bool_]) -> None:
    lat = lonlat[:, 1]
    if np.nanmax(np.abs(lat), initial=0.0) > 90:
        share = float(np.mean(np.abs(lat[np.isfinite(lat)]) > 90))
        if share > 0.5:
            raise TrackError(
                f"{path}: latitudes reach {np.nanmax(np.abs(lat)):g}, beyond 90; either latitude "
                "and longitude are swapped (give the columns lat and lon) or they are projected."
            )
    if keep.sum() < 3:
        raise TrackError(f"{path}: {int(keep.sum())} usable positions; a track needs three.")
