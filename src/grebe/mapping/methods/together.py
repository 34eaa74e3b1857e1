"""Cokriging as a method: a quantity is mapped from its own readings and those of others.

It pays if one quantity is sparse and a correlated one is dense. If the quantities were read at the
same places and have the same shape of covariance, the others add nothing to a quantity's own
readings (Wackernagel 2003, chapter 25), and it is mapped alone. The same holds if the likelihood
does not clearly favour shared structure.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from grebe.mapping.covariance.coregionalisation import Cokriging, Coregionalisation, Observed
from grebe.mapping.covariance.coregionalisation_fit import KIND, fit_coregionalisation
from grebe.mapping.covariance.models import CovarianceModel
from grebe.mapping.covariance.variogram import EmpiricalVariogram, fit_variogram
from grebe.mapping.fields.joining import merge_places
from grebe.mapping.fields.simulation import circulant_fields
from grebe.mapping.methods.averaged import Averaged
from grebe.mapping.methods.base import (
    Companions,
    Domain,
    Field,
    Method,
    Model,
    Readings,
    field_at_moments,
)
from grebe.mapping.methods.passing_on import PassingField

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# A quantity's samples are merged to at most this many places, starting with this size [m].
MOST_PLACES, JOINED_M = 500, 0.5
# A reduction of the standard deviation by less than this share is no gain; the number of places at
# which it is evaluated.
NO_GAIN, LOOKED_AT = 0.02, 300
# A kept reading within this distance is the same one [m].
SAME_M = 1e-6


@dataclass(frozen=True, kw_only=True)
class Together:
    """Ordinary cokriging under a linear model of coregionalisation of two structures.

    `beside`: the other quantities' readings by name, each on its own scale; `alone`: how the
    quantity is mapped if they add nothing.
    """

    beside: tuple[tuple[str, Readings], ...]
    alone: Method = field(default_factory=Averaged)

    key = "cokriging"
    label = "Cokriging"

    def fit(self, readings: Readings, domain: Domain) -> Field:
        """See `Method`. Raises `ValueError` if a quantity does not vary."""
        several = (readings, *(one for _, one in self.beside))
        fitted = fit_coregionalisation(several)
        made = TogetherField(
            covariance=fitted.model,
            model=self._described(fitted.model, readings),
            readings=readings,
            beside=several[1:],
            whole=readings.positions,
            domain=domain,
        )
        spared = made.spared() if fitted.is_shared else 0.0
        told = self._companions(fitted.model, spared)
        if told.heeded:
            return replace(made, model=replace(made.model, companions=told))
        return LoneField(field=self.alone.fit(readings, domain), companions=told)

    def _companions(self, covariance: Coregionalisation, spared: float) -> Companions:
        return Companions(
            names=tuple(name for name, _ in self.beside),
            correlations=tuple(
                covariance.correlation(0, i) for i in range(1, len(self.beside) + 1)
            ),
            spared=spared,
            heeded=spared > NO_GAIN,
        )

    def _described(self, covariance: Coregionalisation, readings: Readings) -> Model:
        reach = covariance.practical_range_m(0)
        nugget, sill = float(covariance.nuggets[0]), float(covariance.whole[0, 0])
        return Model(
            kind="two exponential",
            text=f"two exponential structures, practical range {reach:.0f} m",
            nugget=nugget,
            sill=sill,
            practical_range_m=reach,
            reason="ranges, noise and shared structure by the posterior mode under priors",
            semivariance=partial(_semivariance, covariance),
            empirical=_shown(readings),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class TogetherField:
    """The signal of the first of several quantities, given the readings of all. `whole` (n, 2) are
    the places of its readings before any was left out.
    """

    covariance: Coregionalisation
    model: Model
    readings: Readings
    beside: tuple[Readings, ...]
    whole: Array
    domain: Domain
    # The last places and their estimate: mean and sd come from one solution.
    _last: list[tuple[Array, Array, Array]] = field(
        default_factory=list[tuple["Array", "Array", "Array"]], init=False, repr=False
    )

    def mean(self, places: Array) -> Array:
        """See `Field`."""
        return self._estimate(places)[1]

    def sd(self, places: Array) -> Array:
        """See `Field`."""
        return np.sqrt(self._estimate(places)[2])

    def given(self, readings: Readings) -> TogetherField:
        """See `Field`. Where the quantity's own readings are left out, so are the others' that are
        nearest to them, as if the boat had not been there.
        """
        kept = KDTree(readings.positions).query(self.whole)[0] <= SAME_M
        tree = KDTree(self.whole)
        beside = tuple(one.part(kept[tree.query(one.positions)[1]]) for one in self.beside)
        return replace(self, readings=readings, beside=beside)

    def spared(self) -> float:
        """The share by which the other quantities reduce the standard deviation at the median
        place.
        """
        nodes = self.domain.grid.nodes
        some = nodes[:: -(-len(nodes) // LOOKED_AT)]
        together = np.sqrt(self._solved().estimate(some, 0)[1])
        alone = np.sqrt(replace(self, beside=())._solved().estimate(some, 0)[1])
        return float(1 - np.median(together) / np.median(alone))

    def draws(self, places: Array, count: int, seed: int) -> Array:
        """Unconditional fields, whose error at the readings is removed by cokriging."""
        observed, rng = self._observed(), np.random.default_rng(seed)
        seen, there = self._free(observed, places, count, rng)
        noise = rng.normal(0.0, np.sqrt(observed.noise), seen.shape)
        lack = replace(observed, values=(observed.values - seen - noise).T)
        return there + Cokriging(lack, self.covariance).estimate(places, 0)[0].T

    def _free(
        self, observed: Observed, places: Array, count: int, rng: np.random.Generator
    ) -> tuple[Array, Array]:
        """Signals before any reading: of each quantity where it was observed (count, n), and of the
        first one at the places (count, m).
        """
        n, at = len(observed.of), np.vstack([observed.positions, places])
        seen, there = np.zeros((count, n)), np.zeros((count, len(places)))
        for sill, reach in zip(self.covariance.sills, self.covariance.ranges_m, strict=True):
            unit = CovarianceModel(kind=KIND, sill=1.0, range_m=reach, nugget=0.0)
            size, vectors = np.linalg.eigh(sill)
            for factor in (vectors * np.sqrt(np.maximum(size, 0.0))).T:
                _, free = circulant_fields(unit, self.domain.grid, at, count, rng, 2)
                seen += factor[observed.of] * free[:, :n]
                there += factor[0] * free[:, n:]
        return seen, there

    def _estimate(self, places: Array) -> tuple[Array, Array, Array]:
        if not (self._last and np.array_equal(self._last[0][0], places)):
            self._last[:] = [(places.copy(), *self._solved().estimate(places, 0))]
        return self._last[0]

    def _solved(self) -> Cokriging:
        return Cokriging(self._observed(), self.covariance)

    def _observed(self) -> Observed:
        """The readings of all quantities, merged where one has too many."""
        several = (self.readings, *self.beside)
        joined = [_joined(one, float(self.covariance.nuggets[i])) for i, one in enumerate(several)]
        positions, values, noise = (np.concatenate(column) for column in zip(*joined, strict=True))
        of = np.repeat(np.arange(len(joined)), [len(one[0]) for one in joined])
        return Observed(positions=positions, values=values, of=of, noise=noise)


def _semivariance(covariance: Coregionalisation, distance: Array) -> Array:
    """The model's semivariance of the first quantity."""
    level = float(covariance.nuggets[0]) + float(covariance.whole[0, 0])
    return level - covariance.covariance(0, distance)


def _shown(readings: Readings) -> EmpiricalVariogram | None:
    """The variogram that the report draws, if there are enough pairs."""
    try:
        return fit_variogram(readings.positions, readings.values, "matheron").empirical
    except ValueError:
        return None


def _joined(readings: Readings, nugget: float) -> tuple[Array, Array, Array]:
    """Places, the mean value at each, and its noise variance."""
    extra = np.zeros(len(readings)) if readings.extra_sd is None else readings.extra_sd**2
    columns = np.column_stack([readings.values, extra])
    at, means, counts = merge_places(readings.positions, columns)
    size = JOINED_M
    while len(at) > MOST_PLACES:
        at, means, counts = merge_places(readings.positions, columns, size)
        size *= np.sqrt(2)
    return at, means[:, 0], (nugget + means[:, 1]) / counts


@dataclass(frozen=True, kw_only=True, eq=False)
class LoneField(PassingField):
    """The field of a quantity to which its companions add nothing."""

    companions: Companions

    @property
    def model(self) -> Model:
        """See `Field`."""
        return replace(self.field.model, companions=self.companions)

    def at_moments(self, places: Array, moments_s: Array) -> list[tuple[Array, Array]]:
        """See `Timed`."""
        return field_at_moments(self.field, places, moments_s)
