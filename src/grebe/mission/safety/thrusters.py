"""Detects a dead thruster by how the boat turns.

The moment about the vertical axis, last row of Eq. (9), is the sum of the moments of the two
thrusters, of the drag, and of surge and sway through the water. The share of each that the boat
shows is estimated by least squares over the last seconds. The prior is the boat as modelled and the
estimated current; a current that is not known yet can balance a complete thruster. A thruster is
dead if its share is nil whatever the drag, the current and the other thruster's share may be: a
boat with twice the drag, or with a weak thruster, goes on. Everything passes through one low-pass
filter, so that the yaw rate need not be differentiated and neither lag nor noise looks like a
fault.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# pyright: reportMissingParameterType=false

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.dynamics import Weather
from grebe.core.kernels import exact_machine_code, machine_code
from grebe.core.vessel import Vessel
from grebe.mission.safety.states import Cause, Facts, Finding

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Time constants of the filter and of the least squares [s].
FILTER_S, AVERAGE_S = 1.5, 10.0
# Prior standard deviations: of the shares of port, starboard and drag, and of each component of a
# current whose estimate has long been constant [m/s].
SHARES_SD, CURRENT_SD_MPS = (0.5, 0.5, 1.0), 0.15
# The smallest root mean square of the residuals, as a share of one thruster's full moment.
FLOOR_SHARE = 0.04
# If the root mean square of the residuals exceeds this share, something else turns the boat.
MOST_MISSED_SHARE = 0.15
# A thruster is dead if, for `PERSIST_S` [s], its share plus `SURE` standard deviations is below
# `DEAD` and the estimated share of the other thruster is above `ALIVE`.
DEAD, SURE, ALIVE, PERSIST_S = 0.35, 2.0, 0.5, 3.0
SIDES = ("", "port", "starboard")

# The number of moments whose shares are estimated: of port, starboard, the drag and the current's
# four terms. The moment of surge and sway over ground is filtered with them (see `_moments`) [N m].
EXPLAINED = 7
NONE = (0.0,) * (EXPLAINED + 1)


@dataclass(frozen=True, kw_only=True)
class Turning:
    """Filtered yaw rate and moments, and the estimates made from them.

    `products` (8, 8) are the averaged products of all moments but the last, and of the moment that
    they have to explain; the array is never written to. `current` (north, east) is the average of
    its estimates [m/s]. The thruster on `side` has seemed dead since `since_s`.
    """

    time_s: float | None = None
    yaw_rate: float = 0.0
    moments: tuple[float, ...] = NONE
    products: Array = field(
        default_factory=lambda: np.zeros((EXPLAINED + 1, EXPLAINED + 1)), compare=False
    )
    current: tuple[float, float] = (0.0, 0.0)
    side: int = 0
    since_s: float = 0.0


def updated_turning(before: Turning, facts: Facts, vessel: Vessel) -> Turning:
    """Return the turning, updated with an estimate and the thrusts that led to it."""
    yaw_rate = facts.state[5]
    if before.time_s is None:
        return Turning(time_s=facts.time_s, yaw_rate=yaw_rate, current=_current(facts.weather))
    seconds = facts.time_s - before.time_s
    if seconds <= 0:
        return before
    share, keep = 1 - math.exp(-seconds / FILTER_S), math.exp(-seconds / AVERAGE_S)
    seen = vessel.m33_kgm2 * (yaw_rate - before.yaw_rate) / FILTER_S
    now = _moments(vessel, facts)
    moments = tuple(old + share * (new - old) for old, new in zip(before.moments, now, strict=True))
    row = np.array((*moments[:-1], seen - moments[-1]))
    products = _averaged(before.products, row, keep)
    north, east = _current(facts.weather)
    average = (
        keep * before.current[0] + (1 - keep) * north,
        keep * before.current[1] + (1 - keep) * east,
    )
    expected, unsure = _expected(north, east, math.dist((north, east), average))
    side = _dead_side(products, vessel, expected, unsure)
    return Turning(
        time_s=facts.time_s,
        yaw_rate=before.yaw_rate + share * (yaw_rate - before.yaw_rate),
        moments=moments,
        products=products,
        current=average,
        side=side,
        since_s=before.since_s if side == before.side else facts.time_s,
    )


@exact_machine_code
def _averaged(before, row, keep):
    """Return the averages (n, n) of the products of moments, updated with a row of them (n,)."""
    averages = np.empty_like(before)
    for i in range(len(row)):
        for j in range(len(row)):
            averages[i, j] = keep * before[i, j] + (1 - keep) * (row[i] * row[j])
    return averages


def dead_thruster(turning: Turning) -> Finding | None:
    """Return the finding of a dead thruster; None if there is none."""
    if turning.side == 0 or turning.time_s is None or turning.time_s - turning.since_s < PERSIST_S:
        return None
    name = SIDES[turning.side]
    return Finding(
        cause=Cause.THRUSTER,
        message=f"the boat turns as if its {name} thruster gave no thrust",
    )


def _moments(vessel: Vessel, facts: Facts) -> tuple[float, ...]:
    """Return the moments [N m] of the commanded thrusts, of the drag, and of the coupling of surge
    and sway through the water. The coupling is linear in four terms of the current (n, e):
    n, e, e^2 - n^2 and n e. The remainder is the coupling of surge and sway over ground.
    """
    _, _, heading, surge, sway, yaw_rate = facts.state
    c, s, coupling = math.cos(heading), math.sin(heading), vessel.yaw_coupling_kg
    port, starboard = facts.thrusts
    return (
        vessel.arm_m * port,
        -vessel.arm_m * starboard,
        (vessel.n_r + vessel.n_rr * abs(yaw_rate)) * yaw_rate,
        coupling * (s * surge - c * sway),
        -coupling * (c * surge + s * sway),
        coupling * c * s,
        coupling * (c * c - s * s),
        coupling * surge * sway,
    )


def _dead_side(products: Array, vessel: Vessel, expected: Array, unsure: Array) -> int:
    """Return the dead thruster: 1 port, 2 starboard, 0 none."""
    floor = (FLOOR_SHARE * vessel.arm_m * vessel.thrust_max_n) ** 2
    # The residuals of the first fit give the noise for the second.
    shares, _, missed = _fitted(products, floor, expected, unsure)
    if missed > (MOST_MISSED_SHARE / FLOOR_SHARE) ** 2 * floor:
        return 0
    shares, sd, _ = _fitted(products, max(floor, missed), expected, unsure)
    for side, at, other in ((1, 0, 1), (2, 1, 0)):
        if shares[at] + SURE * sd[at] < DEAD and shares[other] > ALIVE:
            return side
    return 0


def _current(weather: Weather) -> tuple[float, float]:
    return weather.current_north_mps, weather.current_east_mps


def _expected(n: float, e: float, moved: float) -> tuple[Array, Array]:
    """Return the means (7,) and standard deviations (7,) of the prior: the boat as modelled, and
    the terms of the estimated current (n, e). That has `moved` away from its average [m/s], and may
    move further.
    """
    sd = math.hypot(CURRENT_SD_MPS, moved)
    apart = sd * math.hypot(n, e, sd)
    return (
        np.array([1.0, 1.0, 1.0, n, e, e * e - n * n, n * e]),
        np.array([*SHARES_SD, sd, sd, 2 * apart, apart]),
    )


@machine_code
def _fitted(products, noise, expected, unsure):
    """Return the shares (n,) by least squares, their standard deviations (n,), and the mean square
    of the residuals. `noise` is the variance of the data; the prior has the means `expected` (n,)
    and the standard deviations `unsure` (n,).
    """
    count = expected.size
    # Data within one time constant of the filter count as one observation.
    weight = AVERAGE_S / FILTER_S / noise
    # Gauss-Jordan elimination: the steps that reduce the information matrix to the unit matrix turn
    # the unit matrix into its inverse.
    m, inverse, right = weight * products[:count, :count], np.eye(count), np.empty(count)
    for i in range(count):
        m[i, i] += unsure[i] ** -2
        right[i] = weight * products[i, count] + unsure[i] ** -2 * expected[i]
    for i in range(count):
        pivot = m[i, i]
        for n in range(count):
            m[i, n] /= pivot
            inverse[i, n] /= pivot
        for j in range(count):
            if j != i:
                factor = m[j, i]
                for n in range(count):
                    m[j, n] -= factor * m[i, n]
                    inverse[j, n] -= factor * inverse[i, n]
    shares, sd, missed = np.zeros(count), np.empty(count), products[count, count]
    for i in range(count):
        sd[i] = np.sqrt(inverse[i, i])
        for n in range(count):
            shares[i] += inverse[i, n] * right[n]
    for i in range(count):
        missed -= 2 * shares[i] * products[i, count]
        for n in range(count):
            missed += shares[i] * products[i, n] * shares[n]
    return shares, sd, missed
