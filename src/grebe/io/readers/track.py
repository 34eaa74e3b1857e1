"""Read the track of a survey boat from CSV: positions, times and what the sonde said.

Columns are found by their names, or named by the caller. Rows whose position is missing,
zero, not on Earth or a jump are left out and reported; nothing is repaired silently.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import TrackError
from grebe.core.quantities import QUANTITY_KEYS
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
# What a column may be called, first match wins; matched on lower-case letters and digits.
_PATTERNS: dict[str, tuple[str, ...]] = {
    "time": (r"gpstimestamp", r"timestamp", r"time.*", r"datetime.*", r"unix.*"),
    "lat": (r"lat(itude)?(deg|dd)?", r".*latitude.*"),
    "lon": (r"lon(gitude)?(deg|dd)?", r"lng", r".*longitude.*"),
    "temperature_degc": (r"temp(erature)?(degc|°c|c)?", r"watertemp.*"),
    "dissolved_oxygen_mgl": (r"odomgl", r"do(mgl)?", r"dissolvedoxygen(mgl)?", r"o2mgl"),
    "ph": (r"ph",),
    "conductivity_uscm": (
        r"spcond[uµμ]scm",
        r"specificconductance.*",
        r"cond(uctivity)?[uµμ]scm",
        r"conductivity",
    ),
    "turbidity_ntu": (r"turb(idity)?(ntu|fnu)?",),
}


@dataclass(frozen=True, kw_only=True)
class TrackColumns:
    """Names of columns that the caller knows; None means: find it by its name."""

    time: str | None = None
    lat: str | None = None
    lon: str | None = None
    temperature_degc: str | None = None
    dissolved_oxygen_mgl: str | None = None
    ph: str | None = None
    conductivity_uscm: str | None = None
    turbidity_ntu: str | None = None


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

    @property
    def missing(self) -> list[str]:
        """Keys of the quantities that the file does not have."""
        return [key for key in QUANTITY_KEYS if key not in self.values]


def read_track(
    path: Path, columns: TrackColumns | None = None, header_from: Path | None = None
) -> RawTrack:
    """Read and clean a track; `TrackError` or `InputError` says what is wrong with it.

    `header_from` names a file whose first row holds the columns' names where this one has
    none.
    """
    columns = columns or TrackColumns()
    header, rows = _read_csv(path, header_from)
    found = _find_columns(path, header, columns)
    table = {key: _column(rows, header.index(name)) for key, name in found.items() if key != "time"}
    times = _times(rows, header.index(found["time"])) if "time" in found else None
    if times is None and columns.time is not None:
        example = (*rows[0], *header)[header.index(columns.time)]
        raise TrackError(
            f"{path}: column {columns.time!r} holds {example!r} and the like, which are no times; "
            "give unix seconds or ISO 8601."
        )
    lonlat = np.column_stack([table["lon"], table["lat"]])
    keep, notes = _find_glitches(lonlat, times)
    _refuse_if_hopeless(path, lonlat, keep)
    return RawTrack(
        lonlat=lonlat[keep],
        times=None if times is None else times[keep],
        values={key: table[key][keep] for key in QUANTITY_KEYS if key in table},
        columns=found,
        notes=tuple(notes),
    )


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


def _find_columns(path: Path, header: list[str], given: TrackColumns) -> dict[str, str]:
    found: dict[str, str] = {}
    plain: dict[str, str] = {}
    for name in header:
        if not _NOT_A_VALUE.search(name.lower()):
            plain.setdefault(re.sub(r"[^a-z0-9°µμ]", "", name.lower()), name)
    for field in fields(given):
        name = getattr(given, field.name)
        if name is not None:
            if name not in header:
                raise TrackError(
                    f"{path}: there is no column {name!r}; it has {', '.join(header)}."
                )
            found[field.name] = name
            continue
        for pattern in _PATTERNS[field.name]:
            match = next((plain[key] for key in plain if re.fullmatch(pattern, key)), None)
            if match is not None:
                found[field.name] = match
                break
    for key, option in (("lat", "--lat-column"), ("lon", "--lon-column")):
        if key not in found:
            raise TrackError(
                f"{path}: no column looks like a {'lat' if key == 'lat' else 'long'}itude; "
                f"name it with {option} (columns: {', '.join(header)})."
            )
    return found


def _column(rows: Sequence[Sequence[str]], index: int) -> NDArray[np.float64]:
    values = np.full(len(rows), np.nan)
    for i, row in enumerate(rows):
        number = _number(row[index]) if index < len(row) else None
        if number is not None:
            values[i] = number
    values[~np.isfinite(values)] = np.nan
    return values


def _times(rows: Sequence[Sequence[str]], index: int) -> NDArray[np.float64] | None:
    """Unix seconds from numbers or ISO 8601; None where less than half can be read."""
    values = _column(rows, index)
    if np.isnan(values).all():
        for i, row in enumerate(rows):
            values[i] = _iso_seconds(row[index]) if index < len(row) else np.nan
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
    for k in range(good + 1, len(index)):
        gap = float(np.hypot(*(places[k] - places[good])))
        waited = np.nan if times is None else times[index[k]] - times[index[good]]
        allowed = reach if not np.isfinite(waited) else JUMP_SPEED_MPS * max(waited, 1.0) + 5.0
        if gap > allowed:
            jumps.append(int(index[k]))
        else:
            good = k
    return jumps


def _refuse_if_hopeless(path: Path, lonlat: NDArray[np.float64], keep: NDArray[np.bool_]) -> None:
    lat = lonlat[:, 1]
    if np.nanmax(np.abs(lat), initial=0.0) > 90:
        share = float(np.mean(np.abs(lat[np.isfinite(lat)]) > 90))
        if share > 0.5:
            raise TrackError(
                f"{path}: latitudes reach {np.nanmax(np.abs(lat)):g}, beyond 90; either latitude "
                "and longitude are swapped (--lat-column, --lon-column) or they are projected."
            )
    if keep.sum() < 3:
        raise TrackError(f"{path}: {int(keep.sum())} usable positions; a track needs three.")
