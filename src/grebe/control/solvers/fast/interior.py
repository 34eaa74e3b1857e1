"""A primal-dual interior point for the quadratic problem of a horizon (Mehrotra 1992).

The nodes have half-space rows a (x, y, u) <= b, and the inputs have box bounds. The rows of one set
at one node form a family. There are two kinds:

- sets of the cost: w max(0, a z - b)^2 is a row softened by a slack e at price w e^2. Eliminating
  e = lambda / (2 w) gives a row with compliance 1 / (2 w);
- sets that must contain a node, and corridors: their rows share one slack s >= 0 at a price linear
  in s.

Everything local to a node is eliminated, so each iteration is one Riccati recursion. One vector
holds the slacks t of all rows, then those of the box: the lower bounds of all inputs, then the
upper ones. Another holds their multipliers in the same order.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# Their loops run at least once, so what a loop sets is bound after it.
# pyright: reportMissingParameterType=false, reportPossiblyUnboundVariable=false

from __future__ import annotations

import numpy as np

from grebe.control.solvers.fast.riccati import NW, NX, NY, ROW, factorise, solve
from grebe.core.copies import copy_matrix, copy_vector
from grebe.core.eights import WIDTH
from grebe.core.kernels import inlined_machine_code, part_of_kernels

MOST_ITERATIONS = 40
TO_THE_BOUNDARY = 0.995
# Least initial slack and multiplier of a row.
FLOOR = 1e-2


@part_of_kernels
def start_rows(first, compliance, price, base, t, lam, s, nu):
    """Initialise slacks and multipliers in the interior, near those of the last solve.

    `first` (J + 1,) is where the rows of each family begin, `base` (M,) is a z - b at the current
    iterate. Softened rows begin on their constraint, which keeps the first residuals at zero.
    """
    for j in range(len(price)):
        if price[j] > 0.0:
            _start_shared(first[j], first[j + 1], j, price, base, t, lam, s, nu)
            continue
        for i in range(first[j], first[j + 1]):
            t[i] = max(-base[i], FLOOR)
            if base[i] > -FLOOR:
                lam[i] = (base[i] + t[i]) / compliance[j] + FLOOR
            else:
                lam[i] = min(max(lam[i], FLOOR), 1.0)


@inlined_machine_code
def _start_shared(begin, end, j, price, base, t, lam, s, nu):
    """Do the same for rows that share a slack."""
    worst, total = 0.0, 0.0
    for i in range(begin, end):
        worst = max(worst, base[i])
    s[j] = worst + FLOOR
    for i in range(begin, end):
        t[i] = max(s[j] - base[i], FLOOR)
        lam[i] = max(lam[i], FLOOR / t[i])
        total += lam[i]
    limit = 0.99 * price[j]
    if total > limit:
        for i in range(begin, end):
            lam[i] *= limit / total
        total = limit
    nu[j] = price[j] - total


@part_of_kernels
def start_box(low, high, t, lam):
    """Initialise the box's slacks in the interior; `low`, `high` (N, 3) relative to the iterate."""
    half = low.size
    for k in range(low.shape[0]):
        for i in range(NW):
            at = len(t) - 2 * half + NW * k + i
            t[at] = max(-low[k, i], FLOOR)
            t[at + half] = max(high[k, i], FLOOR)
            lam[at] = max(lam[at], FLOOR)
            lam[at + half] = max(lam[at + half], FLOOR)


