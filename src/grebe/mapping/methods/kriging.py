"""Kriging as a method: a covariance of straight-line distance, and a drift."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from grebe.mapping.covariance.drift import DriftFunction
from grebe.mapping.covariance.likelihood import fit_reml
from grebe.mapping.covariance.models import CovarianceModel, Fleeting
from grebe.mapping.covariance.variogram import Estimator, VariogramFit, fit_variogram
from grebe.mapping.fields.kriging import Drift, Estimate, Moments, Passing, krige, krige_moments
from grebe.mapping.fields.simulation import circulant_fields
from grebe.mapping.grid import Grid
from grebe.mapping.methods.base import Domain, Model, Readings
from grebe.mapping.way import REACH_M, passed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Fields are drawn on a grid with this many nodes per range, because between two nodes they are too
# smooth (by 1/60 of the variance). The grid is up to `REFINE` times as fine as the map's, if that
# does not exceed `MOST_DRAWN_NODES`.
NODES_A_RANGE, REFINE, MOST_DRAWN_NODES = 30, 3, 2_000_000
# How many numbers are drawn at once, to limit memory.
DRAWN_AT_ONCE = 5_000_000

CovarianceFit = Callable[["Array", "Array", Estimator], VariogramFit]


@dataclass(frozen=True, kw_only=True)
class Kriging:
    """Kriging with a covariance of straight-line distance.

    `fit_covariance` takes positions (n, 2), values (n,) and the variogram's `estimator`:
    `fit_reml`, `fit_variogram` or your own. `drift` gives what the mean depends on besides a
    constant.
    """

    fit_covariance: CovarianceFit = fit_reml
    estimator: Estimator = "matheron"
    drift: DriftFunction | None = None

    key = "kriging"
    label = "Kriging"

    def fit(self, readings: Readings, domain: Domain) -> KrigingField:
        """See `Method`. If nothing varies, the variogram's flat model is used."""
        fit = first_fit(readings, self.estimator, self.drift)
        if fit.model.sill > 0 and np.ptp(readings.values) > 0:
            values = without_drift(readings, self.drift)
            fit = self.fit_covariance(readings.positions, values, self.estimator)
        return KrigingField(
            covariance=fit.model,
            model=described(fit),
            readings=readings,
            domain=domain,
            drift=self.drift,
        )


def first_fit(
    readings: Readings, estimator: Estimator, drift: DriftFunction | None
) -> VariogramFit:
    """Fit a covariance to the variogram of the values without their drift. Raises `ValueError` if
    there are too few pairs.
    """
    return fit_variogram(readings.positions, without_drift(readings, drift), estimator)


def without_drift(readings: Readings, drift: DriftFunction | None) -> Array:
    """The readings' values (n,) minus the best-fitting drift."""
    at, data = readings.positions, readings.values
    if drift is None:
        return data
    basis = np.column_stack([np.ones(len(at)), drift(at)])
    return data - basis @ np.linalg.lstsq(basis, data, rcond=None)[0]


