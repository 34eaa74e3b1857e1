"""Islands that a file draws as polygons of their own instead of as holes in the lake.

Whoever draws a lake by hand draws its islands on top of it. A polygon is an island if it lies
within another one and is called so, by its name, its folder or an attribute.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Which polygons within another one are land: those called islands, all of them, or none.
Islands = Literal["named", "all", "none"]
# The words by which an island is known, in English, French and German.
_WORDS = re.compile(r"\b(islands?|islets?|[iî]les?|[iî]lots?|inseln?)\b", re.IGNORECASE)
# More notes than this are summed up.
MOST_NOTES = 3


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """A geometry of a file in degrees, its name, and whether the file calls it an island."""

    geometry: BaseGeometry | None
    name: str
    is_island: bool = False


def called_island(folder: str, attributes: object) -> bool:
    """Return whether a feature's folder, or one of its attributes, says that it is an island."""
    values = attributes.values() if isinstance(attributes, Mapping) else ()
    return any(isinstance(text, str) and _WORDS.search(text) for text in (folder, *values))


def without_islands(areas: Sequence[Drawn], islands: Islands) -> tuple[list[Drawn], list[str]]:
    """Return the areas with their islands cut out, and notes.

    The notes are on what is cut out, and on polygons within another that are taken as water. An
    island is no area of its own any more. A polygon within an island is a pond, and stays.
    """
    if islands == "none":
        return list(areas), []
    geometries = np.array([one.geometry for one in areas], dtype=object)
    parts, owner = shapely.get_parts(geometries, return_index=True)
    inner, outer = _within(parts)
    depth = np.bincount(inner, minlength=len(parts))
    land = (depth % 2 == 1) & [islands == "all" or areas[one].is_island for one in owner.tolist()]
    notes: dict[bool, list[str]] = {True: [], False: []}
    for one in np.flatnonzero(depth).tolist():
        around = int(outer[inner == one][0])
        notes[bool(land[one])].append(_note((one, around), owner, areas, is_land=bool(land[one])))
    kept = [
        replace(one, geometry=_dry(parts[(owner == k) & ~land], parts[land]))
        for k, one in enumerate(areas)
        if not land[owner == k].all()
    ]
    return kept, [*_summed(notes[True]), *_summed(notes[False])]


def _within(parts: NDArray[np.object_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the indices of polygons and of those that they lie within; equal ones do not.

    Nothing is compared if a corner is not a number, which the check of the region reports.
    """
    if not np.isfinite(shapely.get_coordinates(parts)).all():
        return np.array([], dtype=np.intp), np.array([], dtype=np.intp)
    whole = shapely.make_valid(parts)
    inner, outer = shapely.STRtree(whole).query(whole, predicate="within")
    proper = inner != outer
    proper[proper] = ~shapely.equals(whole[inner[proper]], whole[outer[proper]])
    return inner[proper], outer[proper]


def _dry(parts: NDArray[np.object_], land: NDArray[np.object_]) -> BaseGeometry:
    """Return the parts of an area without the land; invalid parts are left to their checker."""
    cut = [
        shapely.difference(one, shapely.union_all(own))
        if one.is_valid and len(own := land[shapely.within(land, one)])
        else one
        for one in parts.tolist()
    ]
    pieces = [piece for one in cut for piece in shapely.get_parts(one)]
    return pieces[0] if len(pieces) == 1 else shapely.MultiPolygon(pieces)


def _note(
    pair: tuple[int, int], owner: NDArray[np.intp], areas: Sequence[Drawn], *, is_land: bool
) -> str:
    """Return a note on a polygon and the one around it; parts of one feature have one name."""
    own, around = (areas[int(owner[one])].name for one in pair)
    inner = f"polygon {pair[0] + 1}" if own in {"", around} else own
    outer = f"polygon {pair[1] + 1}" if around in {"", own} else around
    if is_land:
        return f"{inner} lies within {outer} and is taken as an island"
    return (
        f"{inner} lies within {outer} and is taken as water: if it is an island, name it so, ask "
        "for all such polygons to be islands, or cut it out of the outline"
    )


def _summed(notes: Sequence[str]) -> list[str]:
    if len(notes) <= MOST_NOTES:
        return list(notes)
    return [f"{notes[0]}; so are {len(notes) - 1} others"]
