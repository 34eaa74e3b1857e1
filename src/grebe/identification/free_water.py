"""Free water for a manoeuvre: the nearest free circle to the boat."""

from __future__ import annotations

import shapely

from grebe.core.errors import PlanError
from grebe.core.survey import Survey
from grebe.identification.manoeuvre import Circle

# Radii to try if none is given, largest first [m].
RADII_M = (60.0, 50.0, 40.0, 35.0, 30.0, 25.0, 20.0, 15.0, 12.0, 10.0, 8.0, 6.0)
# A boat at a jetty may be this far from the water.
ASHORE_M = 5.0


def circle_in(survey: Survey, place: tuple[float, float], radius_m: float | None = None) -> Circle:
    """Return a circle of free water that a boat at `place` (north, east) reaches straight.

    Without a radius it is the largest of `RADII_M` that fits. Raises `PlanError` if there is none.
    """
    water = shapely.difference(survey.water, shapely.union_all(list(survey.no_go)))
    boat = shapely.Point(place)
    for radius in RADII_M if radius_m is None else (radius_m,):
        middles = shapely.buffer(water, -radius)
        if middles.is_empty:
            continue
        middle = shapely.shortest_line(middles, boat).coords[0]
        line = shapely.LineString([middle, place])
        if line.difference(water).length <= ASHORE_M:
            return Circle(north_m=middle[0], east_m=middle[1], radius_m=radius)
    least = RADII_M[-1] if radius_m is None else radius_m
    raise PlanError(
        f"{survey.name} has no free circle of {least:g} m that the boat can reach in a straight "
        "line; bring it to open water, or give a smaller radius.",
        settings=("radius_m",),
    )
