"""Correction of the boat's model during a mission, if the data reject it.

The model of Eq. (9) is simulated in short pieces over the last `WINDOW_S`, from measured states
under the thrusts that were sent. A few parameters are fitted to its errors: the share of its order
that each thruster gives, the drag of surge and sway, the inertia and drag of yaw, the delay of
orders (a dead time and a lag), the compass's error, and the weather. They are found by the
Gauss-Newton method with a prior at the model (a maximum a posteriori estimate; Ljung 1999, ch. 7).
A correction is accepted only if it explains the data far better than the model in its best weather.
A boat that behaves as its model is never corrected, and its missions stay as they are.

Motion does not distinguish mass from thrust: a boat that is heavier by some factor is corrected as
one whose thrusters and drag are weaker by it.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from grebe.control.correction import Correction, as_modelled
from grebe.control.misfit import DRIFT_AT, WEATHER_AT, misfit, parameters_of
from grebe.control.motion_record import MotionRecord
from grebe.control.rollout import pieces_ends
from grebe.core.dynamics import CALM, Weather
from grebe.core.motion import parameter_vector
from grebe.core.vessel import Vessel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Length of the data, length of a piece, and interval between two fits [s].
WINDOW_S, PIECE_S, EVERY_S = 40.0, 1.5, 2.0
# Data needed for the first fit [s]; it is short because a boat unlike its model is soon lost.
LEAST_S = 8.0
FEWEST_PIECES = 5
# Standard deviations of a piece's end: position [m], heading [rad], velocities [m/s], yaw rate
# [rad/s].
END_SD = np.array([0.15, 0.15, 0.03, 0.05, 0.05, 0.03])
# Standard deviations of the prior: logarithms of the thrusters' shares, drag of surge and sway,
# inertia and drag of yaw; dead time and lag [s]; compass [rad]; current [m/s]; wind as a share of
# full thrust; rate of change of the current [m/s^2].
PRIOR_SD = np.array([0.4, 0.4, 0.6, 0.6, 0.4, 0.6, 0.6, 0.6, 0.15, 0.3, 0.3, 0.1, 0.1, 0.01, 0.01])
LOW = np.array([-1.4] * 6 + [0.0, 0.0, -0.5, -3.0, -3.0, -0.5, -0.5, -0.05, -0.05])
HIGH = np.array([0.7, 0.7, 1.4, 1.4, 1.4, 1.4, 2.0, 2.5, 0.5, 3.0, 3.0, 0.5, 0.5, 0.05, 0.05])
PROBE = np.array([0.02] * 6 + [0.05, 0.05] + [0.01] * 5 + [0.001] * 2)
COUNT = len(PRIOR_SD)
WEATHER, DRIFT, ALL = slice(WEATHER_AT, COUNT), slice(DRIFT_AT, COUNT), slice(0, COUNT)
# Runge-Kutta steps within the time constant of the boat's fastest motion.
STEPS_PER_RATE = 2.5
ITERATIONS = 6
# Iterations of a search for the weather alone, whose end decides whether the model is rejected. If
# it stops early, a rising current is taken for another boat.
WEATHER_ITERATIONS = 15
# Other dead times to start the search from [s]: the cost of a few turns has several minima.
OTHER_STARTS_S = (0.5, 1.0)
# The boat's parameters must explain this much more than weather alone: in halves of chi squared,
# and as a share of all that weather leaves unexplained.
LEAST_GAIN, LEAST_SHARE = 25.0, 0.35
# Largest ratio of the unexplained to the expected variance. If neither boat nor weather explains
# the motion, as in weeds or on a tow, the fitted parameters are meaningless.
MOST_LEFT = 4.0


Found = tuple[Correction, Weather]


def fitting(
    model: Vessel, record: MotionRecord, followed: Correction, weather: Weather = CALM
) -> Generator[None, None, Found | None]:
    """Find the correction that the data require, and the weather with it.

    Returns None if the model, or the correction followed so far, explains the data well enough.
    The search starts from `weather`. It is a generator, so that a boat's small computer is never
    busy for long: it yields after every simulation of the model and returns the result.
    """
    modelled = as_modelled(model)
    start = _in_weather(model, modelled, weather)
    problem = _Problem.of(model, record)
    # Noise lowers the weight of errors, so this is their largest possible cost.
    if problem is None or problem.cost(start) < LEAST_GAIN:
        return None
    problem = replace(problem, about=start)
    plain, plain_cost = yield from problem.solve(start, WEATHER, enough=LEAST_GAIN)
    if plain_cost >= LEAST_GAIN:
        # The effect of noise on a piece depends on the weather, which is better known now.
        problem = replace(problem, about=plain)
        plain, plain_cost = yield from problem.solve(plain, WEATHER, enough=LEAST_GAIN)
    if plain_cost < LEAST_GAIN:
        return None
    best, cost, kept_cost = plain, plain_cost, plain_cost
    if followed == modelled:
        starts = [(plain, dead_s) for dead_s in (0.0, *OTHER_STARTS_S)]
    else:
        start = _in_weather(model, followed, weather)
        kept, kept_cost = yield from problem.solve(start, WEATHER, enough=LEAST_GAIN)
        if kept_cost < LEAST_GAIN:
            return None
        starts = [(kept, followed.dead_s)]
    for begin, dead_s in starts:
        numbers, new_cost = yield from problem.solve(_with_dead_time(begin, dead_s), ALL)
        if new_cost < cost:
            best, cost = numbers, new_cost
        if problem.is_better(plain_cost, cost):
            break
    if problem.is_better(plain_cost, cost) and problem.is_better(kept_cost, cost):
        return Correction.of(best), _weather(model, best)
    # The correction followed so far is worse than no correction at all.
    return (modelled, _weather(model, plain)) if kept_cost > plain_cost else None


def fitted(model: Vessel, record: MotionRecord, followed: Correction | None = None) -> Found | None:
    """Find the correction at once; see `fitting`."""
    work = fitting(model, record, followed or as_modelled(model))
    while True:
        try:
            next(work)
        except StopIteration as done:
            return done.value


@dataclass(frozen=True, kw_only=True)
class _Problem:
    """The fit to the pieces `first` to `last` of the data.

    `about`: the parameters for which the noise of estimates is propagated through the pieces; None
    to ignore noise.
    """

    model: Vessel
    record: MotionRecord
    first: NDArray[np.int64]
    last: NDArray[np.int64]
    about: Array | None = None
    thrust_cache: dict[tuple[float, float], Array] = field(default_factory=dict)

    @classmethod
    def of(cls, model: Vessel, record: MotionRecord) -> _Problem | None:
        """Cut the data into pieces; None if there are too few."""
        edges = np.arange(record.times[0], record.times[-1], PIECE_S)
        cuts = np.unique(np.searchsorted(record.times, edges))
        first, last = cuts[:-1], cuts[1:]
        whole = record.times[last] - record.times[first] < 2 * PIECE_S
        if whole.sum() < FEWEST_PIECES:
            return None
        return cls(model=model, record=record, first=first[whole], last=last[whole])

    def is_better(self, plain_cost: float, cost: float) -> bool:
        """Whether a boat unlike its model explains far more than weather alone does.

        The threshold is scaled by the remaining variance if the data are noisier than assumed.
        """
        unit = 2 * cost / max(1, 6 * len(self.first) - COUNT)
        if unit > MOST_LEFT:
            return False
        least = LEAST_GAIN * max(1.0, unit) * self.noise_factor
        return plain_cost - cost > max(least, LEAST_SHARE * plain_cost)

    @cached_property
    def boat(self) -> Array:
        """The model's parameters in the equations of motion, without weather."""
        return parameter_vector(self.model, np.zeros(0))

    @cached_property
    def units(self) -> Array:
        """Units of the weather parameters: currents [m/s], and full thrust [N]."""
        full = 2 * self.model.thrust_max_n
        return np.array([1.0, 1.0, full, full])

    def _thrusts(self, numbers: Array) -> Array:
        """Mean thrusts between states, cached because most parameters do not change the delays."""
        dead_s, lag_s = numbers[6:8].tolist()
        if (dead_s, lag_s) not in self.thrust_cache:
            self.thrust_cache.clear()
            self.thrust_cache[dead_s, lag_s] = self.record.thrusts(dead_s, lag_s)
        return self.thrust_cache[dead_s, lag_s]

    @cached_property
    def per_second(self) -> float:
        """Least number of Runge-Kutta steps a second."""
        return STEPS_PER_RATE * self.model.fastest_rate_hz

    @cached_property
    def prior_mean(self) -> Array:
        """Parameters of a boat that behaves as its model: the prior's mean."""
        return _numbers(as_modelled(self.model))

    @cached_property
    def end_covariances(self) -> Array:
        """Covariances of the errors at the pieces' ends, (pieces, 6, 6).

        They are made of `END_SD`, the noise of estimates at a piece's end, and that at its
        beginning, propagated by the motion. The least sway through the water turns a fast hull,
        Eq. (9): an error of 2 cm/s in it becomes one of some degrees at the end, with errors of yaw
        rate and position.
        """
        count = (len(self.first), 1, 1)
        if self.about is None:
            return np.tile(np.diag(END_SD**2), count)
        states, noise = self.record.states, self.record.noise_sd
        plain = self._ends(self.about, states)
        covariances = np.tile(np.diag(END_SD**2 + noise**2), count)
        for i in range(6):
            moved = states.copy()
            moved[:, i] += noise[i]
            off = self._ends(self.about, moved) - plain
            covariances += off[:, :, None] * off[:, None, :]
        return covariances

    @cached_property
    def whiteners(self) -> Array:
        """Lower triangles (pieces, 6, 6) that make the six errors of a piece independent."""
        whole = np.linalg.inv(np.linalg.cholesky(self.end_covariances))
        return whole.astype(np.float64, copy=False)

    @cached_property
    def noise_factor(self) -> float:
        """Factor on the gain that a correction needs if estimates are noisy; 1 without noise.

        The helm responds to their errors, and the boat then looks like one with other parameters.
        """
        variances = np.diagonal(self.end_covariances, axis1=1, axis2=2)
        return math.sqrt(float(np.mean(variances / END_SD**2)))

    def residuals(self, numbers: Array) -> Array:
        """Errors at the pieces' ends in standard deviations, then the deviations from the prior."""
        return misfit(
            numbers, self.prior_mean, PRIOR_SD, self.boat, self.units, self.record.times,
            self.record.states, self._thrusts(numbers), self.first, self.last, self.per_second,
            self.whiteners,
        )  # fmt: skip

    def cost(self, numbers: Array) -> float:
        """Cost of some parameters."""
        return _cost(self.residuals(numbers))

    def _ends(self, numbers: Array, states: Array) -> Array:
        """Ends (pieces, 6) of the pieces that begin at some states."""
        return pieces_ends(
            parameters_of(numbers, self.boat, self.units), numbers[DRIFT], self.record.times,
            states, self._thrusts(numbers), np.exp(numbers[:2]), self.first, self.last,
            self.per_second,
        )  # fmt: skip

    def solve(
        self, start: Array, free: slice, enough: float = 0.0
    ) -> Generator[None, None, tuple[Array, float]]:
        """Gauss-Newton from `start` with some parameters free; returns the best and their cost.

        The search ends at a cost below `enough`.
        """
        numbers = np.clip(start, LOW, HIGH)
        residuals = self.residuals(numbers)
        cost, damping = _cost(residuals), 1e-2
        which = np.arange(COUNT)[free]
        for _ in range(WEATHER_ITERATIONS if free is WEATHER else ITERATIONS):
            if cost < enough:
                break
            jacobian = yield from self._jacobian(numbers, residuals, which)
            candidate = numbers.copy()
            candidate[which] += _step(jacobian, residuals, numbers[which], damping, which)
            candidate = np.clip(candidate, LOW, HIGH)
            new_residuals = self.residuals(candidate)
            yield
            new_cost = _cost(new_residuals)
            if not new_cost < cost:
                damping *= 10
                continue
            done = cost - new_cost < 1e-3 * cost
            numbers, residuals, cost = candidate, new_residuals, new_cost
            damping = max(damping / 10, 1e-6)
            if done:
                break
        return numbers, cost

    def _jacobian(
        self, numbers: Array, residuals: Array, which: NDArray[np.int64]
    ) -> Generator[None, None, Array]:
        jacobian = np.empty((len(residuals), len(which)))
        for column, i in enumerate(which):
            moved = numbers.copy()
            probe = PROBE[i] if numbers[i] + PROBE[i] <= HIGH[i] else -PROBE[i]
            moved[i] += probe
            jacobian[:, column] = (self.residuals(moved) - residuals) / probe
            yield
        return jacobian


