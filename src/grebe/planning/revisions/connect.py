"""Lead a boat from wherever it is to its next target, around land if necessary.

A mission goes on from wherever its boat is: at the harbour to which it came home, or in a bay into
which the wind has blown it. That need not be the target before the next one, where the corridor
begins. The order stays unchanged; only the path to its next target is new.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from grebe.core.revision import PlanRevision, survey_of
from grebe.core.survey import Survey, Target
from grebe.planning.paths.corridors import REACH_CELLS, Stop, corridors_of, widened
from grebe.planning.revisions.revise import PLACE_RADIUS_M, Halfway, OpenWater, joined, transits_of

# By the error of its estimate a boat may be this far outside its corridor, or beyond the shore [m].
OFF_CORRIDOR_M = 0.5


def is_connected(
    part: Survey,
    sailable: Callable[[], BaseGeometry],
    reached: int,
    place: tuple[float, float],
) -> bool:
    """Whether a boat can sail straight on to the next target of a survey, or of a part of one.

    `sailable` returns the water for that; it is called only if the boat is outside the corridor.
    """
    ahead = part.targets[reached:]
    if not ahead:
        return True
    here = shapely.Point(place)
    if part.corridors and shapely.dwithin(part.corridors[reached], here, OFF_CORRIDOR_M):
        return True
    line = shapely.shortest_line(here, ahead[0].set.polygon)
    return bool(shapely.covers(sailable(), line))


def connected(
    old: PlanRevision, survey: Survey, open_: OpenWater, halfway: Halfway
) -> PlanRevision:
    """Return the revision with transits from the boat's place to its next target.

    Transits that led there from the previous target are left out.
    """
    part = survey_of(survey, old, halfway.sortie)
    ahead = part.targets[halfway.reached :]
    skipped = next((i for i, t in enumerate(ahead) if t.kind != "transit"), len(ahead) - 1)
    goal, rest = ahead[skipped], ahead[skipped + 1 :]
    stops = _stops(open_, halfway.place, goal)
    begin = shapely.Point(halfway.place).buffer(PLACE_RADIUS_M, quad_segs=1)
    shapes = np.array([begin, *(stop.footprint for stop in stops)], dtype=object)
    corridors = corridors_of(shapes[:-1], shapes[1:], open_.water, REACH_CELLS * open_.cell_m)
    fastest = max(target.set.speed_max_mps for target in survey.targets)
    transits = transits_of(old, widened(stops, corridors)[:-1], fastest)
    kept = halfway.reached + skipped + 1
    return joined(
        old,
        halfway.sortie,
        [*part.targets[: halfway.reached], *transits, goal, *rest],
        [*part.corridors[: halfway.reached], *corridors, *part.corridors[kept:]],
        reason="resumed",
        note=f"the boat continues to target {goal.seq} from another place; transit targets on "
        f"the way: {len(transits)}",
    )


def _stops(open_: OpenWater, place: tuple[float, float], goal: Target) -> list[Stop]:
    """The stops on the path from a place to a target, with the target as the last."""
    here, there = open_.nearest(shapely.Point(place)), open_.nearest(goal.set.polygon.centroid)
    last = Stop(footprint=goal.set.polygon, cell=None)
    if here == there:
        return [last]
    first = Stop(footprint=open_.cells[here].footprint, cell=None)
    return [first, *open_.finder.around(here, there), last]
