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

# Room beyond the grid on the torus: so many practical ranges and at most so many nodes. With less,
# a smooth covariance has negative values there, and cutting them off roughens the fields.
ROOM_RANGES, MOST_ROOM = 4.0, 2_000


def circulant_fields(
    model: CovarianceModel,
    grid: Grid,
    positions: Array,
    count: int,
    rng: np.random.Generator,
    refine: int = 1,
) -> tuple[Array, Array]:
    """Draw `count` fields of mean 0; return them at the grid's nodes in the water (count, m) and,
    between the nodes by bilinear weights, at `positions` (count, n).

    The fields are drawn on a grid `refine` times as fine: what lies between nodes is smoother
    than they are, which matters where the field is rough.
    """
    step = grid.step_m / refine
    shape = [refine * (side - 1) + 1 for side in grid.inside.shape]
    spectrum = _spectrum(model, shape, step)
    size = (spectrum.shape[0], 2 * (spectrum.shape[1] - 1))
    place = ((positions - [grid.north[0], grid.east[0]]) / step).T
    nodes, seen = [], []
    for _ in range(count):
        field = np.fft.irfft2(np.fft.rfft2(rng.normal(size=size)) * spectrum, s=size)
        nodes.append(field[: shape[0] : refine, : shape[1] : refine][grid.inside])
        seen.append(map_coordinates(field, place, order=1, mode="grid-wrap"))
    return np.array(nodes), np.array(seen)


def _spectrum(model: CovarianceModel, shape: list[int], step: float) -> Array:
    """Square roots of the covariance's eigenvalues on a torus with room beyond the grid."""
    room = int(ROOM_RANGES * model.practical_range_m / step) + 1
    # Samples may lie beyond the grid by a node or two; the last side's length must be even.
    size = [int(next_fast_len(side + max(min(room, MOST_ROOM), 4)) or side) for side in shape]
    size[1] += size[1] % 2
    signed = [step * np.where(np.arange(n) <= n // 2, np.arange(n), np.arange(n) - n) for n in size]
    offsets = np.stack(np.meshgrid(*signed, indexing="ij"), axis=-1).reshape(-1, 2)
    distance = np.hypot(*model.isotropic(offsets).T).reshape(size)
    return np.sqrt(np.maximum(np.fft.rfft2(model.covariance(distance)).real, 0.0))