def _cost(residuals: Array) -> float:
    """Half the sum of the squared residuals."""
    return 0.5 * float(residuals @ residuals)


def _step(
    jacobian: Array, residuals: Array, numbers: Array, damping: float, which: NDArray[np.int64]
) -> Array:
    """A damped Gauss-Newton step (k,) of some parameters (k,), `which` of all.

    A parameter that would leave its bound stays there, and the others step without it: a lag and a
    dead time look alike if both are short, and neither can be negative.
    """
    normal, downhill = jacobian.T @ jacobian, -jacobian.T @ residuals
    normal = normal + damping * np.diag(np.diag(normal) + 1e-9)
    moves = np.ones(len(numbers), dtype=bool)
    step = np.zeros(len(numbers))
    while moves.any():
        step[:] = 0.0
        step[moves] = np.linalg.solve(normal[np.ix_(moves, moves)], downhill[moves])
        low, high = numbers <= LOW[which], numbers >= HIGH[which]
        beyond = moves & ((low & (step < 0)) | (high & (step > 0)))
        if not beyond.any():
            break
        moves &= ~beyond
    return step


def _with_dead_time(numbers: Array, dead_s: float) -> Array:
    out = numbers.copy()
    out[6] = dead_s
    return out


def _numbers(correction: Correction) -> Array:
    """All parameters (15,) of a boat without weather."""
    return np.concatenate([correction.numbers, np.zeros(COUNT - len(correction.numbers))])


def _in_weather(model: Vessel, correction: Correction, weather: Weather) -> Array:
    """All parameters of a boat in constant weather."""
    numbers = _numbers(correction)
    north, east, force_north, force_east = weather.as_tuple()
    full = 2 * model.thrust_max_n
    numbers[9:13] = north, east, force_north / full, force_east / full
    return numbers


def _weather(model: Vessel, numbers: Array) -> Weather:
    north, east, force_north, force_east = numbers[9:13].tolist()
    full = 2 * model.thrust_max_n
    return Weather(
        current_north_mps=north,
        current_east_mps=east,
        wind_force_north_n=full * force_north,
        wind_force_east_n=full * force_east,
    )