def described(fit: VariogramFit) -> Model:
    """Describe a fitted covariance for reports."""
    model = fit.model
    return Model(
        kind=model.kind,
        text=model.text,
        nugget=model.nugget,
        sill=model.sill,
        range_m=model.range_m,
        practical_range_m=model.practical_range_m,
        ratio=model.ratio,
        angle_deg=model.angle_deg,
        reason=fit.reason,
        standard_errors=fit.standard_errors,
        semivariance=model.variogram,
        empirical=fit.empirical,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class KrigingField:
    """The signal by kriging with a given covariance, of place alone or of place and time.

    With a `fleeting` part, each place is shown as it was when the boat came nearest, as far as that
    part is known there: fully on the boat's path, and not at all beyond some metres from it. If the
    readings are for a single time, the fleeting part is that of all the water at that time.
    """

    covariance: CovarianceModel
    model: Model
    readings: Readings
    domain: Domain
    drift: DriftFunction | None = None
    fleeting: Fleeting | None = None
    # The last places and their estimate: mean and sd come from one solution.
    _last: list[tuple[Array, Estimate]] = field(
        default_factory=list[tuple["Array", Estimate]], init=False, repr=False
    )

    def mean(self, places: Array) -> Array:
        """See `Field`."""
        return self._estimate(places).mean

    def sd(self, places: Array) -> Array:
        """See `Field`."""
        return self._estimate(places).sd

    def at_moments(self, places: Array, moments_s: Array) -> list[tuple[Array, Array]]:
        """See `Timed`."""
        if self.fleeting is None:
            return [(self.mean(places), self.sd(places))] * len(moments_s)
        readings, extra = self.readings, self.readings.extra_sd
        assert readings.times is not None
        found = krige_moments(
            readings.positions,
            readings.values,
            places,
            self.covariance,
            Moments(fleeting=self.fleeting, at_samples=readings.times, at=moments_s),
            drift=self._drift(places),
            extra_variance=None if extra is None else extra**2,
        )
        return [(one.mean, one.sd) for one in found]

    def given(self, readings: Readings) -> KrigingField:
        """See `Field`."""
        return KrigingField(
            covariance=self.covariance,
            model=self.model,
            readings=readings,
            domain=self.domain,
            drift=self.drift,
            fleeting=self.fleeting,
        )

    def draws(self, places: Array, count: int, seed: int) -> Array:
        """Unconditional fields, whose error at the readings is removed by kriging."""
        grid, at = self.domain.grid, self.readings.positions
        drawn = np.empty((count, len(places)))
        rng = np.random.default_rng(seed)
        refine = self._refinement(grid)
        noise_sd = np.sqrt(self.covariance.nugget + _extra_variance(self.readings))
        at_once = max(DRAWN_AT_ONCE // (len(at) + len(places)), 1)
        for start in range(0, count, at_once):
            part = slice(start, min(start + at_once, count))
            _, free = circulant_fields(
                self.covariance, grid, np.vstack([at, places]), part.stop - start, rng, refine
            )
            seen, there = free[:, : len(at)], free[:, len(at) :]
            if self.fleeting is not None:
                passing = self._passing(self.fleeting, places)
                then, later = _free_courses(passing, part.stop - start, rng)
                seen, there = seen + then, there + later
            noise = rng.normal(0.0, noise_sd, seen.shape)
            lack = self.readings.values[:, None] - (seen + noise).T
            drawn[part] = there + self._krige(lack, places).mean.T
        return drawn

    def _refinement(self, grid: Grid) -> int:
        """How many times as fine as the map's grid the unconditional fields are drawn."""
        if grid.inside.size * REFINE**2 >= MOST_DRAWN_NODES:
            return 1
        fine = math.ceil(NODES_A_RANGE * grid.step_m / self.covariance.range_m)
        return min(max(fine, 1), REFINE)

    def _estimate(self, places: Array) -> Estimate:
        if not (self._last and np.array_equal(self._last[0][0], places)):
            self._last[:] = [(places.copy(), self._krige(self.readings.values, places))]
        return self._last[0][1]

    def _krige(self, values: Array, places: Array) -> Estimate:
        extra = self.readings.extra_sd
        return krige(
            self.readings.positions,
            values,
            places,
            self.covariance,
            drift=self._drift(places),
            extra_variance=None if extra is None else extra**2,
            passing=None if self.fleeting is None else self._passing(self.fleeting, places),
        )

    def _drift(self, places: Array) -> Drift | None:
        if self.drift is None:
            return None
        return Drift(at_samples=self.drift(self.readings.positions), at_targets=self.drift(places))

    def _passing(self, fleeting: Fleeting, places: Array) -> Passing:
        """The fleeting part that applies at some places."""
        readings = self.readings
        assert readings.times is not None
        if readings.moment_s is not None:
            when = np.full(len(places), readings.moment_s)
            share = np.ones(len(places))
        else:
            when, away = passed(readings.positions, readings.times, places)
            share = np.exp(-away / REACH_M)
        return Passing(fleeting=fleeting, at_samples=readings.times, at_targets=when, share=share)


def _free_courses(passing: Passing, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """The fleeting part before any reading, at the samples (count, n) and at the targets (count,
    m). The part that is not shared with the boat's path comes from an independent realisation.
    """
    n = len(passing.at_samples)
    both = np.concatenate([passing.at_samples, passing.at_targets])
    course = passing.fleeting.draws(both, count, rng)
    other = passing.fleeting.draws(passing.at_targets, count, rng)
    share = passing.share
    return course[:, :n], share * course[:, n:] + np.sqrt(1 - share**2) * other


def _extra_variance(readings: Readings) -> Array | float:
    return 0.0 if readings.extra_sd is None else readings.extra_sd**2
