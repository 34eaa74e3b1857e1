"""Orders of the cells of a concave lake with islands: single methods against the portfolio."""

from __future__ import annotations

import itertools
import resource
import time
from pathlib import Path

import numpy as np
import shapely

from benchmarks.common import print_head, print_row
from grebe.core.dynamics import CALM, Weather
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import SHAPES, PlanSettings
from grebe.core.taut import taut_path
from grebe.core.vessel import PRESETS
from grebe.io.readers.outline import read_outline
from grebe.planning.cells.mesh import mesh_water
from grebe.planning.paths.corridors import PathFinder
from grebe.planning.paths.network import connect
from grebe.planning.paths.travel import Travel, travel_of
from grebe.planning.planner import plan
from grebe.planning.region import Region, clean_region
from grebe.planning.route.portfolio import best_route, first_orders

BOAT = PRESETS["spyboat"]
CURRENT = Weather(current_north_mps=0.3, current_east_mps=0.1)
FRAME = LocalFrame(origin_lon_deg=3.17, origin_lat_deg=50.63)


def lake(cells: int, cell_m: float = 5.0) -> shapely.Polygon:
    """A bean with a peninsula and three islands, of about `cells` cells."""
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    radius = 1.0 + 0.25 * np.cos(2 * angle) + 0.12 * np.sin(3 * angle)
    water = shapely.Polygon(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))
    water = water.difference(shapely.box(-0.08, 0.15, 0.08, 2.0))
    for x, y, r in ((0.5, -0.2, 0.12), (-0.5, 0.1, 0.1), (-0.2, -0.4, 0.08)):
        water = water.difference(shapely.Point(x, y).buffer(r, quad_segs=3))
    scale = cell_m * np.sqrt(cells / water.area)
    return shapely.affinity.scale(water, scale, scale, origin=(0, 0))


def bean(hectares: float) -> shapely.Polygon:
    """The same lake, of `hectares`."""
    water = lake(1000)
    scale = float(np.sqrt(1e4 * hectares / water.area))
    return shapely.affinity.scale(water, scale, scale, origin=(0, 0))


def archipelago(hectares: float = 1_564.0) -> shapely.Polygon:
    """A long concave lake with three bays and eight islands."""
    angle = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    radius = 1 + 0.3 * np.cos(2 * angle + 0.4) + 0.15 * np.sin(3 * angle) + 0.08 * np.cos(7 * angle)
    ring = np.column_stack([1.5 * radius * np.cos(angle), radius * np.sin(angle)])
    water = shapely.Polygon(ring)
    for north, east, size in (
        (0.9, 0.1, 0.12), (0.3, -0.3, 0.1), (-0.2, 0.3, 0.14), (-0.7, -0.1, 0.1),
        (0.5, 0.4, 0.07), (-1.1, 0.2, 0.08), (0.0, 0.0, 0.06), (1.2, -0.1, 0.06),
    ):  # fmt: skip
        water = water.difference(shapely.Point(north, east).buffer(size, quad_segs=4))
    scale = float(np.sqrt(1e4 * hectares / water.area))
    return shapely.affinity.scale(water, scale, scale, origin=(0, 0))


def planning() -> None:
    print_head(
        "Planning a concave lake with islands, predicted minutes (still water / current)",
        "K", "rows", "columns", "greedy", "spanning tree", "portfolio", "gap to bound", "s", "MB",
    )  # fmt: skip
    for count in (100, 1_000, 10_000, 100_000):
        water = lake(count)
        predicted = [_minutes(water, weather) for weather in (CALM, CURRENT)]
        began = time.perf_counter()
        planned = plan(Region(name="lake", frame=FRAME, water=water), BOAT, PlanSettings())
        seconds = time.perf_counter() - began
        names = ("rows", "columns", "greedy", "spanning tree", "portfolio")
        cells = sum(target.kind == "cell" for target in planned.survey.targets)
        print_row(
            cells,
            *(" / ".join(f"{one[name]:.1f}" for one in predicted) for name in names),
            f"{planned.outcome.gap:.4f}",
            f"{seconds:.1f}",
            resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
        )


def _minutes(water: shapely.Polygon, weather: Weather) -> dict[str, float]:
    """Predicted minutes of each single order and of the portfolio's."""
    cells = mesh_water(water, 5.0)
    network = connect(cells, water, 5.0)
    travel = travel_of(BOAT, (1.0, 2.0), weather)
    start = tuple(network.centres[0])
    orders = first_orders(cells, network, start)
    orders["portfolio"] = best_route(cells, network, travel, start, returns=False).order
    finder = PathFinder(cells, network, water, 5.0)
    return {name: minutes(finder, travel, order, start) for name, order in orders.items()}


def minutes(
    finder: PathFinder, travel: Travel, order: np.ndarray, start: tuple[float, float]
) -> float:
    """The predicted time of an order with its transits."""
    footprints = [stop.footprint for stop in finder.stops(order)]
    return travel.path_s(taut_path(start, footprints)) / 60


SHARED = Path(__file__).parents[1] / ".." / "shared" / "data"
OUTLINES = {
    "crystal": "regions/crystal.geojson",
    "allequash": "regions/allequash.geojson",
    "alamillo": "regions/alamillo.geojson",
    "hull of a track": "tracks/China-catabot-20200915.csv",
}


def lakes() -> None:
    """Real outlines, meshed with each shape of cell."""
    print_head(
        "Real outlines", "lake", "nominal K", "shape", "cell m", "targets", "transits",
        "over the bound", "coverage", "outside m2", "s",
    )  # fmt: skip
    for (name, file), count, shape in itertools.product(
        OUTLINES.items(), (100, 1_000, 10_000), SHAPES
    ):
        outline = read_outline(SHARED / file)
        region = clean_region(outline.geometry, name)
        cell_m = float(np.sqrt(region.water.area / count))
        began = time.perf_counter()
        planned = plan(region, BOAT, PlanSettings(cell_m=cell_m, shape=shape))
        seconds = time.perf_counter() - began
        kinds = [target.kind for target in planned.survey.targets]
        print_row(
            name, count, shape, f"{cell_m:.1f}", kinds.count("cell"), kinds.count("transit"),
            f"{1 + planned.outcome.gap:.4f}", f"{planned.check.coverage:.4f}",
            f"{planned.check.outside_m2:.1f}", f"{seconds:.1f}",
        )  # fmt: skip
