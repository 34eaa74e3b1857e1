"""A primal-dual interior point for the quadratic problem of a horizon (Mehrotra 1992).

Three groups of half-space rows a (x, y, u) <= b live at the nodes, beside the box of the
inputs:

- group 0, the sets of the cost: w max(0, a z - b)^2 is a row softened by a slack e at price
  w e^2, which eliminates to e = lambda / (2 w): a row with compliance 1 / (2 w);
- group 1, the sets that must hold a node, and group 2, its corridor: rows that share one slack
  s >= 0 a node at a price linear in s.

Everything local to a node is eliminated, so that each iteration is one Riccati recursion.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# Their loops run at least once, so what a loop sets is bound after it.
# pyright: reportMissingParameterType=false, reportPossiblyUnboundVariable=false

from __future__ import annotations

import numpy as np

from grebe.control.solvers.fast.riccati import NW, NX, NY, ROW, factorise, solve
from grebe.core.copies import put, put_rows
from grebe.core.eights import WIDTH
from grebe.core.kernels import inlined_machine_code, machine_code

GROUPS = 3
MOST_ITERATIONS = 40
TO_THE_BOUNDARY = 0.995
# Of a row's slack and multiplier when a solve starts.
FLOOR = 1e-2


@machine_code
def start_rows(count, base, compliance, price, t, lam, s, nu):
    """Place slacks and multipliers inside, as near to complementary as the last solve left them.

    `base` (3, N + 1, R) is a z - b at the current iterate. Softened rows begin on their own
    constraint, which keeps the first residuals at zero.
    """
    nodes = base.shape[1]
    for group in range(GROUPS):
        for k in range(nodes):
            m = count[group, k]
            if m == 0:
                continue
            worst = 0.0
            for i in range(m):
                worst = max(worst, base[group, k, i])
            if group > 0:
                s[group, k] = worst + FLOOR
            total = 0.0
            for i in range(m):
                r = base[group, k, i]
                if group == 0:
                    t[group, k, i] = max(-r, FLOOR)
                    if r > -FLOOR:
                        lam[group, k, i] = (r + t[group, k, i]) / compliance[k] + FLOOR
                    else:
                        lam[group, k, i] = max(lam[group, k, i], FLOOR)
                        lam[group, k, i] = min(lam[group, k, i], 1.0)
                else:
                    t[group, k, i] = max(s[group, k] - r, FLOOR)
                    lam[group, k, i] = max(lam[group, k, i], FLOOR / max(t[group, k, i], FLOOR))
                    total += lam[group, k, i]
            if group > 0:
                limit = 0.99 * price[group, k]
                if total > limit:
                    for i in range(m):
                        lam[group, k, i] *= limit / total
                    total = limit
                nu[group, k] = price[group, k] - total


@machine_code
def start_box(low, high, t, lam):
    """Place the box's slacks inside: `low`, `high` (N, 3) relative to the iterate."""
    for k in range(low.shape[0]):
        for i in range(NW):
            t[0, k, i] = max(-low[k, i], FLOOR)
            t[1, k, i] = max(high[k, i], FLOOR)
            for side in range(2):
                lam[side, k, i] = max(lam[side, k, i], FLOOR)


