"""Positions as loggers write them: degrees, minutes, hemispheres, whole numbers of 1e-7 degrees."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from grebe.io.readers.columns import Column
from grebe.io.readers.table import Table, cells_of, numbers_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Whole numbers beyond this are degrees times 1e7, as autopilots and receivers log them; a
# projection's metres are smaller.
E7_FROM = E7 = 1e7
# Columns that give the hemisphere of a place: north or south, east or west.
_SIDES = {
    "lat": re.compile(
        r"(lat(itude)?)?(ns|nors|nsindicator)|lat(itude)?(hemi(sphere)?|dir(ection)?)"
    ),
    "lon": re.compile(
        r"(lon(gitude)?)?(ew|eorw|ewindicator)|lon(gitude)?(hemi(sphere)?|dir(ection)?)"
    ),
}
# A longitude whose header says that it counts to the west, a latitude that counts to the south.
_WESTWARDS = {
    "lat": re.compile(r"[(\[]\s*(s|south)\s*[)\]]", re.IGNORECASE),
    "lon": re.compile(r"[(\[]\s*(w|west)\s*[)\]]", re.IGNORECASE),
}
# An angle in degrees, perhaps with minutes and seconds, with its hemisphere before or after it:
# `45°30.5'N`, `N 45 30 30.1`, `45-30.508W`, `43.48211 N`.
_ANGLE = re.compile(
    r"""(?P<before>[NSEW])?\s*(?P<sign>[+-])?\s*(?P<degrees>\d{1,3}(?:\.\d+)?)\s*[°ºD:\s-]*
        (?:(?P<minutes>[0-5]?\d(?:\.\d+)?)\s*['\u2019\u2032:\s-]*)?
        (?:(?P<seconds>[0-5]?\d(?:\.\d+)?)\s*(?:["\u201d\u2033]|'')?)?\s*(?P<behind>[NSEW])?""",
    re.VERBOSE,
)
# A header of receivers' numbers, in which the last two digits before the point are minutes.
_MINUTES = re.compile(r"d{2,3}m{2}\.?m*", re.IGNORECASE)


def read_places(
    table: Table, found: Mapping[str, Column]
) -> tuple[NDArray[np.float64], list[str], list[str]]:
    """Return positions (n, 2) from a table's columns `lon` and `lat`, notes, and clues.

    Positions are longitude and latitude [deg]; clues are the columns that give their hemispheres.
    """
    signed: dict[str, NDArray[np.float64]] = {}
    notes, clues = list[str](), list[str]()
    for key in _SIDES:
        column = found[key].name
        cells = cells_of(table, column)
        angles, written = _angles(cells, column)
        signed[key], said, named = _with_side(table, column, key, angles)
        notes += [*written, *said]
        clues += named
    told = len(clues) == len(_SIDES) or all(_MINUTES.search(found[key].name) for key in _SIDES)
    if told and _hold_minutes(signed["lat"], signed["lon"]):
        signed = {key: _from_minutes(angles) for key, angles in signed.items()}
        notes.append("positions as DDMM.MMMM: converted to degrees")
    lonlat, scaled = _degrees(signed["lon"], signed["lat"])
    return lonlat, [*notes, *scaled], clues


def _hold_minutes(lat: NDArray[np.float64], lon: NDArray[np.float64]) -> bool:
    """Return whether angles (n,) are too large for degrees and none has 60 minutes or more."""
    pairs = np.abs(np.column_stack([lat, lon]))
    pairs = pairs[np.isfinite(pairs).all(axis=1)]
    if not len(pairs):
        return False
    beyond = np.median(pairs[:, 0]) > 90 and bool((pairs <= (9_000, 18_000)).all())
    return beyond and bool((pairs % 100 < 60).all())


def _from_minutes(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return degrees (n,) from numbers whose hundreds are degrees and the rest minutes."""
    size = np.abs(angles)
    return np.sign(angles) * (size // 100 + size % 100 / 60)


def _angles(cells: Sequence[str], column: str) -> tuple[NDArray[np.float64], list[str]]:
    """Return the angles (n,) [deg] of cells, and notes.

    Cells are numbers, or, if most are not, degrees with minutes and hemispheres; NaN for anything
    else.
    """
    numbers = numbers_of(cells)
    texts = sum(bool(cell.strip()) for cell in cells)
    if np.isfinite(numbers).sum() > texts / 2:
        return numbers, []
    angles = np.array([_angle(cell.strip()) for cell in cells])
    if not np.isfinite(angles).any():
        return numbers, []
    return angles, [f"{column}: degrees with minutes or sides, {cells[0].strip()!r} and the like"]


def _angle(text: str) -> float:
    """Return an angle [deg], south and west negative; NaN if the text is not an angle."""
    found = _ANGLE.fullmatch(text.upper().replace(",", "."))
    if found is None or (found["before"] and found["behind"]):
        return np.nan
    whole = [float(found[part] or 0.0) for part in ("degrees", "minutes", "seconds")]
    if found["minutes"] and "." in found["degrees"]:
        return np.nan
    angle = whole[0] + whole[1] / 60 + whole[2] / 3600
    side = found["before"] or found["behind"] or ""
    return -angle if side in {"S", "W"} or found["sign"] == "-" else angle


def _with_side(
    table: Table, column: str, key: str, degrees: NDArray[np.float64]
) -> tuple[NDArray[np.float64], list[str], list[str]]:
    """Return latitudes or longitudes (n,) with their sign, notes, and the column of the letters.

    A column of N and S, or E and W, or their own header may put them in the other hemisphere.
    """
    here, there = {"lat": ("N", "S"), "lon": ("E", "W")}[key]
    for name in table.header:
        if not _SIDES[key].fullmatch(re.sub(r"[^a-z]", "", name.lower())):
            continue
        cells = cells_of(table, name)
        said = np.array([cell.strip().upper() for cell in cells])
        if np.isin(said, (here, there, "")).all() and (said != "").any():
            turned = np.where(said == there, -np.abs(degrees), degrees)
            return turned, [f"{name}: the hemisphere of {column}"], [name]
    if _WESTWARDS[key].search(column):
        text = f"{column}: counted to the {'west' if key == 'lon' else 'south'}"
        return -np.abs(degrees), [text], []
    return degrees, [], []


def _degrees(
    lon: NDArray[np.float64], lat: NDArray[np.float64]
) -> tuple[NDArray[np.float64], list[str]]:
    """Return positions (n, 2) in degrees, and notes.

    They are given in degrees, in whole numbers of 1e-7 degrees, or with longitudes up to 360.
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
