"""The boat's excess over a set after one step, for many inputs; compiled."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from grebe.core.kernels import machine_code
from grebe.core.motion import advance

if TYPE_CHECKING:
    from numpy.typing import NDArray


@machine_code
def excesses(
    p: NDArray[np.float64],
    state: NDArray[np.float64],
    inputs: NDArray[np.float64],
    duration: float,
    substeps: int,
    rows: NDArray[np.float64],
    out: NDArray[np.float64],
) -> np.intp:
    """Compute the largest a z - b over `rows` (n, 4) after one step, for each of `inputs` (m, 2).

    A negative value means strictly inside. Writes `out` (m,) and returns the index of the least.
    """
    after = np.empty(6)
    for k in range(inputs.shape[0]):
        advance(p, state, inputs[k], duration, substeps, after)
        worst = -np.inf
        for i in range(rows.shape[0]):
            row = rows[i]
            value = row[0] * after[0] + row[1] * after[1] + row[2] * after[3] - row[3]
            worst = max(worst, value)
        out[k] = worst
    return np.argmin(out)
