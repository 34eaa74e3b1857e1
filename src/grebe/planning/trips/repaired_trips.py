"""Trips of which one is predicted to take too long, though others have room: cells change boats.

The exchange between trips counts legs through the centres, and what a trip is predicted to take is
more or less than these by its own turns: of trips that all keep the limit by their legs one may
be a per cent over it. To draw in the limit of all would cost a trip; some cells of the one do.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.core.sets import drawn_in, rings_of
from grebe.core.taut import taut_way
from grebe.planning.trips.lake import Lake
from grebe.planning.trips.trip_times import Ports, shortest_stretch, trip_s
from grebe.planning.ways.corridors import Stop
from grebe.planning.ways.travel import WANDER

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Order = NDArray[np.int64]

# So many cells change trips at most, and so many of the cheapest changes are tried for each.
MOST_CHANGES, TRIED = 24, 12
# What is predicted is no less than this share of the legs through the centres.
LEGS_ARE = 0.6


def predicted_trip_s(lake: Lake, harbour: int, order: Order) -> float:
    """What a trip is predicted to take, by its taut way and back [s]."""
    if not len(order):
        return 0.0
    footprints = [_hit(lake, stop) for stop in lake.ways.stops(order)]
    way = taut_way(lake.homes[harbour].place, footprints)
    home_m = float(lake.homes[harbour].ways_m[order[-1]])
    return lake.travel.path_s(way) + WANDER * home_m * float(np.mean(lake.travel.slowness))


def _hit(lake: Lake, stop: Stop) -> shapely.Polygon:
    """What of a stop the boat must come to: of a cell its core."""
    core = lake.planner.settings.core
    if stop.cell is None or core == 1.0:
        return stop.footprint
    return shapely.Polygon(drawn_in(rings_of([stop.footprint])[0], core))


def repaired(
    lake: Lake, ports: Ports, orders: Sequence[Order], harbours: NDArray[np.int64], limit_s: float
) -> list[Order] | None:
    """Return the trips with cells moved until each is predicted to keep the limit; None where
    that is not come to.
    """
    found = [np.asarray(order) for order in orders]
    seconds = [
        predicted_trip_s(lake, int(h), order) for h, order in zip(harbours, found, strict=True)
    ]
    for _ in range(MOST_CHANGES):
        worst = int(np.argmax(seconds))
        if seconds[worst] <= limit_s:
            return found
        change = _change(lake, ports, found, harbours, seconds, limit_s)
        if change is None:
            return None
        other, shorter, longer, shorter_s, longer_s = change
        found[worst], found[other] = shorter, longer
        seconds[worst], seconds[other] = shorter_s, longer_s
    return None


def _change(
    lake: Lake, ports: Ports, orders: Sequence[Order], harbours: NDArray[np.int64],
    seconds: Sequence[float], limit_s: float,
) -> tuple[int, Order, Order, float, float] | None:  # fmt: skip
    """A cell of the longest trip in another one that has room: which, and both as they are then."""
    worst = int(np.argmax(seconds))
    room_s = [limit_s - spent for spent in seconds]
    for _, k, other, at in _cheapest(lake, ports, orders, harbours, room_s)[:TRIED]:
        longer = np.insert(orders[other], at, orders[worst][k])
        home = int(harbours[other])
        longer_s = predicted_trip_s(lake, home, longer)
        if longer_s > limit_s or shortest_stretch(lake.costs, ports, home, longer) != (0, 0):
            continue
        shorter = np.delete(orders[worst], k)
        shorter_s = predicted_trip_s(lake, int(harbours[worst]), shorter)
        if shorter_s < seconds[worst]:
            return other, shorter, longer, shorter_s, longer_s
    return None


def _cheapest(
    lake: Lake, ports: Ports, orders: Sequence[Order], harbours: NDArray[np.int64],
    room_s: Sequence[float],
) -> list[tuple[float, int, int, int]]:  # fmt: skip
    """What each cell of the longest trip would cost in each other one that has the room [s], the
    cheapest first: the cost, the cell's place, the other trip, and its place there.
    """
    worst = int(np.argmin(room_s))

    def legs_s(i: int, order: Order) -> float:
        return trip_s(lake.costs, ports, int(harbours[i]), order, len(order))

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
    """Places in a trip beside its cells that lie nearest to a cell, and its ends."""
    centres = lake.draft.network.centres
    away = np.hypot(*(centres[order] - centres[cell]).T)
    beside = {int(i) + step for i in np.argsort(away)[:4] for step in (0, 1)}
    return sorted({0, len(order), *beside})
