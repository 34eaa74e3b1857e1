"""A published informative planner: sgptools' differentiable path (Jakkala and Akella 2025).

It runs in an interpreter of its own, because its TensorFlow needs another NumPy than Grebe.
GREBE_SGPTOOLS names that interpreter; without it the planner has no row. The planner is given the
water's true covariance and noise. It knows no boat, no turns and no land: its path is led around
land by shortest paths and sailed by an ideal boat that never slows and samples once a second.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

# Numbers of waypoints to try, and the most by which a path may be longer than the boat's own.
COUNTS, SLACK = (20, 25, 30, 35, 40, 50, 60), 1.02
# Kernel and noise are the benchmark's truth; the path between n waypoints is optimised as a whole.
PLAN = """
import os, sys
os.environ.update(TF_CPP_MIN_LOG_LEVEL="3", CUDA_VISIBLE_DEVICES="-1")
import numpy as np, gpflow
from sgptools.methods import ContinuousSGP
from sgptools.core.transformations import IPPTransform
from sgptools.utils.misc import get_inducing_pts
from sgptools.utils.tsp import run_tsp
folder, count, scale, noise, length, seed = sys.argv[1], int(sys.argv[2]), *map(float, sys.argv[3:])
np.random.seed(int(seed))
nodes = np.loadtxt(os.path.join(folder, "nodes.csv"), delimiter=",")
kernel = gpflow.kernels.Matern32(variance=1.0, lengthscales=scale)
first = get_inducing_pts(nodes, count)
paths, _ = run_tsp(first, num_vehicles=1, time_limit=10)
way = IPPTransform(sampling_rate=5, distance_budget=length, num_robots=1, constraint_weight=1e3)
model = ContinuousSGP(count, nodes, kernel, noise, transform=way, X_init=paths[0][:count])
np.savetxt(os.path.join(folder, "way.csv"), model.optimize()[0], delimiter=",")
"""


def interpreter() -> str | None:
    """The Python that has sgptools."""
    return os.environ.get("GREBE_SGPTOOLS")


@cache
def informative_path(
    lake: shapely.Polygon, scale_m: float, noise_sd: float, length_m: float
) -> np.ndarray:
    """Return the longest of its paths (n, 2) that an ideal boat sails in `length_m`, led around
    land.

    `scale_m` is the length scale of a Matern covariance of smoothness 3/2.
    """
    paths = [
        _around_land(_planned(lake, count, scale_m, noise_sd, length_m), lake) for count in COUNTS
    ]
    lengths = [shapely.LineString(path).length for path in paths]
    fits = [i for i, length in enumerate(lengths) if length <= SLACK * length_m]
    if not fits:
        raise ValueError(f"No path fits {length_m:.0f} m; the shortest has {min(lengths):.0f} m.")
    return paths[max(fits, key=lengths.__getitem__)]


def sampled(path: np.ndarray, every_m: float) -> np.ndarray:
    """Places (n, 2) along a path, `every_m` apart."""
    line = shapely.LineString(path)
    return shapely.get_coordinates(line.interpolate(np.arange(0, line.length, every_m)))


def _planned(
    lake: shapely.Polygon, count: int, scale_m: float, noise_sd: float, length_m: float
) -> np.ndarray:
    python = interpreter()
    assert python is not None
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        west, south, east, north = lake.bounds
        grid = np.stack(np.meshgrid(np.arange(west, east, 6), np.arange(south, north, 6)), -1)
        nodes = grid.reshape(-1, 2)
        nodes = nodes[shapely.contains_xy(lake, nodes)]
        np.savetxt(folder / "nodes.csv", nodes, delimiter=",")
        (folder / "plan.py").write_text(PLAN)
        told = [str(count), str(scale_m), str(noise_sd**2), str(length_m), "0"]
        subprocess.run([python, folder / "plan.py", folder, *told], check=True, capture_output=True)
        return np.loadtxt(folder / "way.csv", delimiter=",")


def _around_land(way: np.ndarray, lake: shapely.Polygon) -> np.ndarray:
    """The waypoints moved into the water, joined by shortest paths."""
    nearest = shapely.shortest_line(lake.buffer(-0.5), shapely.points(way))
    drawn = shapely.get_coordinates(shapely.get_point(nearest, 0))
    legs = [_leg(a, b, lake) for a, b in pairwise(drawn)]
    return np.vstack([drawn[:1], *(leg[1:] for leg in legs)])


def _leg(a: np.ndarray, b: np.ndarray, lake: shapely.Polygon) -> np.ndarray:
    """The shortest path in the water, over the corners that see each other."""
    if lake.covers(shapely.LineString([a, b])):
        return np.vstack([a, b])
    nodes = np.vstack([a, b, shapely.get_coordinates(lake)])
    first, second = np.triu_indices(len(nodes), 1)
    lines = shapely.linestrings(np.stack([nodes[first], nodes[second]], axis=1))
    seen = shapely.covers(lake.buffer(1e-6), lines)
    lengths = shapely.length(lines)[seen] + 1e-9
    graph = coo_array((lengths, (first[seen], second[seen])), shape=(len(nodes),) * 2)
    _, before = dijkstra(graph.tocsr(), directed=False, indices=0, return_predecessors=True)
    way = [1]
    while way[-1] != 0:
        way.append(int(before[way[-1]]))
    return nodes[way[::-1]]
