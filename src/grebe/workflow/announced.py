"""Where a fleet's boats have announced to read, taken from the plan that all share."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import shapely

from grebe.core.revision import PlanRevision, Sortie, as_planned
from grebe.core.sets import footprints_of
from grebe.core.taut import taut_path
from grebe.io.store import SurveyFile

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Polyline = NDArray[np.float64]

# Room around a boat that stays where it is, beyond the distance that boats keep [m]: it wanders,
# and the one that passes is not a point.
ROOM_M = 5.0


def announced(
    file: SurveyFile, revision: PlanRevision, own: Sortie | None, sailing: Collection[int]
) -> list[Polyline]:
    """Return the taut paths (k, 2) through what the other sorties of a revision have left.

    Each begins where its boat was last. There are none if there is only one mission. For a boat
    that is no longer `sailing` only the planned targets count: another boat takes them over, and
    nobody goes to the places that it had added itself.
    """
    if own is None:
        return []
    progress = file.progress()
    reached = {
        target.seq
        for target, when in zip(file.survey.targets, progress.reached_at, strict=True)
        if when is not None
    }
    planned = {target.seq for target in as_planned(file.revisions()).targets}
    paths: list[Polyline] = []
    for sortie in revision.sorties:
        left = [
            target
            for target in revision.targets[sortie.first - 1 : sortie.last]
            if target.seq not in reached and (sortie.boat in sailing or target.seq in planned)
        ]
        if sortie.number != own.number and left:
            sets = footprints_of([target.set for target in left])
            paths.append(taut_path(_place_of(file, sortie), sets))
    return paths


def _place_of(file: SurveyFile, sortie: Sortie) -> tuple[float, float]:
    """Return where the boat of a sortie was last, or sets out."""
    ends = file.track_ends(sortie.boat)
    if ends is None:
        return sortie.start.north_m, sortie.start.east_m
    return ends[1].state[0], ends[1].state[1]


def moored_areas(file: SurveyFile, sailing: Collection[int]) -> list[shapely.Polygon]:
    """Return the water around each boat of a fleet that has sailed and is no longer `sailing`."""
    fleet = file.survey.fleet
    if fleet is None:
        return []
    over = [boat for boat in range(1, fleet.boats + 1) if boat not in sailing]
    ends = [end for boat in over if (end := file.track_ends(boat)) is not None]
    return [shapely.Point(end[1].state[:2]).buffer(fleet.apart_m + ROOM_M) for end in ends]
