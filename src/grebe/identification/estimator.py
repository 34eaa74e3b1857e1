"""Gauss-Newton on a drive in pieces: theta (p,) of the boat and the day, and each piece's start.

The cost has two terms. The first is Huber's loss, against occasional glitches, of the prediction's
errors in units of each channel's standard deviation, which is estimated too. The second is the
squared distance from the preset, in standard deviations of the prior:

    sum_i rho((y_i - h_i(theta, x_s)) / sigma_c) + sum_j ((theta_j - theta_0j) / prior_j)^2

The start x_s of a piece affects only its own piece, so the starts are eliminated from each step
(Schur complement). The damping is Levenberg's and Marquardt's. Source: Ljung, System
Identification (1999), chapters 7 and 9; Bock's multiple shooting.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.identification.drive_log import DriveLog
from grebe.identification.parameters import Candidate, Model
from grebe.identification.prediction import predict
from grebe.identification.segments import Segments, smoothed_states

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# First guess of the noise of (north, east, heading, surge, sway, yaw rate), and its lower limit.
FIRST_NOISE = np.array([0.5, 0.5, 0.05, 0.1, 0.1, 0.05])
LEAST_NOISE = np.array([1e-3, 1e-3, 2e-4, 1e-3, 1e-3, 5e-4])
# Prior standard deviations of a piece's start about the smoothed state.
START_SD = np.array([30.0, 30.0, 1.0, 1.0, 1.0, 1.0])
HUBER = 3.0
STEPS_AT_MOST = 40
# The rounds of a descent: the share of each piece that is used, from its beginning, and the share
# of the cost that a step must gain to be followed by another. The noise is estimated again after
# each round. A boat may be unstable in yaw, and a small error of the start is then large after ten
# seconds; so the first rounds use only the beginnings.
ROUNDS = ((0.25, 1e-3), (0.5, 1e-3), (1.0, 1e-3), (1.0, 1e-5))
PROBE = 1e-5


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Result of a descent.

    `theta` (p,), `starts` (s, 6), `noise` (6,) the channels' standard deviations, `residuals`
    (n, 6) measured less predicted, NaN where nothing was measured; `cost` as above.
    `information` (6, p, p) is that of each channel on theta, with the starts estimated too.
    """

    model: Model
    theta: Array
    starts: Array
    noise: Array
    residuals: Array
    information: Array
    cost: float


@dataclass(frozen=True, kw_only=True)
class _Point:
    """An iterate of the descent, with its residuals (n, 6) and its cost."""

    theta: Array
    starts: Array
    residuals: Array
    cost: float


