"""The linear-quadratic problem of a horizon, by Riccati recursion (Rawlings et al. 2017, 8.8).

    min sum_k 1/2 y' H_k y + g_k' y,  y = (dx_k, dw_k)
    s.t. dx_0 = 0,  dx_{k+1} = E (x, y)_k + M_k q_k + c_k,  q = (psi, u, v, r, F_1, F_2, share)

with nine variables a stage: six states and three inputs (F_1, F_2, share of duration). Nothing
depends on the position except the next position, so E is the first two columns of the identity
matrix. M, the stage's sensitivities, is the other seven columns of its derivative. `factorise`
depends only on the matrices, so one factorisation serves several vectors.

Rows are padded for the vector registers: to eight numbers for a state or for q, and to `ROW` for y.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# pyright: reportMissingParameterType=false

from __future__ import annotations

import numpy as np

from grebe.core.eights import WIDTH, loaded, stored, sum_of_six
from grebe.core.kernels import inlined_machine_code, machine_code

NX, NW, NY = 6, 3, 9
# The number of positions, after which q begins in y; and the length of a row of y, one for padding.
PLACE, ROW = 2, 10


@machine_code
def factorise(hess, terminal, sens, p, gain, chol):
    """Backward pass of the matrices; return False if a reduced Hessian is not positive definite.

    In: `hess` (N, 9, 10), `terminal` (6, 6), `sens` (N, 6, 8), whose last column is zero. Out: `p`
    (N + 1, 6, 8), `gain` (N, 3, 8), `chol` (N, 3, 3), with inverted diagonals.
    """
    n = hess.shape[0]
    ahead = np.empty((NX, WIDTH))
    whole = np.empty((NY, ROW))
    for i in range(NX):
        for j in range(NX):
            p[n, i, j] = terminal[i, j]
    for k in range(n - 1, -1, -1):
        _propagate(hess[k], sens[k], p[k + 1], ahead, whole)
        if not _decompose(whole, chol[k]):
            return False
        _eliminate(whole, chol[k], p[k], gain[k])
    return True


@inlined_machine_code
def _propagate(hess, sens, p, ahead, whole):
    """Set `whole` to the Hessian of a stage and all that follow: H + (E, M)' P (E, M)."""
    for i in range(NX):
        row = sum_of_six(sens, p[i, 0], p[i, 1], p[i, 2], p[i, 3], p[i, 4], p[i, 5])
        stored(row, ahead, i, 0)
    for i in range(PLACE):
        stored(loaded(hess, i, PLACE) + loaded(ahead, i, 0), whole, i, PLACE)
        for j in range(PLACE):
            whole[i, j] = hess[i, j] + p[i, j]
    for i in range(NY - PLACE):
        row = sum_of_six(
            ahead, sens[0, i], sens[1, i], sens[2, i], sens[3, i], sens[4, i], sens[5, i]
        )
        stored(loaded(hess, PLACE + i, PLACE) + row, whole, PLACE + i, PLACE)
        for j in range(PLACE):
            whole[PLACE + i, j] = hess[PLACE + i, j] + ahead[j, i]


@inlined_machine_code
def _decompose(whole, lower):
    """Cholesky factor of the inputs' block; return False if it is not positive definite.

    The diagonal is inverted, because a division takes as long as ten products.
    """
    for i in range(NW):
        for j in range(i + 1):
            value = whole[NX + i, NX + j]
            for m in range(j):
                value -= lower[i, m] * lower[j, m]
            if i > j:
                lower[i, j] = value * lower[j, j]
            elif value > 1e-12:
                lower[i, i] = 1.0 / np.sqrt(value)
            else:
                return False
    return True


