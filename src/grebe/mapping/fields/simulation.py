"""Free fields of a covariance model on a regular grid, exactly and fast.

Circulant embedding (Dietrich and Newsam 1997): on a torus large enough the covariance matrix
is diagonal in Fourier space. What is negative there, of a smooth covariance, is cut off.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np
from scipy import fft
from scipy.ndimage import map_coordinates

from grebe.mapping.covariance.models import CovarianceModel
from grebe.mapping.grid import Grid

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Room beyond the grid on the torus, in practical ranges: the first with which what is negative
# there is no more than such a share of the variance, for to cut it off roughens the fields; and at
# most so many nodes.
ROOM_RANGES, NEGATIVE_SHARE, MOST_ROOM = (1.0, 2.0, 4.0), 1e-6, 2_000


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
    place = ((positions - [grid.north[0], grid.east[0]]) / step).T
    nodes, seen = [], []
    for _ in range(0, count, 2):
        # The real and the imaginary part are two fields that know nothing of each other.
        white = rng.normal(size=(*spectrum.shape, 2)).view(np.complex128)[..., 0]
        both = _transformed(white * spectrum)
        for field in (both.real, both.imag)[: count - len(nodes)]:
            nodes.append(field[: shape[0] : refine, : shape[1] : refine][grid.inside])
            seen.append(map_coordinates(field, place, order=1, mode="grid-wrap"))
    return np.array(nodes), np.array(seen)


def _spectrum(model: CovarianceModel, shape: list[int], step: float) -> Array:
    """Square roots of the covariance's eigenvalues, over the number of nodes, on a torus with
    room beyond the grid.
    """
    values = np.ones((1, 1))
    for ranges in ROOM_RANGES:
        room = min(int(ranges * model.practical_range_m / step) + 1, MOST_ROOM)
        values = _eigenvalues(model, shape, step, room)
        if -values[values < 0].sum() <= NEGATIVE_SHARE * values.sum():
            break
    return np.sqrt(np.maximum(values, 0.0) / values.size)


def _eigenvalues(model: CovarianceModel, shape: list[int], step: float, room: int) -> Array:
    # Samples may lie beyond the grid by a node or two.
    size = [int(fft.next_fast_len(side + max(room, 4)) or side) for side in shape]
    signed = [step * np.where(np.arange(n) <= n // 2, np.arange(n), np.arange(n) - n) for n in size]
    offsets = np.stack(np.meshgrid(*signed, indexing="ij"), axis=-1).reshape(-1, 2)
    distance = np.hypot(*model.isotropic(offsets).T).reshape(size)
    return _transformed(model.covariance(distance)).real


def _transformed(field: NDArray[Any]) -> NDArray[np.complex128]:
    return cast("NDArray[np.complex128]", fft.fft2(field))
