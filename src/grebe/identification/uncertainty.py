"""Standard errors that account for correlated residuals.

The inverse of the information treats every row as independent. But errors of a filter last for
seconds, so many rows count as one, and gusts also leave errors that last. With
tau_c = 1 + 2 sum_k rho_k, the integrated autocorrelation of channel c's residuals, the covariance
is the sandwich

    A^-1 (sum_c tau_c A_c + P) A^-1,    A = sum_c A_c + P.

It is exact if the effect of a parameter on the predictions changes slowly compared with the errors,
and otherwise too large, never too small. P is the preset's precision.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from grebe.identification.estimator import Fit
from grebe.identification.segments import Segments

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Correlations below this are treated as zero and end the sum.
LEAST_CORRELATION = 0.05
LONGEST_ROWS = 50


def covariance(fit: Fit, segments: Segments) -> Array:
    """Covariance (p, p) of the estimated coordinates."""
    prior = np.diag(1.0 / fit.model.prior_sd**2)
    times = correlation_factors(fit.residuals, segments.piece)
    bread = np.linalg.inv(fit.information.sum(axis=0) + prior)
    return bread @ (np.einsum("c,cij->ij", times, fit.information) + prior) @ bread


def correlation_factors(residuals: Array, piece: NDArray[np.int64]) -> Array:
    """tau_c (6,) of the channels' residuals (n, 6), 1 or more; only rows of one piece correlate."""
    out = np.ones(6)
    for channel in range(6):
        known = np.isfinite(residuals[:, channel])
        errors, own = residuals[known, channel], piece[known]
        power = float(errors @ errors)
        if power == 0.0:
            continue
        for k in range(1, min(LONGEST_ROWS, len(errors) - 1)):
            together = own[k:] == own[:-k]
            rho = float(np.sum((errors[k:] * errors[:-k])[together])) / power
            if rho < LEAST_CORRELATION:
                break
            out[channel] += 2.0 * rho
    return out
