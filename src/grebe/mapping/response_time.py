"""The time constant of a slow sensor, from the opposing lanes of one survey.

Whether a sensor is slow is a comparison of what its readings are means of. Those of a fast sensor
are of the water at one place, those of a late one of the water some seconds back, and those of a
slow one (`grebe.mapping.slow_sensor`) of the water at all places before, of which a few stand for
equal shares. The covariances of readings are the means of the water's, and their likelihood decides
(Rasmussen and Williams 2006, section 9.8, for integrals of a Gaussian process). Unlike a
delay, a slow response also smooths.

How slow it is follows from the likelihood of the readings themselves. To restore the water is to
multiply them by a triangular matrix. So their density is that of the water it restores, with the
noise that it brings, times the matrix's determinant.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from grebe.mapping.covariance.noise import median_noise_variance
from grebe.mapping.covariance.posterior import Posterior
from grebe.mapping.methods.base import Readings
from grebe.mapping.shared_in_time import fleeting, slow
from grebe.mapping.slow_sensor import Groups, Response, in_order
from grebe.mapping.stamps import usual_step_s
from grebe.mapping.way import earlier

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Delays and time constants to compare [s].
DELAYS_S = (0.0, 2.0, 4.0, 7.0, 10.0, 14.0, 20.0, 30.0)
CONSTANTS_S = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
# Log likelihood that a slow response must add to a sensor that is not slow: at a first look, which
# has fewer readings, and finally.
FIRST_GAIN, CLEAR_GAIN = 2.0, 4.0
# To restore the water by a time constant with a larger relative error than this would not help.
LARGEST_ERROR = 1.0 / 3.0
# Smooth water looks as if a sensor had smoothed it, so the gain must be clear beside either kind.
KINDS = ("exponential", "matern32")
# Groups of readings from which the time constant is estimated, at most, and in how many stretches
# of the record; a group is no longer than this share of the time constant.
GROUPS, STRETCHES, GROUP_SHARE = 360, 4, 0.5
# Where the search for a slow change begins, and that for a wandering sensor: shares of the values'
# variance, and memories as multiples of the expected one.
SLOW_SHARE, WANDER_SHARES, WANDER_MEMORIES = 1e-3, (0.01, 0.1, 1.0), (0.3, 1.0, 3.0)
# Fewer joined groups determine nothing.
FEWEST = 30
# How many usual distances apart two groups are at most.
FAR_STEPS = 1.5
# Steps of the logarithm of the time constant by which its estimate is approached, and their number.
FIRST_STEP, LAST_STEP, MOST_STEPS = 0.4, 0.1, 5
# What a mean of the water over two groups lacks of the water midway, as a share of its variance:
# where the search for it begins.
LACK_SHARE = 0.01


def find_response(readings: Readings, start: Array) -> Response | None:
    """Find the time constant of a slow sensor, from readings with times. `start` (4,): parameters
    of a `Posterior` with one process in time, where the search begins.

    Returns None unless the likelihood clearly favours a slow response over no lag, any delay, and a
    sensor that wanders, and determines its time constant.
    """
    readings = in_order(readings)
    start = np.append(start, np.log(SLOW_SHARE))
    constant, at = _first_look(readings, start)
    if constant is None:
        return None
    constant_s, sd_s = _estimated(readings, constant, at)
    if sd_s > LARGEST_ERROR * constant_s:
        return None
    ages = ages_of(constant_s, CONFIRMED.places)
    gained = max(CONFIRMED.highest(readings, ages, kind, at)[0] for kind in KINDS)
    gain = gained - max(CONFIRMED.highest_fast(readings, kind, start) for kind in KINDS)
    return Response(constant_s=constant_s, sd_s=sd_s, gain=gain) if gain > CLEAR_GAIN else None


def ages_of(constant_s: float, count: int) -> Array:
    """How old the water in a reading of a slow sensor is, (count,) [s]: the mean ages of equal
    shares of it, so that the mean of all is the time constant.
    """
    ends = np.log(count / np.arange(count, 0, -1))
    older = (1.0 + ends) * np.exp(-ends)
    return constant_s * count * -np.diff(older, append=0.0)


def _first_look(readings: Readings, start: Array) -> tuple[float | None, Array]:
    """The best of a few time constants and the parameters there; None if it is hardly better than
    a sensor that is not slow.
    """
    best, constant, best_at = -np.inf, CONSTANTS_S[0], start
    at = start
    for constant_s in CONSTANTS_S:
        ages = ages_of(constant_s, FIRST.places)
        density, at = FIRST.highest(readings, ages, KINDS[0], at)
        if density > best:
            best, constant, best_at = density, constant_s, at
    fast = FIRST.highest_fast(readings, KINDS[0], start)
    return (constant if best > fast + FIRST_GAIN else None), best_at


@dataclass(frozen=True, kw_only=True)
class _Comparison:
    """A comparison of sensors, at `readings` evenly spread ones, by taking each as the mean of
    water at as many `places`.
    """

    readings: int
    places: int

    def highest(
        self, readings: Readings, ages: Array, kind: str, start: Array
    ) -> tuple[float, Array]:
        """The highest log posterior if readings are means of water of these ages (k,) [s], and
        where it is.
        """
        at, values, noise, when, span_s = self._chosen(readings, ages)
        common = (fleeting(when, span_s), slow(when, when, span_s))
        return Posterior.of(at, values, kind, noise, common).highest(start)

    def wandering(self, readings: Readings, kind: str, start: Array) -> float:
        """The highest log posterior of a fast sensor if what all places share may have any memory:
        a wandering sensor is as smooth in time as a slow one.
        """
        at, values, noise, when, span_s = self._chosen(readings, np.zeros(1))
        problem = Posterior.of(at, values, kind, noise, (slow(when, when, span_s),), times=when)
        begins = [
            np.concatenate([start[:3], start[4:], [np.log(share), np.log(memory)]])
            for share in WANDER_SHARES
            for memory in WANDER_MEMORIES
        ]
        return problem.highest(max(begins, key=problem.log_density))[0]

    def _chosen(self, readings: Readings, ages: Array) -> tuple[Array, Array, float, Array, float]:
        """Where the water of these ages was (n, k, 2), the values (n,) that are means of it, their
        noise's variance, when they were read (n,), and the time of all readings [s].
        """
        times = readings.times
        assert times is not None
        most = min(len(times), self.readings)
        chosen = np.unique(np.linspace(0, len(times) - 1, most).astype(np.int64))
        places = [earlier(times, readings.positions, age)[chosen] for age in ages.tolist()]
        noise = median_noise_variance(readings.positions, readings.values)
        at, values = np.stack(places, axis=1), readings.values[chosen]
        return at, values, noise, times[chosen], float(np.ptp(times))

    def highest_fast(self, readings: Readings, kind: str, start: Array) -> float:
        """The highest log posterior of a sensor that is not slow: of any delay, of none, and of one
        that wanders.
        """
        late = [self.highest(readings, np.array([one]), kind, start)[0] for one in DELAYS_S]
        return max(*late, self.wandering(readings, kind, start))


FIRST, CONFIRMED = _Comparison(readings=120, places=5), _Comparison(readings=240, places=8)


def _estimated(readings: Readings, constant_s: float, start: Array) -> tuple[float, float]:
    """The likeliest time constant near a given one, and its standard error [s], which is infinite
    if there is none.
    """
    log_constant = float(np.log(constant_s))
    profiles = [_Profile.of(readings, constant_s, kind) for kind in KINDS]
    if np.sum(profiles[0].groups.joined) < FEWEST:
        return constant_s, np.inf
    profile = max(profiles, key=lambda one: one.at(constant_s, start)[0])
    step = FIRST_STEP
    for _ in range(MOST_STEPS):
        around = np.exp(log_constant + step * np.array([-1.0, 0.0, 1.0])).tolist()
        low, mid, high = (profile.at(one, start)[0] for one in around)
        # The peak of the parabola through the three, if it is near them, or else uphill.
        bend = (2 * mid - low - high) / step**2
        off = (high - low) / (2 * step)
        if bend * 1.5 * step < abs(off):
            log_constant += 1.5 * float(np.copysign(step, off))
            continue
        log_constant += off / bend
        if step <= LAST_STEP:
            return float(np.exp(log_constant)), float(np.exp(log_constant) / np.sqrt(bend))
        step *= 0.5
    return float(np.exp(log_constant)), np.inf


@dataclass(frozen=True, kw_only=True, eq=False)
class _Profile:
    """The likelihood of time constants, from stretches of groups of readings whose noise has the
    variance `noise`.
    """

    groups: Groups
    span_s: float
    noise: float
    kind: str

    @classmethod
    def of(cls, readings: Readings, constant_s: float, kind: str) -> _Profile:
        """The groups are short beside a time constant that is nearly right."""
        times = readings.times
        assert times is not None
        longest = int(GROUP_SHARE * constant_s / usual_step_s(times))
        size = int(np.clip(-(-len(times) // GROUPS), 1, max(longest, 1)))
        return cls(
            groups=_stretches(_steady(Groups.of(readings, size))),
            span_s=float(np.ptp(times)),
            noise=median_noise_variance(readings.positions, readings.values),
            kind=kind,
        )

    def at(self, constant_s: float, start: Array) -> tuple[float, Array]:
        """The highest log posterior with a time constant, and where it is."""
        groups, water = self.groups, self.groups.water(constant_s)
        assert water.times is not None
        lack = LACK_SHARE * float(np.var(water.values))
        common = (
            fleeting(water.times, self.span_s),
            slow(water.times, water.times, self.span_s),
        )
        problem = Posterior.of(water.positions, water.values, self.kind, lack, common)
        known = groups.noise(constant_s, self.noise) / problem.variance
        density, at = replace(problem, known=known).highest(start)
        unit = 0.5 * (len(water) - 1) * float(np.log(problem.variance))
        steps = np.diff(groups.times)[groups.joined]
        return density - unit + float(np.sum(np.log(0.5 + constant_s / steps))), at


def _steady(groups: Groups) -> Groups:
    """Without what lies between two groups much farther apart than usual: its mean is not the water
    midway.
    """
    apart = np.hypot(*np.diff(groups.positions, axis=0).T)
    usual = np.sum(apart, where=groups.joined) / max(np.sum(groups.joined), 1)
    return replace(groups, joined=groups.joined & (apart <= FAR_STEPS * usual))


def _stretches(groups: Groups) -> Groups:
    """Some stretches of the record, evenly spread, if it has too many groups."""
    count = len(groups.values)
    if count <= GROUPS:
        return groups
    size = GROUPS // STRETCHES
    first = np.linspace(0, count - size, STRETCHES).astype(np.int64)
    chosen = (first[:, None] + np.arange(size)).ravel()
    joined = np.append(groups.joined, False)[chosen]
    joined[size - 1 :: size] = False
    return Groups(
        times=groups.times[chosen],
        positions=groups.positions[chosen],
        values=groups.values[chosen],
        counts=groups.counts[chosen],
        joined=joined[:-1],
    )
