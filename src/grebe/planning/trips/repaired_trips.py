"""Move cells from a trip that is predicted to take too long to trips that have room.

The exchange between trips counts legs through the centres. The predicted time of a trip differs
from these by its own turns, so a trip that keeps the limit by its legs may be a per cent over it.
A tighter limit for all would cost one more trip; moving a few cells of the one trip is enough.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.core.sets import drawn_in, rings_of
from grebe.core.taut import taut_path
from grebe.planning.paths.corridors import Stop
from grebe.planning.paths.travel import WANDER
from grebe.planning.trips.lake import Lake
from grebe.planning.trips.trip_times import Depots, shortest_stretch, trip_s

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Order = NDArray[np.int64]

# Most cells that change trips, and how many of the cheapest changes are tried for each.
MOST_CHANGES, TRIED = 24, 12
# A predicted time is no less than this share of that of the legs through the centres.
LEGS_ARE = 0.6


def predicted_trip_s(lake: Lake, harbour: int, order: Order) -> float:
    """Predicted time of a trip [s]: of its taut path, and of the path home."""
    if not len(order):
        return 0.0
    footprints = [_hit(lake, stop) for stop in lake.finder.stops(order)]
    path = taut_path(lake.homes[harbour].place, footprints)
    home_m = float(lake.homes[harbour].distances_m[order[-1]])
    return lake.travel.path_s(path) + WANDER * home_m * float(np.mean(lake.travel.slowness))


def _hit(lake: Lake, stop: Stop) -> shapely.Polygon:
    """The part of a stop that the boat must reach: for a cell, its core."""
    core = lake.planner.settings.core
    if stop.cell is None or core == 1.0:
        return stop.footprint
    return shapely.Polygon(drawn_in(rings_of([stop.footprint])[0], core))


def repaired(
    lake: Lake, depots: Depots, orders: Sequence[Order], harbours: NDArray[np.int64], limit_s: float
) -> list[Order] | None:
    """Return the trips with cells moved until each is predicted to keep the limit, or None if that
    fails.
    """
    found = [np.asarray(order) for order in orders]
    seconds = [
        predicted_trip_s(lake, int(h), order) for h, order in zip(harbours, found, strict=True)
    ]
    for _ in range(MOST_CHANGES):
        worst = int(np.argmax(seconds))
        if seconds[worst] <= limit_s:
            return found
        change = _change(lake, depots, found, harbours, seconds, limit_s)
        if change is None:
            return None
        other, shorter, longer, shorter_s, longer_s = change
        found[worst], found[other] = shorter, longer
        seconds[worst], seconds[other] = shorter_s, longer_s
    return None


def _change(
    lake: Lake, depots: Depots, orders: Sequence[Order], harbours: NDArray[np.int64],
    seconds: Sequence[float], limit_s: float,
) -> tuple[int, Order, Order, float, float] | None:  # fmt: skip
    """The move of a cell from the longest trip to another with room, or None.

    Returned as the other trip, the longest one without the cell, the other with it, and the two
    predicted times [s].
    """
    worst = int(np.argmax(seconds))
    room_s = [limit_s - spent for spent in seconds]
    for _, k, other, at in _cheapest(lake, depots, orders, harbours, room_s)[:TRIED]:
        longer = np.insert(orders[other], at, orders[worst][k])
        home = int(harbours[other])
        longer_s = predicted_trip_s(lake, home, longer)
        if longer_s > limit_s or shortest_stretch(lake.costs, depots, home, longer) != (0, 0):
            continue
        shorter = np.delete(orders[worst], k)
        shorter_s = predicted_trip_s(lake, int(harbours[worst]), shorter)
        if shorter_s < seconds[worst]:
            return other, shorter, longer, shorter_s, longer_s
    return None


def _cheapest(
    lake: Lake, depots: Depots, orders: Sequence[Order], harbours: NDArray[np.int64],
    room_s: Sequence[float],
) -> list[tuple[float, int, int, int]]:  # fmt: skip
    """The moves of each cell of the longest trip to each other trip with room, the cheapest first:
    the cost [s], the cell's place, the other trip, and the place there.
    """
    worst = int(np.argmin(room_s))

    def legs_s(i: int, order: Order) -> float:
        return trip_s(lake.costs, depots, int(harbours[i]), order, len(order))

    own_s = [legs_s(i, order) for i, order in enumerate(orders)]
    costs: list[tuple[float, int, int, int]] = []
    for k, cell in enumerate(orders[worst]):
        saved = own_s[worst] - legs_s(worst, np.delete(orders[worst], k))
        for i, order in enumerate(orders):
            if i == worst:
                continue
            added = [
                (legs_s(i, np.insert(order, at, cell)) - own_s[i], at)
                for at in _near(lake, order, cell)
            ]
            cost, at = min(added)
            if LEGS_ARE * cost <= room_s[i]:
                costs.append((cost - saved, k, i, at))
    return sorted(costs)


def _near(lake: Lake, order: Order, cell: int) -> list[int]:
    """Places in a trip beside those of its cells that are nearest to a cell, and its ends."""
    centres = lake.draft.network.centres
    away = np.hypot(*(centres[order] - centres[cell]).T)
    beside = {int(i) + step for i in np.argsort(away)[:4] for step in (0, 1)}
    return sorted({0, len(order), *beside})
