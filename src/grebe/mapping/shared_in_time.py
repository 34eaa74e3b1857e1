"""Processes in time that all the water shares, by which the readings of a survey may differ."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from grebe.mapping.covariance.models import Fleeting

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# As shares of the survey's time: how slow a change is, and the memory of the process by which two
# passes differ.
SLOW, FLEETING = 0.5, 0.05


def slow(a: Array, b: Array, span_s: float) -> Array:
    """Correlation (n, m) of a slow change at times (n,) and (m,) [s]: Matérn 5/2."""
    x = np.sqrt(5.0) * np.abs(a[:, None] - b[None, :]) / (SLOW * span_s)
    return (1 + x + x**2 / 3) * np.exp(-x)


def fleeting(times: Array, span_s: float) -> Array:
    """Correlation (n, n) of what differs between two passes, at times (n,) [s]."""
    return Fleeting(variance=1.0, memory_s=FLEETING * span_s).covariance(times, times)
