"""Sequential quadratic programming for one horizon (Nocedal and Wright 2006, ch. 18).

Multiple shooting: the iterate holds states and inputs, the quadratic problem closes the gaps
between them. The Hessian is that of the Lagrangian, with the curvature of the dynamics taken
in full where the reduced problem stays convex and left out (Gauss-Newton) where it does not.
Steps are accepted by an exact penalty function that may rise for a few steps.
"""

from __future__ import annotations

import numpy as np

from grebe.control.fast.compiled import compiled
from grebe.control.fast.interior import minimise, start_box, start_rows
from grebe.control.fast.model import advance, linearise, second_order
from grebe.control.fast.riccati import NW, NX, NY

# How an optimisation ended.
CONVERGED, FEASIBLE, FAILED = 0, 1, 2

HALVINGS = 8
MEMORY = 6
FIRST_DAMPING, MOST_DAMPING = 1.0, 1e8
SUFFICIENT = 1e-4
QP_TOLERANCE = 1e-5
GAP_TOLERANCE = 1e-5
FEASIBLE_GAP = 1e-3


@compiled
def optimise(
    p, substeps, states, inputs, costate, rows, count, weight, price,
    effort, timing, limits, regularisation, most_iterations, tolerance,
):  # fmt: skip
    """Improve `states` (N + 1, 6) and `inputs` (N, 3) in place; return how it ended, the
    iterations of the outer and of the inner loop, and the cost.

    `p` the model's parameters; `rows` (3, N + 1, R, 4) half-spaces with `count` (3, N + 1) in
    use; `weight` (N + 1,) of the squared distance; `price` (3, N + 1) of
    slack; `effort` (N,) per squared newton; `limits` (2,) of a thrust. `costate` (N + 1, 6)
    starts the multipliers (zeros: Gauss-Newton first) and returns them.
    """
    n = inputs.shape[0]
    width = rows.shape[2]
    a = np.zeros((n, NX, NX))
    b = np.zeros((n, NX, NW))
    gap = np.empty((n, NX))
    hess = np.zeros((n, NY, NY))
    grad = np.zeros((n, NY))
    base = np.zeros((3, n + 1, width))
    compliance = 0.5 / np.maximum(weight, 1e-12)
    t = np.ones((3, n + 1, width))
    lam = np.zeros((3, n + 1, width))
    s = np.zeros((3, n + 1))
    nu = np.ones((3, n + 1))
    box_t = np.ones((2, n, NW))
    box_lam = np.zeros((2, n, NW))
    low = np.empty((n, NW))
    high = np.empty((n, NW))
    dx = np.zeros((n + 1, NX))
    dw = np.zeros((n, NW))
    new_costate = np.zeros((n + 1, NX))
    trial_x = np.empty((n + 1, NX))
    trial_w = np.empty((n, NW))
    evals = 4 * substeps
    sens = np.empty((NX, 7))
    points = np.empty((n, evals, 4, 7))
    slopes = np.empty((n, evals, 4))
    jacs = np.empty((n, evals, NX, NX))
    curve = np.empty((7, 7))
    following = np.empty(NX)
    history = np.full(MEMORY, -np.inf)
    inner = 0
    penalty = 1.0
    damping = 0.0
    free = np.max(timing[1]) > 0.0
    for iteration in range(most_iterations):
        for k in range(n):
            duration = timing[0, k] + inputs[k, 2] * timing[1, k]
            linearise(
                p, states[k], inputs[k], duration, substeps, following, sens,
                points[k], slopes[k], jacs[k],
            )  # fmt: skip
            for i in range(NX):
                gap[k, i] = following[i] - states[k + 1, i]
                a[k, i, 0] = a[k, i, 1] = 0.0
                for j in range(4):
                    a[k, i, 2 + j] = sens[i, j]
                b[k, i, 0], b[k, i, 1] = sens[i, 4], sens[i, 5]
                b[k, i, 2] = sens[i, 6] * timing[1, k]
            a[k, 0, 0] = a[k, 1, 1] = 1.0
        _values(rows, count, states, base)
        if iteration < 0:
            _adjoint(a, rows, count, base, weight, costate)
        for k in range(n):
            for i in range(2):
                low[k, i] = limits[0] - inputs[k, i]
                high[k, i] = limits[1] - inputs[k, i]
            low[k, 2] = -inputs[k, 2]
            high[k, 2] = 1.0 - inputs[k, 2]
        solved = -1
        for attempt in range(2):
            curved = attempt == 0 or damping > 0.0 or free
            mirrored = attempt == 1
            _quadratic(
                p, substeps, inputs, costate, effort, timing, regularisation, damping, limits, curved, mirrored, points, slopes, jacs, curve, hess, grad,
            )  # fmt: skip
            start_rows(count, base, compliance, price, rows, t, lam, s, nu)
            start_box(low, high, box_t, box_lam)
            solved = minimise(
                hess, grad, a, b, gap, rows, count, base, compliance, price, low, high,
                t, lam, s, nu, box_t, box_lam, dx, dw, new_costate, QP_TOLERANCE,
            )  # fmt: skip
            inner += abs(solved)
            if solved >= 0:
                break
        if solved < 0:
            break
        biggest = 0.0
        for k in range(1, n + 1):
            for i in range(NX):
                biggest = max(biggest, abs(new_costate[k, i]))
        penalty = max(1.1 * biggest, 0.5 * penalty)
        merit = _merit(
            p, substeps, states, inputs, rows, count, weight, price, effort, timing, regularisation, penalty,
        )  # fmt: skip
        history[iteration % MEMORY] = merit
        reference = np.max(history)
        alpha = 1.0
        accepted = False
        promise = _promise(hess, grad, dx, dw, gap, penalty)
        for _ in range(HALVINGS):
            trial_x[:] = states + alpha * dx
            trial_w[:] = inputs + alpha * dw
            trial = _merit(
                p, substeps, trial_x, trial_w, rows, count, weight, price, effort, timing, regularisation, penalty,
            )  # fmt: skip
            if trial <= reference + 1e-9 * abs(reference) + SUFFICIENT * alpha * min(promise, 0.0):
                accepted = True
                break
            alpha *= 0.5
        if not accepted:
            if damping > MOST_DAMPING:
                break
            damping = max(10.0 * damping, FIRST_DAMPING)
            continue
        damping = 0.0 if damping < FIRST_DAMPING or alpha == 1.0 else 0.3 * damping
        if alpha < 0.25:
            damping = max(damping, FIRST_DAMPING)
        states[:] = trial_x
        inputs[:] = trial_w
        for k in range(n + 1):
            for i in range(NX):
                costate[k, i] += alpha * (new_costate[k, i] - costate[k, i])
        step = _step_size(dx, dw, limits, timing)
        if alpha == 1.0 and step < tolerance:
            cost = _merit(
                p, substeps, states, inputs, rows, count, weight, price, effort, timing, regularisation, 0.0,
            )  # fmt: skip
            return CONVERGED, iteration + 1, inner, cost
    gap_size = _largest_gap(p, substeps, states, inputs, timing)
    cost = _merit(
        p, substeps, states, inputs, rows, count, weight, price, effort, timing, regularisation, 0.0,
    )  # fmt: skip
    ended = FEASIBLE if gap_size < FEASIBLE_GAP else FAILED
    return ended, most_iterations, inner, cost


