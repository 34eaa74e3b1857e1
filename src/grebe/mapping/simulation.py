"""Free fields of a covariance model on a regular grid, exactly and fast.

Circulant embedding (Dietrich and Newsam 1997): on a torus large enough the covariance matrix
is diagonal in Fourier space. What is negative there, of a smooth covariance, is cut off.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len
from scipy.ndimage import map_coordinates

from grebe.mapping.covariance import CovarianceModel
from grebe.mapping.grid import Grid

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Room beyond the grid on the torus: so many practical ranges, at most as much as the grid.
ROOM_RANGES = 1.5


def circulant_fields(
    model: CovarianceModel, grid: Grid, positions: Array, count: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Draw `count` fields of mean 0; return them at the grid's nodes in the water (count, m) and,
    between the nodes by bilinear weights, at `positions` (count, n).
    """
    shape = grid.inside.shape
    room = int(ROOM_RANGES * model.practical_range_m / grid.step_m) + 1
    # Samples may lie beyond the grid by a node or two.
    size = [int(next_fast_len(side + max(min(room, 2 * side), 4)) or side) for side in shape]
    steps = [np.minimum(np.arange(n), n - np.arange(n)) * grid.step_m for n in size]
    signed = [np.where(np.arange(n) <= n // 2, 1.0, -1.0) * s
              for n, s in zip(size, steps, strict=True)]  # fmt: skip
    offsets = np.stack(np.meshgrid(*signed, indexing="ij"), axis=-1).reshape(-1, 2)
    distance = np.hypot(*model.isotropic(offsets).T).reshape(size)
    spectrum = np.sqrt(np.maximum(np.fft.rfft2(model.covariance(distance)).real, 0.0))
    place = ((positions - [grid.north[0], grid.east[0]]) / grid.step_m).T
    nodes, seen = [], []
    for _ in range(count):
        field = np.fft.irfft2(np.fft.rfft2(rng.normal(size=size)) * spectrum, s=size)
        nodes.append(field[: shape[0], : shape[1]][grid.inside])
        seen.append(map_coordinates(field, place, order=1, mode="grid-wrap"))
    return np.array(nodes), np.array(seen)