@machine_code
def minimise(
    hess, grad, sens, c, rows, count, base, compliance, price, low, high,
    t, lam, s, nu, box_t, box_lam, dx, dw, costate, gain, tolerance,
):  # fmt: skip
    """Solve the quadratic problem; returns the iterations, negative where it failed.

    In: `hess` (N, 9, 10) positive semidefinite, `grad` (N, 10), dynamics `sens` and `c`; `rows`
    (3, N + 1, R, 4) with `count` (3, N + 1) of them in use and `base` their value at the
    iterate; `compliance` (N + 1,), `price` (3, N + 1); the box `low`, `high` (N, 3) of dw.
    In and out: slacks and multipliers. Out: `dx`, `dw`, `costate`, and `gain` (N, 3, 8), by which
    the inputs answer a departure of the state from the solution.
    """
    n = hess.shape[0]
    width = rows.shape[2]
    full = np.empty((n, NY, ROW))
    full_grad = np.empty((n, ROW))
    end_hess = np.zeros((NX, NX))
    end_grad = np.zeros(NX)
    p = np.zeros((n + 1, NX, WIDTH))
    chol = np.zeros((n, NW, NW))
    new_dx = np.zeros((n + 1, NX))
    new_dw = np.zeros((n, NW))
    new_costate = np.zeros((n + 1, NX))
    weight = np.zeros((GROUPS, n + 1, width))
    shift = np.zeros((GROUPS, n + 1, width))
    d_t = np.zeros((GROUPS, n + 1, width))
    d_lam = np.zeros((GROUPS, n + 1, width))
    d_s = np.zeros((GROUPS, n + 1))
    d_nu = np.zeros((GROUPS, n + 1))
    box_d_t = np.zeros((2, n, NW))
    box_d_lam = np.zeros((2, n, NW))
    dx[:] = 0.0
    dw[:] = 0.0
    costate[:] = 0.0
    infeasible = 1.0
    pairs = 2 * NW * n
    for group in range(GROUPS):
        for k in range(n + 1):
            pairs += count[group, k]
            if group > 0 and count[group, k] > 0:
                pairs += 1
    for iteration in range(MOST_ITERATIONS):
        mu = _complementarity(count, t, lam, s, nu, box_t, box_lam) / pairs
        worst = _row_residual(rows, count, base, compliance, dx, t, lam, s)
        if mu < tolerance and worst < tolerance and infeasible < 1e-6:
            return iteration
        aim = 0.0
        for corrector in range(2):
            _condense_rows(
                rows, count, base, compliance, dx, t, lam, s, aim, corrector,
                d_t, d_lam, weight, shift,
            )  # fmt: skip
            _assemble(
                hess, grad, rows, count, price, dx, s, nu, lam, weight, shift, aim, corrector,
                d_s, d_nu, dw, low, high, box_t, box_lam, box_d_t, box_d_lam,
                full, full_grad, end_hess, end_grad,
            )  # fmt: skip
            if corrector == 0 and not factorise(full, end_hess, sens, p, gain, chol):
                return -1 - iteration
            solve(full_grad, end_grad, sens, c, p, gain, chol, new_dx, new_dw, new_costate)
            _row_steps(
                rows, count, base, compliance, price, dx, new_dx, t, lam, s, nu, aim, corrector,
                weight, shift, d_t, d_lam, d_s, d_nu,
            )  # fmt: skip
            _box_steps(low, high, dw, new_dw, box_t, box_lam, aim, corrector, box_d_t, box_d_lam)
            alpha = _longest_step(
                count, t, lam, s, nu, d_t, d_lam, d_s, d_nu, box_t, box_lam, box_d_t, box_d_lam
            )
            if corrector == 0:
                ahead = _complementarity_after(
                    alpha, count, t, lam, s, nu, d_t, d_lam, d_s, d_nu,
                    box_t, box_lam, box_d_t, box_d_lam,
                ) / pairs  # fmt: skip
                aim = mu * min(1.0, max(ahead / mu, 0.0) ** 3)
                aim = max(aim, 1e-3 * tolerance)
        alpha = min(1.0, TO_THE_BOUNDARY * alpha)
        _step(alpha, count, t, lam, s, nu, d_t, d_lam, d_s, d_nu)
        for k in range(n):
            for i in range(NW):
                dw[k, i] += alpha * (new_dw[k, i] - dw[k, i])
                for side in range(2):
                    box_t[side, k, i] += alpha * box_d_t[side, k, i]
                    box_lam[side, k, i] += alpha * box_d_lam[side, k, i]
        for k in range(n + 1):
            for i in range(NX):
                dx[k, i] += alpha * (new_dx[k, i] - dx[k, i])
                costate[k, i] += alpha * (new_costate[k, i] - costate[k, i])
        infeasible *= 1.0 - alpha
        if alpha < 1e-8:
            return -1 - iteration
    return -1 - MOST_ITERATIONS


