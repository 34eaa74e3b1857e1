"""Put the cells in order: the sequence Omega_1 ... Omega_K of remark 12, by a portfolio.

Sweeps along rows and columns, a tour around a spanning tree and a greedy walk are each made
locally as fast as may be; the best of them is improved further. What counts is predicted time:
legs at the speed over ground that current and wind leave, and turns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.planning.costs import Costs, costs_of
from grebe.planning.mesh import Cell
from grebe.planning.network import Network
from grebe.planning.orders import greedy, spanning_tree_tour, sweeps
from grebe.planning.polish import polished
from grebe.planning.travel import Travel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Order = NDArray[np.int64]

# Kicks of the final improvement: so many a cell, within limits that keep planning quick.
KICKS_PER_CELL, FEWEST_KICKS, MOST_KICKS = 1, 2_000, 8_000


@dataclass(frozen=True, kw_only=True)
class Route:
    """An order of the cells, its predicted time [s], and the sweep or tour it grew from."""

    order: Order
    time_s: float
    method: str


def first_orders(
    cells: list[Cell], network: Network, start: tuple[float, float]
) -> dict[str, Order]:
    """Return the portfolio's first orders by name."""
    rows, columns = sweeps(cells, network, start)
    orders = {"rows": rows, "columns": columns, "greedy": greedy(cells, network, start)}
    tour = spanning_tree_tour(cells, network, start)
    return orders if tour is None else orders | {"spanning tree": tour}


def best_route(
    cells: list[Cell],
    network: Network,
    travel: Travel,
    start: tuple[float, float],
    *,
    returns: bool,
    anywhere: bool = False,
    quick: bool = False,
) -> Route:
    """Order the cells for the shortest time; `quick` leaves the last polish out. The first cell
    is near the start, or where it suits the order best if that may be `anywhere`.
    """
    costs = costs_of(network, travel, start, returns=returns, anywhere=anywhere)
    tried = [
        _route(name, costs, order, 0) for name, order in first_orders(cells, network, start).items()
    ]
    best = min(tried, key=lambda route: route.time_s)
    if quick:
        return best
    kicks = int(np.clip(KICKS_PER_CELL * len(cells), FEWEST_KICKS, MOST_KICKS))
    return _route(best.method, costs, best.order, kicks)


def _route(name: str, costs: Costs, order: Order, kicks: int) -> Route:
    improved, time_s = polished(costs, order, kicks)
    return Route(order=improved, time_s=time_s, method=name)