@compiled
def _values(rows, count, states, base):
    for group in range(3):
        for k in range(count.shape[1]):
            z = states[k]
            for i in range(count[group, k]):
                row = rows[group, k, i]
                base[group, k, i] = row[0] * z[0] + row[1] * z[1] + row[2] * z[3] - row[3]


@compiled
def _adjoint(a, rows, count, base, weight, costate):
    """Estimate the costates from the cost's gradient along the starting trajectory."""
    n = a.shape[0]
    for k in range(n, -1, -1):
        costate[k] = 0.0
        if k < n:
            for i in range(NX):
                for m in range(NX):
                    costate[k, i] += a[k, m, i] * costate[k + 1, m]
        for i in range(count[0, k]):
            r = base[0, k, i]
            if r > 0.0:
                for axis, index in ((0, 0), (1, 1), (2, 3)):
                    costate[k, index] += 2 * weight[k] * r * rows[0, k, i, axis]


@compiled
def _quadratic(
    p, substeps, inputs, costate, effort, timing, regularisation,
    damping, limits, curved, mirrored, points, slopes, jacs, curve, hess, grad,
):  # fmt: skip
    """Hessian of the Lagrangian and gradient of the cost without the rows.

    With `mirrored` the dynamics' curvature is replaced by its absolute value, eigenvalue by
    eigenvalue: positive semidefinite, and cautious where the curvature is large.
    """
    hess[:] = 0.0
    grad[:] = 0.0
    reach = limits[1] - limits[0]
    for k in range(inputs.shape[0]):
        if curved:
            duration = timing[0, k] + inputs[k, 2] * timing[1, k]
            second_order(
                p, costate[k + 1], duration, substeps, points[k], slopes[k], jacs[k], curve
            )
            for i in range(7):
                curve[i, 6] *= timing[1, k]
            for i in range(7):
                curve[6, i] *= timing[1, k]
            if mirrored:
                values, vectors = np.linalg.eigh(curve)
                curve[:] = (vectors * np.abs(values)) @ vectors.T
            hess[k, 2:, 2:] = curve
        for i in range(2):
            hess[k, 6 + i, 6 + i] += 2 * effort[k] + damping / (reach * reach)
            grad[k, 6 + i] = 2 * effort[k] * inputs[k, i]
        span, stiffness = timing[1, k], timing[4, k]
        stray = timing[0, k] + inputs[k, 2] * span - timing[3, k]
        hess[k, 8, 8] += 2 * regularisation + damping + 2 * stiffness * span * span
        grad[k, 8] = 2 * regularisation * (inputs[k, 2] - 0.5)
        grad[k, 8] += (timing[2, k] + 2 * stiffness * stray) * span


