"""Read the track of a survey boat from a table: positions, times and the sonde's readings.

Columns are found by their names and units, or named by the caller. Rows whose position is missing,
zero, not on Earth, a jump, or repeated while the boat went on are left out and reported. Nothing is
repaired silently, and each column that is not used is reported.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import tzinfo
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import TrackError
from grebe.core.oxygen import oxygen_solubility_mgl
from grebe.core.quantities import BUILTIN, Quantities
from grebe.core.samples import LONG_PAUSE_S
from grebe.io.readers.ambiguities import ambiguities
from grebe.io.readers.columns import DATE, OXYGEN, Column, find_columns
from grebe.io.readers.formats import read_logged
from grebe.io.readers.glitches import find_glitches
from grebe.io.readers.places import read_places
from grebe.io.readers.profile import Profile
from grebe.io.readers.table import Table, cells_of, no_numbers, numbers_of
from grebe.io.readers.times import read_time_columns

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Rows are sorted by their times if that lengthens the boat's path by no more than this factor.
NO_LONGER = 1.05

# A depth in one column, of the water or of the sonde.
WATER_DEPTH, SONDE_DEPTH = "water_depth_m", "sonde_depth_m"
# A sonde below a small boat does not usually hang deeper than this [m].
SONDE_HANGS_M = 2.0

# Columns that the caller knows, by `time`, `lat`, `lon` or the key of a quantity; the others are
# found by their names.
TrackColumns = Mapping[str, str]


@dataclass(frozen=True, kw_only=True)
class RawTrack:
    """A track without glitches.

    `lonlat` (n, 2) degrees; `times` (n,) unix seconds, or None; `values` one (n,) array with NaN
    for gaps for each quantity that the file has; `columns` the column that each came from; `notes`
    what was left out or converted; `unused` the columns that were not used.
    """

    lonlat: NDArray[np.float64]
    times: NDArray[np.float64] | None
    values: dict[str, NDArray[np.float64]]
    columns: dict[str, str]
    notes: tuple[str, ...]
    unused: tuple[str, ...] = field(default=())


@dataclass(frozen=True, kw_only=True)
class Readings:
    """The rows of a table before anything is left out.

    `lonlat` (n, 2) is None if it has no positions; the rest is as in `RawTrack`.
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

    `header_from` names a file whose first row holds the columns' names if this one has none;
    `quantities` are those that are looked for; `zone` is that of times that name none; `profile`
    says what a logger's file holds.
    """
    read = read_readings(path, columns, header_from, quantities, zone=zone, profile=profile)
    return clean_track(path, read)


def clean_track(path: Path, read: Readings) -> RawTrack:
    """Make a track of readings that have positions; glitches are left out and reported."""
    lonlat, times = read.lonlat, read.times
    if lonlat is None:
        raise TrackError(f"{path}: the file holds no positions.")
    order, sorted_ = _in_order(lonlat, times)
    lonlat, times = lonlat[order], None if times is None else times[order]
    keep, notes = find_glitches(lonlat, times, order)
    _refuse_if_hopeless(path, lonlat, keep, notes)
    return RawTrack(
        lonlat=lonlat[keep],
        times=None if times is None else times[keep],
        values={key: column[order][keep] for key, column in read.values.items()},
        columns=read.columns,
        notes=(*sorted_, *notes, *read.notes, *_pauses(times, keep, order)),
        unused=read.unused,
    )


def _pauses(
    times: NDArray[np.float64] | None, keep: NDArray[np.bool_], order: NDArray[np.intp]
) -> list[str]:
    """Return a note on long pauses between the rows that are kept."""
    if times is None or keep.sum() < 2:
        return []
    rows = np.flatnonzero(keep)
    waited = np.diff(times[rows])
    longest = int(np.argmax(waited))
    count = int(np.sum(waited > LONG_PAUSE_S))
    if not count:
        return []
    hours = waited[longest] / 3600
    spell = f"{hours / 24:.0f} days" if hours > 72 else f"{hours:.0f} hours"
    longest_one = f"of {spell} after row {order[rows[longest]] + 1}"
    others = f", the longest of {count} of more than half a day" if count > 1 else ""
    return [
        f"a pause {longest_one}{others}: the map combines all days; give a file for each survey"
    ]


def _in_order(
    lonlat: NDArray[np.float64], times: NDArray[np.float64] | None
) -> tuple[NDArray[np.intp], list[str]]:
    """Return the order (n,) of the rows, and notes.

    Rows are sorted by their times if these run back and sorting does not lengthen the boat's path.
    If it does, the clock was set back, and the rows keep their order.
    """
    as_read = np.arange(len(lonlat))
    if times is None or not np.any(np.diff(times[np.isfinite(times)]) < 0):
        return as_read, []
    order = np.argsort(times, kind="stable")

    def length(rows: NDArray[np.intp]) -> float:
        steps = np.diff(lonlat[rows], axis=0)
        return float(np.nansum(np.hypot(*steps.T)))

    if length(order) > NO_LONGER * length(as_read):
        return as_read, []
    return order, ["rows out of order: sorted by their times"]


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
    """Read a table's rows, in the quantities' own units; with `placed` it must have positions."""
    profile = profile or Profile()
    given = {**profile.columns, **(columns or {})}
    table = read_logged(path, header_from, profile.names)
    found = find_columns(path, table.header, given, quantities, placed=placed)
    found, by_sounder = _of_a_sounder(found, given, quantities)
    named = given.get("time")
    clock = zone or profile.zone
    times = read_time_columns(path, table, found, named, clock, placed=placed, day=given.get(DATE))
    values, converted = _values(path, table, found, quantities)
    lonlat, said, sides = None, list[str](), list[str]()
    if "lat" in found and "lon" in found:
        lonlat, said, sides = read_places(table, found)
    columns = {key: one.name for key, one in found.items()}
    by_two = bool(times.columns)
    named_so = {name for key, name in columns.items() if not (by_two and key == "time")}
    used = {*named_so, *times.columns, *times.clues, *sides, *table.clues}
    if by_two:
        columns["time"] = " and ".join(times.columns)
    return Readings(
        lonlat=lonlat,
        times=times.times,
        values=values,
        columns=columns,
        notes=(*table.notes, *times.notes, *by_sounder, *converted, *said),
        unused=tuple(name for name in table.header if name and name not in used),
    )


def _of_a_sounder(
    found: dict[str, Column], given: TrackColumns, quantities: Quantities
) -> tuple[dict[str, Column], list[str]]:
    """Return the columns, and a note.

    A depth is the water's if there are no readings of a sonde beside it.
    """
    beside = [key for key in quantities if key in found and quantities[key].on_sonde]
    depth = found.get(SONDE_DEPTH)
    if depth is None or SONDE_DEPTH in given or WATER_DEPTH in found or beside:
        return found, []
    named = {key: one for key, one in found.items() if key != SONDE_DEPTH}
    return named | {WATER_DEPTH: depth}, [
        f"{depth.name}: taken as the depth of the water, as no reading of a sonde is beside it"
    ]


def _values(
    path: Path, table: Table, found: Mapping[str, Column], quantities: Quantities
) -> tuple[dict[str, NDArray[np.float64]], list[str]]:
    """Return the values (n,) of each quantity that the table has, in its unit, and notes."""
    values: dict[str, NDArray[np.float64]] = {}
    notes: list[str] = []
    for key, one in quantities.items():
        if key not in found:
            continue
        if found[key].name in table.mixed:
            raise TrackError(table.mixed[found[key].name])
        cells = cells_of(table, found[key].name)
        numbers = numbers_of(cells)
        values[key] = _present(numbers, one.missing)
        notes += no_numbers(found[key].name, cells, numbers)
    for key, column in found.items():
        if key in quantities:
            notes += ambiguities(column, quantities[key], found)
        if column.converted:
            values[key] = _converted(path, values, key, column)
            notes.append(_conversion_text(column, quantities[key].unit))
    sonde = values.get(SONDE_DEPTH)
    if sonde is not None and np.isfinite(sonde).any() and np.nanmedian(sonde) > SONDE_HANGS_M:
        notes.append(
            f"{found[SONDE_DEPTH].name}: taken as the depth of the sonde; if it is the water's, "
            f"name it so, as {WATER_DEPTH}=NAME"
        )
    return values, notes


def _converted(
    path: Path, values: Mapping[str, NDArray[np.float64]], key: str, column: Column
) -> NDArray[np.float64]:
    """Return values in their quantity's unit; oxygen by its solubility in fresh water, at 1 atm."""
    scaled = column.factor * values[key] + column.offset
    if not column.by_solubility:
        return scaled
    if "temperature_degc" not in values:
        raise TrackError(
            f"{path}: {column.name!r} in {column.unit} becomes {key} only with the temperature of "
            "the water, but no column looks like one.",
            settings=("columns",),
        )
    full = oxygen_solubility_mgl(values["temperature_degc"])
    return scaled / 100 * full if key == OXYGEN else 100 * scaled / full


def _conversion_text(column: Column, unit: str) -> str:
    how = " by the solubility in fresh water at 1013.25 hPa" if column.by_solubility else ""
    return f"{column.name}: converted from {column.unit} to {unit}{how}"


def _present(values: NDArray[np.float64], missing: tuple[float, ...]) -> NDArray[np.float64]:
    """Return values with NaN for the numbers that stand for none."""
    return np.where(np.isin(values, missing), np.nan, values) if missing else values


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
