"""Put the cells in order: the sequence Omega_1 ... Omega_K of remark 12, by a portfolio.

Sweeps along rows and columns, a tour around a spanning tree and a greedy walk are each improved
to a local optimum; the shortest and the fastest of them are improved further. The final choice is
by predicted time: that of the taut path with its turns, at the speed over ground that current and
wind allow, and of the paths around land.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.plan_settings import Pattern
from grebe.core.taut import ROUGHLY, TautPaths
from grebe.planning.cells.mesh import Cell
from grebe.planning.paths.network import Network
from grebe.planning.paths.travel import Travel
from grebe.planning.route.costs import Costs, costs_of, order_cost
from grebe.planning.route.orders import greedy, spanning_tree_tour, sweeps
from grebe.planning.route.polish import polished

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Order = NDArray[np.int64]

# Kicks of the final improvement: more for more cells, up to 10,000 cells; beyond that fewer,
# because each takes longer.
FEWEST_KICKS, KICKS_AT_MOST, CELLS_AT_MOST = 2_000, 40_000, 10_000
# An order that is predicted to be faster may have legs that take longer than the shortest, up to
# this factor. It is larger in a current, where the path through the centres says less about the
# path that is sailed.
SLACK, SLACK_IN_CURRENT = 1.005, 1.02


@dataclass(frozen=True, kw_only=True)
class Route:
    """An order of the cells, the time [s] of its legs, and the sweep or tour that it began as."""

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
    """Order the cells for the shortest time.

    The first cell is near the start, or with `anywhere` where it suits the order best. `quick`
    leaves out the last polish. A `pattern` of rows or columns is swept unchanged.
    """
    costs = costs_of(network, travel, start, returns=returns, anywhere=anywhere)
    if pattern != "free":
        rows, columns = sweeps(cells, network, start)
        order = rows if pattern == "rows" else columns
        legs_s = order_cost(costs, np.append(len(network), order))
        return Route(order=order, legs_s=float(legs_s), method=pattern)
    paths = TautPaths([cell.footprint for cell in cells])

    def predicted_s(route: Route) -> float:
        """Time of the taut path through the cells, and of the paths around land besides."""
        places = costs.places[route.order]
        north, east = places[0].tolist()
        taut = travel.path_s(paths.through((north, east), route.order, steady=ROUGHLY))
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
