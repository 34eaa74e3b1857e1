"""The misfit between a boat's parameters and its motion.

It is compiled, because a search evaluates it thousands of times.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# pyright: reportMissingParameterType=false, reportUnknownParameterType=false
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false

from __future__ import annotations

import numpy as np

from grebe.control.correction import turn
from grebe.control.rollout import piece_end
from grebe.core.kernels import machine_code, part_of_kernels

# Indices into the parameters: logarithms of two thrusters' shares and of four factors, dead time
# and lag, compass, two currents and two wind forces, rates of change of the currents.
SHARES, COMPASS, WEATHER_AT, DRIFT_AT = 0, 8, 9, 13
# Indices of the parameters of the equations of motion that are multiplied by a factor, in the order
# m33, x_u, y_v, n_r, x_uu, y_vv, n_rr, and the index of the factor for each.
FACTORS_OF, FACTORS = (2, 3, 4, 5, 6, 7, 8), (4, 2, 3, 5, 2, 3, 5)
# Standard deviations beyond which an error counts by its size and no longer by its square.
ROBUST = 3.0

_turn = part_of_kernels(turn)


@machine_code
def parameters_of(numbers, boat, units):
    """The 15 parameters of the equations of motion, from the fitted `numbers`.

    `boat` (11,) is multiplied by its factors; the weather follows, in its `units` (4,).
    """
    p = np.empty(len(boat) + len(units))
    for i in range(len(boat)):
        p[i] = boat[i]
    for i, factor in zip(FACTORS_OF, FACTORS):  # noqa: B905 (numba knows no strict)
        p[i] *= np.exp(numbers[factor])
    for i in range(len(units)):
        p[len(boat) + i] = numbers[WEATHER_AT + i] * units[i]
    return p


@machine_code
def misfit(
    numbers, prior_mean, prior_sd, boat, units, times, states, thrusts, first, last, per_second,
    whiteners,
):  # fmt: skip
    """Residuals (6 k + 15,) of the pieces `first` to `last`, and of the prior.

    The errors at the pieces' ends are made independent and of unit variance by the lower triangles
    `whiteners` (k, 6, 6). The last 15 residuals are the deviations of `numbers` from `prior_mean`.
    All are pseudo-Huber residuals, so that a single one, from an estimate that jumps, does not
    decide. `thrusts` (n - 1, 2) would act between `states` (n, 6) if thrusters gave their orders.
    """
    p = parameters_of(numbers, boat, units)
    drift, angle = numbers[DRIFT_AT:], -numbers[COMPASS]
    cos, sin = np.cos(angle), np.sin(angle)
    shares = np.exp(numbers[SHARES : SHARES + 2])
    out = np.empty(6 * len(first) + len(numbers))
    z, end = np.empty(6), np.empty(6)
    for k in range(len(first)):
        _turn(states[first[k]], angle, cos, sin, z)
        piece_end(p, drift, times, z, thrusts, shares, first[k], last[k], per_second)
        _turn(states[last[k]], angle, cos, sin, end)
        for i in range(6):
            out[6 * k + i] = 0.0
            for j in range(i + 1):
                out[6 * k + i] += whiteners[k, i, j] * (z[j] - end[j])
    pulls = 6 * len(first)
    for i in range(len(numbers)):
        out[pulls + i] = (numbers[i] - prior_mean[i]) / prior_sd[i]
    for i in range(len(out)):
        share = out[i] / ROBUST
        size = ROBUST * np.sqrt(2.0 * (np.sqrt(1.0 + share * share) - 1.0))
        out[i] = size if share >= 0 else -size
    return out