@part_of_kernels
def minimise(
    hess, grad, sens, c, rows, first, node, compliance, price, base, low, high,
    t, lam, s, nu, dx, dw, costate, gain, tolerance,
):  # fmt: skip
    """Solve the quadratic problem; return the number of iterations, negative if it failed.

    In: `hess` (N, 9, 10) positive semidefinite, `grad` (N, 10), dynamics `sens` and `c`; `rows`
    (M, 4), and their value `base` (M,) at the iterate; for each family (J,) the index of its first
    row, `first` (J + 1,), its `node`, in ascending order, its `compliance`, and the `price` of its
    slack, zero if its rows share none; the box `low`, `high` (N, 3) of dw. In and out: slacks `t`
    and multipliers `lam` (M + 6 N,), `s` and `nu` (J,). Out: `dx`, `dw`, `costate`, and `gain`
    (N, 3, 8), the feedback of the inputs to a deviation of the state from the solution.
    """
    n, m = hess.shape[0], len(base)
    full, full_grad = np.empty((n, NY, ROW)), np.empty((n, ROW))
    end_hess, end_grad = np.zeros((NX, NX)), np.zeros(NX)
    p, chol = np.zeros((n + 1, NX, WIDTH)), np.zeros((n, NW, NW))
    new_dx, new_dw, new_costate = np.zeros((n + 1, NX)), np.zeros((n, NW)), np.zeros((n + 1, NX))
    residual, weight, shift = np.zeros(m), np.zeros(m), np.zeros(m)
    d_t, d_lam = np.zeros(len(t)), np.zeros(len(t))
    d_s, d_nu = np.zeros(len(s)), np.zeros(len(s))
    dx[:] = 0.0
    dw[:] = 0.0
    costate[:] = 0.0
    infeasible = 1.0
    pairs = len(t) + np.sum(price > 0.0)
    for iteration in range(MOST_ITERATIONS):
        mu = _complementarity(0.0, t, lam, s, nu, d_t, d_lam, d_s, d_nu) / pairs
        worst = _residuals(rows, first, node, compliance, base, dx, t, lam, s, residual)
        if mu < tolerance and worst < tolerance and infeasible < 1e-6:
            return iteration
        aim = 0.0
        for corrector in range(2):
            _condense(
                first, compliance, residual, t, lam, aim, corrector, d_t, d_lam, weight, shift
            )
            _assemble(
                hess, grad, rows, first, node, price, dx, s, nu, lam, weight, shift, aim,
                corrector, d_s, d_nu, dw, low, high, t, d_t, d_lam,
                full, full_grad, end_hess, end_grad,
            )  # fmt: skip
            if corrector == 0 and not factorise(full, end_hess, sens, p, gain, chol):
                return -1 - iteration
            solve(full_grad, end_grad, sens, c, p, gain, chol, new_dx, new_dw, new_costate)
            _row_steps(
                rows, first, node, compliance, price, residual, dx, new_dx, lam, s, nu, aim,
                corrector, weight, shift, d_t, d_lam, d_s, d_nu,
            )  # fmt: skip
            _box_steps(low, high, dw, new_dw, t, lam, aim, corrector, d_t, d_lam)
            alpha = min(_longest_step(t, lam, d_t, d_lam), _longest_step(s, nu, d_s, d_nu))
            if corrector == 0:
                ahead = _complementarity(alpha, t, lam, s, nu, d_t, d_lam, d_s, d_nu) / pairs
                aim = max(mu * min(1.0, max(ahead / mu, 0.0) ** 3), 1e-3 * tolerance)
        alpha = min(1.0, TO_THE_BOUNDARY * alpha)
        _move(alpha, t, d_t)
        _move(alpha, lam, d_lam)
        _move(alpha, s, d_s)
        _move(alpha, nu, d_nu)
        dw += alpha * (new_dw - dw)
        dx += alpha * (new_dx - dx)
        costate += alpha * (new_costate - costate)
        infeasible *= 1.0 - alpha
        if alpha < 1e-8:
            return -1 - iteration
    return -1 - MOST_ITERATIONS


@part_of_kernels
def _complementarity(alpha, t, lam, s, nu, d_t, d_lam, d_s, d_nu):
    """Sum of slacks times multipliers after a share `alpha` of a step."""
    total = 0.0
    for i in range(len(t)):
        total += (t[i] + alpha * d_t[i]) * (lam[i] + alpha * d_lam[i])
    for j in range(len(s)):
        total += (s[j] + alpha * d_s[j]) * (nu[j] + alpha * d_nu[j])
    return total


@part_of_kernels
def _residuals(rows, first, node, compliance, base, dx, t, lam, s, residual):
    """Compute the residual of each row's equation; return the largest magnitude."""
    worst = 0.0
    for j in range(len(node)):
        x, y, u = dx[node[j], 0], dx[node[j], 1], dx[node[j], 3]
        for i in range(first[j], first[j + 1]):
            value = base[i] + rows[i, 0] * x + rows[i, 1] * y + rows[i, 2] * u
            residual[i] = value - s[j] - compliance[j] * lam[i] + t[i]
            worst = max(worst, abs(residual[i]))
    return worst


