"""Read the track of a survey boat from a table: positions, times and what the sonde said.

Columns are found by their names and units, or named by the caller. Rows whose position is missing,
zero, not on Earth or a jump are left out and reported; nothing is repaired silently, and each
column that is not used is told.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import tzinfo
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import InputError, TrackError
from grebe.core.oxygen import oxygen_solubility_mgl
from grebe.core.quantities import BUILTIN, Quantities
from grebe.io.readers.clock import (
    EARLIEST_S,
    LATEST_S,
    in_seconds,
    plausible,
    read_times,
    zone_in_cells,
)
from grebe.io.readers.columns import OXYGEN, Column, find_columns
from grebe.io.readers.profile import Profile
from grebe.io.readers.table import Table, number, read_table, ungrouped

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Faster than any survey boat: a step that needs more than this speed is a glitch of the GPS.
JUMP_SPEED_MPS = 10.0
# Without times, a step this many times the median step is a jump.
JUMP_FACTOR = 50.0
# Whole numbers beyond this are degrees times 1e7, as autopilots and receivers log them; metres of
# a projection are less.
E7_FROM = E7 = 1e7
# Columns that hold a date, the time standing in a column of its own.
_DATE = re.compile(r"(local|utc)?date(mmddyyyy|ddmmyyyy|yyyymmdd|mmddyy|ddmmyy|yymmdd)?")
_TIME = re.compile(r"(local|utc|gmt)?time(hhmmss|utc|gmt|hhmmsstt)?")
# A date within a cell.
_DATED = re.compile(r"\d+[-/.]\d+[-/.]\d+")
# Columns that say on which side of the equator and of Greenwich a place is, and in which zone a
# time.
_SIDES = {
    "lat": re.compile(
        r"(lat(itude)?)?(ns|nors|nsindicator)|lat(itude)?(hemi(sphere)?|dir(ection)?)"
    ),
    "lon": re.compile(
        r"(lon(gitude)?)?(ew|eorw|ewindicator)|lon(gitude)?(hemi(sphere)?|dir(ection)?)"
    ),
}
_ZONE = re.compile(r"(time)?(tz|zone|utcoffset|gmtoffset)")
# A longitude whose header says that it counts to the west, a latitude that counts to the south.
_WESTWARDS = {
    "lat": re.compile(r"[(\[]\s*(s|south)\s*[)\]]", re.IGNORECASE),
    "lon": re.compile(r"[(\[]\s*(w|west)\s*[)\]]", re.IGNORECASE),
}
# Rows are put in the order of their times where the way is not so much longer then.
NO_LONGER = 1.05

# Columns that the caller knows, by `time`, `lat`, `lon` or the key of a quantity; the others are
# found by their names.
TrackColumns = Mapping[str, str]


@dataclass(frozen=True, kw_only=True)
class RawTrack:
    """A track without glitches.

    `lonlat` (n, 2) degrees; `times` (n,) unix seconds, or None; `values` one (n,) array
    with NaN for gaps for each quantity that the file has; `columns` which column each came
    from; `notes` what was left out or converted; `unused` the columns that nothing was made of.
    """

    lonlat: NDArray[np.float64]
    times: NDArray[np.float64] | None
    values: dict[str, NDArray[np.float64]]
    columns: dict[str, str]
    notes: tuple[str, ...]
    unused: tuple[str, ...] = field(default=())


@dataclass(frozen=True, kw_only=True)
class Readings:
    """The rows of a table before anything is left out: `lonlat` (n, 2) is None where it has no
    positions, the rest is as in `RawTrack`.
    """

    lonlat: NDArray[np.float64] | None
    times: NDArray[np.float64] | None
    values: dict[str, NDArray[np.float64]]
    columns: dict[str, str]
    notes: tuple[str, ...]
    unused: tuple[str, ...]


def read_track(
    path: Path,
    columns: TrackColumns | None = None,
    header_from: Path | None = None,
    quantities: Quantities = BUILTIN,
    *,
    zone: tzinfo | None = None,
    profile: Profile | None = None,
) -> RawTrack:
    """Read and clean a track; `TrackError` or `InputError` says what is wrong with it.

    `header_from` names a file whose first row holds the columns' names where this one has
    none; `quantities` are those that are looked for; `zone` is that of times that name none;
    `profile` says what a logger's file holds.
    """
    read = read_readings(path, columns, header_from, quantities, zone=zone, profile=profile)
    return clean_track(path, read)


def clean_track(path: Path, read: Readings) -> RawTrack:
    """A track of readings that have positions, its glitches left out and reported."""
    lonlat, times = read.lonlat, read.times
    if lonlat is None:
        raise TrackError(f"{path}: the file holds no positions.")
    order, sorted_ = _in_order(lonlat, times)
    lonlat, times = lonlat[order], None if times is None else times[order]
    keep, notes = _find_glitches(lonlat, times, order)
    _refuse_if_hopeless(path, lonlat, keep, notes)
    return RawTrack(
        lonlat=lonlat[keep],
        times=None if times is None else times[keep],
        values={key: column[order][keep] for key, column in read.values.items()},
        columns=read.columns,
        notes=(*sorted_, *notes, *read.notes),
        unused=read.unused,
    )


def _in_order(
    lonlat: NDArray[np.float64], times: NDArray[np.float64] | None
) -> tuple[NDArray[np.intp], list[str]]:
    """The rows (n,) in the order of their times, where these run back and the boat's way is not
    longer so: a clock that was set back is told by the way, and the rows stay.
    """
    as_read = np.arange(len(lonlat))
    if times is None or not np.any(np.diff(times[np.isfinite(times)]) < 0):
        return as_read, []
    order = np.argsort(times, kind="stable")

    def way(rows: NDArray[np.intp]) -> float:
        steps = np.diff(lonlat[rows], axis=0)
        return float(np.nansum(np.hypot(*steps.T)))

    if way(order) > NO_LONGER * way(as_read):
        return as_read, []
    return order, ["rows out of order: put in the order of their times"]


def read_readings(
    path: Path,
    columns: TrackColumns | None = None,
    header_from: Path | None = None,
    quantities: Quantities = BUILTIN,
    *,
    zone: tzinfo | None = None,
    profile: Profile | None = None,
    placed: bool = True,
) -> Readings:
    """Read a table's rows, in the quantities' own units; `placed`: it must have positions."""
    profile = profile or Profile()
    given = {**profile.columns, **(columns or {})}
    table = read_table(path, header_from, profile.names)
    found = find_columns(path, table.header, given, quantities, placed=placed)
    places = {key: table.header.index(one.name) for key, one in found.items()}
    cells = _columns(table.rows, places)
    if table.groups:
        cells = {key: [ungrouped(cell) for cell in column] for key, column in cells.items()}
    notes = list(table.notes)
    told, clues = _zone_told(table)
    zone = zone or told or profile.zone
    times, clocks, said = _times_of(path, table, found, cells, given, zone, placed=placed)
    notes += said
    values = {
        key: _present(_numbers(cells[key]), one.missing)
        for key, one in quantities.items()
        if key in found
    }
    for key, column in found.items():
        if column.unknown:
            unit = quantities[key].unit or "its unit"
            notes.append(
                f"{column.name}: {column.unknown!r} is no unit that is known; taken as {unit}"
            )
        if column.converted:
            values[key] = _converted(path, values, key, column)
            notes.append(_conversion_text(column, quantities[key].unit))
    lonlat = None
    if "lat" in found and "lon" in found:
        signed = {key: _numbers(cells[key]) for key in _SIDES}
        for key in _SIDES:
            signed[key], said, named = _with_side(table, found[key].name, key, signed[key])
            notes += said
            clues += named
        lonlat, scaled = _degrees(signed["lon"], signed["lat"])
        notes += scaled
    if clocks:
        found = {**found, "time": Column(name=" and ".join(clocks))}
    used = {one.name for one in found.values()} | {*clocks, *clues}
    return Readings(
        lonlat=lonlat,
        times=times,
        values=values,
        columns={key: one.name for key, one in found.items()},
        notes=tuple(notes),
        unused=tuple(name for name in table.header if name and name not in used),
    )


def _times_of(
    path: Path,
    table: Table,
    found: Mapping[str, Column],
    cells: dict[str, list[str]],
    given: Mapping[str, str],
    zone: tzinfo | None,
    *,
    placed: bool,
) -> tuple[NDArray[np.float64] | None, list[str], list[str]]:
    """Times (n,) of a table, the columns that they came from where those are two, and notes.
    Seconds since 1970 count before a date and a time, which may be local.
    """
    try:
        read, clocks = None, list[str]()
        pair = _date_and_time(table.header)
        if "time" not in given and pair is not None and not _counts_seconds(cells.get("time")):
            both = _columns(table.rows, {name: table.header.index(name) for name in pair})
            texts = [
                # A clock that says the day too needs no other column for it.
                clock if _DATED.match(clock) else f"{day} {clock}"
                for day, clock in zip(*both.values(), strict=True)
            ]
            read, clocks = read_times(texts, " ".join(pair), zone), list(pair)
        if read is None and "time" in cells:
            read, clocks = read_times(cells["time"], found["time"].name, zone), []
        if read is None:
            if "time" in given:
                raise TrackError(
                    f"column {found['time'].name!r} holds {cells['time'][0]!r} and the like, which "
                    "are no times; give unix seconds or ISO 8601."
                )
            return None, [], []
        times, lost = plausible(read[0]) if placed else (read[0], [])
    except InputError as error:
        raise TrackError(f"{path}: {error}", settings=error.settings) from None
    return times, clocks, [*read[1], *lost]


def _counts_seconds(cells: Sequence[str] | None) -> bool:
    """Whether a column holds seconds, or less of them, since 1970."""
    probe = [one for one in map(number, (cells or [])[:50]) if one is not None]
    return bool(probe) and EARLIEST_S < in_seconds(float(np.median(probe))) < LATEST_S


def _zone_told(table: Table) -> tuple[tzinfo | None, list[str]]:
    """The zone that a column of its own names, and the column."""
    for place, name in enumerate(table.header):
        if _ZONE.fullmatch(re.sub(r"[^a-z]", "", name.lower())):
            zone = zone_in_cells(_columns(table.rows, {"zone": place})["zone"])
            return zone, [name] if zone else []
    return None, []


def _with_side(
    table: Table, column: str, key: str, degrees: NDArray[np.float64]
) -> tuple[NDArray[np.float64], list[str], list[str]]:
    """Latitudes or longitudes (n,) that a column of N and S, or E and W, or their own header puts
    on the other side; notes, and the column of the letters.
    """
    here, there = {"lat": ("N", "S"), "lon": ("E", "W")}[key]
    for place, name in enumerate(table.header):
        if not _SIDES[key].fullmatch(re.sub(r"[^a-z]", "", name.lower())):
            continue
        cells = _columns(table.rows, {"side": place})["side"]
        said = np.array([cell.strip().upper() for cell in cells])
        if np.isin(said, (here, there, "")).all() and (said != "").any():
            turned = np.where(said == there, -np.abs(degrees), degrees)
            return turned, [f"{name}: the side of {column}"], [name]
    if _WESTWARDS[key].search(column):
        text = f"{column}: counted to the {'west' if key == 'lon' else 'south'}"
        return -np.abs(degrees), [text], []
    return degrees, [], []


def _date_and_time(header: Sequence[str]) -> tuple[str, str] | None:
    """The columns of the date and of the time of day, where a table has one of each."""
    plain = {re.sub(r"[^a-z]", "", name.lower()): name for name in header}
    days = [name for text, name in plain.items() if _DATE.fullmatch(text)]
    clocks = [name for text, name in plain.items() if _TIME.fullmatch(text)]
    # Of several the one that says that it is no local time.
    for some in (days, clocks):
        some.sort(key=lambda name: "utc" not in name.lower() and "gmt" not in name.lower())
    return (days[0], clocks[0]) if days and clocks else None


def _degrees(
    lon: NDArray[np.float64], lat: NDArray[np.float64]
) -> tuple[NDArray[np.float64], list[str]]:
    """Positions (n, 2) in degrees, from degrees, from whole numbers of 1e-7 degrees, or from
    longitudes that count on to 360.
    """
    lonlat = np.column_stack([lon, lat])
    known = lonlat[np.isfinite(lonlat).all(axis=1) & (lonlat != 0).any(axis=1)]
    if not len(known):
        return lonlat, []
    whole = bool((known == np.rint(known)).all())
    if whole and np.median(np.abs(known).max(axis=1)) > E7_FROM:
        return lonlat / E7, ["positions in 1e-7 degrees: converted to degrees"]
    middle = np.median(known, axis=0)
    if 180 < middle[0] <= 360 and abs(middle[1]) <= 90:
        lonlat[:, 0] -= np.where(lonlat[:, 0] > 180, 360.0, 0.0)
        return lonlat, ["longitudes from 0 to 360: those beyond 180 are west"]
    return lonlat, []


def _converted(
    path: Path, values: Mapping[str, NDArray[np.float64]], key: str, column: Column
) -> NDArray[np.float64]:
    """Values in their quantity's unit; oxygen by its solubility in fresh water, at 1 atm."""
    scaled = column.factor * values[key] + column.offset
    if not column.by_solubility:
        return scaled
    if "temperature_degc" not in values:
        raise TrackError(
            f"{path}: {column.name!r} in {column.unit} becomes {key} only with the temperature of "
            "the water, and no column looks like one.",
            settings=("columns",),
        )
    full = oxygen_solubility_mgl(values["temperature_degc"])
    return scaled / 100 * full if key == OXYGEN else 100 * scaled / full


