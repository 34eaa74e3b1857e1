"""Orders of the cells against OR-tools and against a lower bound on any order.

All are measured alike: by the length of the shortest path through the water between the centres of
consecutive cells, and by the predicted time, for the same cells. Every path may begin anywhere.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.sparse.csgraph import dijkstra

from benchmarks.common import print_head, print_row
from benchmarks.planning import BOAT, CURRENT, lake, minutes
from grebe.core.dynamics import CALM
from grebe.planning.cells.mesh import mesh_water
from grebe.planning.paths.corridors import PathFinder
from grebe.planning.paths.network import connect
from grebe.planning.paths.travel import travel_of
from grebe.planning.route.bounds import lower_bound_m
from grebe.planning.route.costs import costs_of
from grebe.planning.route.polish import polished
from grebe.planning.route.portfolio import best_route, first_orders

SCALE = 1000  # OR-tools computes in integers: millimetres
SECONDS = {100: 10, 1_000: 30}
OR_TOOLS, GREBE = "OR-tools, guided local search", "Grebe"


class Waters:
    """A lake of about a given number of cells, and everything by which its orders are measured."""

    def __init__(self, count: int) -> None:
        water = lake(count)
        self.peer_s = SECONDS[count]
        self.cells = [cell for cell in mesh_water(water, 5.0) if not cell.is_speck]
        self.network = connect(self.cells, water, 5.0)
        self.start = tuple(self.network.centres[0])
        self.travels = [travel_of(BOAT, (1.0, 2.0), weather) for weather in (CALM, CURRENT)]
        self.finder = PathFinder(self.cells, self.network, water, 5.0)
        self.lengths = water_lengths(water, self.network.centres)
        self.bound_m = lower_bound_m(self.cells, "square", 5.0, self.network.around)

    def metres(self, order: np.ndarray) -> float:
        """Length of the path through the centres, through the water [m]."""
        return float(self.lengths[order[:-1], order[1:]].sum())

    def predicted_min(self, order: np.ndarray) -> list[float]:
        """The boat's predicted minutes in each weather."""
        begin = tuple(self.network.centres[order[0]])
        return [minutes(self.finder, travel, order, begin) for travel in self.travels]


@dataclass(frozen=True, kw_only=True)
class Ordered:
    """An order of the cells, its length over the bound, and the time to find it."""

    order: np.ndarray
    metres: float
    over: float
    took_s: float


def ordered(waters: Waters, method: str) -> Ordered:
    """Find an order of the cells by one of the methods."""
    began = time.perf_counter()
    order = METHODS[method](waters)
    took_s = time.perf_counter() - began
    metres = waters.metres(order)
    return Ordered(order=order, metres=metres, over=metres / waters.bound_m, took_s=took_s)


def routes() -> None:
    for count in SECONDS:
        waters = Waters(count)
        print_head(
            f"{len(waters.cells)} cells of a concave lake with islands; "
            f"bound {waters.bound_m:.1f} m",
            "method", "length m", "over the bound", "min, still", "min, current", "planned in s",
        )  # fmt: skip
        for name in METHODS:
            found = ordered(waters, name)
            print_row(
                name, f"{found.metres:.1f}", f"{found.over:.4f}",
                *(f"{m:.2f}" for m in waters.predicted_min(found.order)), f"{found.took_s:.2f}",
            )  # fmt: skip


def _rows(waters: Waters) -> np.ndarray:
    return first_orders(waters.cells, waters.network, waters.start)["rows"]


def _greedy(waters: Waters) -> np.ndarray:
    network, start = waters.network, waters.start
    costs = costs_of(network, waters.travels[0], start, returns=False, anywhere=True)
    return polished(costs, first_orders(waters.cells, network, start)["greedy"], 0)[0]


def _or_tools(waters: Waters) -> np.ndarray:
    return or_tools(waters.lengths, waters.peer_s)


def _grebe(waters: Waters) -> np.ndarray:
    travel = travel_of(BOAT, (1.0, 2.0), CALM)
    cells, network = waters.cells, waters.network
    return best_route(cells, network, travel, waters.start, returns=False, anywhere=True).order


METHODS: dict[str, Callable[[Waters], np.ndarray]] = {
    "rows": _rows,
    "greedy, 2-opt, Or-opt": _greedy,
    OR_TOOLS: _or_tools,
    GREBE: _grebe,
}


def water_lengths(water: shapely.Polygon, places: np.ndarray) -> np.ndarray:
    """Lengths of the shortest paths through the water between places: a visibility graph."""
    nodes = np.vstack([places, shapely.get_coordinates(water)])
    first, second = np.triu_indices(len(nodes), 1)
    allowed = water.buffer(1e-6)
    shapely.prepare(allowed)
    seen = shapely.covers(allowed, shapely.linestrings(np.stack([nodes[first], nodes[second]], 1)))
    direct = np.zeros((len(nodes), len(nodes)))
    away = np.maximum(np.hypot(*(nodes[first] - nodes[second]).T), 1e-9)
    direct[first[seen], second[seen]] = away[seen]
    return dijkstra(direct, directed=False, indices=np.arange(len(places)))[:, : len(places)]


def or_tools(lengths: np.ndarray, seconds: int) -> np.ndarray:
    """The order that OR-tools finds in `seconds`; the path may begin and end anywhere."""
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2

    n = len(lengths)
    matrix = np.zeros((n + 1, n + 1), dtype=int)
    matrix[:n, :n] = np.rint(SCALE * lengths)
    manager = pywrapcp.RoutingIndexManager(n + 1, 1, n)
    model = pywrapcp.RoutingModel(manager)
    model.SetArcCostEvaluatorOfAllVehicles(model.RegisterTransitMatrix(matrix.tolist()))
    asked = pywrapcp.DefaultRoutingSearchParameters()
    asked.first_solution_strategy = routing_enums_pb2.FirstSolutionStrategy.PATH_CHEAPEST_ARC
    asked.local_search_metaheuristic = (
        routing_enums_pb2.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
    )
    asked.time_limit.seconds = seconds
    found = model.SolveWithParameters(asked)
    order, at = [], found.Value(model.NextVar(model.Start(0)))
    while not model.IsEnd(at):
        order.append(manager.IndexToNode(at))
        at = found.Value(model.NextVar(at))
    return np.array(order)