@part_of_kernels
def _condense(first, compliance, residual, t, lam, aim, corrector, d_t, d_lam, weight, shift):
    """Eliminate each row: d lam = shift + weight (a dz - ds)."""
    for j in range(len(compliance)):
        for i in range(first[j], first[j + 1]):
            target = aim - t[i] * lam[i]
            if corrector == 1:
                target -= d_t[i] * d_lam[i]
            inverse = 1.0 / (t[i] + compliance[j] * lam[i])
            weight[i] = lam[i] * inverse
            shift[i] = (target + lam[i] * residual[i]) * inverse


@part_of_kernels
def _slack_terms(begin, end, j, price, s, nu, lam, weight, shift, aim, corrector, d_s, d_nu):
    """Curvature and right-hand side of a family's shared slack after its rows are eliminated."""
    total_weight, total_shift, total_lam = 0.0, 0.0, 0.0
    for i in range(begin, end):
        total_weight += weight[i]
        total_shift += shift[i]
        total_lam += lam[i]
    target = aim - s[j] * nu[j]
    if corrector == 1:
        target -= d_s[j] * d_nu[j]
    stationarity = price[j] - total_lam - nu[j]
    return total_weight + nu[j] / s[j], total_shift + target / s[j] - stationarity, target


@part_of_kernels
def _assemble(
    hess, grad, rows, first, node, price, dx, s, nu, lam, weight, shift, aim, corrector,
    d_s, d_nu, dw, low, high, t, d_t, d_lam, full, full_grad, end_hess, end_grad,
):  # fmt: skip
    """Add rows and box to the Hessian and gradient of every node, in terms of the new point."""
    n, j = hess.shape[0], 0
    for k in range(n + 1):
        # Lower half of the curvature in position (x, y) and surge u, then the slope.
        xx = yx = yy = ux = uy = uu = 0.0
        x = y = u = 0.0
        while j < len(node) and node[j] == k:
            pull_x = pull_y = pull_u = 0.0
            for i in range(first[j], first[j + 1]):
                w, a_x, a_y, a_u = weight[i], rows[i, 0], rows[i, 1], rows[i, 2]
                along = a_x * dx[k, 0] + a_y * dx[k, 1] + a_u * dx[k, 3]
                value = lam[i] + shift[i] - w * along
                x, y, u = x + value * a_x, y + value * a_y, u + value * a_u
                by_x, by_y, by_u = w * a_x, w * a_y, w * a_u
                pull_x, pull_y, pull_u = pull_x + by_x, pull_y + by_y, pull_u + by_u
                xx, yx, yy = xx + by_x * a_x, yx + by_y * a_x, yy + by_y * a_y
                ux, uy, uu = ux + by_u * a_x, uy + by_u * a_y, uu + by_u * a_u
            if price[j] > 0.0:
                curve, push, _ = _slack_terms(
                    first[j], first[j + 1], j, price, s, nu, lam, weight, shift, aim, corrector,
                    d_s, d_nu,
                )  # fmt: skip
                along = pull_x * dx[k, 0] + pull_y * dx[k, 1] + pull_u * dx[k, 3]
                answer = (push - along) / curve
                x, y, u = x - pull_x * answer, y - pull_y * answer, u - pull_u * answer
                by_x, by_y, by_u = pull_x / curve, pull_y / curve, pull_u / curve
                xx, yx, yy = xx - by_x * pull_x, yx - by_y * pull_x, yy - by_y * pull_y
                ux, uy, uu = ux - by_u * pull_x, uy - by_u * pull_y, uu - by_u * pull_u
            j += 1
        if k == n:
            end_hess[:] = 0.0
            _add_curvature(end_hess, xx, yx, yy, ux, uy, uu)
            end_grad[:] = 0.0
            end_grad[0], end_grad[1], end_grad[3] = x, y, u
            break
        if corrector == 0:
            copy_matrix(full[k], hess[k])
            _add_curvature(full[k], xx, yx, yy, ux, uy, uu)
        copy_vector(full_grad[k], grad[k])
        full_grad[k, 0] += x
        full_grad[k, 1] += y
        full_grad[k, 3] += u
        _add_box(k, dw, low, high, t, lam, aim, corrector, d_t, d_lam, full, full_grad)


