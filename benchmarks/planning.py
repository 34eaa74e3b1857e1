"""Orders of the cells of a concave lake with islands: single methods against the portfolio."""

from __future__ import annotations

import resource
import time

import numpy as np
import shapely

from benchmarks.common import print_head, print_row
from grebe.dynamics import CALM, Weather
from grebe.frames import LocalFrame
from grebe.planning.mesh import mesh_water
from grebe.planning.network import connect
from grebe.planning.planner import PlanSettings, plan
from grebe.planning.costs import costs_of, order_cost
from grebe.planning.region import Region
from grebe.planning.route import best_route, first_orders
from grebe.planning.travel import travel_of
from grebe.vessel import PRESETS

BOAT = PRESETS["spyboat"]
CURRENT = Weather(current_north_mps=0.3, current_east_mps=0.1)
FRAME = LocalFrame(origin_lon_deg=3.17, origin_lat_deg=50.63)


def lake(cells: int, cell_m: float = 5.0) -> shapely.Polygon:
    """A bean with a peninsula and three islands, of about so many cells."""
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    radius = 1.0 + 0.25 * np.cos(2 * angle) + 0.12 * np.sin(3 * angle)
    water = shapely.Polygon(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))
    water = water.difference(shapely.box(-0.08, 0.15, 0.08, 2.0))
    for x, y, r in ((0.5, -0.2, 0.12), (-0.5, 0.1, 0.1), (-0.2, -0.4, 0.08)):
        water = water.difference(shapely.Point(x, y).buffer(r, quad_segs=3))
    scale = cell_m * np.sqrt(cells / water.area)
    return shapely.affinity.scale(water, scale, scale, origin=(0, 0))


def planning() -> None:
    print_head(
        "Planning a concave lake with islands, predicted minutes (still water / current)",
        "K", "rows", "columns", "greedy", "spanning tree", "portfolio", "gap to bound", "s", "MB",
    )  # fmt: skip
    for count in (100, 1_000, 10_000, 100_000):
        water = lake(count)
        minutes = [_minutes(water, weather) for weather in (CALM, CURRENT)]
        began = time.perf_counter()
        planned = plan(Region(name="lake", frame=FRAME, water=water), BOAT, PlanSettings())
        seconds = time.perf_counter() - began
        names = ("rows", "columns", "greedy", "spanning tree", "portfolio")
        cells = sum(target.kind == "cell" for target in planned.survey.targets)
        print_row(
            cells,
            *(" / ".join(f"{one[name]:.1f}" for one in minutes) for name in names),
            f"{planned.numbers.gap:.4f}",
            f"{seconds:.1f}",
            resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
        )


def _minutes(water: shapely.Polygon, weather: Weather) -> dict[str, float]:
    cells = mesh_water(water, 5.0)
    network = connect(cells, water, 5.0)
    travel = travel_of(BOAT, (1.0, 2.0), weather)
    start = tuple(network.centres[0])
    costs = costs_of(network, travel, start, returns=False)
    head = len(network)
    found = {
        name: order_cost(costs, np.concatenate([[head], order])) / 60
        for name, order in first_orders(cells, network, start).items()
    }
    return found | {
        "portfolio": best_route(cells, network, travel, start, returns=False).time_s / 60
    }
