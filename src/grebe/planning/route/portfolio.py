"""Put the cells in order: the sequence Omega_1 ... Omega_K of remark 12, by a portfolio.

Sweeps along rows and columns, a tour around a spanning tree and a greedy walk are each made
locally as short as may be; the shortest and the fastest of them are improved further. What
counts in the end is predicted time: the taut way at the speed over ground that current and wind
leave, with its turns, and the ways around land.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.plan_settings import Pattern
from grebe.core.taut import ROUGHLY, TautWays
from grebe.planning.cells.mesh import Cell
from grebe.planning.route.costs import Costs, costs_of, order_cost
from grebe.planning.route.orders import greedy, spanning_tree_tour, sweeps
from grebe.planning.route.polish import polished
from grebe.planning.ways.network import Network
from grebe.planning.ways.travel import Travel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Order = NDArray[np.int64]

# How the cells may be ordered: for the shortest time, or as a lawn is mown.
# Kicks of the final improvement: more where there are more cells to place, up to 10,000 cells,
# and then fewer, because each takes longer.
FEWEST_KICKS, KICKS_AT_MOST, CELLS_AT_MOST = 2_000, 40_000, 10_000
# How much longer than the shortest an order's legs may take that is predicted to be faster: more
# in a current, where the way through the centres says less of the way that is flown.
SLACK, SLACK_IN_CURRENT = 1.005, 1.02


@dataclass(frozen=True, kw_only=True)
class Route:
    """An order of the cells, the time [s] of its legs, and the sweep or tour it grew from."""

    order: Order
    legs_s: float
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
    pattern: Pattern = "free",
) -> Route:
    """Order the cells for the shortest time; `quick` leaves the last polish out. The first cell
    is near the start, or where it suits the order best if that may be `anywhere`. A `pattern` of
    rows or columns is swept as it is.
    """
    costs = costs_of(network, travel, start, returns=returns, anywhere=anywhere)
    if pattern != "free":
        rows, columns = sweeps(cells, network, start)
        order = rows if pattern == "rows" else columns
        legs_s = order_cost(costs, np.append(len(network), order))
        return Route(order=order, legs_s=float(legs_s), method=pattern)
    ways = TautWays([cell.footprint for cell in cells])

    def predicted_s(route: Route) -> float:
        """The taut way through the cells, and what ways around land add."""
        places = costs.places[route.order]
        north, east = places[0].tolist()
        taut = travel.path_s(ways.through((north, east), route.order, steady=ROUGHLY))
        return taut + route.legs_s - float(np.sum(travel.leg_s(np.diff(places, axis=0))))

    tried = [
        _polished(name, costs, order, 0)
        for name, order in first_orders(cells, network, start).items()
    ]
    shortest = min(tried, key=lambda route: route.legs_s)
    if quick:
        return shortest
    fastest = min(tried, key=predicted_s)
    share = len(cells) / CELLS_AT_MOST
    kicks = max(FEWEST_KICKS, int(KICKS_AT_MOST * min(share**2, 1 / share)))
    further = [shortest] if shortest is fastest else [shortest, fastest]
    improved = [_polished(route.method, costs, route.order, kicks) for route in further]
    slack = SLACK_IN_CURRENT if costs.windy else SLACK
    longest = slack * min(route.legs_s for route in improved)
    return min((one for one in improved if one.legs_s <= longest), key=predicted_s)


def _polished(name: str, costs: Costs, order: Order, kicks: int) -> Route:
    improved, legs_s = polished(costs, order, kicks)
    return Route(order=improved, legs_s=legs_s, method=name)