@machine_code
def _row_value(row, base, dx):
    return base + row[0] * dx[0] + row[1] * dx[1] + row[2] * dx[3]


@machine_code
def _complementarity(count, t, lam, s, nu, box_t, box_lam):
    total = 0.0
    for group in range(GROUPS):
        for k in range(count.shape[1]):
            for i in range(count[group, k]):
                total += t[group, k, i] * lam[group, k, i]
            if group > 0 and count[group, k] > 0:
                total += s[group, k] * nu[group, k]
    for side in range(2):
        for k in range(box_t.shape[1]):
            for i in range(NW):
                total += box_t[side, k, i] * box_lam[side, k, i]
    return total


@machine_code
def _complementarity_after(
    alpha, count, t, lam, s, nu, d_t, d_lam, d_s, d_nu, box_t, box_lam, box_d_t, box_d_lam
):
    total = 0.0
    for group in range(GROUPS):
        for k in range(count.shape[1]):
            for i in range(count[group, k]):
                total += (t[group, k, i] + alpha * d_t[group, k, i]) * (
                    lam[group, k, i] + alpha * d_lam[group, k, i]
                )
            if group > 0 and count[group, k] > 0:
                total += (s[group, k] + alpha * d_s[group, k]) * (
                    nu[group, k] + alpha * d_nu[group, k]
                )
    for side in range(2):
        for k in range(box_t.shape[1]):
            for i in range(NW):
                total += (box_t[side, k, i] + alpha * box_d_t[side, k, i]) * (
                    box_lam[side, k, i] + alpha * box_d_lam[side, k, i]
                )
    return total


@machine_code
def _row_residual(rows, count, base, compliance, dx, t, lam, s):
    worst = 0.0
    for group in range(GROUPS):
        for k in range(count.shape[1]):
            soft = compliance[k] if group == 0 else 0.0
            for i in range(count[group, k]):
                r = _row_value(rows[group, k, i], base[group, k, i], dx[k])
                gap = r - s[group, k] - soft * lam[group, k, i] + t[group, k, i]
                worst = max(worst, abs(gap))
    return worst


@machine_code
def _condense_rows(
    rows, count, base, compliance, dx, t, lam, s, aim, corrector, d_t, d_lam, weight, shift
):
    """Eliminate each row: d lam = shift + weight (a dz - ds)."""
    for group in range(GROUPS):
        for k in range(count.shape[1]):
            soft = compliance[k] if group == 0 else 0.0
            for i in range(count[group, k]):
                ti, li = t[group, k, i], lam[group, k, i]
                r = _row_value(rows[group, k, i], base[group, k, i], dx[k])
                residual = r - s[group, k] - soft * li + ti
                target = aim - ti * li
                if corrector == 1:
                    target -= d_t[group, k, i] * d_lam[group, k, i]
                inverse = 1.0 / (ti + soft * li)
                weight[group, k, i] = li * inverse
                shift[group, k, i] = (target + li * residual) * inverse


@machine_code
def _slack_terms(group, k, count, price, s, nu, lam, weight, shift, aim, corrector, d_s, d_nu):
    """Curvature and right-hand side of a node's shared slack after its rows are eliminated."""
    total_weight, total_shift, total_lam = 0.0, 0.0, 0.0
    for i in range(count[group, k]):
        total_weight += weight[group, k, i]
        total_shift += shift[group, k, i]
        total_lam += lam[group, k, i]
    sk, nk = s[group, k], nu[group, k]
    target = aim - sk * nk
    if corrector == 1:
        target -= d_s[group, k] * d_nu[group, k]
    stationarity = price[group, k] - total_lam - nk
    return total_weight + nk / sk, total_shift + target / sk - stationarity, target


