"""First trips: wedges of a lake, each with its tip at a harbour.

The cells are put in the order in which a ray that turns around the harbour meets them. Stretches of
that order are wedges, and each becomes a round trip.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from grebe.planning.paths.harbour_distances import around_the_harbour
from grebe.planning.route.costs import costs_of
from grebe.planning.route.polish import polished
from grebe.planning.trips.lake import Lake
from grebe.planning.trips.trip_times import Depots

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Order = NDArray[np.int64]

# Kicks in the polish of one trip.
KICKS = 300


def wedges(lake: Lake, depots: Depots, count: int) -> tuple[list[Order], NDArray[np.int64]]:
    """Return `count` trips and their harbours: wedges of about equal time around each harbour."""
    nearest = np.argmin(depots.out, axis=0)
    members = [lake.wanted & (nearest == h) for h in range(len(lake.homes))]
    sizes = np.array([one.sum() for one in members])
    orders: list[Order] = []
    harbours: list[int] = []
    for h, parts in enumerate(_shared(sizes, count)):
        walk = around_the_harbour(lake.draft.network, lake.homes[h], members[h])
        costs = costs_of(lake.draft.network, lake.travel, lake.homes[h].place, returns=True)
        for part in _even_stretches(walk, depots.out[h], lake.pitch_s, parts):
            orders.append(polished(costs, part, KICKS)[0] if len(part) > 1 else part)
            harbours.append(h)
    return orders, np.array(harbours, dtype=np.int64)


def _even_stretches(
    walk: Order, out_s: NDArray[np.float64], pitch_s: float, parts: int
) -> list[Order]:
    """Cut a walk into `parts` stretches whose trips take about equally long."""
    low, high = 0.0, 2 * float(out_s[walk].max(initial=0.0)) + pitch_s * len(walk)
    for _ in range(40):
        middle = 0.5 * (low + high)
        if len(_filled(walk, out_s, pitch_s, middle)) <= parts:
            high = middle
        else:
            low = middle
    return _filled(walk, out_s, pitch_s, high) if parts else []


def _filled(walk: Order, out_s: NDArray[np.float64], pitch_s: float, most_s: float) -> list[Order]:
    """Stretches of a walk, each as long as its trip may be within `most_s`, and at least one cell.

    A trip takes at least the time to its farthest cell and back, and at least the time to its
    nearest cell and back plus a pitch for each cell.
    """
    stretches: list[Order] = []
    first, nearest, farthest = 0, np.inf, 0.0
    for k, away in enumerate(out_s[walk].tolist()):
        nearest, farthest = min(nearest, away), max(farthest, away)
        if k > first and 2 * max(farthest, nearest + 0.5 * pitch_s * (k + 1 - first)) > most_s:
            stretches.append(walk[first:k])
            first, nearest, farthest = k, away, away
    return [*stretches, walk[first:]] if len(walk) else []


def _shared(sizes: NDArray[np.int64], count: int) -> list[int]:
    """Share `count` trips out in proportion to the numbers of cells, largest remainders first."""
    exact = count * sizes / sizes.sum()
    parts = np.floor(exact).astype(int)
    for h in np.argsort(parts - exact)[: count - parts.sum()]:
        parts[h] += 1
    return parts.tolist()
