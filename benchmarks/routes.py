"""Orders of the cells against OR-tools and against what no order can be shorter than.

All are measured alike: the length of the shortest way through the water between the centres of
consecutive cells, and the predicted time, for the same cells; every path may begin anywhere.
"""

from __future__ import annotations

import time

import numpy as np
import shapely
from scipy.sparse.csgraph import dijkstra

from benchmarks.common import print_head, print_row
from benchmarks.planning import BOAT, CURRENT, lake, minutes
from grebe.core.dynamics import CALM
from grebe.planning.bounds import lower_bound_m
from grebe.planning.corridors import Waterways
from grebe.planning.costs import Costs, costs_of
from grebe.planning.mesh import mesh_water
from grebe.planning.network import Network, connect
from grebe.planning.polish import polished
from grebe.planning.route import best_route, first_orders
from grebe.planning.travel import travel_of

SCALE = 1000  # OR-tools reckons in whole numbers: millimetres
SECONDS = {100: 10, 1_000: 30}


def routes() -> None:
    for count, seconds in SECONDS.items():
        _compare(lake(count), seconds)


def _compare(water: shapely.Polygon, seconds: int) -> None:
    cells = [cell for cell in mesh_water(water, 5.0) if not cell.is_speck]
    network = connect(cells, water, 5.0)
    start = tuple(network.centres[0])
    travels = [travel_of(BOAT, (1.0, 2.0), weather) for weather in (CALM, CURRENT)]
    costs = costs_of(network, travels[0], start, returns=False, anywhere=True)
    ways = Waterways(cells, network, water, 5.0)
    lengths = water_lengths(water, network.centres)
    bound = lower_bound_m(cells, "square", 5.0, network.around)
    print_head(
        f"{len(cells)} cells of a concave lake with islands; bound {bound:.1f} m",
        "method", "length m", "over the bound", "min, still", "min, current", "planned in s",
    )  # fmt: skip
    for name, order, took in _orders(cells, network, costs, start, lengths, seconds):
        metres = float(lengths[order[:-1], order[1:]].sum())
        begin = tuple(network.centres[order[0]])
        predicted = [minutes(ways, travel, order, begin) for travel in travels]
        print_row(
            name, f"{metres:.1f}", f"{metres / bound:.4f}", *(f"{m:.2f}" for m in predicted),
            f"{took:.2f}",
        )  # fmt: skip


def _orders(cells, network: Network, costs: Costs, start, lengths, seconds):
    firsts = first_orders(cells, network, start)
    yield "rows", firsts["rows"], 0.0
    began = time.perf_counter()
    order, _ = polished(costs, firsts["greedy"], 0)
    yield "greedy, 2-opt, Or-opt", order, time.perf_counter() - began
    began = time.perf_counter()
    order = or_tools(lengths, seconds)
    yield "OR-tools, guided local search", order, time.perf_counter() - began
    began = time.perf_counter()
    travel = travel_of(BOAT, (1.0, 2.0), CALM)
    order = best_route(cells, network, travel, start, returns=False, anywhere=True).order
    yield "Grebe", order, time.perf_counter() - began


def water_lengths(water: shapely.Polygon, places: np.ndarray) -> np.ndarray:
    """Lengths of the shortest ways through the water between places: a visibility graph."""
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
    """The order that OR-tools finds in so many seconds; the path may begin and end anywhere."""
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
