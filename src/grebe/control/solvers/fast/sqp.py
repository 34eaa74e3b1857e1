"""Sequential quadratic programming for one horizon (Nocedal and Wright 2006, ch. 18).

Multiple shooting: the iterate holds states and inputs, and the quadratic problem closes the gaps
between them. The Hessian is that of the Lagrangian, with the full curvature of the dynamics if the
reduced problem stays convex. Otherwise the curvature is left out (Gauss-Newton), or mirrored if
durations are free.
Steps are accepted by an exact penalty function that may rise for a few steps.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# Their loops run at least once, so what a loop sets is bound after it.
# pyright: reportMissingParameterType=false, reportPossiblyUnboundVariable=false

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from grebe.control.solvers.fast.derivatives import linearise, second_order
from grebe.control.solvers.fast.interior import minimise, start_box, start_rows
from grebe.control.solvers.fast.riccati import NW, NX, NY, PLACE, ROW
from grebe.core.copies import copy_matrix, copy_vector
from grebe.core.eights import WIDTH
from grebe.core.kernels import machine_code, part_of_kernels
from grebe.core.motion import advance

if TYPE_CHECKING:
    from numpy.typing import NDArray

# How an optimisation ended.
CONVERGED, FEASIBLE, FAILED = 0, 1, 2

HALVINGS = 8
MEMORY = 6
# Relative spread of the remembered penalties below which a small cycle counts as an end.
IDLE = 1e-4
FIRST_DAMPING, MOST_DAMPING = 1.0, 1e8
COST_SHARE = 1e-2
SUFFICIENT = 1e-4
QP_TOLERANCE = 1e-5
SMALL_GAP = 0.05
# If a step shrinks to this share of the one before, the next is predicted from both, and not taken
# if it would be below this share of the tolerance.
SHRINKING, NEGLIGIBLE = 0.25, 0.1


class Terms(NamedTuple):
    """The data of one optimisation, constant while it runs.

    `p` are the model's parameters, `substeps` those of its integration; `rows` (M, 4) half-spaces
    in families (see `interior`). For each family (J,), `first` (J + 1,) is where its rows begin,
    `node` where they hold, `weight` the price of the squared distance, or `price` that of the
    slack. `effort` (2, N) is the price of a squared newton, and of one for a second. `timing`
    (5, N): shortest duration, span of durations, price of a second, nominal duration, price of the
    squared deviation from it. `limits` (2,) are those of a thrust, and `bounds` (2, N, 2) the least
    and largest thrusts of each stage within them; `regularisation` is that of the shares.
    """

    p: NDArray[np.float64]
    substeps: int
    rows: NDArray[np.float64]
    first: NDArray[np.int64]
    node: NDArray[np.int64]
    weight: NDArray[np.float64]
    price: NDArray[np.float64]
    effort: NDArray[np.float64]
    timing: NDArray[np.float64]
    limits: NDArray[np.float64]
    bounds: NDArray[np.float64]
    regularisation: float


class Shooting(NamedTuple):
    """The dynamics along an iterate.

    Sensitivities (N, 6, 8) and gaps (N, 6), see `riccati`; the rest is for the curvature.
    """

    sens: NDArray[np.float64]
    gap: NDArray[np.float64]
    stage_sens: NDArray[np.float64]
    stage_states: NDArray[np.float64]
    jacs: NDArray[np.float64]


@machine_code
def optimise(terms, states, inputs, costate, most_iterations, tolerance):
    """Improve `states` (N + 1, 6), `inputs` (N, 3) and `costate` (N + 1, 6) in place.

    The costates are the multipliers of the dynamics into each node. Returns the outcome (CONVERGED,
    FEASIBLE or FAILED), the number of iterations, and the cost.
    """
    n, families = inputs.shape[0], len(terms.node)
    evals = 4 * terms.substeps
    shooting = Shooting(
        np.empty((n, NX, WIDTH)),
        np.empty((n, NX)),
        np.empty((n, evals, 4, WIDTH)),
        np.empty((n, evals, 4)),
        np.empty((n, evals, NX, WIDTH)),
    )
    hess, grad = np.zeros((n, NY, ROW)), np.zeros((n, ROW))
    base, compliance = np.empty(len(terms.rows)), np.zeros(families)
    for j in range(families):
        compliance[j] = 0.5 / terms.weight[j] if terms.weight[j] > 0.0 else 0.0
    pairs = len(base) + 2 * NW * n
    t, lam = np.ones(pairs), np.zeros(pairs)
    s, nu = np.zeros(families), np.zeros(families)
    low, high = np.empty((n, NW)), np.empty((n, NW))
    dx, dw = np.zeros((n + 1, NX)), np.zeros((n, NW))
    gain = np.zeros((n, NW, WIDTH))
    new_costate = np.zeros((n + 1, NX))
    trial_x, trial_w = np.empty((n + 1, NX)), np.empty((n, NW))
    history = np.full(MEMORY, -np.inf)
    penalty, damping, step = 1.0, 0.0, np.inf
    first_cost, first_gaps = -np.inf, 0.0
    # Without curvature a minimum-time problem is linear, and Gauss-Newton would fail.
    free = np.max(terms.timing[1]) > 0.0
    for iteration in range(most_iterations):
        shoot(terms, states, inputs, shooting)
        _values(terms, states, base)
        _box(terms, inputs, low, high)
        solved = -1
        for attempt in range(2):
            curved = attempt == 0 or damping > 0.0 or free
            quadratic(terms, inputs, costate, shooting, damping, curved, attempt == 1, hess, grad)
            start_rows(terms.first, compliance, terms.price, base, t, lam, s, nu)
            start_box(low, high, t, lam)
            solved = minimise(
                hess, grad, shooting.sens, shooting.gap, terms.rows, terms.first, terms.node,
                compliance, terms.price, base, low, high, t, lam, s, nu,
                dx, dw, new_costate, gain, QP_TOLERANCE,
            )  # fmt: skip
            if solved >= 0:
                break
        if solved < 0:
            break
        before, step = step, _step_size(dx, dw, terms.limits, terms.timing)
        if damping == 0.0 and step < tolerance:
            # The step is too small for the penalty function to resolve.
            states += dx
            inputs += dw
            copy_matrix(costate, new_costate)
            return CONVERGED, iteration + 1, _cost(terms, states, inputs)
        penalty = max(1.1 * np.max(np.abs(new_costate[1:])), 0.5 * penalty)
        cost, gaps = _cost(terms, states, inputs), np.sum(np.abs(shooting.gap))
        if iteration == 0:
            first_cost, first_gaps = cost, gaps
        history[iteration % MEMORY] = cost + penalty * gaps
        promise = _promise(hess, dx, dw, shooting.gap, penalty)
        alpha = search(
            terms, states, inputs, dx, dw, gain, np.max(np.abs(shooting.gap)) < SMALL_GAP,
            np.max(history), promise, penalty, trial_x, trial_w,
        )  # fmt: skip
        if alpha == 0.0:
            if damping > MOST_DAMPING:
                break
            damping = max(10.0 * damping, FIRST_DAMPING * max(1.0, COST_SHARE * np.max(history)))
            step = np.inf
            continue
        damping = _eased(damping, alpha)
        copy_matrix(states, trial_x)
        copy_matrix(inputs, trial_w)
        costate += alpha * (new_costate - costate)
        idle = np.max(history) - np.min(history) < IDLE * abs(history[0])
        small = step < tolerance or _next_is_negligible(before, step, tolerance)
        if (alpha == 1.0 and small) or (idle and step < 10 * tolerance):
            return CONVERGED, iteration + 1, _cost(terms, states, inputs)
        step = step if alpha == 1.0 else np.inf
    return unfinished(terms, gain, states, inputs, first_cost + penalty * first_gaps, iteration + 1)


@part_of_kernels
def _next_is_negligible(before, step, tolerance):
    shrinks = np.isfinite(before) and step < SHRINKING * before
    return shrinks and step * step / before < NEGLIGIBLE * tolerance


@part_of_kernels
def unfinished(terms, gain, states, inputs, first, iterations):
    """End an optimisation that has not converged: drive its plan, and check the resulting cost."""
    driven_x, driven_w = states.copy(), inputs.copy()
    _drive(terms, gain, driven_x, driven_w)
    cost = _cost(terms, driven_x, driven_w)
    if not cost <= first:
        return FAILED, iterations, cost
    copy_matrix(states, driven_x)
    copy_matrix(inputs, driven_w)
    return FEASIBLE, iterations, cost


@part_of_kernels
def _duration(terms, inputs, k):
    return terms.timing[0, k] + inputs[k, 2] * terms.timing[1, k]


@part_of_kernels
def shoot(terms, states, inputs, shooting):
    """Integrate every stage with its derivatives."""
    following = np.empty(NX)
    for k in range(inputs.shape[0]):
        linearise(
            terms.p, states[k], inputs[k], _duration(terms, inputs, k), terms.substeps, following,
            shooting.sens[k], shooting.stage_sens[k], shooting.stage_states[k], shooting.jacs[k],
        )  # fmt: skip
        for i in range(NX):
            shooting.gap[k, i] = following[i] - states[k + 1, i]
            shooting.sens[k, i, 6] *= terms.timing[1, k]


@part_of_kernels
def _box(terms, inputs, low, high):
    """Bounds of the inputs' change: thrusts between their bounds, shares in [0, 1]."""
    for k in range(inputs.shape[0]):
        for i in range(2):
            low[k, i] = terms.bounds[0, k, i] - inputs[k, i]
            high[k, i] = terms.bounds[1, k, i] - inputs[k, i]
        low[k, 2] = -inputs[k, 2]
        high[k, 2] = 1.0 - inputs[k, 2]


