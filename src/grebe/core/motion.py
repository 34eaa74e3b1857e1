"""Eq. (9) compiled, for kernels that simulate the boat many times.

The equations are those of `grebe.core.dynamics.rates`; the tests compare both.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# pyright: reportMissingParameterType=false, reportUnknownParameterType=false
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from grebe.core.kernels import inlined_machine_code, machine_code
from grebe.core.vessel import Vessel

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Indices of the vessel's parameters in the parameter vector.
M11, M22, M33, XU, YV, NR, XUU, YVV, NRR, ARM, YAW = range(11)
CN, CE, FN, FE = range(11, 15)


def parameter_vector(vessel: Vessel, weather: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the 15 parameters of the equations: vessel, then current and wind force."""
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
def in_hull_axes(p, psi):
    """Cosine and sine of the heading, then current and wind force ahead and to starboard."""
    c, s = np.cos(psi), np.sin(psi)
    current, wind = (p[CN], p[CE]), (p[FN], p[FE])
    return (
        c,
        s,
        c * current[0] + s * current[1],
        c * current[1] - s * current[0],
        c * wind[0] + s * wind[1],
        c * wind[1] - s * wind[0],
    )


@inlined_machine_code
def motion(p, psi, u, v, r, port, starboard):
    """Right-hand side of Eq. (9), six numbers."""
    c, s, u_c, v_c, wind_x, wind_y = in_hull_axes(p, psi)
    u_r, v_r = u - u_c, v - v_c
    m11, m22 = p[M11], p[M22]
    drag_u = (p[XU] + p[XUU] * abs(u_r)) * u_r
    drag_v = (p[YV] + p[YVV] * abs(v_r)) * v_r
    drag_r = (p[NR] + p[NRR] * abs(r)) * r
    return (
        u * c - v * s,
        u * s + v * c,
        r,
        (port + starboard + wind_x + m22 * v_r * r + drag_u) / m11 + r * v_c,
        (wind_y - m11 * u_r * r + drag_v) / m22 - r * u_c,
        (p[ARM] * (port - starboard) + p[YAW] * u_r * v_r + drag_r) / p[M33],
    )


@machine_code
def advance(p, z, thrusts, duration, substeps, out):
    """Integrate one stage from `z` (6,) into `out` (6,) by RK4, without derivatives."""
    # Scalars, because the search spends most of its time here and small arrays are costly.
    h, half = duration / substeps, 0.5 * duration / substeps
    port, starboard = thrusts[0], thrusts[1]
    x, y, psi, u, v, r = z[0], z[1], z[2], z[3], z[4], z[5]
    for _ in range(substeps):
        a0, a1, a2, a3, a4, a5 = motion(p, psi, u, v, r, port, starboard)
        b0, b1, b2, b3, b4, b5 = motion(
            p, psi + half * a2, u + half * a3, v + half * a4, r + half * a5, port, starboard
        )
        c0, c1, c2, c3, c4, c5 = motion(
            p, psi + half * b2, u + half * b3, v + half * b4, r + half * b5, port, starboard
        )
        d0, d1, d2, d3, d4, d5 = motion(
            p, psi + h * c2, u + h * c3, v + h * c4, r + h * c5, port, starboard
        )
        x += h / 6 * (a0 + 2 * b0 + 2 * c0 + d0)
        y += h / 6 * (a1 + 2 * b1 + 2 * c1 + d1)
        psi += h / 6 * (a2 + 2 * b2 + 2 * c2 + d2)
        u += h / 6 * (a3 + 2 * b3 + 2 * c3 + d3)
        v += h / 6 * (a4 + 2 * b4 + 2 * c4 + d4)
        r += h / 6 * (a5 + 2 * b5 + 2 * c5 + d5)
    out[0], out[1], out[2], out[3], out[4], out[5] = x, y, psi, u, v, r
