"""Unconditional fields of a covariance model on a regular grid, exact and fast.

Circulant embedding (Dietrich and Newsam 1997): on a large enough torus, the covariance matrix is
diagonal in Fourier space. Negative eigenvalues of a smooth covariance are cut off.
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

# Room beyond the grid on the torus, in practical ranges. The first is used with which the negative
# eigenvalues are no more than this share of the variance, because cutting them off roughens the
# fields. The room is limited to this many nodes.
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
    interpolated bilinearly between the nodes, at `positions` (count, n).

    The fields are drawn on a grid `refine` times as fine: interpolation between nodes smooths them,
    which matters if the field is rough.
    """
    step = grid.step_m / refine
    shape = [refine * (side - 1) + 1 for side in grid.inside.shape]
    spectrum = _spectrum(model, shape, step)
    place = ((positions - [grid.north[0], grid.east[0]]) / step).T
    nodes, seen = [], []
    for _ in range(0, count, 2):
        # The real and imaginary parts are two independent fields.
        white = rng.normal(size=(*spectrum.shape, 2)).view(np.complex128)[..., 0]
        both = _transformed(white * spectrum)
        for field in (both.real, both.imag)[: count - len(nodes)]:
            nodes.append(field[: shape[0] : refine, : shape[1] : refine][grid.inside])
            seen.append(map_coordinates(field, place, order=1, mode="grid-wrap"))
    return np.array(nodes), np.array(seen)


def _spectrum(model: CovarianceModel, shape: list[int], step: float) -> Array:
    """Square roots of the covariance's eigenvalues, divided by the number of nodes, on a torus with
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
    # Samples may be outside the grid by a node or two.
    size = [int(fft.next_fast_len(side + max(room, 4)) or side) for side in shape]
    signed = [step * np.where(np.arange(n) <= n // 2, np.arange(n), np.arange(n) - n) for n in size]
    offsets = np.stack(np.meshgrid(*signed, indexing="ij"), axis=-1).reshape(-1, 2)
    distance = np.hypot(*model.isotropic(offsets).T).reshape(size)
    return _transformed(model.covariance(distance)).real


def _transformed(field: NDArray[Any]) -> NDArray[np.complex128]:
    return cast("NDArray[np.complex128]", fft.fft2(field))