@part_of_kernels
def search(
    terms, states, inputs, dx, dw, gain, closed, reference, promise, penalty, trial_x, trial_w
):
    """Halve the step until the penalty function is low enough; return 0 if it never is.

    The straight step is tried first. If the boat turns fast, its small gaps in the dynamics grow
    without bound along the horizon. Then the step is driven, with the problem's feedback gains.
    """
    rollouts = 2 if closed else 1
    for driven in range(rollouts):
        alpha = 1.0
        for _ in range(HALVINGS):
            copy_matrix(trial_x, states + alpha * dx)
            copy_matrix(trial_w, inputs + alpha * dw)
            if driven:
                _drive(terms, gain, trial_x, trial_w)
            trial = _cost(terms, trial_x, trial_w) + penalty * _gaps(terms, trial_x, trial_w)
            if trial <= reference + 1e-9 * abs(reference) + SUFFICIENT * alpha * min(promise, 0.0):
                return alpha
            alpha *= 0.5
    return 0.0


@part_of_kernels
def _drive(terms, gain, states, inputs):
    """Replace a trial by the motion of a boat that follows it with the gains, without gaps."""
    off, following = np.zeros(NX), np.empty(NX)
    low, high = terms.bounds[0], terms.bounds[1]
    for k in range(inputs.shape[0]):
        for i in range(NW):
            answer = 0.0
            for j in range(NX):
                answer += gain[k, i, j] * off[j]
            inputs[k, i] += answer
        inputs[k, 0] = min(max(inputs[k, 0], low[k, 0]), high[k, 0])
        inputs[k, 1] = min(max(inputs[k, 1], low[k, 1]), high[k, 1])
        inputs[k, 2] = min(max(inputs[k, 2], 0.0), 1.0)
        advance(
            terms.p, states[k], inputs[k], _duration(terms, inputs, k), terms.substeps, following
        )
        for i in range(NX):
            off[i] = following[i] - states[k + 1, i]
            states[k + 1, i] = following[i]


