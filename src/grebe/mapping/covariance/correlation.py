"""Correlations computed by rows, in loops that the compiler can vectorise.

A map needs some hundred million of them, and most of its time went into the library's exponential,
one call for each number. Computed for a row, it takes a sixth of the time and agrees to all digits
but the last.
"""

# Kernels do not annotate the arguments that they pass to each other: numba infers the types.
# pyright: reportMissingParameterType=false, reportUnknownParameterType=false
# pyright: reportUnknownArgumentType=false, reportUnknownVariableType=false
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math

import numpy as np

from grebe.core.kernels import exact_machine_code, machine_code

SQRT3, SQRT5 = math.sqrt(3.0), math.sqrt(5.0)
LOG2_E, LN_2 = 1.0 / math.log(2.0), math.log(2.0)
# A number of this size has no fractional bits: what is added to it is rounded to an integer, which
# can be read from its last bits.
ROUNDER = 1.5 * 2.0**52
# Larger arguments of the exponential count as `FURTHEST`, where the result is negligible; the
# biased exponent of 1, and the position of the exponent in a number's bits.
FURTHEST, ONE, EXPONENT_AT = 700.0, 1023, 52


@exact_machine_code
def decay(x, bits, out):
    """Write exp(-x) of a non-negative row `x` (m,) to `out` (m,), accurate to 3e-15; `bits` (m,)
    are integers to work with.

    exp(-x) = 2^n exp(g), where n is the integer nearest to -x / ln 2, and exp(g) of the remainder g
    is a series.
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
    `KINDS[code]` of `grebe.mapping.covariance.models`. Overwrites `x`.
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
    """The derivatives (n,) of the correlations at distances of `x` (n,) ranges by the logarithm of
    the range, and the correlations themselves, (n,).
    """
    found, grown, t = np.empty(x.size), np.empty(x.size), np.empty(x.size)
    grow(code, x, t, np.empty(x.size, np.int64), found, grown)
    return grown, found


@machine_code
def grow(code, x, t, bits, found, grown):
    """Write the results of `slopes_of` for a row `x` (m,) to `found` and `grown` (m,); `t` (m,) and
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
    """The covariance (n, n), on and below the diagonal, of samples at pairwise `distance` (n, n),
    with a share `jitter` of `sill` added to the diagonal. If `apart` (n, n), the times between
    samples, is not empty, a fleeting process of variance `passing` is added. Above the diagonal,
    it is 0: whole matrices are added to it, and sums with uninitialised memory may be invalid.
    """
    n = distance.shape[0]
    out = np.zeros((n, n))
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
    """Sums (4,) of the following term over all pairs of samples.

        (rest_i rest_j + by_one_i by_one_j - inverse_ij) dC_ij,

    where dC is the derivative of `lower_covariance` by the logarithms of `reach`, `sill`, `passing`
    and `memory` in turn. Of `inverse` (n, n), only the part on and below the diagonal is read.
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
def lower_covariance_of_means(code, sill, reach, jitter, distance, count):
    """As `lower_covariance`, (n, n), for samples each of which is the mean of the signal over
    `count` places. The distances (n count, n count) are those of all places, sample by sample.
    """
    n = distance.shape[0] // count
    out = np.zeros((n, n))
    x, row = np.empty(n * count), np.empty(n * count)
    bits, share = np.empty(n * count, np.int64), sill / count**2
    for i in range(n):
        m = (i + 1) * count
        for place in range(i * count, m):
            for j in range(m):
                x[j] = distance[place, j] / reach
            correlate(code, x[:m], bits[:m], row[:m])
            for j in range(i + 1):
                total = 0.0
                for k in range(j * count, (j + 1) * count):
                    total += row[k]
                out[i, j] += share * total
        out[i, i] += jitter * sill
    return out


@machine_code
def lower_slopes_of_means(code, sill, reach, jitter, distance, count, inverse, rest, by_one):
    """As `lower_slopes`, (2,), for `lower_covariance_of_means`: by `reach` and `sill`."""
    n = distance.shape[0] // count
    sums = np.zeros(2)
    x, t, bits = np.empty(n * count), np.empty(n * count), np.empty(n * count, np.int64)
    found, grown = np.empty(n * count), np.empty(n * count)
    for i in range(n):
        m = (i + 1) * count
        for place in range(i * count, m):
            for j in range(m):
                x[j] = distance[place, j] / reach
            grow(code, x[:m], t[:m], bits[:m], found[:m], grown[:m])
            for j in range(i + 1):
                by_reach, by_sill = 0.0, 0.0
                for k in range(j * count, (j + 1) * count):
                    by_reach += grown[k]
                    by_sill += found[k]
                weight = (1.0 if i == j else 2.0) / count**2
                weight *= rest[i] * rest[j] + by_one[i] * by_one[j] - inverse[i, j]
                sums[0] += weight * sill * by_reach
                sums[1] += weight * sill * by_sill
        own = rest[i] ** 2 + by_one[i] ** 2 - inverse[i, i]
        sums[1] += jitter * sill * own
    return sums


@machine_code
def covariances(code, sill, reach, a, b, below):
    """Covariances (n, m) of each place of `a` (n, 2) with each of `b` (m, 2). With `below`, only
    those on and below the diagonal are computed, and the others are 0.
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
    """Covariances (n, m) of an exponential process between times (n,) and (m,)."""
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
    """Add to `out` (n, n), on and below the diagonal, the covariances of times (n,) with themselves
    that `faded` returns.
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
