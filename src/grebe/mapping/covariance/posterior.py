"""The most probable covariance, under priors that keep it to what a track can determine.

Maximum likelihood alone fails on a track in narrow water. The range grows to many times the water's
width, because a trend and a long range look alike there, and a smooth covariance then overshoots in
gaps. Structure of a few metres is taken for noise. So range and standard deviation have the
penalised-complexity prior of Fuglstad et al. (2019, theorem 2.6, two dimensions), which penalises
short ranges and large standard deviations. The noise has a prior from the second differences of
successive samples at one place, by their median, which outliers do not affect.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import get_lapack_funcs
from scipy.optimize import minimize
from scipy.spatial.distance import cdist

from grebe.mapping.covariance.correlation import (
    lower_covariance,
    lower_covariance_of_means,
    lower_slopes,
    lower_slopes_of_means,
)
from grebe.mapping.covariance.likelihood import CLEAR_GAIN
from grebe.mapping.covariance.models import KINDS, PRACTICAL_RANGE, CovarianceModel, Fleeting
from grebe.mapping.covariance.noise import median_noise_variance
from grebe.mapping.covariance.variogram import Estimator, VariogramFit, fit_variogram

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# The cost of a factorisation grows with the cube of the samples; more than these are thinned.
MOST_SAMPLES = 350
# The prior: a range below this share of the extent, at most this many metres, has the probability
# `UNLIKELY`; so has a standard deviation above this many of the values' own.
SHORT_SHARE, SHORT_M, UNLIKELY, LARGE_SDS = 0.05, 5.0, 0.05, 2.0
# Standard deviation of the logarithm of the noise that second differences give.
NOISE_LOG_SD = 0.5
# Bounds of the search, as shares of the extent and of the values' variance. Within the samples'
# extent, a longer range with a larger sill is the same field: `LONGEST` is the practical range.
LEAST_RANGE, LONGEST = 1e-3, 0.8
SILL_BOUNDS, NOISE_BOUNDS, SHARE_BOUNDS = (1e-4, 1e2), (1e-8, 2.0), (1e-8, 1e2)
# How long two passes remember their difference: as a share of the time of all values, the standard
# deviation of its logarithm, and the bounds of the search as multiples of that time.
MEMORY_SHARE, MEMORY_LOG_SD, MEMORY_BOUNDS = 0.05, 1.0, (0.02, 50.0)
# The step for a derivative of the slope; the density if a matrix is not a covariance.
STEP, IMPOSSIBLE = 1e-2, -1e300
# Added to the diagonal, as a share of the sill: keeps a smooth covariance positive definite.
JITTER = 1e-9


def fit_posterior(
    positions: Array, values: Array, estimator: Estimator = "matheron", *, kind: str = "exponential"
) -> VariogramFit:
    """Fit a covariance of one kind by its posterior mode, with a direction if that is clear.

    Raises `ValueError` if there are too few pairs or the values do not vary.
    """
    if np.ptp(values) == 0:
        raise ValueError("the values do not vary")
    start = fit_variogram(positions, values, estimator)
    chosen = thinned(len(values))
    noise = median_noise_variance(positions, values)
    at, data = positions[chosen], values[chosen]
    problem = Posterior.of(at, data, kind, noise)
    gained, model, errors = problem.best(start.model)
    reason = f"{kind} by the posterior mode under priors of range, standard deviation and noise"
    if start.model.ratio < 1:
        shape = {"ratio": start.model.ratio, "angle_deg": start.model.angle_deg}
        directed = replace(start.model, kind=kind, **shape)
        turned = Posterior.of(directed.isotropic(at), data, kind, noise).best(directed)
        if turned[0] > gained + CLEAR_GAIN:
            reason += f"; its direction adds {turned[0] - gained:.1f} to the log posterior"
            model, errors = replace(turned[1], **shape), turned[2]
    return VariogramFit(
        model=model,
        empirical=start.empirical,
        candidates=(model,),
        standard_errors=errors,
        reason=reason,
    )


fit_rough = partial(fit_posterior, kind="exponential")
fit_smooth = partial(fit_posterior, kind="matern32")


def thinned(count: int, most: int = MOST_SAMPLES) -> NDArray[np.int64]:
    """Indices of pairs of neighbours along the track, evenly spread: near pairs show the noise."""
    if count <= most:
        return np.arange(count)
    first = np.linspace(0, count - 2, most // 2).astype(np.int64)
    return np.unique(np.concatenate([first, first + 1]))


@dataclass(frozen=True, kw_only=True, eq=False)
class Posterior:
    """Log posterior of (log range / extent, log sill / variance, log noise / variance), the mean
    integrated out. `values` (n,) have mean 0 and variance 1; `noise` is the variance of their
    noise.

    `common`, (n, n) each, are correlations of processes in time that all places share. Each adds a
    parameter, the logarithm of its variance over that of the values; the last one may be left out.
    With `apart_s` (n, n), the time between any two values, there is also a fleeting process. It
    adds two parameters: the logarithms of its variance over that of the values and of its memory
    over `memory_s`.

    If each value is the mean of the signal over `places` > 1 places, `distance` (n places,
    n places) is that of all of these, value by value; there is then no fleeting process. `known`
    (n, n) is the covariance of errors that are known, over the variance of the values.
    """

    distance: Array
    values: Array
    extent_m: float
    variance: float
    kind: str
    noise: float
    common: tuple[Array, ...] = ()
    apart_s: Array | None = None
    memory_s: float = 1.0
    places: int = 1
    known: Array | None = None

    @classmethod
    def of(
        cls,
        positions: Array,
        values: Array,
        kind: str,
        noise: float,
        common: tuple[Array, ...] = (),
        times: Array | None = None,
    ) -> Posterior:
        """The problem for values (n,) at positions (n, 2) with noise of variance `noise`; with
        `times` (n,), it includes a fleeting process. Of positions (n, k, 2), each value is a mean.
        """
        at = positions.reshape(-1, 2)
        distance = cdist(at, at)
        variance = float(np.var(values))
        return cls(
            distance=distance,
            values=(values - values.mean()) / np.sqrt(variance),
            extent_m=float(distance.max()),
            variance=variance,
            kind=kind,
            noise=min(max(noise / variance, NOISE_BOUNDS[0]), NOISE_BOUNDS[1]),
            common=common,
            apart_s=None if times is None else np.abs(times[:, None] - times[None, :]),
            memory_s=1.0 if times is None else MEMORY_SHARE * float(np.ptp(times)),
            places=len(at) // len(values),
        )

    def best(self, start: CovarianceModel) -> tuple[float, CovarianceModel, dict[str, float]]:
        """The highest log posterior, its model, and standard errors from its curvature."""
        density, at = self.highest_near(start)
        model = self.model(at)
        return density, model, self.standard_errors(model, at)

    def highest_near(self, start: CovarianceModel) -> tuple[float, Array]:
        """The highest log posterior, searched from a variogram's model, and where it is."""
        sill = max(start.sill / self.variance, 0.3)
        return self.highest(np.log([min(start.range_m / self.extent_m, 0.5), sill, self.noise]))

    def model(self, at: Array) -> CovarianceModel:
        """The covariance of place given by the first three parameters."""
        share, sill, noise = np.exp(at[:3]).tolist()
        return CovarianceModel(
            kind=self.kind,
            sill=sill * self.variance,
            range_m=share * self.extent_m,
            nugget=noise * self.variance,
        )

    def fleeting(self, at: Array) -> Fleeting:
        """The fleeting process given by the last two parameters."""
        return Fleeting(
            variance=float(np.exp(at[-2])) * self.variance,
            memory_s=float(np.exp(at[-1])) * self.memory_s,
        )

    def highest(self, start: Array) -> tuple[float, Array]:
        """The highest log posterior found from a start, and where it is."""
        ranges = (LEAST_RANGE, LONGEST / PRACTICAL_RANGE[self.kind])
        fleeting = [] if self.apart_s is None else [SHARE_BOUNDS, MEMORY_BOUNDS]
        shares = [SHARE_BOUNDS] * (len(start) - 3 - len(fleeting))
        bounds = np.log([ranges, SILL_BOUNDS, NOISE_BOUNDS, *shares, *fleeting])
        inside = np.clip(start, *(bounds.T + np.array([[0.1], [-0.1]])))

        def lost(at: Array) -> tuple[float, Array]:
            density, slope = self.density_and_slope(at)
            return -density, -slope

        found = minimize(
            lost, inside, jac=True, method="L-BFGS-B", bounds=bounds,
            options={"maxiter": 60, "ftol": 1e-7, "gtol": 1e-3},
        )  # fmt: skip
        return -float(found.fun), np.asarray(found.x)

    def density_and_slope(self, at: Array) -> tuple[float, Array]:
        """Log posterior, up to a constant, and its derivatives by `at`."""
        white = self._whitened(self.covariance(at))
        if white is None:
            return IMPOSSIBLE, np.zeros(len(at))
        by_one, rest = white.backward(np.stack([white.ones, white.rest]))
        by_one = by_one / np.sqrt(float(white.ones @ white.ones))
        inverse = white.inverse()
        # The noise's derivative is a multiple of the unit matrix.
        of_noise = float(np.exp(at[2])) * float(rest @ rest + by_one @ by_one - np.trace(inverse))
        reach, sill, *fleeting = self._slopes(at, inverse.T, rest, by_one)
        shares = [
            float(np.exp(log_share))
            * (float(rest @ one @ rest + by_one @ one @ by_one) - _product(inverse, one))
            for log_share, one in zip(at[3:].tolist(), self.common, strict=False)
        ]
        last = [] if self.apart_s is None else fleeting
        prior, prior_slope = self._prior(at)
        all_slopes = 0.5 * np.array([reach, sill, of_noise, *shares, *last])
        return white.log_likelihood + prior, all_slopes + prior_slope

    def log_density(self, at: Array) -> float:
        """Log posterior, up to a constant."""
        return self.log_likelihood(at) + self._prior(at)[0]

    def covariance(self, at: Array) -> Array:
        """Covariance (n, n) of the values, on and below the diagonal; entries above it have
        no meaning, but are finite.
        """
        if self.places > 1:
            matrix = lower_covariance_of_means(*self._of_place(at), self.places)
        else:
            matrix = lower_covariance(*self._of_place_and_time(at))
        for log_share, common in zip(at[3:].tolist(), self.common, strict=False):
            matrix += np.exp(log_share) * common
        matrix[np.diag_indices(len(matrix))] += np.exp(at[2])
        if self.known is not None:
            matrix += self.known
        return matrix

    def _slopes(self, at: Array, inverse: Array, rest: Array, by_one: Array) -> list[float]:
        """The sums of `lower_slopes`, or of `lower_slopes_of_means`."""
        if self.places > 1:
            of_place = self._of_place(at)
            return lower_slopes_of_means(*of_place, self.places, inverse, rest, by_one).tolist()
        return lower_slopes(*self._of_place_and_time(at), inverse, rest, by_one).tolist()

    def _of_place(self, at: Array) -> tuple[int, float, float, float, Array]:
        """The first arguments of `lower_covariance` and `lower_slopes` for these parameters."""
        share, sill = np.exp(at[:2]).tolist()
        return KINDS.index(self.kind), sill, share * self.extent_m, JITTER, self.distance

    def _of_place_and_time(
        self, at: Array
    ) -> tuple[int, float, float, float, Array, float, float, Array]:
        """All their arguments, with the fleeting process, if there is one."""
        place = self._of_place(at)
        if self.apart_s is None:
            return *place, 0.0, 1.0, np.empty((0, 0))
        passing, memory = np.exp(at[-2:]).tolist()
        return *place, passing, memory * self.memory_s, self.apart_s

    def log_likelihood(self, at: Array) -> float:
        """Restricted log likelihood, up to a constant."""
        white = self._whitened(self.covariance(at))
        return IMPOSSIBLE if white is None else white.log_likelihood

    def _whitened(self, matrix: Array) -> _Whitened | None:
        """The values whitened by a covariance, which is overwritten; None if it is not positive
        definite.
        """
        (factorise,) = get_lapack_funcs(("potrf",), (matrix,))
        # LAPACK stores by columns, so the transpose of a symmetric matrix needs no copy.
        upper, failed = factorise(matrix.T, lower=0, overwrite_a=1, clean=1)
        if failed:
            return None
        both = np.stack([np.ones(len(self.values)), self.values])
        ones, values = _forward(upper, both)
        rest = values - float(ones @ values) / float(ones @ ones) * ones
        return _Whitened(upper=upper, ones=ones, rest=rest)

    def _prior(self, at: Array) -> tuple[float, Array]:
        """Log prior and its derivatives: of log range and log standard deviation (penalised
        complexity), of log noise, of the standard deviations of changes, and of the memory.
        """
        share, sd = float(np.exp(at[0])), float(np.exp(0.5 * at[1]))
        rate = -np.log(UNLIKELY)
        short = rate * min(SHORT_SHARE, SHORT_M / self.extent_m) / share
        off = 0.5 * (at[2] - np.log(self.noise)) / NOISE_LOG_SD
        large = rate / LARGE_SDS * sd
        density = -at[0] - short + 0.5 * at[1] - large - 0.5 * off**2
        slope = [short - 1.0, 0.5 * (1.0 - large), -0.5 * off / NOISE_LOG_SD]
        sds = rate * np.exp(0.5 * at[3 : 3 + len(self.common)])
        density -= sds.sum()
        slope += (-0.5 * sds).tolist()
        if self.apart_s is not None:
            of_passes, memory = rate * float(np.exp(0.5 * at[-2])), float(at[-1]) / MEMORY_LOG_SD
            density += 0.5 * at[-2] - of_passes - 0.5 * memory**2
            slope += [0.5 * (1.0 - of_passes), -memory / MEMORY_LOG_SD]
        return float(density), np.array(slope)

    def standard_errors(self, model: CovarianceModel, at: Array) -> dict[str, float]:
        """Standard errors of nugget, sill and range_m, from the log posterior's curvature."""
        steps = STEP * np.eye(len(at))
        hessian = np.array(
            [
                (self.density_and_slope(at - one)[1] - self.density_and_slope(at + one)[1])
                / (2 * STEP)
                for one in steps
            ]
        )
        with np.errstate(invalid="ignore"):
            spread = np.sqrt(np.diag(np.linalg.pinv(0.5 * (hessian + hessian.T))))
        return {
            "nugget": float(model.nugget * spread[2]),
            "sill": float(model.sill * spread[1]),
            "range_m": float(model.range_m * spread[0]),
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class _Whitened:
    """Ones (n,) and the values less their mean (n,), both whitened by the Cholesky factor `upper`
    (n, n) of a covariance.
    """

    upper: Array
    ones: Array
    rest: Array

    @property
    def log_likelihood(self) -> float:
        """Restricted log likelihood, up to a constant."""
        log_det = 2 * float(np.sum(np.log(np.diag(self.upper))))
        information = float(self.ones @ self.ones)
        return float(-0.5 * (float(self.rest @ self.rest) + log_det + np.log(information)))

    def backward(self, rows: Array) -> Array:
        """Multiply rows (k, n), given whitened, by the covariance's inverse, (k, n)."""
        (solve,) = get_lapack_funcs(("trtrs",), (self.upper,))
        return solve(self.upper, rows.T, lower=0)[0].T

    def inverse(self) -> Array:
        """The inverse of the covariance, on and above the diagonal; entries below are undefined."""
        (invert,) = get_lapack_funcs(("potri",), (self.upper,))
        return invert(self.upper, lower=0)[0]


def _forward(upper: Array, rows: Array) -> Array:
    """Whiten rows (k, n) by a covariance's factor, (k, n)."""
    (solve,) = get_lapack_funcs(("trtrs",), (upper,))
    return solve(upper, rows.T, lower=0, trans=1)[0].T


def _product(upper: Array, other: Array) -> float:
    """The sum of the products of two symmetric matrices' elements, where the first is given on and
    above its diagonal only.
    """
    whole = 2 * np.vdot(upper.T, other)
    return float(whole - np.diag(upper) @ np.diag(other))