@machine_code
def _assemble(
    hess, grad, rows, count, price, dx, s, nu, lam, weight, shift, aim, corrector,
    d_s, d_nu, dw, low, high, box_t, box_lam, box_d_t, box_d_lam,
    full, full_grad, end_hess, end_grad,
):  # fmt: skip
    """Add rows and box to the Hessian and gradient of every node, in terms of the new point."""
    n = hess.shape[0]
    for k in range(n + 1):
        # Of a position (x, y) and a surge u: the lower half of the curvature, and the slope.
        xx = yx = yy = ux = uy = uu = 0.0
        x = y = u = 0.0
        for group in range(GROUPS):
            m = count[group, k]
            if m == 0:
                continue
            pull_x = pull_y = pull_u = 0.0
            for i in range(m):
                w, row = weight[group, k, i], rows[group, k, i]
                along = row[0] * dx[k, 0] + row[1] * dx[k, 1] + row[2] * dx[k, 3]
                value = lam[group, k, i] + shift[group, k, i] - w * along
                x, y, u = x + value * row[0], y + value * row[1], u + value * row[2]
                by_x, by_y, by_u = w * row[0], w * row[1], w * row[2]
                pull_x, pull_y, pull_u = pull_x + by_x, pull_y + by_y, pull_u + by_u
                if corrector == 0:
                    xx, yx, yy = xx + by_x * row[0], yx + by_y * row[0], yy + by_y * row[1]
                    ux, uy, uu = ux + by_u * row[0], uy + by_u * row[1], uu + by_u * row[2]
            if group > 0:
                curve, push, _ = _slack_terms(
                    group, k, count, price, s, nu, lam, weight, shift, aim, corrector, d_s, d_nu
                )
                along = pull_x * dx[k, 0] + pull_y * dx[k, 1] + pull_u * dx[k, 3]
                answer = (push - along) / curve
                x, y, u = x - pull_x * answer, y - pull_y * answer, u - pull_u * answer
                by_x, by_y, by_u = pull_x / curve, pull_y / curve, pull_u / curve
                xx, yx, yy = xx - by_x * pull_x, yx - by_y * pull_x, yy - by_y * pull_y
                ux, uy, uu = ux - by_u * pull_x, uy - by_u * pull_y, uu - by_u * pull_u
        if k == n:
            if corrector == 0:
                end_hess[:] = 0.0
                _add_curvature(end_hess, xx, yx, yy, ux, uy, uu)
            end_grad[:] = 0.0
            end_grad[0], end_grad[1], end_grad[3] = x, y, u
            break
        if corrector == 0:
            put_rows(full[k], hess[k])
            _add_curvature(full[k], xx, yx, yy, ux, uy, uu)
        put(full_grad[k], grad[k])
        full_grad[k, 0] += x
        full_grad[k, 1] += y
        full_grad[k, 3] += u
        _add_box(
            k, dw, low, high, box_t, box_lam, aim, corrector, box_d_t, box_d_lam, full, full_grad
        )


@inlined_machine_code
def _add_curvature(hess, xx, yx, yy, ux, uy, uu):
    """Add the lower half of a curvature in (x, y, u), and its mirror image."""
    hess[0, 0] += xx
    hess[1, 0] += yx
    hess[0, 1] += yx
    hess[1, 1] += yy
    hess[3, 0] += ux
    hess[0, 3] += ux
    hess[3, 1] += uy
    hess[1, 3] += uy
    hess[3, 3] += uu


@machine_code
def _box_row(side, value, low, high):
    """Sign of the row and its value: low - w <= 0 (side 0), w - high <= 0 (side 1)."""
    return (-1.0, low - value) if side == 0 else (1.0, value - high)


@machine_code
def _add_box(k, dw, low, high, box_t, box_lam, aim, corrector, box_d_t, box_d_lam, full, full_grad):
    for i in range(NW):
        for side in range(2):
            sign, r = _box_row(side, dw[k, i], low[k, i], high[k, i])
            ti, li = box_t[side, k, i], box_lam[side, k, i]
            target = aim - ti * li
            if corrector == 1:
                target -= box_d_t[side, k, i] * box_d_lam[side, k, i]
            inverse = 1.0 / ti
            w = li * inverse
            shift = (target + li * (r + ti)) * inverse
            if corrector == 0:
                full[k, NX + i, NX + i] += w
            full_grad[k, NX + i] += sign * (li + shift - w * sign * dw[k, i])


