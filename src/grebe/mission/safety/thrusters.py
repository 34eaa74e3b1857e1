"""A thruster that gives nothing: found by how the boat turns.

The moment about the vertical axis, last row of Eq. (9), is the sum of what either thruster makes
and of the drag. How much of each the boat shows is found by least squares over the last seconds,
with a prior at the boat as it is said to be. A thruster is dead when its share is nothing, whatever
the drag may be and the other thruster gives: a boat with twice the drag, or a weak thruster, goes
on. All goes through one low-pass filter, so that the yaw rate need not be differentiated and
neither a lag nor noise is mistaken for a fault.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# pyright: reportMissingParameterType=false

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.dynamics import Weather
from grebe.core.kernels import machine_code
from grebe.core.vessel import Vessel
from grebe.mission.safety.states import Cause, Facts, Finding

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Time constants of the filter and of the least squares [s].
FILTER_S, AVERAGE_S = 1.5, 8.0
# Of the shares of port, starboard and drag, before anything is seen.
AS_SAID, PRIOR_SD = np.ones(3), np.array([0.5, 0.5, 1.0])
# Smallest root mean square that counts, as a share of one thruster's full moment.
FLOOR_SHARE = 0.04
# A dead thruster surely gives less than the first of its order, by so many standard deviations, and
# the other seems to give more than the second, for so long [s].
DEAD, SURE, ALIVE, PERSIST_S = 0.3, 2.0, 0.5, 3.0
SIDES = ("", "port", "starboard")

# Filtered moments [N m]: port's, starboard's, the drag's, what remains of the hull's coupling and
# inertia.
Four = tuple[float, float, float, float]
NONE: Four = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Turning:
    """Filtered yaw rate and moments, and the averages of their products (16,), row by row; `side`
    that seems dead, `since_s` when.
    """

    time_s: float | None = None
    yaw_rate: float = 0.0
    moments: Four = NONE
    products: tuple[float, ...] = (0.0,) * 16
    side: int = 0
    since_s: float = 0.0


def watched_turning(before: Turning, facts: Facts, vessel: Vessel) -> Turning:
    """Take an estimate, and the thrusts that led to it, into account."""
    yaw_rate = facts.state[5]
    if before.time_s is None:
        return Turning(time_s=facts.time_s, yaw_rate=yaw_rate)
    seconds = facts.time_s - before.time_s
    if seconds <= 0:
        return before
    share, keep = 1 - math.exp(-seconds / FILTER_S), math.exp(-seconds / AVERAGE_S)
    seen = vessel.m33_kgm2 * (yaw_rate - before.yaw_rate) / FILTER_S
    now = _moments(vessel, facts)
    moments = tuple(old + share * (new - old) for old, new in zip(before.moments, now, strict=True))
    port, starboard, drag, coupling = moments
    products = _averaged(before.products, (port, starboard, drag, seen - coupling), keep)
    side = _dead_side(np.array(products).reshape(4, 4), vessel)
    return Turning(
        time_s=facts.time_s,
        yaw_rate=before.yaw_rate + share * (yaw_rate - before.yaw_rate),
        moments=(port, starboard, drag, coupling),
        products=products,
        side=side,
        since_s=before.since_s if side == before.side else facts.time_s,
    )


def _averaged(before: tuple[float, ...], row: Four, keep: float) -> tuple[float, ...]:
    """Averages of the products of a row of moments, row by row, with one more row."""
    products = (a * b for a in row for b in row)
    return tuple(keep * old + (1 - keep) * new for old, new in zip(before, products, strict=True))


def dead_thruster(turning: Turning) -> Finding | None:
    """The thruster that gives nothing, if one does."""
    if turning.side == 0 or turning.time_s is None or turning.time_s - turning.since_s < PERSIST_S:
        return None
    name = SIDES[turning.side]
    return Finding(
        cause=Cause.THRUSTER,
        message=f"the boat turns as if its {name} thruster gave nothing",
    )


def _moments(vessel: Vessel, facts: Facts) -> Four:
    """Moments [N m] of the thrusters as ordered, of the drag, and of the coupling of surge and
    sway.
    """
    _, _, heading, surge, sway, yaw_rate = facts.state
    ahead, aside = _through(heading, facts.weather)
    port, starboard = facts.thrusts
    drag = (vessel.n_r + vessel.n_rr * abs(yaw_rate)) * yaw_rate
    coupling = vessel.yaw_coupling_kg * (surge - ahead) * (sway - aside)
    return vessel.arm_m * port, -vessel.arm_m * starboard, drag, coupling


def _through(heading: float, weather: Weather) -> tuple[float, float]:
    """The current along and across the hull."""
    c, s = math.cos(heading), math.sin(heading)
    north, east = weather.current_north_mps, weather.current_east_mps
    return c * north + s * east, c * east - s * north


def _dead_side(products: Array, vessel: Vessel) -> int:
    """The thruster whose share is nothing: 1 port, 2 starboard, 0 none."""
    floor = (FLOOR_SHARE * vessel.arm_m * vessel.thrust_max_n) ** 2
    # The first fit tells how well the second may be trusted.
    shares, _, missed = _fitted(products, floor)
    shares, sd, _ = _fitted(products, max(floor, missed))
    for side, at, other in ((1, 0, 1), (2, 1, 0)):
        if shares[at] + SURE * sd[at] < DEAD and shares[other] > ALIVE:
            return side
    return 0


@machine_code
def _fitted(products, noise):
    """Shares (3,) of port, starboard and drag by least squares with the prior, under a variance of
    `noise`; their standard deviations (3,); and the mean square that they miss.
    """
    # What is seen within the filter's time constant counts once.
    weight = AVERAGE_S / FILTER_S / noise
    m = weight * products[:3, :3]
    right = np.empty(3)
    for i in range(3):
        m[i, i] += PRIOR_SD[i] ** -2
        right[i] = weight * products[i, 3] + PRIOR_SD[i] ** -2 * AS_SAID[i]
    inverse = np.empty((3, 3))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for n in range(3):
            p, q = (n + 1) % 3, (n + 2) % 3
            inverse[n, i] = m[j, p] * m[k, q] - m[j, q] * m[k, p]
    determinant = m[0, 0] * inverse[0, 0] + m[0, 1] * inverse[1, 0] + m[0, 2] * inverse[2, 0]
    inverse /= determinant
    shares, sd, missed = np.zeros(3), np.empty(3), products[3, 3]
    for i in range(3):
        sd[i] = np.sqrt(inverse[i, i])
        for n in range(3):
            shares[i] += inverse[i, n] * right[n]
    for i in range(3):
        missed -= 2 * shares[i] * products[i, 3]
        for n in range(3):
            missed += shares[i] * products[i, n] * shares[n]
    return shares, sd, missed
