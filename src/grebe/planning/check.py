"""Check a finished plan, independently of the planner: with shapely and the survey alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from grebe.core.sets import footprints_of
from grebe.core.survey import Survey, covered_share, overlap_m2

# Tolerance [m], so that rounded coordinates do not count as land.
ROUNDING_M = 1e-5


@dataclass(frozen=True, kw_only=True)
class PlanCheck:
    """The result of a check.

    `outside_m2`: area of the hulls of consecutive targets, and of corridors, outside the water;
    `coverage`: share of the water that cells cover; `overlap_m2`: area that cells share.
    `start_afloat`: whether the start is in the water; if not, the leg from it is not counted.
    """

    outside_m2: float
    coverage: float
    overlap_m2: float
    start_afloat: bool

    @property
    def holds(self) -> bool:
        """Whether the boat stays in the water and no two cells overlap."""
        return self.outside_m2 == 0.0 and self.overlap_m2 < 1e-3


def check_plan(survey: Survey, water: shapely.Polygon) -> PlanCheck:
    """Check a survey against the water that its boat may use."""
    shapes = footprints_of(survey.sets)
    pairs = shapely.geometrycollections(np.stack([shapes[:-1], shapes[1:]], axis=-1))
    hulls = [*np.asarray(shapely.convex_hull(pairs)).tolist(), *survey.corridors[1:]]
    afloat = False
    if survey.start is not None:
        place = shapely.Point(survey.start.north_m, survey.start.east_m)
        afloat = bool(water.distance(place) <= ROUNDING_M)
        if afloat:
            hulls.append(shapely.convex_hull(shapely.GeometryCollection([place, shapes[0]])))
            hulls += survey.corridors[:1]
    cells = survey.cells
    overlap = overlap_m2(cells)
    return PlanCheck(
        outside_m2=_outside_m2(np.array(hulls, dtype=object), water),
        coverage=covered_share(cells, water, overlap),
        overlap_m2=overlap,
        start_afloat=afloat,
    )


def _outside_m2(hulls: np.ndarray, water: shapely.Polygon) -> float:
    allowed = water.buffer(ROUNDING_M, join_style="mitre")
    shapely.prepare(allowed)
    doubtful = hulls[~shapely.covers(allowed, hulls)]
    return float(sum(shapely.area(shapely.difference(doubtful, allowed))))
