"""A map that takes in readings as they come: a few more cost milliseconds, however many there are.

The signal at a map's nodes is the state of a Kalman filter without motion. A batch of readings is
observed through the nodes around it. What the nodes do not explain, the rest of the covariance
within the batch, counts as its noise (the partially independent conditional of Quinonero-Candela
and Rasmussen 2005, JMLR 6, applied batch by batch). So the state is as large as the map and does
not grow with the survey. What is lost, compared with the full map, is variation between nodes that
two batches share. The covariance is fixed: a new fit starts a new filter.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy.linalg import blas, cho_factor, cho_solve, cholesky, solve_triangular
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from grebe.mapping.covariance.models import CovarianceModel
from grebe.mapping.fields.spde import Mesh, ShoreModel, prior_precision
from grebe.mapping.methods.averaged import AveragedField
from grebe.mapping.methods.base import Field, Model, Readings
from grebe.mapping.methods.kriging import KrigingField
from grebe.mapping.methods.spde import SpdeField

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Readings that are taken in together, and the number of nodes through which each is observed.
BATCH, AROUND = 64, 12
# Variance of the unknown mean, in variances of the readings: practically uninformative.
VAGUE = 1e4
# Added to a diagonal, as a share of the sill: keeps a smooth covariance positive definite.
JITTER = 1e-9


class Prior(Protocol):
    """The signal at the nodes before any reading, and how places depend on the nodes."""

    @property
    def nugget(self) -> float:
        """Variance of a reading about the signal."""
        ...

    def covariance(self) -> Array:
        """Covariance of the signal at the nodes, (m, m)."""
        ...

    def seen(self, places: Array) -> tuple[csr_array, Array]:
        """Weights (n, m) of the nodes at places (n, 2), with rows that sum to 1; and the covariance
        (n, n) that the nodes do not explain.
        """
        ...


@dataclass(frozen=True, kw_only=True)
class StraightPrior:
    """A covariance of straight-line distance, at nodes (m, 2)."""

    model: CovarianceModel
    nodes: Array

    @property
    def nugget(self) -> float:
        """See `Prior`."""
        return self.model.nugget

    def covariance(self) -> Array:
        """See `Prior`."""
        at = self._at
        return self._between(at, at) + JITTER * self.model.sill * np.eye(len(at))

    def seen(self, places: Array) -> tuple[csr_array, Array]:
        """See `Prior`: ordinary kriging from the surrounding nodes."""
        nodes, at = self._at, self.model.isotropic(places)
        _, near = self._tree.query(at, k=min(AROUND, len(nodes)))
        used = np.unique(near)
        inner = self._between(nodes[used], nodes[used])
        inner[np.diag_indices(len(used))] += JITTER * self.model.sill
        factor = cho_factor(inner, lower=True)
        across = self._between(nodes[used], at)
        solved = cho_solve(factor, np.column_stack([across, np.ones(len(used))]))
        simple, ones = solved[:, :-1], solved[:, -1]
        # The weights sum to 1, because the mean is unknown.
        missing = (1.0 - simple.sum(axis=0)) / ones.sum()
        weights = simple + np.outer(ones, missing)
        left = self._between(at, at) - across.T @ simple
        left += np.outer(missing, missing) * ones.sum()
        rows = np.repeat(np.arange(len(at)), len(used))
        columns = np.tile(used, len(at))
        shape = (len(at), len(nodes))
        return csr_array((weights.T.ravel(), (rows, columns)), shape=shape), left

    @cached_property
    def _at(self) -> Array:
        """The nodes in isotropic coordinates."""
        return self.model.isotropic(self.nodes)

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self._at)

    def _between(self, a: Array, b: Array) -> Array:
        return self.model.covariance(cdist(a, b))


@dataclass(frozen=True, kw_only=True)
class ShorePrior:
    """A field with no flux through the shore, at a mesh's nodes."""

    model: ShoreModel
    mesh: Mesh

    @property
    def nugget(self) -> float:
        """See `Prior`."""
        return self.model.nugget

    def covariance(self) -> Array:
        """See `Prior`."""
        factor = splu(prior_precision(self.mesh, self.model))
        return factor.solve(np.eye(len(self.mesh.nodes)))

    def seen(self, places: Array) -> tuple[csr_array, Array]:
        """See `Prior`: the mesh's own bilinear weights, which define the field between nodes."""
        return self.mesh.interpolation(places), np.zeros((len(places), len(places)))


