"""The field that knows the shore, as a method."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from grebe.mapping.covariance.variogram import EmpiricalVariogram, Estimator, fit_variogram
from grebe.mapping.fields.spde import Mesh, ShoreField, ShoreModel, fit_spde
from grebe.mapping.methods.base import Domain, Model, Readings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

REASON = "range and noise by restricted likelihood on the water's mesh"


@dataclass(frozen=True, kw_only=True)
class Spde:
    """A field with no flux through the shore, and a constant mean.

    `estimator` is for the variogram that the report draws beside the model.
    """

    estimator: Estimator = "matheron"

    key = "spde"
    label = "Field with no flux through the shore"

    def fit(self, readings: Readings, domain: Domain) -> SpdeField:
        """See `Method`. The parameters are fitted on a coarse mesh."""
        at, values = readings.positions, readings.values
        shown = fit_variogram(at, values, self.estimator).empirical
        parameters = fit_spde(domain.coarse_mesh, at, values)
        return SpdeField(
            parameters=parameters,
            model=described(parameters, shown),
            readings=readings,
            domain=domain,
            mesh=domain.mesh,
        )


def described(parameters: ShoreModel, empirical: EmpiricalVariogram | None = None) -> Model:
    """Describe the parameters for reports."""
    return Model(
        kind=parameters.kind,
        text=parameters.text,
        nugget=parameters.nugget,
        sill=parameters.sill,
        range_m=parameters.range_m,
        practical_range_m=parameters.practical_range_m,
        reason=REASON,
        semivariance=parameters.variogram,
        empirical=empirical,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class SpdeField:
    """The signal on a mesh of the water, interpolated bilinearly between nodes."""

    parameters: ShoreModel
    model: Model
    readings: Readings
    domain: Domain
    mesh: Mesh

    def __post_init__(self) -> None:
        if self.readings.extra_sd is not None:
            raise ValueError(
                "the field with no flux through the shore needs the same noise for all "
                "readings; use kriging"
            )

    def __getstate__(self) -> dict[str, Any]:
        """Leave the computed fields out: a factorisation cannot be sent to another process."""
        return {one.name: getattr(self, one.name) for one in fields(self)}

    def mean(self, places: Array) -> Array:
        """See `Field`."""
        return self.mesh.interpolation(places) @ self._nodes.mean()

    def sd(self, places: Array) -> Array:
        """See `Field`."""
        return np.sqrt(np.maximum(self.mesh.interpolation(places) @ self._variance, 0.0))

    def draws(self, places: Array, count: int, seed: int) -> Array:
        """See `Field`."""
        return (self.mesh.interpolation(places) @ self._nodes.draws(count, seed).T).T

    def given(self, readings: Readings) -> SpdeField:
        """See `Field`; on the coarse mesh, to save time."""
        return SpdeField(
            parameters=self.parameters,
            model=self.model,
            readings=readings,
            domain=self.domain,
            mesh=self.domain.coarse_mesh,
        )

    @cached_property
    def _nodes(self) -> ShoreField:
        readings = self.readings
        return ShoreField(self.mesh, readings.positions, readings.values, self.parameters)

    @cached_property
    def _variance(self) -> Array:
        return self._nodes.variance()
