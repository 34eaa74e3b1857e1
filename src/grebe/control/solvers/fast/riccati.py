"""The linear-quadratic problem of a horizon, by Riccati recursion (Rawlings et al. 2017, 8.8).

    min sum_k 1/2 y' H_k y + g_k' y,  y = (dx_k, dw_k)
    s.t. dx_0 = 0,  dx_{k+1} = A_k dx_k + B_k dw_k + c_k

with nine variables a stage: six states and three inputs (F_1, F_2, share of duration).
`factorise` depends on the matrices alone, so that one factorisation serves several vectors.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# pyright: reportMissingParameterType=false

from __future__ import annotations

import numpy as np

from grebe.core.copies import put, put_rows
from grebe.core.kernels import machine_code

NX, NW, NY = 6, 3, 9


@machine_code
def factorise(hess, terminal, a, b, p, gain, chol):
    """Backward pass of the matrices; false where a reduced Hessian is not positive definite.

    `hess` (N, 9, 9), `terminal` (6, 6), `a` (N, 6, 6), `b` (N, 6, 3) in; `p` (N + 1, 6, 6),
    `gain` (N, 3, 6), `chol` (N, 3, 3) out.
    """
    n = hess.shape[0]
    pa = np.empty((NX, NX))
    pb = np.empty((NX, NW))
    r = np.empty((NW, NW))
    s = np.empty((NW, NX))
    put_rows(p[n], terminal)
    for k in range(n - 1, -1, -1):
        ak, bk, pk = a[k], b[k], p[k + 1]
        for i in range(NX):
            for j in range(NX):
                value = 0.0
                for m in range(NX):
                    value += pk[i, m] * ak[m, j]
                pa[i, j] = value
            for j in range(NW):
                value = 0.0
                for m in range(NX):
                    value += pk[i, m] * bk[m, j]
                pb[i, j] = value
        for i in range(NW):
            for j in range(i + 1):
                value = hess[k, NX + i, NX + j]
                for m in range(NX):
                    value += bk[m, i] * pb[m, j]
                r[i, j] = value
            for j in range(NX):
                value = hess[k, NX + i, j]
                for m in range(NX):
                    value += bk[m, i] * pa[m, j]
                s[i, j] = value
        c = chol[k]
        for i in range(NW):
            for j in range(i + 1):
                value = r[i, j]
                for m in range(j):
                    value -= c[i, m] * c[j, m]
                if i == j:
                    if not value > 1e-12:
                        return False
                    c[i, i] = np.sqrt(value)
                else:
                    c[i, j] = value / c[j, j]
        # gain = R^-1 S: forward substitution, kept half-way for the update of P.
        g = gain[k]
        for j in range(NX):
            for i in range(NW):
                value = s[i, j]
                for m in range(i):
                    value -= c[i, m] * g[m, j]
                g[i, j] = value / c[i, i]
        for i in range(NX):
            for j in range(i + 1):
                value = hess[k, i, j]
                for m in range(NX):
                    value += ak[m, i] * pa[m, j]
                for m in range(NW):
                    value -= g[m, i] * g[m, j]
                p[k, i, j] = value
                p[k, j, i] = value
        for j in range(NX):
            for i in range(NW - 1, -1, -1):
                value = g[i, j]
                for m in range(i + 1, NW):
                    value -= c[m, i] * g[m, j]
                g[i, j] = value / c[i, i]
    return True


@machine_code
def solve(grad, terminal, a, b, c, p, gain, chol, dx, dw, costate):
    """Vector pass: minimiser `dx` (N + 1, 6), `dw` (N, 3), and `costate` (N + 1, 6), the
    multiplier of the dynamics into each node.

    `grad` (N, 9), `terminal` (6,), `c` (N, 6); the rest as `factorise` left it.
    """
    n = grad.shape[0]
    q = np.empty(NX)
    t = np.empty(NX)
    feed = np.empty((n, NW))
    put(q, terminal)
    put(costate[n], terminal)
    for k in range(n - 1, -1, -1):
        for i in range(NX):
            value = q[i]
            for m in range(NX):
                value += p[k + 1, i, m] * c[k, m]
            t[i] = value
        for i in range(NW):
            value = grad[k, NX + i]
            for m in range(NX):
                value += b[k, m, i] * t[m]
            feed[k, i] = value
        for i in range(NX):
            value = grad[k, i]
            for m in range(NX):
                value += a[k, m, i] * t[m]
            for m in range(NW):
                value -= gain[k, m, i] * feed[k, m]
            q[i] = value
        for i in range(NX):
            costate[k, i] = q[i]
        lower = chol[k]
        for i in range(NW):
            value = feed[k, i]
            for m in range(i):
                value -= lower[i, m] * feed[k, m]
            feed[k, i] = value / lower[i, i]
        for i in range(NW - 1, -1, -1):
            value = feed[k, i]
            for m in range(i + 1, NW):
                value -= lower[m, i] * feed[k, m]
            feed[k, i] = value / lower[i, i]
    dx[0] = 0.0
    for k in range(n):
        for i in range(NW):
            value = -feed[k, i]
            for m in range(NX):
                value -= gain[k, i, m] * dx[k, m]
            dw[k, i] = value
        for i in range(NX):
            value = c[k, i]
            for m in range(NX):
                value += a[k, i, m] * dx[k, m]
            for m in range(NW):
                value += b[k, i, m] * dw[k, m]
            dx[k + 1, i] = value
    for k in range(n + 1):
        for i in range(NX):
            for m in range(NX):
                costate[k, i] += p[k, i, m] * dx[k, m]
