"""The motion of the boat, Eq. (9) of the paper, and its integration.

State z = (x, y, psi, u, v, r): north and east [m], heading clockwise from north [rad],
surge and sway *over ground* [m/s], yaw rate positive to starboard [rad/s]. Inputs F_1
(port) and F_2 (starboard) [N]. In still water this is Eq. (9) with two changes: the vessel chooses
the sign of the Coriolis term in yaw (`Vessel.yaw_coupling`, Fossen's by default, not the printed
one), and it may have quadratic drag. In a steady current the hydrodynamic terms act on the velocity
through the water (Fossen 2011, sec. 8.3).

Each function is written once for numbers (`math`) and CasADi symbols: `cos` and `sin` are
arguments.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from grebe.core.errors import InputError
from grebe.core.vessel import Vessel

STATE_NAMES = ("north_m", "east_m", "heading_rad", "surge_mps", "sway_mps", "yaw_rate_radps")

# A float in the plant, a CasADi SX in the controller: the arithmetic is the same.
Scalar = Any


@dataclass(frozen=True, kw_only=True)
class Weather:
    """A steady current and a steady wind force, both pointing *towards* north and east."""

    current_north_mps: float = 0.0
    current_east_mps: float = 0.0
    wind_force_north_n: float = 0.0
    wind_force_east_n: float = 0.0

    def __post_init__(self) -> None:
        if not all(math.isfinite(value) for value in self.as_tuple()):
            raise InputError(f"Current and wind must be finite numbers, but are {self.as_tuple()}.")

    def as_tuple(self) -> tuple[float, float, float, float]:
        """Return (current north, current east [m/s], force north, force east [N])."""
        return (
            self.current_north_mps,
            self.current_east_mps,
            self.wind_force_north_n,
            self.wind_force_east_n,
        )


CALM = Weather()


def rates(
    vessel: Vessel,
    state: Sequence[Scalar],
    thrusts: Sequence[Scalar],
    weather: Sequence[Scalar] = (0.0, 0.0, 0.0, 0.0),
    *,
    cos: Callable[[Scalar], Scalar] = math.cos,
    sin: Callable[[Scalar], Scalar] = math.sin,
) -> list[Scalar]:
    """Return dz/dt, six values in SI units.

    This is Eq. (9) with quadratic drag, current and wind force; `vessel.yaw_coupling` gives the
    sign of its last row. `thrusts` is (F_1, F_2); `weather` is `Weather.as_tuple()`.
    """
    _, _, psi, u, v, r = state
    current_north, current_east, force_north, force_east = weather
    cos_psi, sin_psi = cos(psi), sin(psi)
    # In the hull's axes the current turns with the hull; r * v_c and -r * u_c undo this.
    u_c = cos_psi * current_north + sin_psi * current_east
    v_c = cos_psi * current_east - sin_psi * current_north
    u_r, v_r = u - u_c, v - v_c
    tau_u = thrusts[0] + thrusts[1] + cos_psi * force_north + sin_psi * force_east
    tau_v = cos_psi * force_east - sin_psi * force_north
    tau_r = vessel.arm_m * (thrusts[0] - thrusts[1])
    m11, m22, m33 = vessel.m11_kg, vessel.m22_kg, vessel.m33_kgm2
    surge_drag = (vessel.x_u + vessel.x_uu * abs(u_r)) * u_r
    sway_drag = (vessel.y_v + vessel.y_vv * abs(v_r)) * v_r
    yaw_drag = (vessel.n_r + vessel.n_rr * abs(r)) * r
    return [
        u * cos_psi - v * sin_psi,
        u * sin_psi + v * cos_psi,
        r,
        (tau_u + m22 * v_r * r + surge_drag) / m11 + r * v_c,
        (tau_v - m11 * u_r * r + sway_drag) / m22 - r * u_c,
        (tau_r + vessel.yaw_coupling_kg * u_r * v_r + yaw_drag) / m33,
    ]


def rk4(
    derivative: Callable[[Sequence[Scalar]], list[Scalar]],
    state: Sequence[Scalar],
    duration: Scalar,
    substeps: int,
) -> list[Scalar]:
    """Integrate over `duration` [s] with `substeps` classical Runge-Kutta steps."""
    step = duration / substeps
    z = list(state)
    for _ in range(substeps):
        k1 = derivative(z)
        k2 = derivative([a + step / 2 * b for a, b in zip(z, k1, strict=True)])
        k3 = derivative([a + step / 2 * b for a, b in zip(z, k2, strict=True)])
        k4 = derivative([a + step * b for a, b in zip(z, k3, strict=True)])
        z = [
            a + step / 6 * (d1 + 2 * d2 + 2 * d3 + d4)
            for a, d1, d2, d3, d4 in zip(z, k1, k2, k3, k4, strict=True)
        ]
    return z


def drive_power_w(
    vessel: Vessel, thrusts: Sequence[float], surge_through_water_mps: float
) -> float:
    """Electrical power of both thrusters by momentum theory [W].

    An ideal propeller of disc area A that makes thrust F in water arriving at speed V takes
    F (V + sqrt(V^2 + 2 F / (rho A))) / 2. The result is this, divided by the drive's efficiency.
    """
    area = math.pi / 4 * vessel.propeller_diameter_m**2
    speed = max(0.0, surge_through_water_mps)
    ideal = 0.0
    for thrust in map(abs, thrusts):
        ideal += 0.5 * thrust * (speed + math.sqrt(speed**2 + 2 * thrust / (1000.0 * area)))
    return ideal / vessel.drive_efficiency