class SequentialField:
    """The signal given the readings so far: a `Field` that `add` updates with more of them."""

    def __init__(self, prior: Prior, model: Model, level: float, spread: float) -> None:
        self.model = model
        self._prior = prior
        covariance = prior.covariance() + VAGUE * max(spread, prior.nugget, 1e-300)
        self._covariance = np.asfortranarray(covariance)
        self._mean = np.full(len(covariance), level)

    def add(self, positions: Array, values: Array) -> None:
        """Take in readings (n,) at positions (n, 2)."""
        for start in range(0, len(values), BATCH):
            part = slice(start, start + BATCH)
            self._take_in(positions[part], values[part])

    def _take_in(self, positions: Array, values: Array) -> None:
        weights, noise = self._prior.seen(positions)
        noise[np.diag_indices(len(values))] += max(self._prior.nugget, 1e-300)
        used, small = _used(weights)
        gained = self._covariance[:, used] @ small.T
        size = small @ gained[used] + noise
        factor = cholesky(size, lower=True)
        carried = solve_triangular(factor, gained.T, lower=True).T
        lack = solve_triangular(factor, values - small @ self._mean[used], lower=True)
        self._mean += carried @ lack
        self._covariance = blas.dgemm(  # pyright: ignore[reportAttributeAccessIssue]
            -1.0, carried, carried, beta=1.0, c=self._covariance, trans_b=1, overwrite_c=1
        )

    @property
    def node_mean(self) -> Array:
        """The best estimate at the nodes, (m,)."""
        return self._mean.copy()

    @property
    def node_sd(self) -> Array:
        """The estimate's standard deviation, (m,)."""
        return np.sqrt(np.maximum(np.diag(self._covariance), 0.0))

    def mean(self, places: Array) -> Array:
        """See `Field`."""
        found = [self._prior.seen(part)[0] @ self._mean for part in _parts(places)]
        return np.concatenate([np.empty(0), *found])

    def sd(self, places: Array) -> Array:
        """See `Field`."""
        found = [np.empty(0)]
        for part in _parts(places):
            weights, left = self._prior.seen(part)
            used, small = _used(weights)
            own = np.einsum("ij,jk,ik->i", small, self._covariance[np.ix_(used, used)], small)
            found.append(np.sqrt(np.maximum(own + np.diag(left), 0.0)))
        return np.concatenate(found)

    def covariance(self, places: Array) -> Array:
        """Covariance (n, n) of the signal at places, as far as the nodes determine it."""
        used, small = _used(self._prior.seen(places)[0])
        return small @ self._covariance[np.ix_(used, used)] @ small.T

    def draws(self, places: Array, count: int, seed: int) -> Array:
        """See `Field`; variation between nodes is drawn independently at each place."""
        rng = np.random.default_rng(seed)
        size = len(self._mean)
        lift = JITTER * float(np.trace(self._covariance)) / size
        factor = cholesky(self._covariance + lift * np.eye(size), lower=True)
        nodes = self._mean[:, None] + factor @ rng.normal(size=(size, count))
        found = [np.empty((0, count))]
        for part in _parts(places):
            weights, left = self._prior.seen(part)
            fine = np.sqrt(np.maximum(np.diag(left), 0.0))[:, None]
            found.append(weights @ nodes + fine * rng.normal(size=(len(part), count)))
        return np.concatenate(found).T

    def given(self, readings: Readings) -> SequentialField:
        """See `Field`."""
        level, spread = float(readings.values.mean()), float(readings.values.var())
        fresh = SequentialField(self._prior, self.model, level, spread)
        fresh.add(readings.positions, readings.values)
        return fresh


def sequential(fitted: Field, nodes: Array) -> SequentialField | None:
    """Return a field at nodes (m, 2) that has the covariance and the readings of a fitted one and
    takes in more readings; None for a user's own method, or one with a drift.
    """
    prior: Prior
    if isinstance(fitted, AveragedField):
        # Of two averaged fields, use that of place alone: it grows with each reading, and its error
        # is honest.
        fitted = fitted.fields[0]
    if isinstance(fitted, KrigingField) and fitted.drift is None and fitted.covariance.sill > 0:
        prior = StraightPrior(model=fitted.covariance, nodes=nodes)
    elif isinstance(fitted, SpdeField):
        prior = ShorePrior(model=fitted.parameters, mesh=fitted.mesh)
    else:
        return None
    values = fitted.readings.values
    begun = SequentialField(prior, fitted.model, float(values.mean()), float(values.var()))
    begun.add(fitted.readings.positions, values)
    return begun


def _used(weights: csr_array) -> tuple[NDArray[np.int64], Array]:
    """The nodes (k,) that have any weight, and their weights (n, k)."""
    used = np.unique(weights.indices).astype(np.int64)
    return used, np.asarray(weights[:, used].toarray())


def _parts(places: Array) -> list[Array]:
    return [places[start : start + BATCH] for start in range(0, len(places), BATCH)]
