"""Simulation of the model under the thrusts that were sent, over pieces of a track."""

# pyright: reportMissingParameterType=false, reportUnknownParameterType=false
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false

from __future__ import annotations

import numpy as np

from grebe.core.copies import copy_vector
from grebe.core.kernels import machine_code, part_of_kernels
from grebe.core.motion import CE, CN, advance

SUBSTEPS_PER_S = 20.0


@machine_code
def lagged(thrusts, lags):
    """Mean thrusts (n, 2) of thrusters with a lag under the orders `thrusts` (n, 2).

    Step i lasts `lags[i]` time constants. The thrusters begin at the first order.
    """
    out = np.empty_like(thrusts)
    now = thrusts[0].copy()
    for i in range(len(thrusts)):
        left = np.exp(-lags[i])
        for j in range(2):
            off = now[j] - thrusts[i, j]
            out[i, j] = thrusts[i, j] + off * (1.0 - left) / lags[i]
            now[j] = thrusts[i, j] + off * left
    return out


@part_of_kernels
def piece_end(p, drift, times, z, thrusts, shares, first, last, per_second):
    """Simulate `z` (6,) from `times[first]` to `times[last]`, in place.

    `thrusts` (n - 1, 2) are the means between successive times; the thrusters give `shares` (2,) of
    them. The current of `p` holds at the last time, `drift` (2,) is its rate of change until then.
    There are at least `per_second` Runge-Kutta steps a second.
    """
    q, end, given = p.copy(), np.empty(6), np.empty(2)
    before = times[-1] - 0.5 * (times[first] + times[last])
    q[CN] = p[CN] - before * drift[0]
    q[CE] = p[CE] - before * drift[1]
    for i in range(first, last):
        duration = times[i + 1] - times[i]
        substeps = max(1, int(np.ceil(duration * per_second - 1e-6)))
        given[0], given[1] = shares[0] * thrusts[i, 0], shares[1] * thrusts[i, 1]
        advance(q, z, given, duration, substeps, end)
        copy_vector(z, end)


@machine_code
def pieces_ends(p, drift, times, states, thrusts, shares, first, last, per_second):
    """Ends (k, 6) of the pieces that begin at `states[first]`; see `piece_end`."""
    ends = np.empty((len(first), 6))
    for k in range(len(first)):
        copy_vector(ends[k], states[first[k]])
        piece_end(p, drift, times, ends[k], thrusts, shares, first[k], last[k], per_second)
    return ends