class Descent:
    """Estimates theta from some pieces of a log whose commands are throttles."""

    def __init__(self, log: DriveLog, segments: Segments, model: Model) -> None:
        self._log = log
        self._whole = segments
        self._model = model
        self._smoothed = smoothed_states(log, segments.begins)
        self._noise = FIRST_NOISE
        self._look_at(1.0)

    def _look_at(self, share: float) -> None:
        """Use the first `share` of every piece from now on."""
        self._segments = some = self._whole.first(share)
        self._measured = self._log.states[some.rows]
        # Rows of the log are in order, so those of a piece are contiguous.
        self._slices = np.searchsorted(some.piece, np.arange(len(some.used) + 1))

    def run(self, theta: Array | None = None, like: Fit | None = None) -> Fit:
        """Descend from `theta` (None: the preset's), and estimate the noise on the way.

        `like` is an earlier fit of a similar model; if it has the same pieces, its starts are used.
        """
        self._noise = FIRST_NOISE if like is None else like.noise
        theta, starts = self._model.start if theta is None else theta, self._smoothed
        rounds = ROUNDS
        if like is not None and like.starts.shape == starts.shape:
            starts, rounds = like.starts, ROUNDS[-1:]
        for i, (share, enough) in enumerate(rounds):
            self._look_at(share)
            point = self._descend(self._point(theta, starts), enough)
            theta, starts = point.theta, point.starts
            self._noise = self._spread(point.residuals, first=like is None and i == 0)
        point = self._point(theta, starts)
        return Fit(
            model=self._model,
            theta=point.theta,
            starts=point.starts,
            noise=self._noise,
            residuals=point.residuals,
            information=self._information(point),
            cost=point.cost,
        )

    def _point(self, theta: Array, starts: Array) -> _Point:
        predicted = self._predict([self._model.candidate(theta)], starts[None])[0]
        residuals = self._apart(predicted)
        scaled = np.nan_to_num(residuals / self._noise)
        away = (theta - self._model.start) / self._model.prior_sd
        off = (starts - self._smoothed) / START_SD
        with np.errstate(over="ignore", invalid="ignore"):
            cost = float(np.sum(_losses(scaled)) + away @ away + np.sum(off**2))
        finite = np.isfinite(predicted[np.isfinite(self._measured)]).all()
        return _Point(
            theta=theta, starts=starts, residuals=residuals, cost=cost if finite else np.inf
        )

    def _predict(self, candidates: list[Candidate], starts: Array) -> Array:
        return predict(self._log, self._segments, candidates, starts)

    def _apart(self, predicted: Array) -> Array:
        apart = self._measured - predicted
        apart[:, 2] = np.remainder(apart[:, 2] + np.pi, 2 * np.pi) - np.pi
        return apart

    def _descend(self, point: _Point, enough: float) -> _Point:
        damping = 1e-3
        for _ in range(STEPS_AT_MOST):
            of_theta, of_starts = self._jacobians(point)
            while True:
                new = self._stepped(point, of_theta, of_starts, damping)
                if new.cost < point.cost:
                    break
                damping *= 8.0
                # A Gauss-Newton step that gains nothing shows that there is nothing left to gain.
                if new.cost - point.cost < enough * point.cost or damping > 1e6:
                    return point
            gained = point.cost - new.cost
            point, damping = new, max(damping / 8.0, 1e-9)
            if gained < enough * point.cost:
                return point
        return point

    def _jacobians(self, point: _Point) -> tuple[Array, Array]:
        """Derivatives of the predictions, (n, 6, p) in theta and (n, 6, 6) in the starts."""
        theta, starts = point.theta, point.starts
        p, count = len(theta), 1 + len(theta) + 6
        probes = np.where([one.log for one in self._model.parameters], PROBE, PROBE * 10)
        thetas = np.tile(theta, (count, 1))
        thetas[1 + np.arange(p), np.arange(p)] += probes
        places = np.tile(starts, (count, 1, 1))
        places[1 + p + np.arange(6), :, np.arange(6)] += PROBE
        predicted = self._predict([self._model.candidate(t) for t in thetas], places)
        moved = np.moveaxis(predicted[1:] - predicted[0], 0, -1)
        return moved[..., :p] / probes, moved[..., p:] / PROBE

    def _stepped(self, point: _Point, of_theta: Array, of_starts: Array, damping: float) -> _Point:
        theta, starts = point.theta, point.starts
        free = self._free(point, of_theta)
        hessian = np.diag(1.0 / self._model.prior_sd**2)
        gradient = (self._model.start - theta) / self._model.prior_sd**2
        pieces = list(self._pieces(point, of_theta, of_starts))
        ways: list[tuple[Array, Array]] = []
        for i, (a, b, r) in enumerate(pieces):
            own = b.T @ b + np.diag(1.0 / START_SD**2)
            own += damping * np.diag(np.diag(own))
            pull = b.T @ r + (self._smoothed[i] - starts[i]) / START_SD**2
            both = np.column_stack([b.T @ a, pull])
            back: Array = np.linalg.solve(own, both).astype(np.float64)
            ways.append((back[:, -1], back[:, :-1]))
            hessian = hessian + a.T @ a - (a.T @ b) @ back[:, :-1]
            gradient = gradient + a.T @ r - (a.T @ b) @ back[:, -1]
        hessian = hessian + damping * np.diag(np.diag(hessian))
        change = np.zeros(len(theta))
        change[free] = np.linalg.solve(hessian[np.ix_(free, free)], gradient[free])
        change = self._model.clipped(theta + change) - theta
        moved = np.array([straight - slope @ change for straight, slope in ways])
        return self._point(theta + change, starts + moved)

    def _free(self, point: _Point, of_theta: Array) -> NDArray[np.bool_]:
        """Mask (p,) of the coordinates that no pull holds at a bound."""
        scaled = np.nan_to_num(point.residuals / self._noise)
        pull = np.einsum("ncp,nc->p", of_theta / self._noise[:, None], _weights(scaled) * scaled)
        outwards = self._model.clipped(point.theta + 1e-9 * np.sign(pull)) == point.theta
        return ~(outwards & (pull != 0))

    def _pieces(
        self, point: _Point, of_theta: Array, of_starts: Array
    ) -> list[tuple[Array, Array, Array]]:
        """Scaled slopes (rows, p), (rows, 6) and residuals (rows,) of each piece."""
        scaled = point.residuals / self._noise
        known = np.isfinite(scaled)
        scaled = np.nan_to_num(scaled)
        root = np.where(known, np.sqrt(_weights(scaled)), 0.0)
        share = (root / self._noise)[..., None]
        a, b, r = of_theta * share, of_starts * share, scaled * root
        p = a.shape[-1]
        return [
            (a[i:j].reshape(-1, p), b[i:j].reshape(-1, 6), r[i:j].reshape(-1))
            for i, j in zip(self._slices[:-1], self._slices[1:], strict=True)
        ]

    def _spread(self, residuals: Array, *, first: bool) -> Array:
        """Standard deviations (6,) of the channels' errors, with glitches clipped.

        At `first`, large errors may be the model's, and are not clipped.
        """
        out = self._noise.copy()
        for channel in range(6):
            errors = residuals[np.isfinite(residuals[:, channel]), channel]
            if len(errors) == 0:
                continue
            middle = 1.4826 * float(np.median(np.abs(errors))) + LEAST_NOISE[channel]
            bound = np.inf if first else HUBER * middle
            bounded = np.clip(errors, -bound, bound)
            # Each piece's start takes one degree of freedom from each channel.
            left = max(len(errors) - len(self._segments.used), 1)
            out[channel] = max(float(np.sqrt(np.sum(bounded**2) / left)), LEAST_NOISE[channel])
        return out

    def _information(self, point: _Point) -> Array:
        """Information (6, p, p) of each channel on theta, with the starts estimated from all."""
        apart = self._point(self._model.with_distinct_lag(point.theta), point.starts)
        of_theta, of_starts = self._jacobians(apart)
        p = len(point.theta)
        out = np.zeros((6, p, p))
        for a, b, _ in self._pieces(point, of_theta, of_starts):
            own = b.T @ b + np.diag(1.0 / START_SD**2)
            left = (a - b @ np.linalg.solve(own, b.T @ a)).reshape(-1, 6, p)
            out += np.einsum("nci,ncj->cij", left, left)
        return out


def _losses(scaled: Array) -> Array:
    """Huber's loss: the square within `HUBER` standard deviations, its tangent beyond."""
    size = np.abs(scaled)
    return np.where(size <= HUBER, scaled**2, 2 * HUBER * size - HUBER**2)


def _weights(scaled: Array) -> Array:
    """Huber's weights: 1 within `HUBER` standard deviations, less beyond."""
    size = np.abs(scaled)
    return np.where(size <= HUBER, 1.0, HUBER / np.maximum(size, HUBER))
