"""The mean of several methods: which of two covariances is right is itself uncertain.

If models fit equally well, their mean predicts better than most of them, and their differences add
to its uncertainty (Hoeting et al. 1999, "Bayesian model averaging"). The weights are equal: weights
from left-out readings would favour the model that overshoots least at those, not elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from grebe.mapping.covariance.drift import DriftFunction
from grebe.mapping.covariance.posterior import fit_rough
from grebe.mapping.covariance.variogram import Estimator
from grebe.mapping.methods.base import Domain, Model, Readings
from grebe.mapping.methods.kriging import Kriging, KrigingField
from grebe.mapping.methods.passes import Passes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]


@dataclass(frozen=True, kw_only=True)
class Averaged:
    """The mean of a rough covariance of place and a smooth one that models passes.

    Readings without times are mapped by the rough one alone. `estimator` and `drift` apply to both.
    """

    estimator: Estimator = "matheron"
    drift: DriftFunction | None = None

    key = "kriging"
    label = "Kriging"

    def fit(self, readings: Readings, domain: Domain) -> KrigingField | AveragedField:
        """See `Method`."""
        kriging = Kriging(fit_covariance=fit_rough, estimator=self.estimator, drift=self.drift)
        rough = kriging.fit(readings, domain)
        if readings.times is None or rough.covariance.sill == 0:
            return rough
        smooth = Passes(estimator=self.estimator, drift=self.drift)
        return averaged((rough, smooth.fit(readings, domain)))


@dataclass(frozen=True, kw_only=True, eq=False)
class AveragedField:
    """The mean of equally likely fields."""

    fields: tuple[KrigingField, ...]
    model: Model

    def mean(self, places: Array) -> Array:
        """See `Field`."""
        return np.mean([one.mean(places) for one in self.fields], axis=0)

    def sd(self, places: Array) -> Array:
        """See `Field`; includes the differences between the fields."""
        return _mixed([(one.mean(places), one.sd(places)) for one in self.fields])[1]

    def at_moments(self, places: Array, moments_s: Array) -> list[tuple[Array, Array]]:
        """See `Timed`."""
        found = [one.at_moments(places, moments_s) for one in self.fields]
        return [_mixed(of_fields) for of_fields in zip(*found, strict=True)]

    def draws(self, places: Array, count: int, seed: int) -> Array:
        """See `Field`: the fields take turns."""
        drawn = np.empty((count, len(places)))
        for i, one in enumerate(self.fields):
            turn = slice(i, None, len(self.fields))
            drawn[turn] = one.draws(places, len(drawn[turn]), seed + i)
        return drawn

    def given(self, readings: Readings) -> AveragedField:
        """See `Field`."""
        given = tuple(one.given(readings) for one in self.fields)
        return AveragedField(fields=given, model=self.model)


def _mixed(found: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Mean and standard deviation of an equal mixture of distributions (mean, sd)."""
    means, sds = (np.array(one) for one in zip(*found, strict=True))
    return means.mean(axis=0), np.sqrt((sds**2).mean(axis=0) + means.var(axis=0))


def _mean_of(curves: Sequence[Callable[[Array], Array]], distance: Array) -> Array:
    return np.mean([one(distance) for one in curves], axis=0)


def averaged(fields: tuple[KrigingField, ...]) -> AveragedField:
    """The mean of fields, with a model that averages nuggets and curves and otherwise describes the
    first field.
    """
    models = [one.model for one in fields]
    first = models[0]
    return AveragedField(
        fields=fields,
        model=Model(
            kind=" + ".join(one.kind for one in models),
            text="the mean of two: " + "; ".join(one.text for one in models),
            nugget=float(np.mean([one.nugget for one in models])),
            sill=first.sill,
            range_m=first.range_m,
            practical_range_m=first.practical_range_m,
            ratio=first.ratio,
            angle_deg=first.angle_deg,
            parts=tuple(models),
            reason="; ".join(one.reason for one in models),
            standard_errors=first.standard_errors,
            semivariance=partial(
                _mean_of, tuple(one.semivariance for one in models if one.semivariance)
            ),
            empirical=first.empirical,
        ),
    )
