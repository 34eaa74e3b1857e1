"""Sorties: total time over a lower bound, against OR-tools' capacitated routing on the same cells.

Both minimise the time of the legs through the cells' centres by the same costs, with the same
number of trips and the same limit of each. OR-tools need not keep a route home, and has as much
time as Grebe took. Both have their machine code by then.
"""

from __future__ import annotations

import time

import numpy as np
import shapely
from ortools.constraint_solver import pywrapcp, routing_enums_pb2

from benchmarks.common import print_head, print_row
from benchmarks.planning import FRAME, archipelago, bean
from grebe.core.dynamics import CALM, Weather
from grebe.core.plan_settings import PlanSettings, SortieSettings
from grebe.core.vessel import PRESETS
from grebe.planning.planner import planner_of
from grebe.planning.region import Region
from grebe.planning.route.costs import leg
from grebe.planning.trips.endurance import endurance_of
from grebe.planning.trips.fewest_trips import Trips, trips_within
from grebe.planning.trips.lake import Lake, depots_of, lake_of
from grebe.planning.trips.trip_times import Depots

BOAT = PRESETS["blueboat"]
CURRENT = Weather(current_north_mps=0.3, current_east_mps=0.1)
# OR-tools' matrix of more cells than this does not fit into the available memory.
MOST_FOR_PEER = 7_000


def sorties() -> None:
    print_head(
        "Sorties of a BlueBoat at up to 1.5 m/s, cells of 50 m, a harbour in the south",
        "lake", "minutes", "weather", "cells", "sorties", "hours", "over the bound",
        "OR-tools over the bound", "s each",
    )  # fmt: skip
    for name, water, minutes, weather in (
        ("363 ha, 3 islands", bean(363), 180.0, CALM),
        ("363 ha, 3 islands", bean(363), 120.0, CALM),
        ("363 ha, 3 islands", bean(363), 180.0, CURRENT),
        ("1,564 ha, 8 islands", archipelago(), 300.0, CALM),
    ):
        _row(name, water, minutes, weather)


def _row(name: str, water: shapely.Polygon, minutes: float, weather: Weather) -> None:
    settings = PlanSettings(
        cell_m=50.0, speed_min_mps=0.5, speed_max_mps=1.5, shore_margin_m=1.0, weather=weather,
        sorties=SortieSettings(minutes=minutes),
    )  # fmt: skip
    planner, _ = planner_of(Region(name="lake", frame=FRAME, water=water), BOAT, settings)
    draft = planner.first_draft(quick=True)
    south = min(water.exterior.coords, key=lambda corner: corner[0])
    measured = lake_of(planner, draft, [(south[0], south[1])])
    endurance = endurance_of(BOAT, settings, planner.mean_power_w(draft))
    trips_within(measured, endurance, rounds=10)
    began = time.perf_counter()
    trips = trips_within(measured, endurance)
    seconds = time.perf_counter() - began
    depots = depots_of(measured, endurance, 1.0)
    peer = _or_tools(measured, depots, trips, seconds)
    print_row(
        name, f"{minutes:g}", "calm" if weather is CALM else "0.32 m/s current",
        int(measured.wanted.sum()), len(trips.orders), f"{trips.legs_s / 3600:.2f}",
        f"{trips.legs_s / trips.bound_s:.4f}",
        "none found" if peer is None else f"{peer[1] / trips.bound_s:.4f} in {peer[0]}",
        f"{seconds:.0f}",
    )  # fmt: skip


def _or_tools(lake: Lake, depots: Depots, trips: Trips, seconds: float) -> tuple[int, float] | None:
    """OR-tools' number of trips and their time [s], within the same limit and computing time; more
    trips are allowed if it finds none with as many as Grebe.
    """
    members = np.flatnonzero(lake.wanted)
    if len(members) > MOST_FOR_PEER:
        return None
    matrix = _matrix(lake, depots, members).tolist()
    for more in range(4):
        count = len(trips.orders) + more
        manager = pywrapcp.RoutingIndexManager(len(matrix), count, 0)
        routing = pywrapcp.RoutingModel(manager)
        transit = routing.RegisterTransitMatrix(matrix)
        routing.SetArcCostEvaluatorOfAllVehicles(transit)
        routing.AddDimension(transit, 0, int(1000 * trips.limit_s), True, "time")
        options = pywrapcp.DefaultRoutingSearchParameters()
        options.first_solution_strategy = (
            routing_enums_pb2.FirstSolutionStrategy.PARALLEL_CHEAPEST_INSERTION
        )
        options.local_search_metaheuristic = (
            routing_enums_pb2.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
        )
        options.time_limit.FromSeconds(max(1, round(seconds)))
        solution = routing.SolveWithParameters(options)
        if solution is not None:
            return count, solution.ObjectiveValue() / 1000
    return None


def _matrix(lake: Lake, depots: Depots, members: np.ndarray) -> np.ndarray:
    """Milliseconds between the harbour, which is the first, and all cells, as Grebe has them."""
    n = len(members)
    centres = lake.draft.network.centres[members]
    way = centres[None, :, :] - centres[:, None, :]
    far = 1.5 * lake.travel.leg_s(way) + lake.costs.detour_s
    place = np.full(len(lake.wanted), -1)
    place[members] = np.arange(n)
    costs = lake.costs
    first = np.repeat(np.arange(len(costs.starts) - 1), np.diff(costs.starts))
    kept = (place[first] >= 0) & (place[costs.neighbours] >= 0)
    far[place[first[kept]], place[costs.neighbours[kept]]] = costs.link_s[kept]
    np.fill_diagonal(far, 0.0)
    probe = min(n - 1, 1)
    assert abs(far[0, probe] - leg(costs, members[0], members[probe])) < 1e-6
    whole = np.zeros((n + 1, n + 1))
    whole[1:, 1:] = far
    whole[0, 1:], whole[1:, 0] = depots.out[0, members], depots.back[0, members]
    return np.rint(1000 * whole).astype(np.int64)