@machine_code
def _row_steps(
    rows, count, base, compliance, price, dx, new_dx, t, lam, s, nu, aim, corrector,
    weight, shift, d_t, d_lam, d_s, d_nu,
):  # fmt: skip
    """Recover the steps of slacks and multipliers of the rows from the new point."""
    for group in range(GROUPS):
        for k in range(count.shape[1]):
            m = count[group, k]
            if m == 0:
                continue
            step0 = new_dx[k, 0] - dx[k, 0]
            step1 = new_dx[k, 1] - dx[k, 1]
            step3 = new_dx[k, 3] - dx[k, 3]
            ds = 0.0
            if group > 0:
                curve, push, target = _slack_terms(
                    group, k, count, price, s, nu, lam, weight, shift, aim, corrector, d_s, d_nu
                )
                pulled = push
                for i in range(m):
                    row = rows[group, k, i]
                    along = row[0] * step0 + row[1] * step1 + row[2] * step3
                    pulled += weight[group, k, i] * along
                ds = pulled / curve
                d_nu[group, k] = (target - nu[group, k] * ds) / s[group, k]
                d_s[group, k] = ds
            soft = compliance[k] if group == 0 else 0.0
            for i in range(m):
                row = rows[group, k, i]
                along = row[0] * step0 + row[1] * step1 + row[2] * step3
                r = _row_value(row, base[group, k, i], dx[k])
                residual = r - s[group, k] - soft * lam[group, k, i] + t[group, k, i]
                dl = shift[group, k, i] + weight[group, k, i] * (along - ds)
                d_lam[group, k, i] = dl
                d_t[group, k, i] = -residual - along + ds + soft * dl


@machine_code
def _box_steps(low, high, dw, new_dw, box_t, box_lam, aim, corrector, box_d_t, box_d_lam):
    for k in range(dw.shape[0]):
        for i in range(NW):
            step = new_dw[k, i] - dw[k, i]
            for side in range(2):
                sign, r = _box_row(side, dw[k, i], low[k, i], high[k, i])
                ti, li = box_t[side, k, i], box_lam[side, k, i]
                target = aim - ti * li
                if corrector == 1:
                    target -= box_d_t[side, k, i] * box_d_lam[side, k, i]
                dt = -(r + ti) - sign * step
                box_d_t[side, k, i] = dt
                box_d_lam[side, k, i] = (target - li * dt) / ti


@machine_code
def _limit(alpha, value, step):
    if step < 0.0:
        return min(alpha, -value / step)
    return alpha


@machine_code
def _longest_step(count, t, lam, s, nu, d_t, d_lam, d_s, d_nu, box_t, box_lam, box_d_t, box_d_lam):
    alpha = 1.0 / TO_THE_BOUNDARY
    for group in range(GROUPS):
        for k in range(count.shape[1]):
            for i in range(count[group, k]):
                alpha = _limit(alpha, t[group, k, i], d_t[group, k, i])
                alpha = _limit(alpha, lam[group, k, i], d_lam[group, k, i])
            if group > 0 and count[group, k] > 0:
                alpha = _limit(alpha, s[group, k], d_s[group, k])
                alpha = _limit(alpha, nu[group, k], d_nu[group, k])
    for side in range(2):
        for k in range(box_t.shape[1]):
            for i in range(NW):
                alpha = _limit(alpha, box_t[side, k, i], box_d_t[side, k, i])
                alpha = _limit(alpha, box_lam[side, k, i], box_d_lam[side, k, i])
    return alpha


@machine_code
def _step(alpha, count, t, lam, s, nu, d_t, d_lam, d_s, d_nu):
    for group in range(GROUPS):
        for k in range(count.shape[1]):
            for i in range(count[group, k]):
                t[group, k, i] += alpha * d_t[group, k, i]
                lam[group, k, i] += alpha * d_lam[group, k, i]
            if group > 0 and count[group, k] > 0:
                s[group, k] += alpha * d_s[group, k]
                nu[group, k] += alpha * d_nu[group, k]
