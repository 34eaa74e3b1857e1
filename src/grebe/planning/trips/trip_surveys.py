"""Turn the trips of a boat into surveys: each has the targets, paths around land and corridors from
its harbour and back to it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import shapely

from grebe.core.survey import Survey
from grebe.planning.planner import Draft
from grebe.planning.route.portfolio import Route
from grebe.planning.trips.fewest_trips import Trips
from grebe.planning.trips.lake import Lake

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Order = NDArray[np.int64]

# Side of the last target, a square around the harbour, or half a cell if that is smaller [m].
HARBOUR_M = 6.0


def trip_surveys(lake: Lake, trips: Trips, bound_m: float) -> list[Survey]:
    """Return the survey of each trip. `bound_m` is a lower bound of the length of a path through
    all cells of the lake.
    """
    return [
        lake.planner.survey(_draft_of(lake, harbour, order), lake.finder, bound_m)
        for harbour, order in zip(trips.harbours.tolist(), trips.orders, strict=True)
    ]


def _draft_of(lake: Lake, harbour: int, order: Order) -> Draft:
    home = lake.homes[harbour]
    cell = lake.draft.cells[home.cell].footprint
    half = min(0.5 * HARBOUR_M, 0.25 * lake.draft.cell_m)
    north, east = home.place
    square = shapely.box(north - half, east - half, north + half, east + half)
    berth = shapely.intersection(cell, square)
    return replace(
        lake.draft,
        route=Route(order=order, legs_s=0.0, method="sorties"),
        start=home.place,
        harbour=berth if isinstance(berth, shapely.Polygon) else cell,
        home=home.cell,
    )
