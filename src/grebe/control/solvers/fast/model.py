"""Eq. (9) over one stage with first and second derivatives, compiled.

The same equations as `grebe.core.dynamics.rates`, which the tests hold this file to, with their
derivatives written out. Positions enter no right-hand side, so sensitivities are taken in the
seven directions p = (psi, u, v, r, F_1, F_2, T) only. Duration is handled by integrating
T f over unit time, which makes T a parameter like the thrusts.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# pyright: reportMissingParameterType=false

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from grebe.core.copies import put
from grebe.core.eights import WIDTH, eight, loaded, stored
from grebe.core.kernels import inlined_machine_code, machine_code
from grebe.core.vessel import Vessel

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Order of the vessel's numbers in the parameter vector.
_M11, _M22, _M33, _XU, _YV, _NR, _XUU, _YVV, _NRR, _ARM, _YAW = range(11)
_CN, _CE, _FN, _FE = range(11, 15)


def parameter_vector(vessel: Vessel, weather: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the 15 numbers of the equations: vessel, then current and wind force."""
    boat = [
        vessel.m11_kg,
        vessel.m22_kg,
        vessel.m33_kgm2,
        vessel.x_u,
        vessel.y_v,
        vessel.n_r,
        vessel.x_uu,
        vessel.y_vv,
        vessel.n_rr,
        vessel.arm_m,
        vessel.yaw_coupling_kg,
    ]
    return np.concatenate([np.array(boat), weather])


@inlined_machine_code
def _in_hull_axes(p, psi):
    """Cosine and sine of the heading, and current and wind force ahead and to starboard."""
    c, s = np.cos(psi), np.sin(psi)
    current, wind = (p[_CN], p[_CE]), (p[_FN], p[_FE])
    return (
        c,
        s,
        c * current[0] + s * current[1],
        c * current[1] - s * current[0],
        c * wind[0] + s * wind[1],
        c * wind[1] - s * wind[0],
    )


@inlined_machine_code
def _rates(p, psi, u, v, r, port, starboard):
    """Right-hand side: six numbers."""
    c, s, u_c, v_c, wind_x, wind_y = _in_hull_axes(p, psi)
    u_r, v_r = u - u_c, v - v_c
    m11, m22 = p[_M11], p[_M22]
    drag_u = (p[_XU] + p[_XUU] * abs(u_r)) * u_r
    drag_v = (p[_YV] + p[_YVV] * abs(v_r)) * v_r
    drag_r = (p[_NR] + p[_NRR] * abs(r)) * r
    return (
        u * c - v * s,
        u * s + v * c,
        r,
        (port + starboard + wind_x + m22 * v_r * r + drag_u) / m11 + r * v_c,
        (wind_y - m11 * u_r * r + drag_v) / m22 - r * u_c,
        (p[_ARM] * (port - starboard) + p[_YAW] * u_r * v_r + drag_r) / p[_M33],
    )


@machine_code
def evaluate(p, psi, u, v, r, port, starboard, f, jac):
    """Right-hand side `f` (6,) and its Jacobian `jac` (6, 8) in (psi, u, v, r, F_1, F_2),
    with two columns of zeros.
    """
    f[0], f[1], f[2], f[3], f[4], f[5] = _rates(p, psi, u, v, r, port, starboard)
    c, s, u_c, v_c, wind_x, wind_y = _in_hull_axes(p, psi)
    u_r, v_r = u - u_c, v - v_c
    m11, m22, m33, arm, yaw = p[_M11], p[_M22], p[_M33], p[_ARM], p[_YAW]
    slope_u = p[_XU] + 2 * p[_XUU] * abs(u_r)
    slope_v = p[_YV] + 2 * p[_YVV] * abs(v_r)
    jac[:] = 0.0
    jac[0, 0], jac[0, 1], jac[0, 2] = -f[1], c, -s
    jac[1, 0], jac[1, 1], jac[1, 2] = f[0], s, c
    jac[2, 3] = 1.0
    # d u_r / d psi = -v_c and d v_r / d psi = u_c: the current turns against the hull.
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
    jac[5, 3] = (p[_NR] + 2 * p[_NRR] * abs(r)) / m33
    jac[5, 4] = arm / m33
    jac[5, 5] = -arm / m33


