"""The model rolled out under thrusts that were sent: to now, and to where pieces of a track end."""

# pyright: reportMissingParameterType=false, reportUnknownParameterType=false
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false

from __future__ import annotations

import numpy as np

from grebe.core.copies import put
from grebe.core.kernels import machine_code, part_of_kernels
from grebe.core.motion import CE, CN, advance

SUBSTEPS_PER_S = 20.0


@machine_code
def lagged(thrusts, lags):
    """Mean thrusts (n, 2) in steps of `lags` (n,) time constants each, of thrusters that are told
    `thrusts` (n, 2) and give the first of them when it begins.
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
    """Roll `z` (6,) out from `times[first]` to `times[last]`, in place, under the mean thrusts
    (n - 1, 2) between successive times, of thrusters that give `shares` (2,) of them. The current
    of `p` is that of the last time, and `drift` (2,) how it has changed until then; `per_second`
    Runge-Kutta steps a second at least.
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
        put(z, end)


@machine_code
def pieces_ends(p, drift, times, states, thrusts, shares, first, last, per_second):
    """Where the pieces end, (k, 6), that begin at `states[first]`; see `piece_end`."""
    ends = np.empty((len(first), 6))
    for k in range(len(first)):
        put(ends[k], states[first[k]])
        piece_end(p, drift, times, ends[k], thrusts, shares, first[k], last[k], per_second)
    return ends