@part_of_kernels
def _eased(damping, alpha):
    """Damping after an accepted step: none after a full one, some after a short one."""
    damping = 0.0 if damping < FIRST_DAMPING or alpha == 1.0 else 0.3 * damping
    return max(damping, FIRST_DAMPING) if alpha < 0.25 else damping


@part_of_kernels
def _values(terms, states, base):
    """Value of every row at the iterate."""
    rows, first = terms.rows, terms.first
    for j in range(len(terms.node)):
        z = states[terms.node[j]]
        for i in range(first[j], first[j + 1]):
            base[i] = rows[i, 0] * z[0] + rows[i, 1] * z[1] + rows[i, 2] * z[3] - rows[i, 3]


@part_of_kernels
def quadratic(terms, inputs, costate, shooting, damping, curved, mirrored, hess, grad):
    """Hessian of the Lagrangian and gradient of the cost without the rows.

    With `mirrored` the dynamics' curvature is replaced by its absolute value, eigenvalue by
    eigenvalue: positive semidefinite, and cautious where the curvature is large.
    """
    hess[:] = 0.0
    grad[:] = 0.0
    curve = np.empty((7, WIDTH))
    reach = terms.limits[1] - terms.limits[0]
    for k in range(inputs.shape[0]):
        span, stiffness = terms.timing[1, k], terms.timing[4, k]
        if curved:
            second_order(
                terms.p, costate[k + 1], _duration(terms, inputs, k), terms.substeps,
                shooting.stage_sens[k], shooting.stage_states[k], shooting.jacs[k], curve,
            )  # fmt: skip
            for i in range(7):
                curve[i, 6] *= span
            for i in range(7):
                curve[6, i] *= span
            # Far from any solution the curvature may overflow; it is then ignored.
            if not np.all(np.isfinite(curve)):
                curve[:] = 0.0
            elif mirrored:
                values, vectors = np.linalg.eigh(curve[:, :7].copy())
                copy_matrix(curve[:, :7], (vectors * np.abs(values)) @ vectors.T)
            copy_matrix(hess[k, PLACE:, PLACE:], curve)
        duration, power = _duration(terms, inputs, k), terms.effort[1, k]
        effort, squares = terms.effort[0, k] + power * duration, 0.0
        for i in range(2):
            hess[k, 6 + i, 6 + i] += 2 * effort + damping / (reach * reach)
            grad[k, 6 + i] = 2 * effort * inputs[k, i]
            squares += inputs[k, i] * inputs[k, i]
            if curved and not mirrored:
                hess[k, 8, 6 + i] += 2 * power * inputs[k, i] * span
                hess[k, 6 + i, 8] += 2 * power * inputs[k, i] * span
        stray = duration - terms.timing[3, k]
        hess[k, 8, 8] += 2 * terms.regularisation + damping + 2 * stiffness * span * span
        grad[k, 8] = 2 * terms.regularisation * (inputs[k, 2] - 0.5)
        grad[k, 8] += (terms.timing[2, k] + power * squares + 2 * stiffness * stray) * span