def _conversion_text(column: Column, unit: str) -> str:
    how = " by the solubility in fresh water at 1013.25 hPa" if column.by_solubility else ""
    return f"{column.name}: converted from {column.unit} to {unit}{how}"


def _present(values: NDArray[np.float64], missing: tuple[float, ...]) -> NDArray[np.float64]:
    """Values with NaN for the numbers that stand for none."""
    return np.where(np.isin(values, missing), np.nan, values) if missing else values


def _columns(rows: Sequence[Sequence[str]], places: dict[str, int]) -> dict[str, list[str]]:
    """The cells of some columns by key; empty where a row is too short."""
    if not places:
        return {}
    least = max(places.values()) + 1
    if all(len(row) >= least for row in rows):
        return {key: [row[i] for row in rows] for key, i in places.items()}
    return {key: [row[i] if i < len(row) else "" for row in rows] for key, i in places.items()}


def _numbers(cells: list[str]) -> NDArray[np.float64]:
    """Numbers (n,), NaN for anything else; all at once where all are plain."""
    try:
        values = np.array([float(cell or "nan") for cell in cells])
    except ValueError:
        numbers = map(number, cells)
        values = np.array([np.nan if one is None else one for one in numbers])
    values[~np.isfinite(values)] = np.nan
    return values


