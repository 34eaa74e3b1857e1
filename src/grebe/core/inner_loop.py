"""Model of a boat whose autopilot holds speed and yaw rate: a different plant from the bare hull.

An inner loop that follows a speed u_ref and a yaw rate r_ref with first-order lags,

    u' = (u_ref - u) / T_u,    r' = (r_ref - r) / T_r,

is Eq. (9) with linear drag and equal masses in surge and sway. With m = m11 = m22, x_u = -m / T_u
and n_r = -m33 / T_r, the steady rates u_ref = tau_u / -x_u and r_ref = tau_r / -n_r take the place
of the thrusts. No moment couples surge and sway into yaw, because the inner loop compensates it.
Nothing holds sway, which keeps the hull's drag. Any planner for a `Vessel` can therefore plan for
this boat too. The limits of its two thrusters become a joint limit on speed and turn: a boat at
full speed cannot turn.

The model must not promise more braking than the thrusters have. Under the order -a the inner loop
decelerates the boat by (u + a) / T_u, and full thrust astern by (2 F + D(u)) / m, with D the drag
of Eq. (9). `braking_time_s` is the least T_u, and `braking_share` gives the largest a, for which
the first never exceeds the second.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from grebe.core.dynamics import Weather, rates
from grebe.core.errors import VesselError
from grebe.core.vessel import Vessel, steady_rate

# Sway at which quadratic drag is linearised [m/s].
USUAL_SWAY_MPS = 0.2
# The largest speed astern that can be ordered is at least this share of the one ahead.
LEAST_ASTERN_SHARE = 0.1


def surge_time_s(vessel: Vessel) -> float:
    """Time constant T_u [s] that needs no more than full thrust ahead from rest."""
    return vessel.m11_kg * vessel.speed_max_mps / (2 * vessel.thrust_max_n)


def braking_time_s(vessel: Vessel, astern_mps: float) -> float:
    """Least time constant T_u [s] that promises no more braking than the thrusters have.

    With it, an order of `astern_mps` astern decelerates the boat no faster than full thrust astern
    does, at any speed ahead.
    """
    linear, quadratic, force = -vessel.x_u, -vessel.x_uu, -2 * vessel.thrust_min_n
    surge = vessel.speed_max_mps
    if quadratic > 0:
        least = (force - linear * astern_mps) / quadratic
        surge = min(surge, math.sqrt(max(astern_mps**2 + least, 0.0)) - astern_mps)
    at = max(surge, 0.0)
    return max(
        vessel.m11_kg * (u + astern_mps) / (force + vessel.surge_drag_n(u)) for u in (0.0, at)
    )


def braking_share(hull: Vessel, model: Vessel) -> float:
    """Share of the model's thrust astern that promises no more braking than the hull has.

    `model` is the hull under speed control. At any speed ahead this share decelerates it no faster
    than full thrust astern decelerates the hull.
    """
    surge_s = model.m11_kg / -model.x_u
    linear, quadratic, force = -hull.x_u, -hull.x_uu, -2 * hull.thrust_min_n
    mass, fastest = hull.m11_kg, hull.speed_max_mps
    surge = (mass / surge_s - linear) / (2 * quadratic) if quadratic > 0 else fastest
    at = min(max(surge, 0.0), fastest)
    most = min(surge_s * (force + hull.surge_drag_n(u)) / mass - u for u in (0.0, at, fastest))
    least = LEAST_ASTERN_SHARE * fastest
    return min(max(most, least) / (2 * model.thrust_min_n / model.x_u), 1.0)


def yaw_time_s(vessel: Vessel) -> float:
    """Time constant T_r [s] that needs no more than one thruster full ahead, one full astern."""
    return vessel.m33_kgm2 * yaw_rate_max_radps(vessel) / _most_moment_nm(vessel)


def yaw_rate_max_radps(vessel: Vessel) -> float:
    """Steady yaw rate with one thruster full ahead and the other full astern [rad/s]."""
    return steady_rate(-vessel.n_r, -vessel.n_rr, _most_moment_nm(vessel))


def _most_moment_nm(vessel: Vessel) -> float:
    return vessel.arm_m * (vessel.thrust_max_n - vessel.thrust_min_n)


def under_speed_control(
    hull: Vessel,
    *,
    speed_max_mps: float = math.inf,
    surge_lag_s: float | None = None,
    yaw_lag_s: float | None = None,
) -> Vessel:
    """Return the model of a hull under an autopilot that holds speed and yaw rate.

    `speed_max_mps` is the autopilot's limit. Lags [s] that are not given follow from the hull.
    Raises `VesselError` for a limit or a lag that is not positive.
    """
    surge_s = surge_lag_s
    if surge_s is None:
        least = LEAST_ASTERN_SHARE * hull.speed_max_mps
        surge_s = max(surge_time_s(hull), braking_time_s(hull, least))
    yaw_s = yaw_time_s(hull) if yaw_lag_s is None else yaw_lag_s
    for name, value in (("speed_max_mps", speed_max_mps), ("lag", surge_s), ("lag", yaw_s)):
        if not value > 0:
            raise VesselError(
                f"With speed control, a {name} of {value:g} is impossible; give more than 0."
            )
    ahead = min(hull.speed_max_mps, speed_max_mps)
    astern = min(steady_rate(-hull.x_u, -hull.x_uu, -2 * hull.thrust_min_n), speed_max_mps)
    mass, x_u, n_r = hull.m11_kg, -hull.m11_kg / surge_s, -hull.m33_kgm2 / yaw_s
    thrust_max, thrust_min = -x_u * ahead / 2, x_u * astern / 2
    return replace(
        hull,
        name=f"{hull.name} under speed control",
        m22_kg=mass,
        x_u=x_u,
        x_uu=0.0,
        y_v=hull.y_v + hull.y_vv * USUAL_SWAY_MPS,
        y_vv=0.0,
        n_r=n_r,
        n_rr=0.0,
        thrust_max_n=thrust_max,
        thrust_min_n=thrust_min,
        arm_m=-n_r * yaw_rate_max_radps(hull) / (thrust_max - thrust_min),
        thruster_lag_s=0.0,
        thruster_dead_band_n=0.0,
        throttle_exponent=1.0,
        yaw_coupling="fossen",
    )


def held_motion(
    vessel: Vessel, state: Sequence[float], thrusts: tuple[float, float], weather: Weather
) -> tuple[float, float]:
    """Return the surge [m/s] and yaw rate [rad/s], over ground, to order from an inner loop.

    Under this order the boat moves on from `state` as Eq. (9) predicts under `thrusts`: a
    first-order lag T follows the wanted motion w if its reference is w_ref = w + T w'.
    """
    rate = rates(vessel, state, thrusts, weather.as_tuple())
    surge = state[3] + surge_time_s(vessel) * rate[3]
    yaw_rate = state[5] + yaw_time_s(vessel) * rate[5]
    return float(surge), float(yaw_rate)