@part_of_kernels
def _cost(terms, states, inputs):
    """Cost with its L1 slacks: a family adds the squares, or the largest, of its violations."""
    total = 0.0
    timing = terms.timing
    for k in range(inputs.shape[0]):
        w = inputs[k]
        duration = _duration(terms, inputs, k)
        effort = terms.effort[0, k] + terms.effort[1, k] * duration
        total += effort * (w[0] * w[0] + w[1] * w[1])
        total += timing[2, k] * duration + terms.regularisation * (w[2] - 0.5) ** 2
        total += timing[4, k] * (duration - timing[3, k]) ** 2
    rows, first = terms.rows, terms.first
    for j in range(len(terms.node)):
        z, squares, worst = states[terms.node[j]], 0.0, 0.0
        for i in range(first[j], first[j + 1]):
            r = rows[i, 0] * z[0] + rows[i, 1] * z[1] + rows[i, 2] * z[3] - rows[i, 3]
            if r > 0.0:
                squares += r * r
                worst = max(worst, r)
        total += terms.weight[j] * squares + terms.price[j] * worst
    return total


@part_of_kernels
def _gaps(terms, states, inputs):
    """Sum of the gaps in the dynamics."""
    following = np.empty(NX)
    total = 0.0
    for k in range(inputs.shape[0]):
        advance(
            terms.p, states[k], inputs[k], _duration(terms, inputs, k), terms.substeps, following
        )
        for i in range(NX):
            total += abs(following[i] - states[k + 1, i])
    return total


@part_of_kernels
def _promise(hess, dx, dw, gap, penalty):
    """Decrease that a step should achieve: the curvature along it, and the gaps that it closes."""
    total = 0.0
    y = np.empty(NY)
    for k in range(dw.shape[0]):
        copy_vector(y[:NX], dx[k])
        copy_vector(y[NX:], dw[k])
        for i in range(NX):
            total -= penalty * abs(gap[k, i])
        for i in range(NY):
            for j in range(NY):
                total -= 0.5 * hess[k, i, j] * y[i] * y[j]
    return total


@part_of_kernels
def _step_size(dx, dw, limits, timing):
    """Largest change: states in SI units, thrusts as a share of their range."""
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
