"""First and second derivatives of Eq. (9) over one stage, written out and compiled.

Positions enter no right-hand side, so sensitivities are taken only in the seven directions
p = (psi, u, v, r, F_1, F_2, T). T f is integrated over unit time, which makes the duration T a
parameter like the thrusts.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# pyright: reportMissingParameterType=false

from __future__ import annotations

import numpy as np

from grebe.core.copies import copy_vector
from grebe.core.eights import WIDTH, eight, loaded, stored, sum_of_four, sum_of_six
from grebe.core.kernels import inlined_machine_code, machine_code, part_of_kernels
from grebe.core.motion import (
    ARM,
    M11,
    M22,
    M33,
    NR,
    NRR,
    XU,
    XUU,
    YAW,
    YV,
    YVV,
    in_hull_axes,
    motion,
)


@part_of_kernels
def evaluate(p, psi, u, v, r, port, starboard, f, jac):
    """Compute the right-hand side `f` (6,) and its Jacobian `jac` (6, 8), in place.

    The Jacobian's columns are (psi, u, v, r, F_1, F_2), then two of zeros.
    """
    f[0], f[1], f[2], f[3], f[4], f[5] = motion(p, psi, u, v, r, port, starboard)
    c, s, u_c, v_c, wind_x, wind_y = in_hull_axes(p, psi)
    u_r, v_r = u - u_c, v - v_c
    m11, m22, m33, arm, yaw = p[M11], p[M22], p[M33], p[ARM], p[YAW]
    slope_u = p[XU] + 2 * p[XUU] * abs(u_r)
    slope_v = p[YV] + 2 * p[YVV] * abs(v_r)
    jac[:] = 0.0
    jac[0, 0], jac[0, 1], jac[0, 2] = -f[1], c, -s
    jac[1, 0], jac[1, 1], jac[1, 2] = f[0], s, c
    jac[2, 3] = 1.0
    # d u_r / d psi = -v_c and d v_r / d psi = u_c: the current turns relative to the hull.
    jac[3, 0] = (wind_y + m22 * r * u_c - slope_u * v_c) / m11 - r * u_c
    jac[3, 1] = slope_u / m11
    jac[3, 2] = m22 * r / m11
    jac[3, 3] = m22 * v_r / m11 + v_c
    jac[3, 4] = jac[3, 5] = 1.0 / m11
    jac[4, 0] = (-wind_x + m11 * r * v_c + slope_v * u_c) / m22 - r * v_c
    jac[4, 1] = -m11 * r / m22
    jac[4, 2] = slope_v / m22
    jac[4, 3] = -m11 * u_r / m22 - u_c
    jac[5, 0] = yaw * (u_r * u_c - v_r * v_c) / m33
    jac[5, 1] = yaw * v_r / m33
    jac[5, 2] = yaw * u_r / m33
    jac[5, 3] = (p[NR] + 2 * p[NRR] * abs(r)) / m33
    jac[5, 4] = arm / m33
    jac[5, 5] = -arm / m33


@part_of_kernels
def curvature(p, psi, u, v, r, mu, hess):
    """Compute the Hessian `hess` (4, 4) of mu f in (psi, u, v, r); f is linear in the thrusts."""
    c, s, u_c, v_c, wind_x, wind_y = in_hull_axes(p, psi)
    u_r, v_r = u - u_c, v - v_c
    a4, a5, a6 = mu[3] / p[M11], mu[4] / p[M22], mu[5] / p[M33]
    yaw = p[YAW]
    # Partial derivatives of mu f in the velocities through the water.
    l_u = a4 * (p[XU] + 2 * p[XUU] * abs(u_r)) - a5 * p[M11] * r + a6 * yaw * v_r
    l_v = a4 * p[M22] * r + a5 * (p[YV] + 2 * p[YVV] * abs(v_r)) + a6 * yaw * u_r
    l_uu = 2 * a4 * p[XUU] * np.sign(u_r)
    l_vv = 2 * a5 * p[YVV] * np.sign(v_r)
    l_uv = a6 * yaw
    l_ur = -a5 * p[M11]
    l_vr = a4 * p[M22]
    along = mu[0] * (u * c - v * s) + mu[1] * (u * s + v * c)
    hess[0, 0] = (
        l_uu * v_c * v_c
        - 2 * l_uv * u_c * v_c
        + l_vv * u_c * u_c
        + l_u * u_c
        + l_v * v_c
        - a4 * wind_x
        - a5 * wind_y
        + r * (mu[4] * u_c - mu[3] * v_c)
        - along
    )
    hess[0, 1] = -l_uu * v_c + l_uv * u_c - mu[0] * s + mu[1] * c
    hess[0, 2] = -l_uv * v_c + l_vv * u_c - mu[0] * c - mu[1] * s
    hess[0, 3] = -l_ur * v_c + l_vr * u_c - mu[3] * u_c - mu[4] * v_c
    hess[1, 1], hess[1, 2], hess[1, 3] = l_uu, l_uv, l_ur
    hess[2, 2], hess[2, 3] = l_vv, l_vr
    hess[3, 3] = 2 * a6 * p[NRR] * np.sign(r)
    for i in range(4):
        for j in range(i):
            hess[i, j] = hess[j, i]


@inlined_machine_code
def _sensitivity(row, f, duration, psi, u, v, r):
    """Sensitivity to p of an element f of the right-hand side, times the duration.

    `row` is its row of the Jacobian; `psi`, `u`, `v`, `r` are the sensitivities of the point.
    """
    along = (row[0] * psi + row[1] * u) + (row[2] * v + row[3] * r)
    direct = eight(0.0, 0.0, 0.0, 0.0, duration * row[4], duration * row[5], f, 0.0)
    return duration * along + direct


@machine_code
def linearise(p, z, thrusts, duration, substeps, out, sens, stage_sens, stage_states, jacs):
    """Integrate one stage and its sensitivities.

    `out` (6,) is the next state, `sens` (6, 8) its derivative in p and a column of zeros. The rest
    is for `second_order`: `stage_sens` (evals, 4, 8) are the sensitivities of (psi, u, v, r) at the
    points where f was evaluated, `stage_states` (evals, 4) the values of these four, and `jacs`
    (evals, 6, 8) the Jacobians there.
    """
    h = 1.0 / substeps
    f, point, total = np.empty(6), np.empty(6), np.empty(6)
    copy_vector(out, z)
    none = eight(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    of_x = of_y = none
    of_psi = eight(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    of_u = eight(0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    of_v = eight(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    of_r = eight(0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)
    index = 0
    for _ in range(substeps):
        copy_vector(point, out)
        psi, u, v, r = of_psi, of_u, of_v, of_r
        sum_x = sum_y = sum_psi = sum_u = sum_v = sum_r = none
        total[:] = 0.0
        for stage in range(4):
            jac, sensitivities = jacs[index], stage_sens[index]
            evaluate(p, point[2], point[3], point[4], point[5], thrusts[0], thrusts[1], f, jac)
            for i in range(4):
                stage_states[index, i] = point[2 + i]
            stored(psi, sensitivities, 0, 0)
            stored(u, sensitivities, 1, 0)
            stored(v, sensitivities, 2, 0)
            stored(r, sensitivities, 3, 0)
            index += 1
            weight = 2.0 if stage in (1, 2) else 1.0
            lead = h if stage == 2 else 0.5 * h
            d_psi = _sensitivity(jac[2], f[2], duration, psi, u, v, r)
            d_u = _sensitivity(jac[3], f[3], duration, psi, u, v, r)
            d_v = _sensitivity(jac[4], f[4], duration, psi, u, v, r)
            d_r = _sensitivity(jac[5], f[5], duration, psi, u, v, r)
            sum_x = sum_x + weight * _sensitivity(jac[0], f[0], duration, psi, u, v, r)
            sum_y = sum_y + weight * _sensitivity(jac[1], f[1], duration, psi, u, v, r)
            sum_psi, sum_u = sum_psi + weight * d_psi, sum_u + weight * d_u
            sum_v, sum_r = sum_v + weight * d_v, sum_r + weight * d_r
            psi, u = of_psi + lead * d_psi, of_u + lead * d_u
            v, r = of_v + lead * d_v, of_r + lead * d_r
            for i in range(6):
                slope = duration * f[i]
                total[i] += weight * slope
                point[i] = out[i] + lead * slope
        share = h / 6
        of_x, of_y, of_psi = of_x + share * sum_x, of_y + share * sum_y, of_psi + share * sum_psi
        of_u, of_v, of_r = of_u + share * sum_u, of_v + share * sum_v, of_r + share * sum_r
        for i in range(6):
            out[i] += share * total[i]
    stored(of_x, sens, 0, 0)
    stored(of_y, sens, 1, 0)
    stored(of_psi, sens, 2, 0)
    stored(of_u, sens, 3, 0)
    stored(of_v, sens, 4, 0)
    stored(of_r, sens, 5, 0)


@machine_code
def second_order(p, costate, duration, substeps, stage_sens, stage_states, jacs, hess):
    """Compute the Hessian `hess` (7, 8) of costate * (next state) in p, in place.

    It is found by the discrete adjoint of RK4; its last column is zero. Each evaluation of f
    contributes S^T (T mu d2f) S plus the cross terms of T, where S is the sensitivity of the point
    and mu the adjoint of that evaluation.
    """
    h = 1.0 / substeps
    lam = costate.copy()
    bar = np.empty(6)
    # Adjoint of each evaluation's point, without the factor T: in (psi, u, v, r), then in thrusts.
    back = np.empty((4, WIDTH))
    curve = np.empty((4, 4))
    half = np.empty((4, WIDTH))
    cross = eight(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    hess[:] = 0.0
    for sub in range(substeps - 1, -1, -1):
        for stage in range(3, -1, -1):
            index = 4 * sub + stage
            weight = 2.0 if stage in (1, 2) else 1.0
            for i in range(6):
                bar[i] = h / 6 * weight * lam[i]
            if stage < 3:
                lead = h if stage == 2 else 0.5 * h
                for i in range(4):
                    bar[2 + i] += lead * duration * back[stage + 1, i]
            jac, s, point = jacs[index], stage_states[index], stage_sens[index]
            pulled = sum_of_six(jac, bar[0], bar[1], bar[2], bar[3], bar[4], bar[5])
            stored(pulled, back, stage, 0)
            curvature(p, s[0], s[1], s[2], s[3], bar, curve)
            for i in range(4):
                row = sum_of_four(point, curve[i, 0], curve[i, 1], curve[i, 2], curve[i, 3])
                stored(duration * row, half, i, 0)
            for i in range(7):
                row = sum_of_four(half, point[0, i], point[1, i], point[2, i], point[3, i])
                stored(loaded(hess, i, 0) + row, hess, i, 0)
            own = back[stage]
            cross = cross + sum_of_four(point, own[0], own[1], own[2], own[3])
            cross = cross + eight(0.0, 0.0, 0.0, 0.0, own[4], own[5], 0.0, 0.0)
        for i in range(4):
            for stage in range(4):
                lam[2 + i] += duration * back[stage, i]
    # The duration's row: the derivative of T f by T is f, which depends on point and thrusts.
    stored(loaded(hess, 6, 0) + cross, hess, 6, 0)
    stored(cross, half, 0, 0)
    hess[6, 6] += half[0, 6]
    for i in range(7):
        for j in range(i):
            hess[j, i] = hess[i, j]