@inlined_machine_code
def _eliminate(whole, lower, p, gain):
    """Eliminate the inputs from `whole`: compute the states' cost to go `p` and the gains."""
    first = lower[0, 0] * loaded(whole, NX, 0)
    second = lower[1, 1] * (loaded(whole, NX + 1, 0) - lower[1, 0] * first)
    third = loaded(whole, NX + 2, 0) - lower[2, 0] * first - lower[2, 1] * second
    third = lower[2, 2] * third
    stored(first, gain, 0, 0)
    stored(second, gain, 1, 0)
    stored(third, gain, 2, 0)
    for i in range(NX):
        taken = gain[0, i] * first + gain[1, i] * second + gain[2, i] * third
        stored(loaded(whole, i, 0) - taken, p, i, 0)
    # Restore symmetry, which rounding would otherwise degrade stage by stage.
    for i in range(NX):
        for j in range(i):
            p[j, i] = p[i, j]
    third = lower[2, 2] * third
    second = lower[1, 1] * (second - lower[2, 1] * third)
    first = lower[0, 0] * (first - lower[1, 0] * second - lower[2, 0] * third)
    stored(first, gain, 0, 0)
    stored(second, gain, 1, 0)
    stored(third, gain, 2, 0)


@machine_code
def solve(grad, terminal, sens, c, p, gain, chol, dx, dw, costate):
    """Vector pass: compute the minimiser and the costates, in place.

    In: `grad` (N, 10), `terminal` (6,), `c` (N, 6), and the results of `factorise`. Out: `dx`
    (N + 1, 6), `dw` (N, 3), and `costate` (N + 1, 6), the multiplier of the dynamics into each
    node.
    """
    n = grad.shape[0]
    feed = np.empty((n, NW))
    # The gradient of the cost to go at each node, and of a stage and all that follow.
    slope, whole, after = np.zeros((n + 1, WIDTH)), np.empty((1, ROW)), np.empty((1, WIDTH))
    for i in range(NX):
        slope[n, i] = terminal[i]
    for k in range(n - 1, -1, -1):
        ahead = sum_of_six(p[k + 1], c[k, 0], c[k, 1], c[k, 2], c[k, 3], c[k, 4], c[k, 5])
        stored(loaded(slope, k + 1, 0) + ahead, after, 0, 0)
        row = sum_of_six(
            sens[k], after[0, 0], after[0, 1], after[0, 2], after[0, 3], after[0, 4], after[0, 5]
        )
        stored(loaded(grad, k, PLACE) + row, whole, 0, PLACE)
        for i in range(PLACE):
            whole[0, i] = grad[k, i] + after[0, i]
        own = loaded(whole, 0, 0)
        for i in range(NW):
            own = own - whole[0, NX + i] * loaded(gain[k], i, 0)
        stored(own, slope, k, 0)
        _back_substituted(whole, chol[k], feed[k])
    _forward(sens, c, gain, feed, dx, dw)
    for k in range(n + 1):
        row = sum_of_six(p[k], dx[k, 0], dx[k, 1], dx[k, 2], dx[k, 3], dx[k, 4], dx[k, 5])
        stored(loaded(slope, k, 0) + row, after, 0, 0)
        for i in range(NX):
            costate[k, i] = after[0, i]


@inlined_machine_code
def _back_substituted(whole, lower, feed):
    """The inputs' feed-forward, with its sign reversed."""
    for i in range(NW):
        value = whole[0, NX + i]
        for m in range(i):
            value -= lower[i, m] * feed[m]
        feed[i] = value * lower[i, i]
    for i in range(NW - 1, -1, -1):
        value = feed[i]
        for m in range(i + 1, NW):
            value -= lower[m, i] * feed[m]
        feed[i] = value * lower[i, i]


@inlined_machine_code
def _forward(sens, c, gain, feed, dx, dw):
    """Apply feed-forward and gains from the first node on."""
    for i in range(NX):
        dx[0, i] = 0.0
    for k in range(dw.shape[0]):
        for i in range(NW):
            value = -feed[k, i]
            for m in range(NX):
                value -= gain[k, i, m] * dx[k, m]
            dw[k, i] = value
        for i in range(NX):
            value = c[k, i] + dx[k, i] if i < PLACE else c[k, i]
            for m in range(NX - PLACE):
                value += sens[k, i, m] * dx[k, PLACE + m]
            for m in range(NW):
                value += sens[k, i, NX - PLACE + m] * dw[k, m]
            dx[k + 1, i] = value