@machine_code
def curvature(p, psi, u, v, r, mu, hess):
    """Hessian `hess` (4, 4) of mu f in (psi, u, v, r); f is linear in the thrusts."""
    c, s, u_c, v_c, wind_x, wind_y = _in_hull_axes(p, psi)
    u_r, v_r = u - u_c, v - v_c
    a4, a5, a6 = mu[3] / p[_M11], mu[4] / p[_M22], mu[5] / p[_M33]
    yaw = p[_YAW]
    # Partial derivatives of mu f in the velocities through the water.
    l_u = a4 * (p[_XU] + 2 * p[_XUU] * abs(u_r)) - a5 * p[_M11] * r + a6 * yaw * v_r
    l_v = a4 * p[_M22] * r + a5 * (p[_YV] + 2 * p[_YVV] * abs(v_r)) + a6 * yaw * u_r
    l_uu = 2 * a4 * p[_XUU] * np.sign(u_r)
    l_vv = 2 * a5 * p[_YVV] * np.sign(v_r)
    l_uv = a6 * yaw
    l_ur = -a5 * p[_M11]
    l_vr = a4 * p[_M22]
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
    hess[3, 3] = 2 * a6 * p[_NRR] * np.sign(r)
    for i in range(4):
        for j in range(i):
            hess[i, j] = hess[j, i]


@machine_code
def advance(p, z, thrusts, duration, substeps, out):
    """Integrate one stage from `z` (6,) into `out` (6,): RK4 without derivatives."""
    # In plain numbers, for the search does little else: small arrays cost more than they hold.
    h, half = duration / substeps, 0.5 * duration / substeps
    port, starboard = thrusts[0], thrusts[1]
    x, y, psi, u, v, r = z[0], z[1], z[2], z[3], z[4], z[5]
    for _ in range(substeps):
        a0, a1, a2, a3, a4, a5 = _rates(p, psi, u, v, r, port, starboard)
        b0, b1, b2, b3, b4, b5 = _rates(
            p, psi + half * a2, u + half * a3, v + half * a4, r + half * a5, port, starboard
        )
        c0, c1, c2, c3, c4, c5 = _rates(
            p, psi + half * b2, u + half * b3, v + half * b4, r + half * b5, port, starboard
        )
        d0, d1, d2, d3, d4, d5 = _rates(
            p, psi + h * c2, u + h * c3, v + h * c4, r + h * c5, port, starboard
        )
        x += h / 6 * (a0 + 2 * b0 + 2 * c0 + d0)
        y += h / 6 * (a1 + 2 * b1 + 2 * c1 + d1)
        psi += h / 6 * (a2 + 2 * b2 + 2 * c2 + d2)
        u += h / 6 * (a3 + 2 * b3 + 2 * c3 + d3)
        v += h / 6 * (a4 + 2 * b4 + 2 * c4 + d4)
        r += h / 6 * (a5 + 2 * b5 + 2 * c5 + d5)
    out[0], out[1], out[2], out[3], out[4], out[5] = x, y, psi, u, v, r


@inlined_machine_code
def _sensed(row, f, duration, psi, u, v, r):
    """How a number f of the right-hand side, times the duration, depends on p: by its `row` of the
    Jacobian, and by how (psi, u, v, r) depend on p.
    """
    along = (row[0] * psi + row[1] * u) + (row[2] * v + row[3] * r)
    direct = eight(0.0, 0.0, 0.0, 0.0, duration * row[4], duration * row[5], f, 0.0)
    return duration * along + direct