@inlined_machine_code
def _add_curvature(hess, xx, yx, yy, ux, uy, uu):
    """Add a curvature in (x, y, u), given by its lower half, and its mirror image."""
    hess[0, 0] += xx
    hess[1, 0] += yx
    hess[0, 1] += yx
    hess[1, 1] += yy
    hess[3, 0] += ux
    hess[0, 3] += ux
    hess[3, 1] += uy
    hess[1, 3] += uy
    hess[3, 3] += uu


@inlined_machine_code
def _add_box(k, dw, low, high, t, lam, aim, corrector, d_t, d_lam, full, full_grad):
    """Add the bounds of a stage's inputs: low - w <= 0 and w - high <= 0."""
    half = low.size
    for i in range(NW):
        at = len(t) - 2 * half + NW * k + i
        for sign, value in ((-1.0, low[k, i] - dw[k, i]), (1.0, dw[k, i] - high[k, i])):
            target = aim - t[at] * lam[at]
            if corrector == 1:
                target -= d_t[at] * d_lam[at]
            inverse = 1.0 / t[at]
            weight = lam[at] * inverse
            shift = (target + lam[at] * (value + t[at])) * inverse
            if corrector == 0:
                full[k, NX + i, NX + i] += weight
            full_grad[k, NX + i] += sign * (lam[at] + shift - weight * sign * dw[k, i])
            at += half


@part_of_kernels
def _row_steps(
    rows, first, node, compliance, price, residual, dx, new_dx, lam, s, nu, aim, corrector,
    weight, shift, d_t, d_lam, d_s, d_nu,
):  # fmt: skip
    """Recover the steps of slacks and multipliers of the rows from the new point."""
    for j in range(len(node)):
        begin, end, k = first[j], first[j + 1], node[j]
        x, y, u = new_dx[k, 0] - dx[k, 0], new_dx[k, 1] - dx[k, 1], new_dx[k, 3] - dx[k, 3]
        ds = 0.0
        if price[j] > 0.0:
            curve, pulled, target = _slack_terms(
                begin, end, j, price, s, nu, lam, weight, shift, aim, corrector, d_s, d_nu
            )
            for i in range(begin, end):
                pulled += weight[i] * (rows[i, 0] * x + rows[i, 1] * y + rows[i, 2] * u)
            ds = pulled / curve
            d_nu[j] = (target - nu[j] * ds) / s[j]
            d_s[j] = ds
        for i in range(begin, end):
            along = rows[i, 0] * x + rows[i, 1] * y + rows[i, 2] * u
            d_lam[i] = shift[i] + weight[i] * (along - ds)
            d_t[i] = -residual[i] - along + ds + compliance[j] * d_lam[i]


@part_of_kernels
def _box_steps(low, high, dw, new_dw, t, lam, aim, corrector, d_t, d_lam):
    """Recover the steps of the box's slacks and multipliers."""
    half = low.size
    for k in range(dw.shape[0]):
        for i in range(NW):
            at = len(t) - 2 * half + NW * k + i
            step = new_dw[k, i] - dw[k, i]
            for sign, value in ((-1.0, low[k, i] - dw[k, i]), (1.0, dw[k, i] - high[k, i])):
                target = aim - t[at] * lam[at]
                if corrector == 1:
                    target -= d_t[at] * d_lam[at]
                d_t[at] = -(value + t[at]) - sign * step
                d_lam[at] = (target - lam[at] * d_t[at]) / t[at]
                at += half


@part_of_kernels
def _longest_step(t, lam, d_t, d_lam):
    """Longest step that keeps all slacks and multipliers non-negative."""
    steepest = TO_THE_BOUNDARY
    for i in range(len(t)):
        if d_t[i] < 0.0:
            steepest = max(steepest, -d_t[i] / t[i])
        if d_lam[i] < 0.0:
            steepest = max(steepest, -d_lam[i] / lam[i])
    return 1.0 / steepest


@inlined_machine_code
def _move(alpha, numbers, step):
    for i in range(len(numbers)):
        numbers[i] += alpha * step[i]
