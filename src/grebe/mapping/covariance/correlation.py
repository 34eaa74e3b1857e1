"""Correlations by rows, in loops that a processor does several turns of at once.

A map asks for some hundred million of them, and the library's exponential, one call a number, was
most of its time: that of a row takes a sixth of it and agrees to the last digit but one.
"""

# Kernels do not annotate what they pass on to each other: numba infers the types.
# pyright: reportMissingParameterType=false, reportUnknownParameterType=false
# pyright: reportUnknownArgumentType=false, reportUnknownVariableType=false
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math

import numpy as np

from grebe.core.kernels import exact_machine_code, machine_code

SQRT3, SQRT5 = math.sqrt(3.0), math.sqrt(5.0)
LOG2_E, LN_2 = 1.0 / math.log(2.0), math.log(2.0)
# A number of this size has no digits behind the point: what is added to it is rounded to a whole
# number, which is found in its last bits.
ROUNDER = 1.5 * 2.0**52
# Beyond it nothing is left that counts; and the exponent of 1 in a number's bits, and where it is.
FURTHEST, ONE, EXPONENT_AT = 700.0, 1023, 52


@exact_machine_code
def decay(x, bits, out):
    """Write exp(-x) of a row `x` (m,) that is not negative to `out` (m,), within 3e-15 of it;
    `bits` (m,) are integers to work with.

    exp(-x) = 2^n exp(g), n the whole number next to -x / ln 2 and g what is left, by its series.
    """
    two = bits.view(np.float64)
    for i in range(x.size):
        two[i] = max(-x[i], -FURTHEST) * LOG2_E + ROUNDER
    for i in range(x.size):
        out[i] = LN_2 * (max(-x[i], -FURTHEST) * LOG2_E - (two[i] - ROUNDER))
        bits[i] = (bits[i] + ONE) << EXPONENT_AT
    for i in range(x.size):
        g = out[i]
        s = g * g
        high = 1 / 3628800 + g * (1 / 39916800) + s * (1 / 479001600)
        mid = 1 / 720 + g * (1 / 5040) + s * (1 / 40320 + g * (1 / 362880) + s * high)
        out[i] = two[i] * (
            1.0 + g + s * (1 / 2 + g * (1 / 6) + s * (1 / 24 + g * (1 / 120) + s * mid))
        )


@machine_code
def correlate(code, x, bits, out):
    """Write the correlation at distances of `x` (m,) ranges to `out` (m,), under the model
    `KINDS[code]` of `grebe.mapping.covariance.models`; what `x` holds then is lost.
    """
    if code == 0:
        for i in range(x.size):
            near = min(x[i], 1.0)
            out[i] = 1 - 1.5 * near + 0.5 * near * near * near
        return
    scale = SQRT3 if code == 2 else SQRT5 if code == 3 else 1.0
    for i in range(x.size):
        x[i] *= x[i] if code == 4 else scale
    decay(x, bits, out)
    if code == 2:
        for i in range(x.size):
            out[i] *= 1 + x[i]
    elif code == 3:
        for i in range(x.size):
            out[i] *= 1 + x[i] + x[i] * x[i] / 3


@machine_code
def correlations_of(code, x):
    """Correlations at distances of `x` (n,) ranges, (n,)."""
    out, bits = np.empty(x.size), np.empty(x.size, np.int64)
    correlate(code, x.copy(), bits, out)
    return out


@machine_code
def slopes_of(code, x):
    """By how much the correlations at distances of `x` (n,) ranges grow with the range's logarithm,
    (n,), and the correlations themselves, (n,).
    """
    found, grown, t = np.empty(x.size), np.empty(x.size), np.empty(x.size)
    grow(code, x, t, np.empty(x.size, np.int64), found, grown)
    return grown, found


@machine_code
def grow(code, x, t, bits, found, grown):
    """Write what `slopes_of` gives of a row `x` (m,) to `found` and `grown` (m,); `t` (m,) and
    `bits` (m,) are to work with.
    """
    for i in range(x.size):
        t[i] = x[i]
    correlate(code, t, bits, found)
    for i in range(x.size):
        if code == 0:
            near = min(x[i], 1.0)
            grown[i] = 1.5 * (near - near * near * near)
        elif code == 1:
            grown[i] = x[i] * found[i]
        elif code == 2:
            grown[i] = t[i] * t[i] / (1 + t[i]) * found[i]
        elif code == 3:
            grown[i] = t[i] * t[i] * (1 + t[i]) / (3 + 3 * t[i] + t[i] * t[i]) * found[i]
        else:
            grown[i] = 2 * t[i] * found[i]