@machine_code
def linearise(p, z, thrusts, duration, substeps, out, sens, points, slopes, jacs):
    """Integrate one stage and its sensitivities.

    `out` (6,) the next state; `sens` (6, 8) its derivative in p, and a column of zeros. `points`
    (evals, 4, 8) are the sensitivities of (psi, u, v, r) where f was evaluated, `slopes` (evals, 4)
    those four values and `jacs` (evals, 6, 8) the Jacobians there: what `second_order` needs.
    """
    h = 1.0 / substeps
    f, point, total = np.empty(6), np.empty(6), np.empty(6)
    put(out, z)
    none = eight(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    of_x = of_y = none
    of_psi = eight(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    of_u = eight(0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    of_v = eight(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    of_r = eight(0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)
    index = 0
    for _ in range(substeps):
        put(point, out)
        psi, u, v, r = of_psi, of_u, of_v, of_r
        sum_x = sum_y = sum_psi = sum_u = sum_v = sum_r = none
        total[:] = 0.0
        for stage in range(4):
            jac, place = jacs[index], points[index]
            evaluate(p, point[2], point[3], point[4], point[5], thrusts[0], thrusts[1], f, jac)
            for i in range(4):
                slopes[index, i] = point[2 + i]
            stored(psi, place, 0, 0)
            stored(u, place, 1, 0)
            stored(v, place, 2, 0)
            stored(r, place, 3, 0)
            index += 1
            weight = 2.0 if stage in (1, 2) else 1.0
            lead = h if stage == 2 else 0.5 * h
            d_psi = _sensed(jac[2], f[2], duration, psi, u, v, r)
            d_u = _sensed(jac[3], f[3], duration, psi, u, v, r)
            d_v = _sensed(jac[4], f[4], duration, psi, u, v, r)
            d_r = _sensed(jac[5], f[5], duration, psi, u, v, r)
            sum_x = sum_x + weight * _sensed(jac[0], f[0], duration, psi, u, v, r)
            sum_y = sum_y + weight * _sensed(jac[1], f[1], duration, psi, u, v, r)
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


@inlined_machine_code
def _of_four(rows, w0, w1, w2, w3):
    """The sum of four rows of eight numbers, each at its weight."""
    return (w0 * loaded(rows, 0, 0) + w1 * loaded(rows, 1, 0)) + (
        w2 * loaded(rows, 2, 0) + w3 * loaded(rows, 3, 0)
    )


@machine_code
def second_order(p, costate, duration, substeps, points, slopes, jacs, hess):
    """Hessian `hess` (7, 8) of costate * (next state) in p, by the discrete adjoint of RK4; its
    last column is zero.

    Each evaluation of f contributes S^T (T mu d2f) S plus the cross terms of T, where S is the
    sensitivity of the point and mu the adjoint of that evaluation.
    """
    h = 1.0 / substeps
    lam = costate.copy()
    bar = np.empty(6)
    # Adjoint of each evaluation's point, before the duration: in (psi, u, v, r), then in thrusts.
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
            jac, s, point = jacs[index], slopes[index], points[index]
            pulled = (
                (bar[0] * loaded(jac, 0, 0) + bar[1] * loaded(jac, 1, 0))
                + (bar[2] * loaded(jac, 2, 0) + bar[3] * loaded(jac, 3, 0))
                + (bar[4] * loaded(jac, 4, 0) + bar[5] * loaded(jac, 5, 0))
            )
            stored(pulled, back, stage, 0)
            curvature(p, s[0], s[1], s[2], s[3], bar, curve)
            for i in range(4):
                row = _of_four(point, curve[i, 0], curve[i, 1], curve[i, 2], curve[i, 3])
                stored(duration * row, half, i, 0)
            for i in range(7):
                row = _of_four(half, point[0, i], point[1, i], point[2, i], point[3, i])
                stored(loaded(hess, i, 0) + row, hess, i, 0)
            own = back[stage]
            cross = cross + _of_four(point, own[0], own[1], own[2], own[3])
            cross = cross + eight(0.0, 0.0, 0.0, 0.0, own[4], own[5], 0.0, 0.0)
        for i in range(4):
            for stage in range(4):
                lam[2 + i] += duration * back[stage, i]
    # The duration's row: T f changes with T as f does with the point and with the thrusts.
    stored(loaded(hess, 6, 0) + cross, hess, 6, 0)
    stored(cross, half, 0, 0)
    hess[6, 6] += half[0, 6]
    for i in range(7):
        for j in range(i):
            hess[j, i] = hess[i, j]