def _find_glitches(
    lonlat: NDArray[np.float64], times: NDArray[np.float64] | None, order: NDArray[np.intp]
) -> tuple[NDArray[np.bool_], list[str]]:
    """Mark the rows to keep and count what is wrong with the others; `order` (n,) are their places
    in the file.
    """
    finite = np.isfinite(lonlat).all(axis=1)
    zero = finite & (np.abs(lonlat) < 1e-9).all(axis=1)
    off_earth = finite & ((np.abs(lonlat[:, 0]) > 180) | (np.abs(lonlat[:, 1]) > 90))
    keep = finite & ~zero & ~off_earth
    jumps = _find_jumps(lonlat, times, keep)
    keep[jumps] = False
    untimed = np.zeros(len(keep), dtype=bool) if times is None else keep & ~np.isfinite(times)
    keep &= ~untimed
    where = _jump_text(jumps, lonlat, order)
    counts = {
        "have no position": int((~finite).sum()),
        "are at 0, 0": int(zero.sum()),
        "are off the Earth": int(off_earth.sum()),
        f"jump away from their neighbours{where}": len(jumps),
        "have no time": int(untimed.sum()),
    }
    return keep, [f"{count} rows {what}: left out" for what, count in counts.items() if count]


def _jump_text(jumps: Sequence[int], lonlat: NDArray[np.float64], order: NDArray[np.intp]) -> str:
    """Where the first jump is and what to do, by the number of its row of values."""
    if not jumps:
        return ""
    lon, lat = lonlat[jumps[0]].tolist()
    return (
        f" (first row {order[jumps[0]] + 1} of the values, at {lat:g} N {lon:g} E; if the boat was "
        "there, give a file for each stretch)"
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


def _refuse_if_hopeless(
    path: Path, lonlat: NDArray[np.float64], keep: NDArray[np.bool_], notes: Sequence[str]
) -> None:
    lat = lonlat[:, 1]
    if np.nanmax(np.abs(lat), initial=0.0) > 90:
        share = float(np.mean(np.abs(lat[np.isfinite(lat)]) > 90))
        if share > 0.5:
            raise TrackError(
                f"{path}: latitudes reach {np.nanmax(np.abs(lat)):g}, beyond 90; either latitude "
                "and longitude are swapped (give the columns lat and lon) or they are projected."
            )
    if keep.sum() < 3:
        why = f" ({'; '.join(notes)})" if notes else ""
        raise TrackError(
            f"{path}: {int(keep.sum())} usable positions{why}; a track needs three, in decimal "
            "degrees."
        )