@exact_machine_code
def lower_covariance(code, sill, reach, jitter, distance, passing, memory, apart):
    """Below the diagonal and on it, the covariance (n, n) of samples at each other's `distance`
    (n, n), `sill` on the diagonal increased by a share of `jitter`; and that of a fleeting process
    of the variance `passing` for times `apart` (n, n), where that is not empty.
    """
    n = distance.shape[0]
    out = np.empty((n, n))
    x, row, bits = np.empty(n), np.empty(n), np.empty(n, np.int64)
    for i in range(n):
        m = i + 1
        for j in range(m):
            x[j] = distance[i, j] / reach
        correlate(code, x[:m], bits[:m], row[:m])
        for j in range(m):
            out[i, j] = row[j] * sill
        out[i, i] += jitter * sill
        if apart.size:
            for j in range(m):
                x[j] = apart[i, j] / memory
            decay(x[:m], bits[:m], row[:m])
            for j in range(m):
                out[i, j] += passing * row[j]
    return out


@machine_code
def lower_slopes(
    code, sill, reach, jitter, distance, passing, memory, apart, inverse, rest, by_one
):
    """Sums (4,) over all pairs of samples.

        (rest_i rest_j + by_one_i by_one_j - inverse_ij) dC_ij,

    dC the derivative of `lower_covariance` by the logarithms of `reach`, `sill`, `passing` and
    `memory` in turn. Of `inverse` (n, n) what lies below the diagonal and on it is read.
    """
    n = distance.shape[0]
    sums = np.zeros(4)
    x, t, bits = np.empty(n), np.empty(n), np.empty(n, np.int64)
    found, grown, weight = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        m = i + 1
        for j in range(m):
            x[j] = distance[i, j] / reach
            weight[j] = 2.0 * (rest[i] * rest[j] + by_one[i] * by_one[j] - inverse[i, j])
        weight[i] *= 0.5
        grow(code, x[:m], t[:m], bits[:m], found[:m], grown[:m])
        by_reach, by_sill = 0.0, jitter * weight[i]
        for j in range(m):
            by_reach += weight[j] * grown[j]
            by_sill += weight[j] * found[j]
        sums[0] += sill * by_reach
        sums[1] += sill * by_sill
        if apart.size:
            for j in range(m):
                x[j] = apart[i, j] / memory
            decay(x[:m], bits[:m], found[:m])
            by_passing, by_memory = 0.0, 0.0
            for j in range(m):
                by_passing += weight[j] * found[j]
                by_memory += weight[j] * x[j] * found[j]
            sums[2] += passing * by_passing
            sums[3] += passing * by_memory
    return sums


@machine_code
def covariances(code, sill, reach, a, b, below):
    """Of each place of `a` (n, 2) with each of `b` (m, 2); `below`: with those up to its own number
    alone, and 0 with the others.
    """
    out = np.zeros((a.shape[0], b.shape[0]))
    x, bits = np.empty(b.shape[0]), np.empty(b.shape[0], np.int64)
    north, east = b[:, 0].copy(), b[:, 1].copy()
    for i in range(a.shape[0]):
        count = i + 1 if below else b.shape[0]
        row = out[i, :count]
        _distances(a[i], north, east, reach, x[:count])
        correlate(code, x[:count], bits[:count], row)
        for j in range(count):
            row[j] *= sill
    return out


@machine_code
def _distances(place, north, east, reach, x):
    """Distances of a place from others, in units of `reach`."""
    inverse = 1.0 / reach
    for j in range(x.size):
        d_north, d_east = place[0] - north[j], place[1] - east[j]
        x[j] = inverse * math.sqrt(d_north * d_north + d_east * d_east)


@machine_code
def faded(variance, memory, a, b):
    """Covariances (n, m) of a process that forgets, between times (n,) and (m,)."""
    out = np.empty((a.size, b.size))
    x, bits = np.empty(b.size), np.empty(b.size, np.int64)
    inverse = 1.0 / memory
    for i in range(a.size):
        for j in range(b.size):
            x[j] = inverse * abs(a[i] - b[j])
        decay(x, bits, out[i])
        for j in range(b.size):
            out[i, j] *= variance
    return out


@machine_code
def add_faded(variance, memory, times, out):
    """Add to `out` (n, n), below the diagonal and on it, what `faded` gives of times (n,) and
    themselves.
    """
    x, row, bits = np.empty(times.size), np.empty(times.size), np.empty(times.size, np.int64)
    inverse = 1.0 / memory
    for i in range(times.size):
        m = i + 1
        for j in range(m):
            x[j] = inverse * abs(times[i] - times[j])
        decay(x[:m], bits[:m], row[:m])
        for j in range(m):
            out[i, j] += variance * row[j]


@machine_code
def carried(code, at, places, reach, weights):
    """Sums (m, c) of correlations with `at` (m, 2), weighted by (n, c) at `places` (n, 2)."""
    out = np.zeros((at.shape[0], weights.shape[1]))
    n = places.shape[0]
    x, row, bits = np.empty(n), np.empty(n), np.empty(n, np.int64)
    north, east = places[:, 0].copy(), places[:, 1].copy()
    columns = weights.T.copy()
    for i in range(at.shape[0]):
        _distances(at[i], north, east, reach, x)
        correlate(code, x, bits, row)
        for k in range(columns.shape[0]):
            total = 0.0
            for j in range(n):
                total += row[j] * columns[k, j]
            out[i, k] = total
    return out