@compiled
def _merit(
    p, substeps, states, inputs, rows, count, weight, price, effort, timing, regularisation, penalty,
):  # fmt: skip
    """Cost with its L1 slacks, plus `penalty` times the gaps in the dynamics."""
    n = inputs.shape[0]
    total = 0.0
    following = np.empty(NX)
    for k in range(n):
        w = inputs[k]
        duration = timing[0, k] + w[2] * timing[1, k]
        total += effort[k] * (w[0] * w[0] + w[1] * w[1])
        total += timing[2, k] * duration + regularisation * (w[2] - 0.5) ** 2
        total += timing[4, k] * (duration - timing[3, k]) ** 2
        if penalty > 0.0:
            advance(p, states[k], w, duration, substeps, following)
            for i in range(NX):
                total += penalty * abs(following[i] - states[k + 1, i])
    for group in range(3):
        for k in range(n + 1):
            worst = 0.0
            z = states[k]
            for i in range(count[group, k]):
                row = rows[group, k, i]
                r = row[0] * z[0] + row[1] * z[1] + row[2] * z[3] - row[3]
                if r > 0.0:
                    worst = max(worst, r)
                    if group == 0:
                        total += weight[k] * r * r
            if group > 0:
                total += price[group, k] * worst
    return total


@compiled
def _largest_gap(p, substeps, states, inputs, timing):
    following = np.empty(NX)
    worst = 0.0
    for k in range(inputs.shape[0]):
        duration = timing[0, k] + inputs[k, 2] * timing[1, k]
        advance(p, states[k], inputs[k], duration, substeps, following)
        for i in range(NX):
            worst = max(worst, abs(following[i] - states[k + 1, i]))
    return worst


@compiled
def _promise(hess, grad, dx, dw, gap, penalty):
    """A decrease that the step may be asked for: curvature along it, and the gaps it closes."""
    total = 0.0
    y = np.empty(NY)
    for k in range(dw.shape[0]):
        for i in range(NX):
            y[i] = dx[k, i]
            total -= penalty * abs(gap[k, i])
        for i in range(NW):
            y[NX + i] = dw[k, i]
        for i in range(NY):
            for j in range(NY):
                total -= 0.5 * hess[k, i, j] * y[i] * y[j]
    return total


@compiled
def _step_size(dx, dw, limits, timing):
    """The largest change: states in SI units, thrusts as a share of their range."""
    worst = 0.0
    reach = limits[1] - limits[0]
    for k in range(dw.shape[0]):
        worst = max(worst, abs(dw[k, 0]) / reach, abs(dw[k, 1]) / reach)
        if timing[1, k] > 0.0:
            worst = max(worst, abs(dw[k, 2]))
    for k in range(dx.shape[0]):
        for i in range(NX):
            worst = max(worst, abs(dx[k, i]))
    return worst
