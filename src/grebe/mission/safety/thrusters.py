"""A thruster that gives nothing: found by how the boat turns.

The moment about the vertical axis, last row of Eq. (9), is the sum of what either thruster makes,
of the drag, and of surge and sway through the water. How much of each the boat shows is found by
least squares over the last seconds, with a prior at the boat as it is said to be and at the current
as it is estimated: one that is not known yet can hold against a whole thruster. A thruster is dead
when its share is nothing, whatever the drag and the current may be and the other thruster gives: a
boat with twice the drag, or a weak thruster, goes on. All goes through one low-pass filter, so that
the yaw rate need not be differentiated and neither a lag nor noise is mistaken for a fault.
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
# How unsure the shares of port, starboard and drag are before anything is seen, and an estimate of
# the current that has not moved for long, north and east [m/s].
SHARES_SD, CURRENT_SD_MPS = (0.5, 0.5, 1.0), 0.15
# Smallest root mean square that counts, as a share of one thruster's full moment.
FLOOR_SHARE = 0.04
# Where all that is looked for misses more than this share, something else turns the boat.
MOST_MISSED_SHARE = 0.15
# A dead thruster surely gives less than the first of its order, by so many standard deviations, and
# the other seems to give more than the second, for so long [s].
DEAD, SURE, ALIVE, PERSIST_S = 0.35, 2.0, 0.5, 3.0
SIDES = ("", "port", "starboard")

# Filtered moments [N m]: port's, starboard's, the drag's, those of the current's four terms (see
# `_moments`), and that of surge and sway over ground.
EXPLAINED = 7
NONE = (0.0,) * (EXPLAINED + 1)


@dataclass(frozen=True, kw_only=True)
class Turning:
    """Filtered yaw rate and moments, and the averages of the products (8, 8) of all but the last
    and of what is to be explained, which are never written to; `current` (north, east), the average
    of what was estimated [m/s]; `side` that seems dead, `since_s` when.
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


def watched_turning(before: Turning, facts: Facts, vessel: Vessel) -> Turning:
    """Take an estimate, and the thrusts that led to it, into account."""
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
    """Averages (n, n) of the products of a row of moments (n,), with one more row."""
    averages = np.empty_like(before)
    for i in range(len(row)):
        for j in range(len(row)):
            averages[i, j] = keep * before[i, j] + (1 - keep) * (row[i] * row[j])
    return averages


def dead_thruster(turning: Turning) -> Finding | None:
    """The thruster that gives nothing, if one does."""
    if turning.side == 0 or turning.time_s is None or turning.time_s - turning.since_s < PERSIST_S:
        return None
    name = SIDES[turning.side]
    return Finding(
        cause=Cause.THRUSTER,
        message=f"the boat turns as if its {name} thruster gave nothing",
    )


def _moments(vessel: Vessel, facts: Facts) -> tuple[float, ...]:
    """Moments [N m] of the thrusters as ordered, of the drag, and of the coupling of surge and sway
    through the water. The last is linear in four terms of a current (n, e), whatever it is:
    n, e, e^2 - n^2 and n e; what is left is that of surge and sway over ground.
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
    """The thruster whose share is nothing: 1 port, 2 starboard, 0 none."""
    floor = (FLOOR_SHARE * vessel.arm_m * vessel.thrust_max_n) ** 2
    # The first fit tells how well the second may be trusted.
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
    """The boat as it is said to be and the terms of the estimated current (n, e), (7,), and how
    unsure they are where the estimate is so far from its average: it may move on [m/s].
    """
    sd = math.hypot(CURRENT_SD_MPS, moved)
    apart = sd * math.hypot(n, e, sd)
    return (
        np.array([1.0, 1.0, 1.0, n, e, e * e - n * n, n * e]),
        np.array([*SHARES_SD, sd, sd, 2 * apart, apart]),
    )


@machine_code
def _fitted(products, noise, expected, unsure):
    """Shares (n,) by least squares under a variance of `noise`, with a prior that is `unsure` (n,)
    of what is `expected` (n,); their standard deviations (n,); and the mean square that they miss.
    """
    count = expected.size
    # What is seen within the filter's time constant counts once.
    weight = AVERAGE_S / FILTER_S / noise
    # The information beside the unit matrix, and made the unit matrix: the inverse is left.
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
